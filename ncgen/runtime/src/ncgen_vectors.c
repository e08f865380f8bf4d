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

/* Each lane has a largest number of its own, and a sum that is 0 unless one of its numbers is infinite or NaN. */
ncgen_real ncgen_largest(int count, const ncgen_real *x, const ncgen_scalar *sizes)
{
    enum { LANES = 4 };
    ncgen_real largest[LANES] = {0}, left[LANES] = {0};
    int i = 0;
    for (; i + LANES <= count; i += LANES)
        NCGEN_VECTORISED
        for (int k = 0; k < LANES; ++k) {
            const ncgen_real size = NCGEN_ABS(x[i + k]) / sizes[i + k];
            largest[k] = size > largest[k] ? size : largest[k];
            left[k] += size - size;
        }
    for (; i < count; ++i) {
        const ncgen_real size = NCGEN_ABS(x[i]) / sizes[i];
        largest[0] = size > largest[0] ? size : largest[0];
        left[0] += size - size;
    }
    for (int k = 1; k < LANES; ++k) {
        largest[0] = largest[k] > largest[0] ? largest[k] : largest[0];
        left[0] += left[k];
    }
    return NCGEN_ABS(left[0]) > 0 || left[0] != left[0] ? left[0] : largest[0];
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
    if (i > 0 && i < count) { /* some twice, which are finite then as well */
        const ncgen_real *last = x + count - TOGETHER;
        for (int k = 0; k < TOGETHER; ++k)
            sums[k] += last[k];
        i = count;
    }
    for (int k = 0; k < TOGETHER / 2; ++k)
        sums[k] += sums[k + TOGETHER / 2];
    for (int k = 0; k < TOGETHER / 2; ++k)
        sum += sums[k];
    for (; i < count; ++i)
        sum += x[i];
    return sum - sum >= 0;
}
