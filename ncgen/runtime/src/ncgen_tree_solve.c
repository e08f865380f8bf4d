/* ncgen_tree_solve.c: articulated inertias of an open tree, in loops over its tables, and what they give for forces.
 *
 * A joint takes from the inertia A beyond it what it does not pass on, A - U U'/d with U = A s and d = s'U for its screw s. Joints that follow
 * another one at a constant ratio are one group with it: their links hang on one carrier or on one another, and a link moves beside the
 * carrier by the ratios times the screws on the way, S z. So the carrier loses U U'/d with U = sum of A S and d = sum of S'A S, in which every
 * A is the inertia that a link carries without its group.
 */
#include "ncgen_tree_solve.h"

/* From a link's reference point to an element of its body, which may stand with another link. */
static void lever_of(const ncgen_tree_work *w, int link, int element, ncgen_real *lever)
{
    const ncgen_tree *tree = w->tree;
    for (int i = 0; i < 3; ++i)
        lever[i] = w->values[tree->elements[3 * element + i]] - (tree->is_point[element] ? w->values[tree->reference[3 * link + i]] : 0);
}

/* The masses between the members of a link as a matrix. */
static void weigh(ncgen_tree_work *w, int link)
{
    const ncgen_tree *tree = w->tree;
    const int count = tree->member_start[link + 1] - tree->member_start[link];
    const int *members = tree->members + tree->member_start[link];
    ncgen_real *square = w->square + tree->square_start[link];
    for (int i = 0; i < count * count; ++i)
        square[i] = 0;
    w->total[link] = 0;
    for (int s = tree->pair_start[link]; s < tree->pair_start[link + 1]; ++s) {
        const int *pair = tree->pairs + 3 * s;
        const ncgen_real mass = w->mass[pair[2]];
        square[pair[0] * count + pair[1]] = square[pair[1] * count + pair[0]] = mass;
        if (tree->is_point[members[pair[0]]] && tree->is_point[members[pair[1]]])
            w->total[link] += pair[0] == pair[1] ? mass : 2 * mass;
    }
}

void ncgen_tree_weigh(ncgen_tree_work *w)
{
    for (int link = 0; link < w->tree->n_links; ++link)
        weigh(w, link);
}

/* The inertia of members, whose mass is the same in all directions: I = tr(P) 1 - P with P = sum of m x y', B = h x. */
static void add_members(const ncgen_tree_work *w, int link, ncgen_real *inertia)
{
    const ncgen_tree *tree = w->tree;
    const int count = tree->member_start[link + 1] - tree->member_start[link];
    const int *members = tree->members + tree->member_start[link];
    const ncgen_real *square = w->square + tree->square_start[link];
    ncgen_real *second = w->moments + 9 * link, *first = second + 6;
    for (int i = 0; i < 9; ++i)
        second[i] = 0;
    for (int a = 0; a < count; ++a)
        lever_of(w, link, members[a], w->member + 3 * a);
    for (int a = 0; a < count; ++a) {
        const ncgen_real *x = w->member + 3 * a, *masses = square + a * count;
        ncgen_real u = 0, v = 0, z = 0;
        for (int b = 0; b < count; ++b) {
            u += masses[b] * w->member[3 * b];
            v += masses[b] * w->member[3 * b + 1];
            z += masses[b] * w->member[3 * b + 2];
        }
        second[0] += x[0] * u;
        second[1] += x[1] * v;
        second[2] += x[2] * z;
        second[3] += x[0] * v;
        second[4] += x[0] * z;
        second[5] += x[1] * z;
        if (tree->is_point[members[a]]) {
            first[0] += u;
            first[1] += v;
            first[2] += z;
        }
    }
    inertia[TURNING] += second[1] + second[2];
    inertia[TURNING + 1] += second[0] + second[2];
    inertia[TURNING + 2] += second[0] + second[1];
    for (int i = 3; i < 6; ++i)
        inertia[TURNING + i] -= second[i];
    inertia[MIXED + 1] -= first[2];
    inertia[MIXED + 2] += first[1];
    inertia[MIXED + 3] += first[2];
    inertia[MIXED + 5] -= first[0];
    inertia[MIXED + 6] -= first[1];
    inertia[MIXED + 7] += first[0];
    for (int i = 0; i < 3; ++i)
        inertia[ALONG + i] += w->total[link];
}

/* The velocity of one coordinate of an element over a twist: six numbers. */
static void coordinate_row(const ncgen_tree_work *w, int link, int element, int axis, ncgen_real *row)
{
    ncgen_real unit[3] = {0, 0, 0}, lever[3];
    unit[axis] = 1;
    lever_of(w, link, element, lever);
    ncgen_cross(lever, unit, row);
    for (int i = 0; i < 3; ++i)
        row[3 + i] = w->tree->is_point[element] ? unit[i] : 0;
}

static void add_singles(const ncgen_tree_work *w, int link, ncgen_real *inertia)
{
    const ncgen_tree *tree = w->tree;
    for (int s = tree->single_start[link]; s < tree->single_start[link + 1]; ++s) {
        const int *entry = tree->singles + 5 * s;
        const int is_diagonal = entry[0] == entry[2] && entry[1] == entry[3];
        ncgen_real a[6], b[6];
        coordinate_row(w, link, entry[0], entry[1], a);
        coordinate_row(w, link, entry[2], entry[3], b);
        ncgen_add_product(w->mass[entry[4]] * (is_diagonal ? 1 : 2), a, b, inertia);
    }
}

/* A wrench about a link's reference point, added to one about its parent's. */
static void add_wrench(const ncgen_tree_work *w, int link, const ncgen_real *wrench, ncgen_real *sum)
{
    ncgen_real d[3];
    ncgen_between(w, link, d);
    ncgen_add_cross(d, wrench + 3, sum);
    ncgen_add_times(1, wrench, sum);
    ncgen_add_times(1, wrench + 3, sum + 3);
}

/* The inertia beyond a link's own screws without what they do not pass on; 0 where one of them moves nothing. */
static int eliminate_screws(ncgen_tree_work *w, int link)
{
    const ncgen_tree *tree = w->tree;
    ncgen_real *inertia = w->inertia + INERTIA * link;
    int is_regular = 1;
    for (int k = tree->screw_start[link + 1] - 1; k >= tree->screw_start[link]; --k) {
        ncgen_real *momentum = w->momentum + 6 * k;
        const ncgen_real *axis = w->axis + 3 * k;
        ncgen_find_momentum(inertia, tree->turns[k], axis, momentum);
        const ncgen_real pivot = w->pivot[k] + ncgen_dot3(axis, momentum + (tree->turns[k] ? 0 : 3));
        is_regular &= pivot > 0;
        w->pivot[k] = 1 / pivot;
        ncgen_add_product(-w->pivot[k], momentum, momentum, inertia);
    }
    return is_regular;
}

/* What a link hands on of its group's momentum: to the link before it in the group, else to the carrier's sum. */
static ncgen_real *joined_before(const ncgen_tree_work *w, int link)
{
    const ncgen_tree *tree = w->tree;
    const int group = tree->coupling[link], before = tree->parent[link];
    return w->joined + 6 * (before >= 0 && tree->coupling[before] == group ? before : tree->n_links + group);
}

/* A link of a group takes nothing from the inertia beyond it: its screw adds to the group's momentum and pivot, and the carrier takes all. */
static void join(ncgen_tree_work *w, int link)
{
    const ncgen_tree *tree = w->tree;
    const int k = tree->screw_start[link], along = tree->turns[k] ? 0 : 3;
    const ncgen_real *axis = w->axis + 3 * k;
    const ncgen_scalar ratio = tree->ratio[k];
    ncgen_real *pivot = w->group + 2 * tree->coupling[link], *joined = w->joined + 6 * link, *momentum = w->momentum + 6 * k;
    ncgen_find_momentum(w->inertia + INERTIA * link, tree->turns[k], axis, momentum);
    *pivot += ratio * (2 * ncgen_dot3(axis, joined + along) + ratio * (w->pivot[k] + ncgen_dot3(axis, momentum + along)));
    ncgen_add_times(ratio, momentum, joined);
    ncgen_add_times(ratio, momentum + 3, joined + 3);
    if (tree->parent[link] >= 0)
        add_wrench(w, link, joined, joined_before(w, link));
}

/* The pivots of groups that hang on a link, whose inertia loses what they do not pass on; 0 where one of them moves nothing. */
static int close_groups(ncgen_tree_work *w, int link)
{
    int is_regular = 1;
    for (int group = 0; group < w->tree->n_groups; ++group) {
        if (w->tree->carrier[group] != link)
            continue;
        ncgen_real *pivot = w->group + 2 * group, *momentum = w->joined + 6 * (w->tree->n_links + group);
        is_regular &= *pivot > 0;
        *pivot = 1 / *pivot;
        if (link >= 0)
            ncgen_add_product(-*pivot, momentum, momentum, w->inertia + INERTIA * link);
    }
    return is_regular;
}

int ncgen_tree_factor(ncgen_tree_work *w)
{
    const ncgen_tree *tree = w->tree;
    int is_regular = 1;
    for (int i = 0; i < INERTIA * tree->n_links; ++i)
        w->inertia[i] = 0;
    for (int i = 0; tree->n_groups && i < 6 * (tree->n_links + tree->n_groups); ++i)
        w->joined[i] = 0;
    for (int group = 0; group < tree->n_groups; ++group)
        w->group[2 * group] = 0;
    for (int k = 0; k < tree->n_screws; ++k)
        w->pivot[k] = 0;
    for (int i = 0; i < tree->n_rotors; ++i)
        w->pivot[tree->rotors[2 * i]] += tree->gears[i] * w->mass[tree->rotors[2 * i + 1]];
    for (int link = tree->n_links - 1; link >= 0; --link) {
        ncgen_real *inertia = w->inertia + INERTIA * link, d[3];
        add_members(w, link, inertia);
        add_singles(w, link, inertia);
        is_regular &= close_groups(w, link);
        if (tree->coupling[link] >= 0)
            join(w, link);
        else
            is_regular &= eliminate_screws(w, link);
        if (tree->parent[link] >= 0) {
            ncgen_between(w, link, d);
            ncgen_add_shifted(inertia, d, w->inertia + INERTIA * tree->parent[link]);
        }
    }
    return is_regular & close_groups(w, -1);
}

/* Of a rigid body with P = sum of m x y' and h = sum of m x: I a + h x v + (P w) x w, and a x h + m v + w x (w x h). */
void ncgen_tree_take_inertial(ncgen_tree_work *w)
{
    for (int link = 0; link < w->tree->n_links; ++link) {
        const ncgen_real *second = w->moments + 9 * link, *first = second + 6;
        const ncgen_real *turning = w->twist + 6 * link, *change = w->change + 6 * link, *lift = change + 3;
        const ncgen_real trace = second[0] + second[1] + second[2], factor = -w->total[link];
        ncgen_real *moment = w->wrench + 6 * link, *force = moment + 3, spun[3], moved[3];
        ncgen_turned(second, change, spun); /* I a = tr(P) a - P a */
        ncgen_add_times(-trace, change, moment);
        ncgen_add_times(1, spun, moment);
        ncgen_add_cross(lift, first, moment);
        ncgen_turned(second, turning, spun);
        ncgen_add_cross(turning, spun, moment);
        ncgen_add_cross(first, change, force);
        ncgen_add_times(factor, lift, force);
        ncgen_cross(first, turning, moved);
        ncgen_add_cross(turning, moved, force);
    }
}

static ncgen_real dot6(const ncgen_real *a, const ncgen_real *b)
{
    return ncgen_dot3(a, b) + ncgen_dot3(a + 3, b + 3);
}

/* A wrench without what a joint takes of it. */
static void take_share(ncgen_real share, const ncgen_real *momentum, ncgen_real *wrench)
{
    ncgen_add_times(-share, momentum, wrench);
    ncgen_add_times(-share, momentum + 3, wrench + 3);
}

/* Inward: pushes of all screws and groups, and what is left of the wrenches. */
static void push_inward(ncgen_tree_work *w)
{
    const ncgen_tree *tree = w->tree;
    for (int group = 0; group < tree->n_groups; ++group)
        w->group[2 * group + 1] = 0;
    for (int link = tree->n_links - 1; link >= 0; --link) {
        ncgen_real *wrench = w->wrench + 6 * link;
        for (int group = 0; group < tree->n_groups; ++group)
            if (tree->carrier[group] == link)
                take_share(w->group[2 * group] * w->group[2 * group + 1], w->joined + 6 * (tree->n_links + group), wrench);
        for (int k = tree->screw_start[link + 1] - 1; k >= tree->screw_start[link]; --k) {
            w->push[k] += ncgen_dot3(w->axis + 3 * k, wrench + (tree->turns[k] ? 0 : 3));
            if (tree->coupling[link] >= 0)
                w->group[2 * tree->coupling[link] + 1] += tree->ratio[k] * w->push[k];
            else
                take_share(w->pivot[k] * w->push[k], w->momentum + 6 * k, wrench);
        }
        if (tree->parent[link] >= 0)
            add_wrench(w, link, wrench, w->wrench + 6 * tree->parent[link]);
    }
}

/* What is left for the groups that hang on a link whose acceleration is known. */
static void release_groups(ncgen_tree_work *w, int link, const ncgen_real *known)
{
    for (int group = 0; group < w->tree->n_groups; ++group)
        if (w->tree->carrier[group] == link) {
            ncgen_real *own = w->group + 2 * group;
            own[1] = own[0] * (own[1] - dot6(w->joined + 6 * (w->tree->n_links + group), known));
        }
}

void ncgen_tree_solve(ncgen_tree_work *w, ncgen_real *change)
{
    const ncgen_tree *tree = w->tree;
    push_inward(w);
    release_groups(w, -1, ncgen_nothing);
    for (int link = 0; link < tree->n_links; ++link) {
        const ncgen_real *before = ncgen_of_parent(w, w->wrench, link);
        const int group = tree->coupling[link];
        ncgen_real *own = w->wrench + 6 * link, d[3];
        ncgen_copy(6, before, own);
        if (tree->parent[link] >= 0) {
            ncgen_between(w, link, d);
            ncgen_add_cross(before, d, own + 3);
        }
        for (int k = tree->screw_start[link]; k < tree->screw_start[link + 1]; ++k) {
            w->push[k] = group < 0 ? w->pivot[k] * (w->push[k] - dot6(w->momentum + 6 * k, own)) : tree->ratio[k] * w->group[2 * group + 1];
            ncgen_add_screw(w, k, w->push[k], own);
        }
        release_groups(w, link, own);
        for (int i = 0; i < 6; ++i)
            change[6 * link + i] += own[i];
    }
}

