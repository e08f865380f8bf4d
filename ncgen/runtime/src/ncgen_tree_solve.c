/* ncgen_tree_solve.c: articulated inertias of an open tree, in loops over its tables, and what they give for forces.
 *
 * A joint takes from the inertia A beyond it what it does not pass on, A - U U'/d with U = A s and d = s'U for its screw s. Joints that follow
 * another one at a constant ratio are one group with it: their links hang on one carrier or on one another, and a link moves relative to the
 * carrier by the ratios times the screws on the way, S z. So the carrier loses U U'/d with U = sum of A S and d = sum of S'A S, in which every
 * A is the inertia that a link carries without its group.
 */
#include "ncgen_tree_solve.h"
#include "ncgen_tree_bodies.h"
#include "ncgen_tree_hinges.h"
#include "ncgen_tree_singles.h"

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

/* The inertia and the wrench beyond a screw without what it does not pass on; 0 where it moves nothing. */
static inline int eliminate(ncgen_tree_screw *screw, int turns, ncgen_tree_carried *own)
{
    const int along = turns ? 0 : 3;
    ncgen_real momentum[6];
    ncgen_find_momentum(own->inertia, turns, screw->axis, momentum);
    const ncgen_real pivot = screw->rotor + ncgen_dot3(screw->axis, momentum + along), inverse = 1 / pivot;
    const ncgen_real push = screw->push + ncgen_dot3(screw->axis, own->wrench + along);
    screw->pivot = inverse;
    screw->push = push;
    ncgen_set6(momentum, screw->momentum);
    ncgen_add_own_product(-inverse, momentum, own->inertia);
    take_share(inverse * push, momentum, own->wrench);
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
static void join(ncgen_tree_work *w, int link, ncgen_tree_screw *screw, const ncgen_tree_carried *carries)
{
    const ncgen_tree_link *own = w->link + link;
    const int along = screw->turns ? 0 : 3;
    ncgen_real *sums = w->group + 2 * own->group, *joined = w->joined + 6 * link;
    ncgen_find_momentum(carries->inertia, screw->turns, screw->axis, screw->momentum);
    sums[0] += screw->ratio * (2 * ncgen_dot3(screw->axis, joined + along) +
                               screw->ratio * (screw->rotor + ncgen_dot3(screw->axis, screw->momentum + along)));
    screw->push += ncgen_dot3(screw->axis, carries->wrench + along);
    sums[1] += screw->ratio * screw->push;
    ncgen_add_times(screw->ratio, screw->momentum, joined);
    ncgen_add_times(screw->ratio, screw->momentum + 3, joined + 3);
    if (own->parent >= 0)
        ncgen_add_wrench(joined, own->offset, joined_before(w, own));
}

/* The pivots of groups that hang on a link, whose inertia and wrench lose what they do not pass on; 0 where one of them moves nothing. */
static int close_groups(ncgen_tree_work *w, int link, ncgen_tree_carried *carries)
{
    int is_regular = 1;
    for (int group = 0; group < w->tree->n_groups; ++group) {
        if (w->tree->carrier[group] != link)
            continue;
        ncgen_real *own = w->group + 2 * group, *momentum = w->joined + 6 * (w->tree->n_links + group);
        is_regular &= own[0] > 0;
        own[0] = 1 / own[0];
        ncgen_add_own_product(-own[0], momentum, carries->inertia);
        take_share(own[0] * own[1], momentum, carries->wrench);
    }
    return is_regular;
}

/* What groups that hang on a link take of its wrench. */
static void take_shares_of_groups(const ncgen_tree_work *w, int link, ncgen_real *wrench)
{
    for (int group = 0; group < w->tree->n_groups; ++group)
        if (w->tree->carrier[group] == link)
            take_share(w->group[2 * group] * w->group[2 * group + 1], w->joined + 6 * (w->tree->n_links + group), wrench);
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

/* The inertia that a link has of others that hang on it without standing next to it. */
static void add_sum(const ncgen_tree_link *own, ncgen_tree_carried *to)
{
    for (int i = 0; i < INERTIA; ++i)
        to->inertia[i] += own->inertia[i];
}

/* What a link passes on joins what its parent carries already. */
static void add_carried(const ncgen_tree_carried *passed, ncgen_tree_link *parent)
{
    for (int i = 0; i < INERTIA; ++i)
        parent->inertia[i] += passed->inertia[i];
    for (int i = 0; i < 6; ++i)
        parent->lane[(WRENCH + i) * NCGEN_LINK_LANES] += passed->wrench[i];
}

/* Inertias of what hangs on links without standing next to them, and of mass that is not the same along all axes. */
static void begin_sums(ncgen_tree_work *w)
{
    for (ncgen_tree_link *own = w->link, *end = own + w->tree->n_links; own < end; ++own)
        for (int i = 0; i < (own->has_sum ? INERTIA : 0); ++i)
            own->inertia[i] = 0;
    if (!ncgen_has_pairs_alone(w))
        ncgen_tree_add_singles(w);
}

/* A link that is not a hinge alone: what its parent gets of what it carries; 0 where a joint moves nothing. */
static int pass_any(ncgen_tree_work *w, int link, ncgen_tree_screw *screws, ncgen_tree_carried *passed)
{
    const ncgen_tree_link *own = w->link + link;
    ncgen_tree_carried carries;
    ncgen_tree_add_body(own, passed, &carries);
    int is_regular = w->tree->n_groups ? close_groups(w, link, &carries) : 1;
    const ncgen_real turning = trace_of(carries.inertia + TURNING), along = trace_of(carries.inertia + ALONG);
    if (own->group >= 0)
        join(w, link, screws, &carries);
    for (int k = own->group >= 0 ? -1 : own->n_screws - 1; k >= 0; --k)
        is_regular &= eliminate(screws + k, screws[k].turns, &carries);
    if (own->is_hinge) {
        ncgen_real momentum[6];
        ncgen_set6(screws->momentum, momentum);
        ncgen_shift_wrench(own->offset, momentum);
        for (int i = 0; i < 6; ++i)
            screws->share[i] = screws->pivot * momentum[i];
    }
    if (w->tree->n_closing && own->group < 0)
        is_regular &= has_inertia(screws, own->n_screws, turning, along);
    ncgen_set_shifted(carries.inertia, own->offset, passed->inertia);
    ncgen_set6(carries.wrench, passed->wrench);
    ncgen_shift_wrench(own->offset, passed->wrench);
    return is_regular;
}

int ncgen_tree_reduce(ncgen_tree_work *w)
{
    static const ncgen_tree_carried nothing = NCGEN_ALL_ZERO;
    const int n_groups = w->tree->n_groups, has_hinges_alone = !n_groups && !w->tree->n_closing;
    ncgen_tree_carried passed = nothing;
    int is_regular = 1;
    if (n_groups)
        clear_groups(w);
    begin_sums(w);
    for (int link = w->tree->n_links - 1; link >= 0; --link) {
        ncgen_tree_screw *screw = w->screw + w->tree->screw_start[link];
        if (w->link[link].has_sum)
            add_sum(w->link + link, &passed);
        if (w->link[link].is_hinge && has_hinges_alone)
            link = ncgen_tree_pass_hinges(w, link, screw, &passed, &is_regular);
        else
            is_regular &= pass_any(w, link, screw, &passed);
        const int parent = w->link[link].parent;
        if (parent == link - 1)
            continue;
        if (parent >= 0)
            add_carried(&passed, w->link + parent);
        passed = nothing;
    }
    return n_groups ? is_regular & close_groups(w, -1, &passed) : is_regular;
}

/* Forces along the coordinates of a link's elements. */
static inline void add_forces(const ncgen_real *forces, const ncgen_tree_element *e, const ncgen_tree_element *end, ncgen_real *wrench)
{
    for (; e < end; ++e) {
        const ncgen_real force[3] = {forces[e->c[0]], forces[e->c[1]], forces[e->c[2]]};
        ncgen_real lever[3];
        ncgen_get3(e->lane, LEVER, lever);
        ncgen_add_cross(lever, force, wrench);
        ncgen_add_times(e->is_point, force, wrench + 3);
    }
}

/* A link's wrench on to its parent's. */
static inline void pass_wrench(const ncgen_tree_work *w, const ncgen_tree_link *own, ncgen_real *wrench)
{
    if (own->parent < 0)
        return;
    ncgen_real *to = w->link[own->parent].lane, sum[6];
    ncgen_get6(to, WRENCH, sum);
    ncgen_add_wrench(wrench, own->offset, sum);
    ncgen_put6(sum, to, WRENCH);
}

void ncgen_tree_push_link(ncgen_tree_work *w, int link, ncgen_real *pushes, ncgen_real *group_pushes)
{
    const ncgen_tree *tree = w->tree;
    const ncgen_tree_link *own = w->link + link;
    const ncgen_tree_element *element = w->element + tree->element_start[link];
    ncgen_real wrench[6];
    ncgen_get6(own->lane, WRENCH, wrench);
    add_forces(w->force, element, element + own->n_elements, wrench);
    for (int group = 0; group < tree->n_groups; ++group)
        if (tree->carrier[group] == link)
            take_share(w->group[2 * group] * group_pushes[group], w->joined + 6 * (tree->n_links + group), wrench);
    for (int k = tree->screw_start[link + 1] - 1; k >= tree->screw_start[link]; --k) {
        const ncgen_tree_screw *screw = w->screw + k;
        pushes[k] += ncgen_dot3(screw->axis, wrench + (screw->turns ? 0 : 3));
        if (own->group >= 0)
            group_pushes[own->group] += screw->ratio * pushes[k];
        else
            take_share(screw->pivot * pushes[k], screw->momentum, wrench);
    }
    pass_wrench(w, own, wrench);
}

void ncgen_tree_begin_pushes(ncgen_tree_work *w)
{
    const ncgen_tree *tree = w->tree;
    ncgen_tree_screw *screw = w->screw;
    for (int i = 0; i < (w->is_measured_in_order ? tree->n_measured : 0); ++i, ++screw)
        screw->push = tree->ratios[i] * w->force[screw->coordinate];
    if (w->is_measured_in_order)
        return;
    for (int k = 0; k < tree->n_screws; ++k)
        w->screw[k].push = 0;
    for (int i = 0; i < tree->n_measured; ++i)
        w->screw[tree->measured[2 * i + 1]].push += tree->ratios[i] * w->force[tree->measured[2 * i]];
}

/* The pushes of any joint, which takes its part of what is carried to its link, and what its parent gets. */
static void push_any(ncgen_tree_work *w, int link, ncgen_tree_screw *screws, ncgen_real *passed)
{
    const ncgen_tree_link *own = w->link + link;
    ncgen_real wrench[6];
    ncgen_get6(own->lane, WRENCH, wrench);
    ncgen_add_times(1, passed, wrench);
    ncgen_add_times(1, passed + 3, wrench + 3);
    if (w->tree->n_groups)
        take_shares_of_groups(w, link, wrench);
    for (ncgen_tree_screw *screw = screws + own->n_screws; screw-- > screws;) {
        screw->push += ncgen_dot3(screw->axis, wrench + (screw->turns ? 0 : 3));
        if (own->group >= 0)
            w->group[2 * own->group + 1] += screw->ratio * screw->push;
        else
            take_share(screw->pivot * screw->push, screw->momentum, wrench);
    }
    ncgen_shift_wrench(own->offset, wrench);
    ncgen_set6(wrench, passed);
}

void ncgen_tree_push(ncgen_tree_work *w)
{
    const int n_groups = w->tree->n_groups;
    ncgen_real passed[6] = {0, 0, 0, 0, 0, 0};
    for (int group = 0; group < n_groups; ++group)
        w->group[2 * group + 1] = 0;
    for (int link = w->tree->n_links - 1; link >= 0; --link) {
        ncgen_tree_screw *screw = w->screw + w->tree->screw_start[link];
        if (w->link[link].is_hinge && !n_groups)
            link = ncgen_tree_push_hinges(w, link, screw, passed);
        else
            push_any(w, link, screw, passed);
        const int parent = w->link[link].parent;
        if (parent == link - 1)
            continue;
        for (int i = 0; i < 6; ++i) {
            if (parent >= 0)
                w->link[parent].lane[(WRENCH + i) * NCGEN_LINK_LANES] += passed[i];
            passed[i] = 0;
        }
    }
}

static void release_any(const ncgen_tree_work *w, const ncgen_tree_link *own, ncgen_tree_screw *screw, ncgen_real *added)
{
    for (const ncgen_tree_screw *end = screw + own->n_screws; screw < end; ++screw) {
        screw->push = own->group < 0 ? screw->pivot * (screw->push - dot6(screw->momentum, added))
                                     : screw->ratio * w->group[2 * own->group + 1];
        ncgen_add_times(screw->push, screw->axis, added + (screw->turns ? 0 : 3));
    }
}

void ncgen_tree_release(ncgen_tree_work *w)
{
    const int n_groups = w->tree->n_groups;
    if (n_groups)
        release_groups(w, -1, ncgen_nothing);
    for (int link = 0; link < w->tree->n_links;) {
        const ncgen_tree_link *own = w->link + link;
        ncgen_tree_screw *screw = w->screw + w->tree->screw_start[link];
        if (own->is_hinge && !n_groups) {
            link = ncgen_tree_release_hinges(w, link, screw);
            continue;
        }
        ncgen_real added[6];
        ncgen_get6(ncgen_lane_before(w, own), WRENCH, added);
        ncgen_add_cross(added, own->offset, added + 3);
        release_any(w, own, screw, added);
        if (n_groups)
            release_groups(w, link, added);
        ncgen_put6(added, own->lane, WRENCH);
        ++link;
    }
}

void ncgen_tree_respond_to_wrenches(const ncgen_run *r, ncgen_tree_work *w, ncgen_real *x)
{
    ncgen_tree_begin_pushes(w);
    ncgen_tree_push(w);
    ncgen_tree_release(w);
    ncgen_tree_spread_added(w);
    ncgen_tree_measure_pushes(w);
    ncgen_tree_take(r, w, w->moved);
    for (int i = 0; i < r->n; ++i)
        x[i] += w->moved[i];
}
