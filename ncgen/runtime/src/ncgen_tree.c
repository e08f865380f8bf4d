/* ncgen_tree.c: the motion of an open tree of bodies, in loops over its tables.
 *
 * Everything is along the global axes, of every link about its own reference point, so that inertias of small bodies are not added to those
 * of long levers. A joint takes from the inertia A beyond it what it does not pass on, A - U U'/d with U = A s and d = s'U for its screw s;
 * outward, accelerations follow (Featherstone, Rigid Body Dynamics Algorithms, 2008, section 7.2). Forces and masses are the model's own:
 * with q' = T x the equations are T'M T x' = T'(Q - M b), so that whatever acts on coordinates acts on the tree.
 */
#include "ncgen_tree.h"
#include "ncgen_inertia.h"
#include "ncgen_tree_solve.h"

enum { MOST_SCREWS = 6 };

void ncgen_tree_layout(ncgen_run *r, ncgen_tree_work *w)
{
    const ncgen_tree *tree = r->dynamics->tree;
    ncgen_space *space = &r->space;
    w->tree = tree;
    w->mass_is_there = 0;
    w->values = ncgen_take(space, r->n + tree->n_fixed);
    w->mass = ncgen_take(space, ncgen_nonzeros(&r->model->mass_pattern));
    w->square = ncgen_take(space, tree->square_start[tree->n_links]);
    w->total = ncgen_take(space, tree->n_links);
    w->moments = ncgen_take(space, 9 * tree->n_links);
    w->member = ncgen_take(space, 3 * tree->most_members);
    w->lever = ncgen_take(space, 3 * tree->n_elements);
    w->axis = ncgen_take(space, 3 * tree->n_screws);
    w->twist = ncgen_take(space, 6 * tree->n_links);
    w->change = ncgen_take(space, 6 * tree->n_links);
    w->wrench = ncgen_take(space, 6 * tree->n_links);
    w->inertia = ncgen_take(space, INERTIA * tree->n_links);
    w->momentum = ncgen_take(space, 6 * tree->n_screws);
    w->pivot = ncgen_take(space, tree->n_screws);
    w->push = ncgen_take(space, tree->n_screws);
    w->rate = ncgen_take(space, tree->n_screws);
    w->joined = ncgen_take(space, 6 * (tree->n_links + tree->n_groups));
    w->group = ncgen_take(space, 2 * tree->n_groups);
    w->force = ncgen_take(space, r->n);
    w->bias = ncgen_take(space, r->n);
    w->inertial = ncgen_take(space, r->n);
    w->gram = ncgen_take(space, tree->most_rows * tree->most_rows);
    w->right = ncgen_take(space, 2 * tree->most_rows);
    w->jacobian = ncgen_take(space, ncgen_nonzeros(&r->model->phi_q_pattern));
    w->unknown = ncgen_take(space, tree->most_unknowns);
    w->dense = ncgen_take(space, tree->most_rows * tree->most_unknowns);
}

/* Levers and axes at a position. */
static void place(const ncgen_run *r, ncgen_tree_work *w, const ncgen_real *q)
{
    const ncgen_tree *tree = w->tree;
    ncgen_copy(r->n, q, w->values);
    for (int i = 0; i < tree->n_fixed; ++i)
        w->values[r->n + i] = tree->fixed[i];
    for (int link = 0; link < tree->n_links; ++link) {
        const int *origin = tree->reference + 3 * link;
        for (int e = tree->element_start[link]; e < tree->element_start[link + 1]; ++e)
            for (int i = 0; i < 3; ++i)
                w->lever[3 * e + i] = w->values[tree->elements[3 * e + i]] - (tree->is_point[e] ? w->values[origin[i]] : 0);
    }
    for (int k = 0; k < tree->n_screws; ++k) {
        ncgen_real *axis = w->axis + 3 * k;
        axis[0] = axis[1] = axis[2] = 0;
        for (int s = tree->term_start[k]; s < tree->term_start[k + 1]; ++s)
            for (int i = 0; i < 3; ++i)
                axis[i] += tree->weights[s] * w->values[tree->terms[3 * s + i]];
    }
}

/* Velocities ------------------------------------------------------------------------------------------------------ */

/* The velocity of an element that moves with a link. */
static void carried(const ncgen_tree_work *w, int element, const ncgen_real *twist, ncgen_real *velocity)
{
    ncgen_cross(twist, w->lever + 3 * element, velocity);
    if (w->tree->is_point[element])
        ncgen_add_times(1, twist + 3, velocity);
}

/* The velocity of an element at rate 1 of a screw. */
static void moved(const ncgen_tree_work *w, int element, int screw, ncgen_real *velocity)
{
    const ncgen_real *axis = w->axis + 3 * screw;
    if (w->tree->turns[screw])
        ncgen_cross(axis, w->lever + 3 * element, velocity);
    else
        for (int i = 0; i < 3; ++i)
            velocity[i] = w->tree->is_point[element] ? axis[i] : 0;
}

/* The rates of a link's joint that fit the velocities of its elements best, the twist without them being known. */
static int fit_rates(const ncgen_run *r, ncgen_tree_work *w, int link, const ncgen_real *qd, const ncgen_real *twist)
{
    const ncgen_tree *tree = w->tree;
    const int first = tree->screw_start[link], count = tree->screw_start[link + 1] - first;
    ncgen_real square[MOST_SCREWS * MOST_SCREWS] = {0}, right[MOST_SCREWS] = {0}, column[3 * MOST_SCREWS];
    for (int e = tree->element_start[link]; e < tree->element_start[link + 1]; ++e) {
        ncgen_real rest[3];
        if (!(tree->heaviness[e] > 0))
            continue;
        carried(w, e, twist, rest);
        for (int i = 0; i < 3; ++i) {
            const int c = tree->elements[3 * e + i];
            rest[i] = (c < r->n ? qd[c] : 0) - rest[i];
        }
        for (int a = 0; a < count; ++a) {
            moved(w, e, first + a, column + 3 * a);
            right[a] += tree->heaviness[e] * ncgen_dot3(column + 3 * a, rest);
            for (int b = 0; b <= a; ++b)
                square[a * count + b] += tree->heaviness[e] * ncgen_dot3(column + 3 * a, column + 3 * b);
        }
    }
    const int status = ncgen_solve_positive(count, square, right);
    ncgen_copy(count, right, w->rate + first);
    return status;
}

/* The rates of a link's joint: of what follows another joint that one's, of what is measured its own, which no error of the elements touches;
 * of all else what fits best. */
static int find_rates(const ncgen_run *r, ncgen_tree_work *w, int link, const ncgen_real *qd, const ncgen_real *twist)
{
    const ncgen_tree *tree = w->tree;
    int is_measured = 1;
    for (int k = tree->screw_start[link]; k < tree->screw_start[link + 1]; ++k)
        is_measured &= tree->meter[k] >= 0 || tree->leader[k] >= 0;
    const int status = is_measured ? NCGEN_OK : fit_rates(r, w, link, qd, twist);
    for (int k = tree->screw_start[link]; k < tree->screw_start[link + 1]; ++k)
        if (tree->leader[k] >= 0)
            w->rate[k] = tree->ratio[k] * w->rate[tree->leader[k]];
        else if (tree->meter[k] >= 0)
            w->rate[k] = qd[tree->measured[2 * tree->meter[k]]] / tree->ratios[tree->meter[k]];
    return status;
}

/* Velocities of the coordinates from the twists of the links; measured ones stay out. */
static void spread_twists(const ncgen_run *r, const ncgen_tree_work *w, ncgen_real *velocities)
{
    const ncgen_tree *tree = w->tree;
    for (int link = 0; link < tree->n_links; ++link)
        for (int e = tree->element_start[link]; e < tree->element_start[link + 1]; ++e) {
            ncgen_real velocity[3];
            carried(w, e, w->twist + 6 * link, velocity);
            for (int i = 0; i < 3; ++i)
                if (tree->elements[3 * e + i] < r->n)
                    velocities[tree->elements[3 * e + i]] = velocity[i];
        }
}

/* Twists of all links from velocities of the coordinates; the velocities that the joints allow. */
static int find_twists(const ncgen_run *r, ncgen_tree_work *w, const ncgen_real *qd, ncgen_real *allowed)
{
    const ncgen_tree *tree = w->tree;
    int status = NCGEN_OK;
    for (int link = 0; link < tree->n_links; ++link) {
        const ncgen_real *before = ncgen_of_parent(w, w->twist, link);
        ncgen_real *twist = w->twist + 6 * link, d[3];
        ncgen_copy(6, before, twist);
        if (tree->parent[link] >= 0) {
            ncgen_between(w, link, d);
            ncgen_add_cross(before, d, twist + 3);
        }
        if (find_rates(r, w, link, qd, twist) != NCGEN_OK)
            status = NCGEN_SINGULAR;
        for (int k = tree->screw_start[link]; k < tree->screw_start[link + 1]; ++k)
            ncgen_add_screw(w, k, w->rate[k], twist);
    }
    spread_twists(r, w, allowed);
    for (int i = 0; i < tree->n_measured; ++i)
        allowed[tree->measured[2 * i]] = tree->ratios[i] * w->rate[tree->measured[2 * i + 1]];
    return status;
}

/* Accelerations ---------------------------------------------------------------------------------------------------- */

/* What the accelerations of links are without those of the joints. */
static void find_changes(ncgen_tree_work *w)
{
    const ncgen_tree *tree = w->tree;
    for (int link = 0; link < tree->n_links; ++link) {
        const ncgen_real *before = ncgen_of_parent(w, w->twist, link), *twist = w->twist + 6 * link;
        const ncgen_real *outer = ncgen_of_parent(w, w->change, link);
        ncgen_real *change = w->change + 6 * link, d[3], turned_axis[3];
        ncgen_copy(6, outer, change);
        if (tree->parent[link] < 0)
            continue;
        ncgen_between(w, link, d);
        ncgen_add_cross(outer, d, change + 3);
        for (int i = 0; i < 3; ++i)
            d[i] = twist[3 + i] - before[3 + i];
        ncgen_add_cross(before, d, change + 3);
        for (int k = tree->screw_start[link]; k < tree->screw_start[link + 1]; ++k)
            if (tree->is_carried[k]) {
                ncgen_cross(before, w->axis + 3 * k, turned_axis);
                ncgen_add_times(w->rate[k], turned_axis, change + (tree->turns[k] ? 0 : 3));
            }
    }
}

/* Accelerations of the coordinates from those of the links; measured ones stay out. */
static void spread_changes(const ncgen_run *r, const ncgen_tree_work *w, ncgen_real *accelerations)
{
    const ncgen_tree *tree = w->tree;
    for (int link = 0; link < tree->n_links; ++link)
        for (int e = tree->element_start[link]; e < tree->element_start[link + 1]; ++e) {
            const ncgen_real *twist = w->twist + 6 * link;
            ncgen_real speed[3], found[3];
            ncgen_cross(twist, w->lever + 3 * e, speed);
            carried(w, e, w->change + 6 * link, found);
            ncgen_add_cross(twist, speed, found);
            for (int i = 0; i < 3; ++i)
                if (tree->elements[3 * e + i] < r->n)
                    accelerations[tree->elements[3 * e + i]] = found[i];
        }
}

/* Forces along coordinates as wrenches on links, and as pushes of joints. */
static void find_wrenches(const ncgen_run *r, ncgen_tree_work *w, const ncgen_real *force)
{
    const ncgen_tree *tree = w->tree;
    for (int link = 0; link < tree->n_links; ++link) {
        ncgen_real *wrench = w->wrench + 6 * link;
        ncgen_copy(6, ncgen_nothing, wrench);
        for (int e = tree->element_start[link]; e < tree->element_start[link + 1]; ++e) {
            ncgen_real own[3];
            for (int i = 0; i < 3; ++i)
                own[i] = tree->elements[3 * e + i] < r->n ? force[tree->elements[3 * e + i]] : 0;
            ncgen_add_cross(w->lever + 3 * e, own, wrench);
            if (tree->is_point[e])
                ncgen_add_times(1, own, wrench + 3);
        }
    }
    for (int k = 0; k < tree->n_screws; ++k)
        w->push[k] = 0;
    for (int i = 0; i < tree->n_measured; ++i)
        w->push[tree->measured[2 * i + 1]] += tree->ratios[i] * force[tree->measured[2 * i]];
}

/* M at a position, unless it is constant and known. */
static void mass_at(const ncgen_run *r, ncgen_tree_work *w, ncgen_scalar t, const ncgen_real *q)
{
    if (w->mass_is_there && (!r->model->mass || r->model->mass_is_constant))
        return;
    if (r->model->mass)
        r->model->mass(t, q, r->p, w->mass);
    ncgen_tree_weigh(w);
    w->mass_is_there = 1;
}

static ncgen_real growth_of(int is_regular)
{
    return is_regular ? 0 : R(1.0e30);
}

/* Forces less M b, where b are the accelerations without those of the joints. */
static void take_inertial(ncgen_run *r, ncgen_tree_work *w)
{
    for (int i = 0; i < r->n; ++i)
        w->bias[i] = 0;
    spread_changes(r, w, w->bias);
    ncgen_times_mass(r, w->mass, w->bias, w->inertial);
    for (int i = 0; i < r->n; ++i)
        w->force[i] -= w->inertial[i];
}

void ncgen_tree_derivative(ncgen_run *r, ncgen_tree_work *w, ncgen_scalar t, const ncgen_real *q, const ncgen_real *qd, ncgen_real *out)
{
    const int n = r->n;
    ncgen_real energy[3] = {0, 0, 0};
    place(r, w, q);
    int is_regular = find_twists(r, w, qd, out) == NCGEN_OK;
    find_changes(w);
    mass_at(r, w, t, q);
    if (ncgen_forces(r, t, q, out, w->force) != NCGEN_OK)
        is_regular = 0;
    is_regular &= ncgen_tree_factor(w);
    if (w->tree->single_start[w->tree->n_links] > 0)
        take_inertial(r, w);
    find_wrenches(r, w, w->force);
    if (w->tree->single_start[w->tree->n_links] == 0)
        ncgen_tree_take_inertial(w);
    ncgen_tree_solve(w, w->change);
    spread_changes(r, w, out + n);
    for (int i = 0; i < w->tree->n_measured; ++i)
        out[n + w->tree->measured[2 * i]] = w->tree->ratios[i] * w->push[w->tree->measured[2 * i + 1]];
    if (!r->dynamics->conservative && ncgen_energies(r, t, q, out, energy) != NCGEN_OK)
        is_regular = 0;
    out[2 * n] = energy[2];
    out[2 * n + 1] = growth_of(is_regular && ncgen_is_finite(2 * n, out));
}

/* What is left of the velocities, x, has the momentum T'M x over the rates, which changes them by (T'M T)^-1 T'M x. */
void ncgen_tree_velocities(ncgen_run *r, ncgen_tree_work *w, ncgen_scalar t, const ncgen_real *q, const ncgen_real *qd, ncgen_real *out)
{
    const int n = r->n;
    const ncgen_tree *tree = w->tree;
    place(r, w, q);
    int is_regular = find_twists(r, w, qd, out) == NCGEN_OK;
    mass_at(r, w, t, q);
    for (int i = 0; i < n; ++i)
        w->bias[i] = qd[i] - out[i];
    ncgen_times_mass(r, w->mass, w->bias, w->force);
    find_wrenches(r, w, w->force);
    is_regular &= ncgen_tree_factor(w);
    ncgen_tree_solve(w, w->twist);
    spread_twists(r, w, out);
    for (int i = 0; i < tree->n_measured; ++i)
        out[tree->measured[2 * i]] += tree->ratios[i] * w->push[tree->measured[2 * i + 1]];
    out[n] = growth_of(is_regular && ncgen_is_finite(n, out));
}
