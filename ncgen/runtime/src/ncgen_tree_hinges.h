/* ncgen_tree_hinges.h: passes over hinges alone that hang on one another. Each returns the last link that it has come to. */
#ifndef NCGEN_TREE_HINGES_H
#define NCGEN_TREE_HINGES_H

#include "ncgen_tree_work.h"

/* What moves with a link: the inertia and the wrench that its parent gets. */
typedef struct ncgen_tree_carried {
    ncgen_real inertia[INERTIA], wrench[6];
} ncgen_tree_carried;

/* A wrench about a point that is d away from the one it is about now. */
static inline void ncgen_shift_wrench(const ncgen_real *d, ncgen_real *wrench)
{
    ncgen_add_cross(d, wrench + 3, wrench);
}

/* What is carried to a link, and its own body's. */
static inline void ncgen_tree_add_body(const ncgen_tree_link *own, const ncgen_tree_carried *from, ncgen_tree_carried *to)
{
    const ncgen_real *lane = own->lane, *inertia = from->inertia, *before = from->wrench, mass = lane[MASS * NCGEN_LINK_LANES];
    ncgen_real second[6], first[3], wrench[6];
    ncgen_get6(lane, MOMENTS, second);
    ncgen_get3(lane, MOMENTS + 6, first);
    ncgen_get6(lane, WRENCH, wrench);
    const ncgen_real a[6] = {inertia[0] + (second[1] + second[2]), inertia[1] + (second[0] + second[2]),
                             inertia[2] + (second[0] + second[1]), inertia[3] - second[3], inertia[4] - second[4], inertia[5] - second[5]};
    const ncgen_real *B = inertia + MIXED, *M = inertia + ALONG;
    const ncgen_real b[9] = {B[0], B[1] - first[2], B[2] + first[1], B[3] + first[2], B[4], B[5] - first[0], B[6] - first[1],
                             B[7] + first[0], B[8]};
    const ncgen_real c[6] = {M[0] + mass, M[1] + mass, M[2] + mass, M[3], M[4], M[5]};
    for (int i = 0; i < 6; ++i)
        to->inertia[TURNING + i] = a[i];
    for (int i = 0; i < 9; ++i)
        to->inertia[MIXED + i] = b[i];
    for (int i = 0; i < 6; ++i)
        to->inertia[ALONG + i] = c[i];
    for (int i = 0; i < 6; ++i)
        to->wrench[i] = before[i] + wrench[i];
}

/* Inward from a link on: articulated inertias, from what is carried to it, in place of which stands what the last one passes
 * on. is_regular becomes 0 where a hinge moves nothing. */
int ncgen_tree_pass_hinges(const ncgen_tree_work *w, int link, ncgen_tree_screw *screw, ncgen_tree_carried *passed, int *is_regular);

/* The same of wrenches alone: pushes. */
int ncgen_tree_push_hinges(const ncgen_tree_work *w, int link, ncgen_tree_screw *screw, ncgen_real *passed);

/* Outward from a link on: what the hinges' accelerations add to the links'; the link behind the last one. */
int ncgen_tree_release_hinges(ncgen_tree_work *w, int link, ncgen_tree_screw *screw);

#endif
