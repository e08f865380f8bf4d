/* ncgen_inertia.c: inertias of 21 numbers: sums, other reference points, momenta. */
#include "ncgen_inertia.h"

/* factor (a b' + b a') / 2 in an inertia, of six numbers each. */
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

/* An inertia about a point that is d away from the one it is about now, added to another one:
 * B + D M, and I - B D + D B' - D M D, where D is d x. */
void ncgen_add_shifted(const ncgen_real *inertia, const ncgen_real *d, ncgen_real *sum)
{
    const ncgen_real *B = inertia + MIXED, *M = inertia + ALONG;
    const ncgen_real full[9] = {M[0], M[3], M[4], M[3], M[1], M[5], M[4], M[5], M[2]};
    ncgen_real mixed[9], left[9], right[9];
    for (int j = 0; j < 3; ++j) {
        mixed[j] = B[j] + d[1] * full[6 + j] - d[2] * full[3 + j];
        mixed[3 + j] = B[3 + j] + d[2] * full[j] - d[0] * full[6 + j];
        mixed[6 + j] = B[6 + j] + d[0] * full[3 + j] - d[1] * full[j];
    }
    for (int i = 0; i < 3; ++i) { /* rows of B D and of (B + D M) D: b x d */
        ncgen_cross(B + 3 * i, d, left + 3 * i);
        ncgen_cross(mixed + 3 * i, d, right + 3 * i);
    }
    sum[TURNING] += inertia[0] - left[0] - right[0];
    sum[TURNING + 1] += inertia[1] - left[4] - right[4];
    sum[TURNING + 2] += inertia[2] - left[8] - right[8];
    sum[TURNING + 3] += inertia[3] - left[3] - right[1];
    sum[TURNING + 4] += inertia[4] - left[6] - right[2];
    sum[TURNING + 5] += inertia[5] - left[7] - right[5];
    for (int i = 0; i < 9; ++i)
        sum[MIXED + i] += mixed[i];
    for (int i = 0; i < 6; ++i)
        sum[ALONG + i] += M[i];
}

/* Momentum of an inertia for a screw at rate 1. */
void ncgen_find_momentum(const ncgen_real *inertia, int turns, const ncgen_real *axis, ncgen_real *momentum)
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
