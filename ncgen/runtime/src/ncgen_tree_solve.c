/* ncgen_tree_solve.c: articulated inertias of an open tree, in loops over its tables, and what they give for forces.
 *
 * A joint takes from the inertia A beyond it what it does not pass on, A - U U'/d with U = A s and d = s'U for its screw s. Joints that follow
 * another one at a constant ratio are one group with it: their links hang on one carrier or on one another, and a link moves beside the
 * carrier by the ratios times the screws on the way, S z. So the carrier loses U U'/d with U = sum of A S and d = sum of S'A S, in which every
 * A is the inertia that a link carries without its group.
 */
#include "ncgen_tree_solve.h"

static inline ncgen_real dot6(const ncgen_real *a, const ncgen_real *b)
{
    return ncgen_dot3(a, b) + ncgen_dot3(a + 3, b + 3);
}

/* A wrench without what a joint takes of it. */
static inline void take_share(ncgen_real share, const ncgen_real *momentum, ncgen_real *wrench)
{
    ncgen_add_times(-share, momentum, wrench);
    ncgen_add_times(-share, momentum + 3, wrench + 3);
}

/* Forces along the coordinates of a link's elements. */
static inline void add_forces(const ncgen_tree_work *w, int link, ncgen_real *wrench)
{
    const ncgen_tree *tree = w->tree;
    for (int e = tree->element_start[link]; e < tree->element_start[link + 1]; ++e) {
        const int *c = tree->elements + 3 * e;
        const ncgen_real force[3] = {w->force[c[0]], w->force[c[1]], w->force[c[2]]};
        ncgen_add_cross(w->lever + 3 * e, force, wrench);
        ncgen_add_times(tree->is_point[e], force, wrench + 3);
    }
}

/* The inertia and the wrench beyond a screw without what it does not pass on; 0 where it moves nothing. */
static inline int eliminate(ncgen_tree_screw *screw, int turns, ncgen_real *inertia, ncgen_real *wrench)
{
    const int along = turns ? 0 : 3;
    ncgen_real momentum[6];
    ncgen_find_momentum(inertia, turns, screw->axis, momentum);
    const ncgen_real pivot = screw->rotor + ncgen_dot3(screw->axis, momentum + along), inverse = 1 / pivot;
    const ncgen_real push = screw->push + ncgen_dot3(screw->axis, wrench + along);
    screw->pivot = inverse;
    screw->push = push;
    for (int i = 0; i < 6; ++i)
        screw->momentum[i] = momentum[i];
    ncgen_add_own_product(-inverse, momentum, inertia);
    take_share(inverse * push, momentum, wrench);
    return pivot > 0;
}

/* Groups of joints that follow one another ------------------------------------------------------------------------ */

/* What a link hands on of its group's momentum: to the link before it in the group, else to the carrier's sum. */
static ncgen_real *joined_before(const ncgen_tree_work *w, int link)
{
    const ncgen_tree *tree = w->tree;
    const int group = tree->coupling[link], before = tree->parent[link];
    return w->joined + 6 * (before >= 0 && tree->coupling[before] == group ? before : tree->n_links + group);
}

/* A link of a group takes nothing from what is beyond it: its screw adds to the group's momentum, pivot and push, and the carrier takes all. */
static void join(ncgen_tree_work *w, int link, const ncgen_real *inertia, const ncgen_real *wrench)
{
    const ncgen_tree *tree = w->tree;
    const int k = tree->screw_start[link], along = tree->turns[k] ? 0 : 3;
    const ncgen_scalar ratio = tree->ratio[k];
    ncgen_tree_screw *screw = w->screw + k;
    ncgen_real *own = w->group + 2 * tree->coupling[link], *joined = w->joined + 6 * link;
    ncgen_find_momentum(inertia, tree->turns[k], screw->axis, screw->momentum);
    own[0] += ratio * (2 * ncgen_dot3(screw->axis, joined + along) +
                       ratio * (screw->rotor + ncgen_dot3(screw->axis, screw->momentum + along)));
    screw->push += ncgen_dot3(screw->axis, wrench + along);
    own[1] += ratio * screw->push;
    ncgen_add_times(ratio, screw->momentum, joined);
    ncgen_add_times(ratio, screw->momentum + 3, joined + 3);
    if (tree->parent[link] >= 0)
        ncgen_add_wrench(joined, w->link[link].offset, joined_before(w, link));
}

/* The pivots of groups that hang on a link, whose inertia and wrench lose what they do not pass on; 0 where one of them moves nothing. */
static int close_groups(ncgen_tree_work *w, int link, ncgen_real *inertia, ncgen_real *wrench)
{
    int is_regular = 1;
    for (int group = 0; group < w->tree->n_groups; ++group) {
        if (w->tree->carrier[group] != link)
            continue;
        ncgen_real *own = w->group + 2 * group, *momentum = w->joined + 6 * (w->tree->n_links + group);
        is_regular &= own[0] > 0;
        own[0] = 1 / own[0];
        if (link >= 0) {
            ncgen_add_own_product(-own[0], momentum, inertia);
            take_share(own[0] * own[1], momentum, wrench);
        }
    }
    return is_regular;
}

static void clear_groups(ncgen_tree_work *w)
{
    for (int i = 0; i < 6 * (w->tree->n_links + w->tree->n_groups); ++i)
        w->joined[i] = 0;
    for (int i = 0; i < 2 * w->tree->n_groups; ++i)
        w->group[i] = 0;
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

/* The tree --------------------------------------------------------------------------------------------------------- */

int ncgen_tree_reduce(ncgen_tree_work *w)
{
    const ncgen_tree *tree = w->tree;
    int is_regular = 1;
    if (tree->n_groups)
        clear_groups(w);
    for (int link = tree->n_links - 1; link >= 0; --link) {
        const ncgen_tree_link *own = w->link + link;
        const int parent = tree->parent[link], is_joined = tree->coupling[link] >= 0;
        ncgen_real inertia[INERTIA], wrench[6];
        for (int i = 0; i < INERTIA; ++i)
            inertia[i] = own->inertia[i];
        for (int i = 0; i < 6; ++i)
            wrench[i] = own->wrench[i];
        add_forces(w, link, wrench);
        if (tree->n_groups)
            is_regular &= close_groups(w, link, inertia, wrench);
        if (is_joined)
            join(w, link, inertia, wrench);
        for (int k = tree->screw_start[link + 1] - 1; !is_joined && k >= tree->screw_start[link]; --k)
            is_regular &= eliminate(w->screw + k, tree->turns[k], inertia, wrench);
        if (parent >= 0) {
            ncgen_add_shifted(inertia, own->offset, w->link[parent].inertia);
            ncgen_add_wrench(wrench, own->offset, w->link[parent].wrench);
        }
    }
    return tree->n_groups ? is_regular & close_groups(w, -1, NULL, NULL) : is_regular;
}

void ncgen_tree_release(ncgen_tree_work *w, ncgen_real *first)
{
    const ncgen_tree *tree = w->tree;
    const size_t stride = sizeof(ncgen_tree_link) / sizeof(ncgen_real);
    release_groups(w, -1, ncgen_nothing);
    for (int link = 0; link < tree->n_links; ++link) {
        ncgen_tree_link *own = w->link + link;
        const ncgen_tree_link *before = w->link + tree->parent[link];
        const int group = tree->coupling[link];
        ncgen_real added[6], *sum = first + (size_t)link * stride;
        for (int i = 0; i < 6; ++i)
            added[i] = before->wrench[i];
        ncgen_add_cross(before->wrench, own->offset, added + 3);
        for (int k = tree->screw_start[link]; k < tree->screw_start[link + 1]; ++k) {
            ncgen_tree_screw *screw = w->screw + k;
            screw->push = group < 0 ? screw->pivot * (screw->push - dot6(screw->momentum, added)) : tree->ratio[k] * w->group[2 * group + 1];
            ncgen_add_times(screw->push, screw->axis, added + (tree->turns[k] ? 0 : 3));
        }
        release_groups(w, link, added);
        for (int i = 0; i < 6; ++i) {
            own->wrench[i] = added[i];
            sum[i] += added[i];
        }
    }
}
