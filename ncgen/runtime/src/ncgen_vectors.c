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

/* Numbers in a row that are looked at together, in vectors of the processor where it has them. Where they are not a multiple, the last ones
 * are looked at first, and some of them once more with those before. */
enum { TOGETHER = 8, HALF = TOGETHER / 2 };

static ncgen_real largest_of_few(int count, const ncgen_real *x, const ncgen_scalar *sizes)
{
    ncgen_real largest = 0, sum = 0;
    for (int i = 0; i < count; ++i) {
        const ncgen_real size = NCGEN_ABS(x[i]) / sizes[i];
        largest = size > largest ? size : largest;
        sum += size;
    }
    return sum - sum >= 0 ? largest : sum - sum;
}

/* The sum shows whether a number is infinite or none. */
ncgen_real ncgen_largest(int count, const ncgen_real *x, const ncgen_scalar *sizes)
{
    if (count < TOGETHER)
        return largest_of_few(count, x, sizes);
    ncgen_real largest[TOGETHER], sums[TOGETHER];
    NCGEN_VECTORISED
    for (int k = 0; k < TOGETHER; ++k)
        sums[k] = largest[k] = NCGEN_ABS(x[count - TOGETHER + k]) / sizes[count - TOGETHER + k];
    for (int i = 0; i + TOGETHER < count; i += TOGETHER)
        NCGEN_VECTORISED
        for (int k = 0; k < TOGETHER; ++k) {
            const ncgen_real size = NCGEN_ABS(x[i + k]) / sizes[i + k];
            largest[k] = size > largest[k] ? size : largest[k];
            sums[k] += size;
        }
    NCGEN_VECTORISED
    for (int k = 0; k < HALF; ++k) {
        largest[k] = largest[k + HALF] > largest[k] ? largest[k + HALF] : largest[k];
        sums[k] += sums[k + HALF];
    }
    for (int k = 1; k < HALF; ++k) {
        largest[0] = largest[k] > largest[0] ? largest[k] : largest[0];
        sums[0] += sums[k];
    }
    return sums[0] - sums[0] >= 0 ? largest[0] : sums[0] - sums[0];
}

static int are_few_finite(int count, const ncgen_real *x)
{
    ncgen_real sum = 0;
    for (int i = 0; i < count; ++i)
        sum += x[i];
    return sum - sum >= 0;
}

/* With an infinite number or none the sum is, too, and to look at the sum alone costs least. */
int ncgen_is_finite(int count, const ncgen_real *x)
{
    if (count < TOGETHER)
        return are_few_finite(count, x);
    ncgen_real sums[TOGETHER];
    NCGEN_VECTORISED
    for (int k = 0; k < TOGETHER; ++k)
        sums[k] = x[k] + x[count - TOGETHER + k];
    for (int i = TOGETHER; i + TOGETHER < count; i += TOGETHER)
        NCGEN_VECTORISED
        for (int k = 0; k < TOGETHER; ++k)
            sums[k] += x[i + k];
    NCGEN_VECTORISED
    for (int k = 0; k < HALF; ++k)
        sums[k] += sums[k + HALF];
    for (int k = 1; k < HALF; ++k)
        sums[0] += sums[k];
    return sums[0] - sums[0] >= 0;
}
