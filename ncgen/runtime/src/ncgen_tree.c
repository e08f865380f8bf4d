/* ncgen_tree.c: the motion of an open tree of bodies, in loops over its tables.
 *
 * Everything is along the global axes, of every link about its own reference point, so that inertias of small bodies are not added to those
 * of long levers. A joint takes from the inertia A beyond it what it does not pass on, A - U U'/d with U = A s and d = s'U for its screw s;
 * outward, accelerations follow (Featherstone, Rigid Body Dynamics Algorithms, 2008, section 7.2). Forces and masses are the model's own:
 * with q' = T x the equations are T'M T x' = T'(Q - M b), so that whatever acts on coordinates acts on the tree.
 */
#include "ncgen_tree.h"
#include "ncgen_tree_bodies.h"
#include "ncgen_tree_solve.h"

enum { MOST_SCREWS = 6 };

static ncgen_real *take_records(ncgen_space *space, int count, size_t size)
{
    return ncgen_take(space, count * (int)(size / sizeof(ncgen_real)));
}

void ncgen_tree_layout(ncgen_run *r, ncgen_tree_work *w)
{
    const ncgen_tree *tree = r->dynamics->tree;
    ncgen_space *space = &r->space;
    ncgen_real *links = take_records(space, tree->n_links + 1, sizeof(ncgen_tree_link));
    ncgen_real *screws = take_records(space, tree->n_screws, sizeof(ncgen_tree_screw));
    w->tree = tree;
    w->mass_is_there = 0;
    w->link = links ? (ncgen_tree_link *)links + 1 : NULL;
    w->screw = (ncgen_tree_screw *)screws;
    w->values = ncgen_take(space, r->n + tree->n_fixed);
    w->moved = ncgen_take(space, r->n + tree->n_fixed);
    w->force = ncgen_take(space, r->n + tree->n_fixed);
    w->mass = ncgen_take(space, ncgen_nonzeros(&r->model->mass_pattern));
    w->masses = ncgen_take(space, tree->mass_start[tree->n_links]);
    w->member = ncgen_take(space, 3 * tree->most_members);
    w->lever = ncgen_take(space, 3 * tree->n_elements);
    w->joined = tree->n_groups ? ncgen_take(space, 6 * (tree->n_links + tree->n_groups)) : NULL;
    w->group = ncgen_take(space, 2 * tree->n_groups);
    w->bias = ncgen_take(space, r->n);
    w->inertial = ncgen_take(space, r->n);
    w->gram = ncgen_take(space, tree->most_rows * tree->most_rows);
    w->right = ncgen_take(space, 2 * tree->most_rows);
    w->jacobian = ncgen_take(space, ncgen_nonzeros(&r->model->phi_q_pattern));
    w->scaled = ncgen_take(space, ncgen_nonzeros(&r->model->phi_q_pattern));
}

/* What no evaluation changes. */
static void begin(const ncgen_run *r, ncgen_tree_work *w)
{
    ncgen_real *ground = (ncgen_real *)(w->link - 1);
    for (size_t i = 0; i < sizeof(ncgen_tree_link) / sizeof(ncgen_real); ++i)
        ground[i] = 0;
    for (int i = 0; i < w->tree->n_fixed; ++i) {
        w->values[r->n + i] = w->tree->fixed[i];
        w->force[r->n + i] = 0;
    }
}

/* M at a position, unless it is constant and known. */
static void mass_at(const ncgen_run *r, ncgen_tree_work *w, ncgen_scalar t, const ncgen_real *q)
{
    if (w->mass_is_there && (!r->model->mass || r->model->mass_is_constant))
        return;
    if (!w->mass_is_there)
        begin(r, w);
    if (r->model->mass)
        r->model->mass(t, q, r->p, w->mass);
    ncgen_tree_weigh(w);
    w->mass_is_there = 1;
}

/* Levers and axes at a position. */
static void place(const ncgen_run *r, ncgen_tree_work *w, const ncgen_real *q)
{
    const ncgen_tree *tree = w->tree;
    ncgen_copy(r->n, q, w->values);
    for (int link = 0; link < tree->n_links; ++link) {
        const int *c = tree->reference + 3 * link;
        ncgen_tree_link *own = w->link + link;
        const ncgen_tree_link *before = w->link + tree->parent[link];
        const ncgen_real origin[3] = {w->values[c[0]], w->values[c[1]], w->values[c[2]]};
        for (int i = 0; i < 3; ++i) {
            own->origin[i] = origin[i];
            own->offset[i] = origin[i] - before->origin[i];
        }
        for (int e = tree->element_start[link]; e < tree->element_start[link + 1]; ++e)
            for (int i = 0; i < 3; ++i)
                w->lever[3 * e + i] = w->values[tree->elements[3 * e + i]] - tree->is_point[e] * origin[i];
    }
    for (int k = 0; k < tree->n_screws; ++k) {
        ncgen_real axis[3] = {0, 0, 0};
        for (int s = tree->term_start[k]; s < tree->term_start[k + 1]; ++s)
            for (int i = 0; i < 3; ++i)
                axis[i] += tree->weights[s] * w->values[tree->terms[3 * s + i]];
        for (int i = 0; i < 3; ++i)
            w->screw[k].axis[i] = axis[i];
    }
}

/* Velocities ------------------------------------------------------------------------------------------------------ */

/* The velocity of an element that moves with a link. */
static inline void carried(const ncgen_tree_work *w, int element, const ncgen_real *twist, ncgen_real *velocity)
{
    ncgen_cross(twist, w->lever + 3 * element, velocity);
    ncgen_add_times(w->tree->is_point[element], twist + 3, velocity);
}

/* The velocity of an element at rate 1 of a screw. */
static void moved(const ncgen_tree_work *w, int element, int screw, ncgen_real *velocity)
{
    const ncgen_real *axis = w->screw[screw].axis;
    if (w->tree->turns[screw])
        ncgen_cross(axis, w->lever + 3 * element, velocity);
    else
        for (int i = 0; i < 3; ++i)
            velocity[i] = w->tree->is_point[element] * axis[i];
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
    for (int a = 0; a < count; ++a)
        w->screw[first + a].rate = right[a];
    return status;
}

/* The rates of a link's joint: of what follows another joint that one's, of what is measured its own, which no error of the elements touches;
 * of all else what fits best. */
static inline int find_rates(const ncgen_run *r, ncgen_tree_work *w, int link, const ncgen_real *qd, const ncgen_real *twist)
{
    const ncgen_tree *tree = w->tree;
    int is_measured = 1;
    for (int k = tree->screw_start[link]; k < tree->screw_start[link + 1]; ++k)
        is_measured &= tree->meter[k] >= 0 || tree->leader[k] >= 0;
    const int status = is_measured ? NCGEN_OK : fit_rates(r, w, link, qd, twist);
    for (int k = tree->screw_start[link]; k < tree->screw_start[link + 1]; ++k)
        if (tree->leader[k] >= 0)
            w->screw[k].rate = tree->ratio[k] * w->screw[tree->leader[k]].rate;
        else if (tree->meter[k] >= 0)
            w->screw[k].rate = qd[tree->measured[2 * tree->meter[k]]] / tree->ratios[tree->meter[k]];
    return status;
}

/* Velocities of the coordinates from the twists of the links; measured ones stay out. */
static void spread_twists(const ncgen_run *r, ncgen_tree_work *w, ncgen_real *velocities)
{
    const ncgen_tree *tree = w->tree;
    for (int link = 0; link < tree->n_links; ++link)
        for (int e = tree->element_start[link]; e < tree->element_start[link + 1]; ++e) {
            const int *c = tree->elements + 3 * e;
            ncgen_real velocity[3];
            carried(w, e, w->link[link].twist, velocity);
            for (int i = 0; i < 3; ++i)
                w->moved[c[i]] = velocity[i];
        }
    ncgen_copy(r->n, w->moved, velocities);
}

/* Twists of all links from velocities of the coordinates; the velocities that the joints allow. */
static int find_twists(const ncgen_run *r, ncgen_tree_work *w, const ncgen_real *qd, ncgen_real *allowed)
{
    const ncgen_tree *tree = w->tree;
    int status = NCGEN_OK;
    for (int link = 0; link < tree->n_links; ++link) {
        ncgen_tree_link *own = w->link + link;
        const ncgen_real *before = w->link[tree->parent[link]].twist;
        ncgen_real twist[6];
        for (int i = 0; i < 6; ++i)
            twist[i] = before[i];
        ncgen_add_cross(before, own->offset, twist + 3);
        if (find_rates(r, w, link, qd, twist) != NCGEN_OK)
            status = NCGEN_SINGULAR;
        for (int k = tree->screw_start[link]; k < tree->screw_start[link + 1]; ++k)
            ncgen_add_screw(w, k, w->screw[k].rate, twist);
        for (int i = 0; i < 6; ++i)
            own->twist[i] = twist[i];
    }
    for (int i = 0; i < tree->n_measured; ++i)
        w->moved[tree->measured[2 * i]] = tree->ratios[i] * w->screw[tree->measured[2 * i + 1]].rate;
    spread_twists(r, w, allowed);
    return status;
}

/* Accelerations ---------------------------------------------------------------------------------------------------- */

/* What the accelerations of links are without those of the joints. */
static void find_changes(ncgen_tree_work *w)
{
    const ncgen_tree *tree = w->tree;
    for (int link = 0; link < tree->n_links; ++link) {
        const ncgen_tree_link *parent = w->link + tree->parent[link];
        const ncgen_real *before = parent->twist, *outer = parent->change;
        ncgen_tree_link *own = w->link + link;
        ncgen_real change[6], faster[3], turned_axis[3];
        for (int i = 0; i < 6; ++i)
            change[i] = outer[i];
        ncgen_add_cross(outer, own->offset, change + 3);
        for (int i = 0; i < 3; ++i)
            faster[i] = own->twist[3 + i] - before[3 + i];
        ncgen_add_cross(before, faster, change + 3);
        for (int k = tree->screw_start[link]; k < tree->screw_start[link + 1]; ++k)
            if (tree->is_carried[k]) {
                ncgen_cross(before, w->screw[k].axis, turned_axis);
                ncgen_add_times(w->screw[k].rate, turned_axis, change + (tree->turns[k] ? 0 : 3));
            }
        for (int i = 0; i < 6; ++i)
            own->change[i] = change[i];
    }
}

/* Accelerations of the coordinates from those of the links; measured ones are `w->moved` already. */
static void spread_changes(const ncgen_run *r, ncgen_tree_work *w, ncgen_real *accelerations)
{
    const ncgen_tree *tree = w->tree;
    for (int link = 0; link < tree->n_links; ++link) {
        const ncgen_real *twist = w->link[link].twist, *change = w->link[link].change;
        for (int e = tree->element_start[link]; e < tree->element_start[link + 1]; ++e) {
            const int *c = tree->elements + 3 * e;
            ncgen_real speed[3], found[3];
            ncgen_cross(twist, w->lever + 3 * e, speed);
            carried(w, e, change, found);
            ncgen_add_cross(twist, speed, found);
            for (int i = 0; i < 3; ++i)
                w->moved[c[i]] = found[i];
        }
    }
    ncgen_copy(r->n, w->moved, accelerations);
}

static void take_pushes(ncgen_tree_work *w)
{
    const ncgen_tree *tree = w->tree;
    for (int k = 0; k < tree->n_screws; ++k)
        w->screw[k].push = 0;
    for (int i = 0; i < tree->n_measured; ++i)
        w->screw[tree->measured[2 * i + 1]].push += tree->ratios[i] * w->force[tree->measured[2 * i]];
}

static ncgen_real growth_of(int is_regular)
{
    return is_regular ? 0 : R(1.0e30);
}

/* Forces less M b, where b are the accelerations without those of the joints. */
static void take_inertial(ncgen_run *r, ncgen_tree_work *w)
{
    for (int i = 0; i < w->tree->n_measured; ++i)
        w->moved[w->tree->measured[2 * i]] = 0;
    spread_changes(r, w, w->bias);
    ncgen_times_mass(r, w->mass, w->bias, w->inertial);
    for (int i = 0; i < r->n; ++i)
        w->force[i] -= w->inertial[i];
}

void ncgen_tree_derivative(ncgen_run *r, ncgen_tree_work *w, ncgen_scalar t, const ncgen_real *q, const ncgen_real *qd, ncgen_real *out)
{
    const ncgen_tree *tree = w->tree;
    const int n = r->n;
    ncgen_real energy[3] = {0, 0, 0};
    mass_at(r, w, t, q);
    place(r, w, q);
    int is_regular = find_twists(r, w, qd, out) == NCGEN_OK;
    find_changes(w);
    if (ncgen_forces(r, t, q, out, w->force) != NCGEN_OK)
        is_regular = 0;
    if (ncgen_has_pairs_alone(w)) {
        ncgen_tree_find_inertias_and_wrenches(w);
    } else {
        ncgen_tree_find_inertias(w);
        take_inertial(r, w);
    }
    take_pushes(w);
    is_regular &= ncgen_tree_reduce(w);
    ncgen_tree_release(w, w->link->change);
    for (int i = 0; i < tree->n_measured; ++i)
        w->moved[tree->measured[2 * i]] = tree->ratios[i] * w->screw[tree->measured[2 * i + 1]].push;
    spread_changes(r, w, out + n);
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
    mass_at(r, w, t, q);
    place(r, w, q);
    int is_regular = find_twists(r, w, qd, out) == NCGEN_OK;
    for (int i = 0; i < n; ++i)
        w->bias[i] = qd[i] - out[i];
    ncgen_times_mass(r, w->mass, w->bias, w->force);
    take_pushes(w);
    ncgen_tree_find_inertias(w);
    is_regular &= ncgen_tree_reduce(w);
    ncgen_tree_release(w, w->link->twist);
    for (int i = 0; i < tree->n_measured; ++i)
        w->moved[tree->measured[2 * i]] += tree->ratios[i] * w->screw[tree->measured[2 * i + 1]].push;
    spread_twists(r, w, out);
    out[n] = growth_of(is_regular && ncgen_is_finite(n, out));
}
