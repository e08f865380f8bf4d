/* ncgen_inertia.h: vectors in space, and inertias of 21 numbers that move in parallel (articulated ones among them). */
#ifndef NCGEN_INERTIA_H
#define NCGEN_INERTIA_H

#include "ncgen_math.h"

/* Places in 21 numbers of an inertia: angular momentum I w + B v, linear momentum B'w + M v; I and M xx, yy, zz, xy, xz, yz. */
enum { TURNING = 0, MIXED = 6, ALONG = 15, INERTIA = 21 };

/* In space: three numbers a vector. */
static inline void ncgen_set3(const ncgen_real *from, ncgen_real *to)
{
    const ncgen_real x = from[0], y = from[1], z = from[2];
    to[0] = x;
    to[1] = y;
    to[2] = z;
}

static inline void ncgen_set6(const ncgen_real *from, ncgen_real *to)
{
    ncgen_set3(from, to);
    ncgen_set3(from + 3, to + 3);
}

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

/* An inertia without a b', of six numbers each, one of which is a multiple of the other. */
static inline void ncgen_take_product(const ncgen_real *a, const ncgen_real *b, ncgen_real *inertia)
{
    static const int row[6] = {0, 1, 2, 0, 0, 1}, column[6] = {0, 1, 2, 1, 2, 2};
    for (int s = 0; s < 6; ++s) {
        inertia[TURNING + s] -= a[row[s]] * b[column[s]];
        inertia[ALONG + s] -= a[3 + row[s]] * b[3 + column[s]];
    }
    for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j)
            inertia[MIXED + 3 * i + j] -= a[i] * b[3 + j];
}

/* An inertia about a point that is d away from the one it is about now:
 * B + D M, and I - B D + D B' - D M D, where D is d x. */
static inline void ncgen_set_shifted(const ncgen_real *inertia, const ncgen_real *d, ncgen_real *sum)
{
    const ncgen_real *B = inertia + MIXED, *M = inertia + ALONG;
    const ncgen_real x = d[0], y = d[1], z = d[2];
    /* Rows of B + D M; of B D what is on the diagonal and above, of (B + D M) D what is on it and below. */
    const ncgen_real a[3] = {B[0] + y * M[4] - z * M[3], B[1] + y * M[5] - z * M[1], B[2] + y * M[2] - z * M[5]};
    const ncgen_real b[3] = {B[3] + z * M[0] - x * M[4], B[4] + z * M[3] - x * M[5], B[5] + z * M[4] - x * M[2]};
    const ncgen_real c[3] = {B[6] + x * M[3] - y * M[0], B[7] + x * M[1] - y * M[3], B[8] + x * M[5] - y * M[4]};
    sum[TURNING] = inertia[0] - B[1] * z + B[2] * y - a[1] * z + a[2] * y;
    sum[TURNING + 1] = inertia[1] - B[5] * x + B[3] * z - b[2] * x + b[0] * z;
    sum[TURNING + 2] = inertia[2] - B[6] * y + B[7] * x - c[0] * y + c[1] * x;
    sum[TURNING + 3] = inertia[3] - B[2] * x + B[0] * z - b[1] * z + b[2] * y;
    sum[TURNING + 4] = inertia[4] - B[0] * y + B[1] * x - c[1] * z + c[2] * y;
    sum[TURNING + 5] = inertia[5] - B[3] * y + B[4] * x - c[2] * x + c[0] * z;
    for (int i = 0; i < 3; ++i) {
        sum[MIXED + i] = a[i];
        sum[MIXED + 3 + i] = b[i];
        sum[MIXED + 6 + i] = c[i];
    }
    for (int i = 0; i < 6; ++i)
        sum[ALONG + i] = M[i];
}

/* Momentum of an inertia for a screw at rate 1. */
static inline void ncgen_find_momentum(const ncgen_real *inertia, int turns, const ncgen_real *axis, ncgen_real *momentum)
{
    const ncgen_real *B = inertia + MIXED;
    if (turns) {
        ncgen_turned(inertia, axis, momentum);
        momentum[3] = B[0] * axis[0] + B[3] * axis[1] + B[6] * axis[2];
        momentum[4] = B[1] * axis[0] + B[4] * axis[1] + B[7] * axis[2];
        momentum[5] = B[2] * axis[0] + B[5] * axis[1] + B[8] * axis[2];
    } else {
        momentum[0] = ncgen_dot3(B, axis);
        momentum[1] = ncgen_dot3(B + 3, axis);
        momentum[2] = ncgen_dot3(B + 6, axis);
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
