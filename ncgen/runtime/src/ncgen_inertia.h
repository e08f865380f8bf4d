/* ncgen_inertia.h: vectors in space, and inertias of 21 numbers that move beside each other (articulated ones among them). */
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

/* factor u u' in a symmetric matrix. */
static inline void ncgen_add_square(ncgen_real factor, const ncgen_real *u, ncgen_real *s)
{
    const ncgen_real x = factor * u[0], y = factor * u[1], z = factor * u[2];
    s[0] += x * u[0];
    s[1] += y * u[1];
    s[2] += z * u[2];
    s[3] += x * u[1];
    s[4] += x * u[2];
    s[5] += y * u[2];
}

/* factor a a' in an inertia, of six numbers. */
static inline void ncgen_add_own_product(ncgen_real factor, const ncgen_real *a, ncgen_real *inertia)
{
    const ncgen_real *along = a + 3;
    ncgen_add_square(factor, a, inertia + TURNING);
    ncgen_add_square(factor, along, inertia + ALONG);
    ncgen_add_times(factor * a[0], along, inertia + MIXED);
    ncgen_add_times(factor * a[1], along, inertia + MIXED + 3);
    ncgen_add_times(factor * a[2], along, inertia + MIXED + 6);
}

/* An inertia about a point that is d away from the one it is about now, added to another one:
 * B + D M, and I - B D + D B' - D M D, where D is d x. */
static inline void ncgen_add_shifted(const ncgen_real *inertia, const ncgen_real *d, ncgen_real *sum)
{
    const ncgen_real *B = inertia + MIXED, *M = inertia + ALONG;
    const ncgen_real full[9] = {M[0], M[3], M[4], M[3], M[1], M[5], M[4], M[5], M[2]};
    ncgen_real mixed[9], both[9], left[3], right[3];
    for (int j = 0; j < 3; ++j) {
        mixed[j] = B[j] + d[1] * full[6 + j] - d[2] * full[3 + j];
        mixed[3 + j] = B[3 + j] + d[2] * full[j] - d[0] * full[6 + j];
        mixed[6 + j] = B[6 + j] + d[0] * full[3 + j] - d[1] * full[j];
    }
    for (int i = 0; i < 3; ++i) { /* rows of B D from the diagonal on, and of (B + D M) D up to it: b x d */
        ncgen_cross(B + 3 * i, d, left);
        ncgen_cross(mixed + 3 * i, d, right);
        for (int j = 0; j < 3; ++j)
            both[3 * i + j] = j < i ? right[j] : j > i ? left[j] : left[j] + right[j];
    }
    sum[TURNING] += inertia[0] - both[0];
    sum[TURNING + 1] += inertia[1] - both[4];
    sum[TURNING + 2] += inertia[2] - both[8];
    sum[TURNING + 3] += inertia[3] - both[1] - both[3];
    sum[TURNING + 4] += inertia[4] - both[2] - both[6];
    sum[TURNING + 5] += inertia[5] - both[5] - both[7];
    for (int i = 0; i < 9; ++i)
        sum[MIXED + i] += mixed[i];
    for (int i = 0; i < 6; ++i)
        sum[ALONG + i] += M[i];
}

/* Momentum of an inertia for a screw at rate 1. */
static inline void ncgen_find_momentum(const ncgen_real *inertia, int turns, const ncgen_real *axis, ncgen_real *momentum)
{
    const ncgen_real *B = inertia + MIXED;
    if (turns) {
        ncgen_turned(inertia, axis, momentum);
        for (int i = 0; i < 3; ++i)
            momentum[3 + i] = B[i] * axis[0] + B[3 + i] * axis[1] + B[6 + i] * axis[2];
    } else {
        for (int i = 0; i < 3; ++i)
            momentum[i] = ncgen_dot3(B + 3 * i, axis);
        ncgen_turned(inertia + ALONG, axis, momentum + 3);
    }
}

/* A wrench about a point that is d away from the one it is about now, added to another one. */
static inline void ncgen_add_wrench(const ncgen_real *wrench, const ncgen_real *d, ncgen_real *sum)
{
    ncgen_add_cross(d, wrench + 3, sum);
    ncgen_add_times(1, wrench, sum);
    ncgen_add_times(1, wrench + 3, sum + 3);
}

/* factor (a b' + b a') / 2 in an inertia, of six numbers each. */
void ncgen_add_product(ncgen_real factor, const ncgen_real *a, const ncgen_real *b, ncgen_real *inertia);

#endif
