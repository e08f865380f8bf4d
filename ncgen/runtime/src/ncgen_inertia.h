/* ncgen_inertia.h: vectors in space, and inertias of 21 numbers that move in parallel (articulated ones among them). */
#ifndef NCGEN_INERTIA_H
#define NCGEN_INERTIA_H

#include "ncgen_math.h"

/* Places in 21 numbers of an inertia: angular momentum I w + B v, linear momentum B'w + M v; I and M xx, yy, zz, xy, xz, yz. */
enum { TURNING = 0, MIXED = 6, ALONG = 15, INERTIA = 21 };

/* In space: three numbers a vector. */
static inline void ncgen_cross(const ncgen_real *a, const ncgen_real *b, ncgen_real *out)
{
    out[0] = a[1] * b[2] - a[2] * b[1];
    out[1] = a[2] * b[0] - a[0] * b[2];
    out[2] = a[0] * b[1] - a[1] * b[0];
}

static inline void ncgen_add_cross(const ncgen_real *a, const ncgen_real *b, ncgen_real *out)
{
    out[0] += a[1] * b[2] - a[2] * b[1];
    out[1] += a[2] * b[0] - a[0] * b[2];
    out[2] += a[0] * b[1] - a[1] * b[0];
}

static inline void ncgen_add_times(ncgen_real factor, const ncgen_real *a, ncgen_real *out)
{
    out[0] += factor * a[0];
    out[1] += factor * a[1];
    out[2] += factor * a[2];
}

static inline ncgen_real ncgen_dot3(const ncgen_real *a, const ncgen_real *b)
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/* A symmetric matrix times a vector. */
static inline void ncgen_turned(const ncgen_real *s, const ncgen_real *a, ncgen_real *out)
{
    out[0] = s[0] * a[0] + s[3] * a[1] + s[4] * a[2];
    out[1] = s[3] * a[0] + s[1] * a[1] + s[5] * a[2];
    out[2] = s[4] * a[0] + s[5] * a[1] + s[2] * a[2];
}

void ncgen_add_product(ncgen_real factor, const ncgen_real *a, const ncgen_real *b, ncgen_real *inertia);
void ncgen_add_shifted(const ncgen_real *inertia, const ncgen_real *d, ncgen_real *sum);
void ncgen_find_momentum(const ncgen_real *inertia, int turns, const ncgen_real *axis, ncgen_real *momentum);

#endif
