/* ncgen_lu.c: elimination of a dense matrix, by rows, with row exchanges. */
#include "ncgen_lu.h"

static void exchange_rows(int size, ncgen_real *a, int *order, int k, int other)
{
    for (int c = 0; c < size; ++c) {
        const ncgen_real value = a[(size_t)k * (size_t)size + (size_t)c];
        a[(size_t)k * (size_t)size + (size_t)c] = a[(size_t)other * (size_t)size + (size_t)c];
        a[(size_t)other * (size_t)size + (size_t)c] = value;
    }
    const int row = order[k];
    order[k] = order[other];
    order[other] = row;
}

int ncgen_lu_factor(int size, ncgen_real *a, int *order, int *orientation)
{
    *orientation = 1;
    for (int i = 0; i < size; ++i)
        order[i] = i;
    for (int k = 0; k < size; ++k) {
        int best = k;
        for (int i = k + 1; i < size; ++i)
            if (NCGEN_ABS(a[(size_t)i * (size_t)size + (size_t)k]) > NCGEN_ABS(a[(size_t)best * (size_t)size + (size_t)k]))
                best = i;
        if (best != k) {
            exchange_rows(size, a, order, k, best);
            *orientation = -*orientation;
        }
        const ncgen_real *pivot_row = a + (size_t)k * (size_t)size;
        if (!(NCGEN_ABS(pivot_row[k]) > 0))
            return NCGEN_SINGULAR;
        if (pivot_row[k] < 0)
            *orientation = -*orientation;
        for (int i = k + 1; i < size; ++i) {
            ncgen_real *row = a + (size_t)i * (size_t)size;
            if (!(NCGEN_ABS(row[k]) > 0))
                continue;
            const ncgen_real share = row[k] /= pivot_row[k];
            for (int c = k + 1; c < size; ++c)
                row[c] -= share * pivot_row[c];
        }
    }
    return NCGEN_OK;
}

void ncgen_lu_solve(int size, const ncgen_real *a, const int *order, const ncgen_real *right, ncgen_real *x)
{
    for (int i = 0; i < size; ++i)
        x[i] = right[order[i]] - ncgen_dot(i, a + (size_t)i * (size_t)size, x);
    for (int i = size - 1; i >= 0; --i) {
        const ncgen_real *row = a + (size_t)i * (size_t)size;
        x[i] = (x[i] - ncgen_dot(size - 1 - i, row + i + 1, x + i + 1)) / row[i];
    }
}
