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

/* The largest |x| over its size that is larger than one before; not a number if one is not. */
static ncgen_real larger(int count, const ncgen_real *x, const ncgen_scalar *sizes, ncgen_real largest)
{
    for (int i = 0; i < count; ++i) {
        if (NCGEN_ABS(x[i]) <= largest * sizes[i]) /* which takes no division */
            continue;
        const ncgen_real size = NCGEN_ABS(x[i]) / sizes[i];
        if (size != size)
            return size;
        if (size > largest)
            largest = size;
    }
    return largest;
}

/* Most numbers are not larger, which is found for many at once. */
ncgen_real ncgen_largest(int count, const ncgen_real *x, const ncgen_scalar *sizes)
{
    enum { MANY = 32 };
    ncgen_real largest = 0;
    int i = 0;
    for (; i + MANY <= count && largest >= 0; i += MANY) {
        int is_any = 0;
        for (int k = 0; k < MANY; ++k)
            is_any |= !(NCGEN_ABS(x[i + k]) <= largest * sizes[i + k]);
        if (is_any)
            largest = larger(MANY, x + i, sizes + i, largest);
    }
    return largest >= 0 ? larger(count - i, x + i, sizes + i, largest) : largest;
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
