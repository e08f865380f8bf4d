/* ncgen_vectors.c: see ncgen_vectors.h. */
#include "ncgen_vectors.h"

ncgen_real ncgen_dot(int count, const ncgen_real *a, const ncgen_real *b)
{
    ncgen_real sum = 0;
    for (int i = 0; i < count; ++i)
        sum += a[i] * b[i];
    return sum;
}

ncgen_scalar ncgen_next_random(unsigned *seed)
{
    *seed = *seed * 1664525u + 1013904223u;
    return (ncgen_scalar)(*seed >> 8) / R(8388608.0) - 1;
}

ncgen_real ncgen_norm(int count, const ncgen_real *x)
{
    return NCGEN_SQRT(ncgen_dot(count, x, x));
}

ncgen_real ncgen_largest(int count, const ncgen_real *x, const ncgen_scalar *sizes)
{
    ncgen_real largest = 0;
    for (int i = 0; i < count; ++i) {
        if (NCGEN_ABS(x[i]) <= largest * sizes[i]) /* which most are, without a division */
            continue;
        const ncgen_real size = NCGEN_ABS(x[i]) / sizes[i];
        if (size != size)
            return size;
        if (size > largest)
            largest = size;
    }
    return largest;
}

int ncgen_solve_positive(int size, ncgen_real *a, ncgen_real *right)
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

void ncgen_solve_positive_again(int size, const ncgen_real *a, ncgen_real *right)
{
    for (int k = 0; k < size; ++k)
        for (int i = k + 1; i < size; ++i)
            right[i] -= a[i * size + k] / a[k * size + k] * right[k];
    for (int k = size - 1; k >= 0; --k) {
        for (int i = k + 1; i < size; ++i)
            right[k] -= a[i * size + k] * right[i];
        right[k] /= a[k * size + k];
    }
}

/* Numbers in a row that are added up together, in vectors of the processor where it has them. */
enum { TOGETHER = 8 };

/* With an infinite number or none the sum is, too, and to look at the sum alone costs least. */
int ncgen_is_finite(int count, const ncgen_real *x)
{
    ncgen_real sums[TOGETHER] = {0}, sum = 0;
    int i = 0;
    for (; i + TOGETHER <= count; i += TOGETHER)
        for (int k = 0; k < TOGETHER; ++k)
            sums[k] += x[i + k];
    for (; i < count; ++i)
        sum += x[i];
    for (int k = 0; k < TOGETHER; ++k)
        sum += sums[k];
    return sum - sum >= 0;
}
