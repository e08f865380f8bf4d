/* ncgen_inertia.c: inertias of 21 numbers. */
#include "ncgen_inertia.h"

void ncgen_add_product(ncgen_real factor, const ncgen_real *a, const ncgen_real *b, ncgen_real *inertia)
{
    static const int row[6] = {0, 1, 2, 0, 0, 1}, column[6] = {0, 1, 2, 1, 2, 2};
    const ncgen_real half = factor / 2;
    for (int s = 0; s < 6; ++s) {
        const int i = row[s], j = column[s];
        inertia[TURNING + s] += half * (a[i] * b[j] + b[i] * a[j]);
        inertia[ALONG + s] += half * (a[3 + i] * b[3 + j] + b[3 + i] * a[3 + j]);
    }
    for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j)
            inertia[MIXED + 3 * i + j] += half * (a[i] * b[3 + j] + b[i] * a[3 + j]);
}
