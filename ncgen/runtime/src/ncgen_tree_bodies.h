/* ncgen_tree_bodies.h: inertias of the bodies of an open tree.
 *
 * Most mass is the same along all axes, M I between two elements, so that an inertia is P = sum of m x y' and h = sum of m x over the
 * members of a body: I = tr(P) 1 - P, B = h x. The reference point, where it is a member, is at x = 0 and counts in h alone.
 */
#ifndef NCGEN_TREE_BODIES_H
#define NCGEN_TREE_BODIES_H

#include "ncgen_tree_work.h"

/* From a link's reference point to a member of its body, of a vector itself. */
static inline void ncgen_find_lever(const ncgen_tree_member *member, const ncgen_real *values, const ncgen_real *origin, ncgen_real *x)
{
    x[0] = values[member->c[0]] - member->is_point * origin[0];
    x[1] = values[member->c[1]] - member->is_point * origin[1];
    x[2] = values[member->c[2]] - member->is_point * origin[2];
}

/* A member at x, whose masses with all members move as u, in P as xx, yy, zz, xy, xz, yz and in h behind it. */
static inline void ncgen_add_member(const ncgen_real *x, const ncgen_real *u, ncgen_real share, ncgen_real *second)
{
    second[0] += x[0] * u[0];
    second[1] += x[1] * u[1];
    second[2] += x[2] * u[2];
    second[3] += x[0] * u[1];
    second[4] += x[0] * u[2];
    second[5] += x[1] * u[2];
    ncgen_add_times(share, x, second + 6);
}

/* P and h of a body of three, as most are. */
static inline void ncgen_add_three(const ncgen_tree_place *at, const ncgen_real *values, const ncgen_real *origin, ncgen_real *second)
{
    const ncgen_real *shares = at->masses + 1, *square = shares + 3;
    ncgen_real a[3], b[3], c[3];
    ncgen_find_lever(at->member, values, origin, a);
    ncgen_find_lever(at->member + 1, values, origin, b);
    ncgen_find_lever(at->member + 2, values, origin, c);
    ncgen_real u[3] = {square[0] * a[0], square[0] * a[1], square[0] * a[2]};
    ncgen_real v[3] = {square[3] * a[0], square[3] * a[1], square[3] * a[2]};
    ncgen_real z[3] = {square[6] * a[0], square[6] * a[1], square[6] * a[2]};
    ncgen_add_times(square[1], b, u);
    ncgen_add_times(square[2], c, u);
    ncgen_add_times(square[4], b, v);
    ncgen_add_times(square[5], c, v);
    ncgen_add_times(square[7], b, z);
    ncgen_add_times(square[8], c, z);
    ncgen_add_member(a, u, shares[0], second);
    ncgen_add_member(b, v, shares[1], second);
    ncgen_add_member(c, z, shares[2], second);
}

/* P and h of a body of any number of members. */
void ncgen_tree_add_many(const ncgen_tree_work *w, const ncgen_tree_link *own, const ncgen_tree_place *at, ncgen_real *second);

static inline void ncgen_find_moments(const ncgen_tree_work *w, const ncgen_tree_link *own, const ncgen_tree_place *at, ncgen_real *second)
{
    for (int i = 0; i < 9; ++i)
        second[i] = 0;
    if (own->n_members == 3)
        ncgen_add_three(at, w->values, own->origin, second);
    else
        ncgen_tree_add_many(w, own, at, second);
}

static inline void ncgen_set_inertia(const ncgen_real *second, ncgen_real total, ncgen_real *inertia)
{
    const ncgen_real *first = second + 6;
    inertia[TURNING] = second[1] + second[2];
    inertia[TURNING + 1] = second[0] + second[2];
    inertia[TURNING + 2] = second[0] + second[1];
    inertia[TURNING + 3] = -second[3];
    inertia[TURNING + 4] = -second[4];
    inertia[TURNING + 5] = -second[5];
    inertia[MIXED] = inertia[MIXED + 4] = inertia[MIXED + 8] = 0;
    inertia[MIXED + 1] = -first[2];
    inertia[MIXED + 2] = first[1];
    inertia[MIXED + 3] = first[2];
    inertia[MIXED + 5] = -first[0];
    inertia[MIXED + 6] = -first[1];
    inertia[MIXED + 7] = first[0];
    inertia[ALONG] = inertia[ALONG + 1] = inertia[ALONG + 2] = total;
    inertia[ALONG + 3] = inertia[ALONG + 4] = inertia[ALONG + 5] = 0;
}

/* The negative of I a + h x v + (P w) x w, and of a x h + m v + w x (w x h). */
static inline void ncgen_set_wrench(const ncgen_real *second, ncgen_real total, const ncgen_real *turning, const ncgen_real *change,
                                    ncgen_real *wrench)
{
    const ncgen_real *first = second + 6, *lift = change + 3;
    const ncgen_real trace = second[0] + second[1] + second[2];
    ncgen_real moment[3], force[3], spun[3], moved[3];
    ncgen_turned(second, change, moment); /* I a = tr(P) a - P a */
    ncgen_add_times(-trace, change, moment);
    ncgen_add_cross(lift, first, moment);
    ncgen_turned(second, turning, spun);
    ncgen_add_cross(turning, spun, moment);
    ncgen_cross(first, change, force);
    ncgen_add_times(-total, lift, force);
    ncgen_cross(first, turning, moved);
    ncgen_add_cross(turning, moved, force);
    ncgen_set3(moment, wrench);
    ncgen_set3(force, wrench + 3);
}

/* What mass that is not the same along all axes adds to the inertias of the links. */
void ncgen_tree_add_singles(ncgen_tree_work *w);

/* What it takes to move that mass without accelerations of the joints, from the wrenches. */
void ncgen_tree_push_singles(ncgen_tree_work *w);

#endif
