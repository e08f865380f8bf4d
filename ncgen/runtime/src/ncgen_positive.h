/* ncgen_positive.h: a small symmetric positive definite system. */
#ifndef NCGEN_POSITIVE_H
#define NCGEN_POSITIVE_H

#include "ncgen.h"

/* With the factors that ncgen_solve_positive has left in a. */
static inline void ncgen_solve_positive_again(int size, const ncgen_real *a, ncgen_real *right)
{
    for (int k = 0; k < size; ++k) {
        const ncgen_real share = right[k] / a[k * size + k];
        for (int i = k + 1; i < size; ++i)
            right[i] -= a[i * size + k] * share;
    }
    for (int k = size - 1; k >= 0; --k) {
        for (int i = k + 1; i < size; ++i)
            right[k] -= a[i * size + k] * right[i];
        right[k] /= a[k * size + k];
    }
}

/* a by rows, lower half, and right are overwritten, the second by the solution. NCGEN_SINGULAR where a is not positive. */
static inline int ncgen_solve_positive(int size, ncgen_real *a, ncgen_real *right)
{
    for (int k = 0; k < size; ++k) {
        if (!(a[k * size + k] > 0))
            return NCGEN_SINGULAR;
        for (int i = k + 1; i < size; ++i) {
            const ncgen_real share = a[i * size + k] / a[k * size + k];
            for (int j = k + 1; j <= i; ++j)
                a[i * size + j] -= share * a[j * size + k];
        }
    }
    ncgen_solve_positive_again(size, a, right);
    return NCGEN_OK;
}

#endif
