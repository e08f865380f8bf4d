/* ncgen_tree_solve.c: articulated inertias of an open tree, in loops over its tables, and what they give for forces.
 *
 * A joint takes from the inertia A beyond it what it does not pass on, A - U U'/d with U = A s and d = s'U for its screw s. Joints that follow
 * another one at a constant ratio are one group with it: their links hang on one carrier or on one another, and a link moves relative to the
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
static inline void add_forces(const ncgen_real *forces, const ncgen_tree_element *e, const ncgen_tree_element *end, ncgen_real *wrench)
{
    for (; e < end; ++e) {
        const ncgen_real force[3] = {forces[e->c[0]], forces[e->c[1]], forces[e->c[2]]};
        ncgen_add_cross(e->lever, force, wrench);
        ncgen_add_times(e->is_point, force, wrench + 3);
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
    ncgen_set6(momentum, screw->momentum);
    ncgen_add_own_product(-inverse, momentum, inertia);
    take_share(inverse * push, momentum, wrench);
    return pivot > 0;
}

/* Groups of joints that follow one another ------------------------------------------------------------------------ */

/* What a link hands on of its group's momentum: to the link before it in the group, else to the carrier's sum. */
static ncgen_real *joined_before(const ncgen_tree_work *w, const ncgen_tree_link *own)
{
    const int is_inside = own->parent >= 0 && w->link[own->parent].group == own->group;
    return w->joined + 6 * (is_inside ? own->parent : w->tree->n_links + own->group);
}

/* A link of a group takes nothing from what is beyond it: its screw adds to the group's momentum, pivot and push, and the carrier
 * takes all. */
static void join(ncgen_tree_work *w, int link, ncgen_tree_screw *screw)
{
    const ncgen_tree_link *own = w->link + link;
    const int along = screw->turns ? 0 : 3;
    ncgen_real *sums = w->group + 2 * own->group, *joined = w->joined + 6 * link;
    ncgen_find_momentum(own->inertia, screw->turns, screw->axis, screw->momentum);
    sums[0] += screw->ratio * (2 * ncgen_dot3(screw->axis, joined + along) +
                               screw->ratio * (screw->rotor + ncgen_dot3(screw->axis, screw->momentum + along)));
    screw->push += ncgen_dot3(screw->axis, own->wrench + along);
    sums[1] += screw->ratio * screw->push;
    ncgen_add_times(screw->ratio, screw->momentum, joined);
    ncgen_add_times(screw->ratio, screw->momentum + 3, joined + 3);
    if (own->parent >= 0)
        ncgen_add_wrench(joined, own->offset, joined_before(w, own));
}

/* The pivots of groups that hang on a link, whose inertia and wrench lose what they do not pass on; 0 where one of them moves nothing. */
static int close_groups(ncgen_tree_work *w, int link)
{
    int is_regular = 1;
    for (int group = 0; group < w->tree->n_groups; ++group) {
        if (w->tree->carrier[group] != link)
            continue;
        ncgen_real *own = w->group + 2 * group, *momentum = w->joined + 6 * (w->tree->n_links + group);
        is_regular &= own[0] > 0;
        own[0] = 1 / own[0];
        if (link >= 0) {
            ncgen_add_own_product(-own[0], momentum, w->link[link].inertia);
            take_share(own[0] * own[1], momentum, w->link[link].wrench);
        }
    }
    return is_regular;
}

/* What groups that hang on a link take of its wrench. */
static void take_shares_of_groups(ncgen_tree_work *w, int link)
{
    for (int group = 0; group < w->tree->n_groups; ++group)
        if (w->tree->carrier[group] == link)
            take_share(w->group[2 * group] * w->group[2 * group + 1], w->joined + 6 * (w->tree->n_links + group), w->link[link].wrench);
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

/* Do all screws of a link move inertia, compared with what it carries? With closing rows a joint may move none, where these hold it; its
 * pivot is then rounding. */
static int has_inertia(const ncgen_tree_screw *screw, int count, ncgen_real turning, ncgen_real along)
{
    const ncgen_scalar most = R(1.0e11);
    int is_regular = 1;
    for (const ncgen_tree_screw *end = screw + count; screw < end; ++screw)
        is_regular &= screw->pivot * (screw->turns ? turning : along) * ncgen_dot3(screw->axis, screw->axis) < most;
    return is_regular;
}

static ncgen_real trace_of(const ncgen_real *symmetric)
{
    return symmetric[0] + symmetric[1] + symmetric[2];
}

/* The tree --------------------------------------------------------------------------------------------------------- */

int ncgen_tree_reduce(ncgen_tree_work *w)
{
    const int n_groups = w->tree->n_groups;
    const ncgen_tree_element *element = w->element + w->tree->n_elements;
    ncgen_tree_screw *screw = w->screw + w->tree->n_screws;
    int is_regular = 1;
    if (n_groups)
        clear_groups(w);
    for (int link = w->tree->n_links - 1; link >= 0; --link) {
        ncgen_tree_link *own = w->link + link, *parent = w->link + own->parent;
        element -= own->n_elements;
        add_forces(w->force, element, element + own->n_elements, own->wrench);
        if (n_groups)
            is_regular &= close_groups(w, link);
        const ncgen_real turning = trace_of(own->inertia + TURNING), along = trace_of(own->inertia + ALONG);
        if (own->is_hinge)
            is_regular &= eliminate(--screw, 1, own->inertia, own->wrench);
        else if (own->group >= 0)
            join(w, link, --screw);
        else
            for (int k = 0; k < own->n_screws; ++k) {
                --screw;
                is_regular &= eliminate(screw, screw->turns, own->inertia, own->wrench);
            }
        if (w->tree->n_closing && own->group < 0)
            is_regular &= has_inertia(screw, own->n_screws, turning, along);
        if (own->parent >= 0) {
            ncgen_add_shifted(own->inertia, own->offset, parent->inertia);
            ncgen_add_wrench(own->wrench, own->offset, parent->wrench);
        }
    }
    return n_groups ? is_regular & close_groups(w, -1) : is_regular;
}

void ncgen_tree_push_link(ncgen_tree_work *w, int link, ncgen_real *pushes, ncgen_real *group_pushes)
{
    const ncgen_tree *tree = w->tree;
    ncgen_tree_link *own = w->link + link;
    const ncgen_tree_element *element = w->element + tree->element_start[link];
    add_forces(w->force, element, element + own->n_elements, own->wrench);
    for (int group = 0; group < tree->n_groups; ++group)
        if (tree->carrier[group] == link)
            take_share(w->group[2 * group] * group_pushes[group], w->joined + 6 * (tree->n_links + group), own->wrench);
    for (int k = tree->screw_start[link + 1] - 1; k >= tree->screw_start[link]; --k) {
        const ncgen_tree_screw *screw = w->screw + k;
        pushes[k] += ncgen_dot3(screw->axis, own->wrench + (screw->turns ? 0 : 3));
        if (own->group >= 0)
            group_pushes[own->group] += screw->ratio * pushes[k];
        else
            take_share(screw->pivot * pushes[k], screw->momentum, own->wrench);
    }
}

void ncgen_tree_begin_pushes(ncgen_tree_work *w)
{
    const ncgen_tree *tree = w->tree;
    for (int k = 0; k < tree->n_screws; ++k)
        w->screw[k].push = 0;
    for (int i = 0; i < tree->n_measured; ++i)
        w->screw[tree->measured[2 * i + 1]].push += tree->ratios[i] * w->force[tree->measured[2 * i]];
}

void ncgen_tree_push(ncgen_tree_work *w)
{
    const int n_groups = w->tree->n_groups;
    const ncgen_tree_element *element = w->element + w->tree->n_elements;
    ncgen_tree_screw *screw = w->screw + w->tree->n_screws;
    for (int group = 0; group < n_groups; ++group)
        w->group[2 * group + 1] = 0;
    for (int link = w->tree->n_links - 1; link >= 0; --link) {
        ncgen_tree_link *own = w->link + link;
        element -= own->n_elements;
        add_forces(w->force, element, element + own->n_elements, own->wrench);
        if (n_groups)
            take_shares_of_groups(w, link);
        for (int k = 0; k < own->n_screws; ++k) {
            --screw;
            screw->push += ncgen_dot3(screw->axis, own->wrench + (screw->turns ? 0 : 3));
            if (own->group >= 0)
                w->group[2 * own->group + 1] += screw->ratio * screw->push;
            else
                take_share(screw->pivot * screw->push, screw->momentum, own->wrench);
        }
        if (own->parent >= 0)
            ncgen_add_wrench(own->wrench, own->offset, w->link[own->parent].wrench);
    }
}

void ncgen_tree_release(ncgen_tree_work *w)
{
    const int n_groups = w->tree->n_groups;
    ncgen_tree_screw *screw = w->screw;
    if (n_groups)
        release_groups(w, -1, ncgen_nothing);
    for (ncgen_tree_link *own = w->link; own < w->link + w->tree->n_links; ++own) {
        const ncgen_real *before = w->link[own->parent].wrench;
        ncgen_real added[6];
        ncgen_set6(before, added);
        ncgen_add_cross(before, own->offset, added + 3);
        for (const ncgen_tree_screw *end = screw + own->n_screws; screw < end; ++screw) {
            screw->push = own->group < 0 ? screw->pivot * (screw->push - dot6(screw->momentum, added))
                                         : screw->ratio * w->group[2 * own->group + 1];
            ncgen_add_times(screw->push, screw->axis, added + (screw->turns ? 0 : 3));
        }
        if (n_groups)
            release_groups(w, (int)(own - w->link), added);
        ncgen_set6(added, own->wrench);
    }
}
