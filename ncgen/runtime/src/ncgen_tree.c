/* ncgen_tree.c: the motion of an open tree of bodies, in loops over its tables.
 *
 * Everything is along the global axes, of every link about its own reference point, so that inertias of small bodies are not added to those
 * of long levers. A joint takes from the inertia A beyond it what it does not pass on, A - U U'/d with U = A s and d = s'U for its screw s;
 * outward, accelerations follow (Featherstone, Rigid Body Dynamics Algorithms, 2008, section 7.2). Forces and masses are the model's own:
 * with q' = T x the equations are T'M T x' = T'(Q - M b), so that whatever acts on coordinates acts on the tree.
 */
#include "ncgen_tree.h"
#include "ncgen_tree_bodies.h"
#include "ncgen_tree_loops.h"
#include "ncgen_tree_rates.h"
#include "ncgen_tree_solve.h"

/* Where a link, its elements and its axes are. */
static inline void place(const ncgen_tree_work *w, ncgen_tree_link *own, const ncgen_tree_place *at, const int n_screws)
{
    const ncgen_real *values = w->values, *before = w->link[own->parent].origin;
    const ncgen_real x = values[own->reference[0]], y = values[own->reference[1]], z = values[own->reference[2]];
    own->origin[0] = x;
    own->origin[1] = y;
    own->origin[2] = z;
    own->offset[0] = x - before[0];
    own->offset[1] = y - before[1];
    own->offset[2] = z - before[2];
    for (ncgen_tree_element *e = at->element, *end = e + own->n_elements; e < end; ++e) {
        e->lever[0] = values[e->c[0]] - e->is_point * x;
        e->lever[1] = values[e->c[1]] - e->is_point * y;
        e->lever[2] = values[e->c[2]] - e->is_point * z;
    }
    for (int k = 0; k < n_screws; ++k) {
        ncgen_tree_screw *screw = at->screw + k;
        for (int i = 0; i < 3; ++i)
            screw->axis[i] = screw->weight * values[screw->c[i]];
        for (int s = screw->first_term; s < screw->end_term; ++s)
            for (int i = 0; i < 3; ++i)
                screw->axis[i] += w->tree->weights[s] * values[w->tree->terms[3 * s + i]];
    }
}

/* Velocities of a link's coordinates from its twist. */
static inline void spread_twist(const ncgen_tree_element *e, int count, const ncgen_real *twist, ncgen_real *moved)
{
    for (const ncgen_tree_element *end = e + count; e < end; ++e) {
        ncgen_real velocity[3];
        ncgen_carried(e, twist, velocity);
        moved[e->c[0]] = velocity[0];
        moved[e->c[1]] = velocity[1];
        moved[e->c[2]] = velocity[2];
    }
}

/* Accelerations of a link's coordinates from its own. */
static inline void spread_change(const ncgen_tree_element *e, int count, const ncgen_real *twist, const ncgen_real *change,
                                 ncgen_real *moved)
{
    for (const ncgen_tree_element *end = e + count; e < end; ++e) {
        ncgen_real speed[3], acceleration[3];
        ncgen_cross(twist, e->lever, speed);
        ncgen_carried(e, change, acceleration);
        ncgen_add_cross(twist, speed, acceleration);
        moved[e->c[0]] = acceleration[0];
        moved[e->c[1]] = acceleration[1];
        moved[e->c[2]] = acceleration[2];
    }
}

/* What the acceleration of a link is without that of the joints. */
static inline void find_change(const ncgen_tree_work *w, ncgen_tree_link *own, const ncgen_tree_screw *screws, const int n_screws)
{
    const ncgen_tree_link *parent = w->link + own->parent;
    const ncgen_real *before = parent->twist;
    const ncgen_real faster[3] = {own->twist[3] - before[3], own->twist[4] - before[4], own->twist[5] - before[5]};
    ncgen_real change[6], turned_axis[3];
    ncgen_set6(parent->change, change);
    ncgen_add_cross(parent->change, own->offset, change + 3);
    ncgen_add_cross(before, faster, change + 3);
    for (int k = 0; k < n_screws; ++k) {
        ncgen_cross(before, screws[k].axis, turned_axis);
        ncgen_add_times(screws[k].is_carried * screws[k].rate, turned_axis, change + (screws[k].turns ? 0 : 3));
    }
    ncgen_set6(change, own->change);
}

/* Of a link: where it is, how it moves, its body; is_hinge: whether it is one, known to the compiler. */
static inline int go_on(const ncgen_run *r, ncgen_tree_work *w, ncgen_tree_link *own, const ncgen_tree_place *at, const ncgen_real *qd,
                        const int with_changes, const int is_hinge)
{
    const int n_screws = is_hinge ? 1 : own->n_screws;
    const ncgen_real *before = w->link[own->parent].twist;
    ncgen_real twist[6];
    int status = NCGEN_OK;
    if (!w->is_factored) {
        place(w, own, at, n_screws);
        ncgen_find_moments(w, own, at, own->moments);
        ncgen_set_inertia(own->moments, at->masses[0], own->inertia);
    }
    ncgen_set6(before, twist);
    ncgen_add_cross(before, own->offset, twist + 3);
    if (is_hinge)
        at->screw->rate = qd[at->screw->coordinate] * at->screw->slowness;
    else
        status = ncgen_tree_find_rates(r, w, own, at, qd, twist);
    for (int k = 0; k < n_screws; ++k)
        ncgen_add_times(at->screw[k].rate, at->screw[k].axis, twist + (is_hinge || at->screw[k].turns ? 0 : 3));
    ncgen_set6(twist, own->twist);
    spread_twist(at->element, own->n_elements, twist, w->moved);
    if (with_changes)
        find_change(w, own, at->screw, n_screws);
    if (with_changes)
        ncgen_set_wrench(own->moments, at->masses[0], own->twist, own->change, own->wrench);
    else
        ncgen_set6(ncgen_nothing, own->wrench);
    return status;
}

/* Velocities of the coordinates that measure joints. */
static void write_rates(ncgen_tree_work *w)
{
    const ncgen_tree *tree = w->tree;
    for (int i = 0; i < tree->n_measured; ++i)
        w->moved[tree->measured[2 * i]] = tree->ratios[i] * w->screw[tree->measured[2 * i + 1]].rate;
}

static int is_same(int count, const ncgen_real *a, const ncgen_real *b)
{
    for (int i = 0; i < count; ++i)
        if (!(a[i] <= b[i] && a[i] >= b[i]))
            return 0;
    return 1;
}

/* Outward: where links are, how they move, and their bodies; at the position of the evaluation before this one only how they move.
 * Wrenches are those of mass that is the same along all axes without accelerations of the joints, or none. */
static inline int go_outward(const ncgen_run *r, ncgen_tree_work *w, const ncgen_real *q, const ncgen_real *qd, const int with_changes)
{
    const ncgen_tree *tree = w->tree;
    ncgen_tree_place at = ncgen_tree_begin(w);
    int status = NCGEN_OK;
    w->is_factored = w->is_factored && is_same(r->n, q, w->values);
    w->are_there = w->are_there && w->is_factored;
    ncgen_copy(r->n, q, w->values);
    for (ncgen_tree_link *own = w->link, *end = own + tree->n_links; own < end; ++own) {
        if (own->is_hinge)
            go_on(r, w, own, &at, qd, with_changes, 1);
        else if (go_on(r, w, own, &at, qd, with_changes, 0) != NCGEN_OK)
            status = NCGEN_SINGULAR;
        ncgen_tree_go_on(own, &at);
    }
    write_rates(w);
    return status;
}

/* What forces along the coordinates give the joints; 0 where one of them moves nothing. */
static int solve(ncgen_tree_work *w)
{
    ncgen_tree_begin_pushes(w);
    if (!w->is_factored && !ncgen_has_pairs_alone(w))
        ncgen_tree_add_singles(w);
    if (w->is_factored)
        ncgen_tree_push(w);
    else
        w->is_regular = ncgen_tree_reduce(w);
    w->is_factored = 1;
    ncgen_tree_release(w);
    return w->is_regular;
}

/* The growth of an ncgen_motion: 2 calls for stages on the constraints where a step is repeated. */
static ncgen_real growth_of(const ncgen_tree_work *w, int is_regular)
{
    const int is_near = w->tree->n_closing && ncgen_tree_is_near_singular(w);
    return !is_regular ? R(1.0e30) : is_near ? 2 : 0;
}

void ncgen_tree_derivative(ncgen_run *r, ncgen_tree_work *w, ncgen_scalar t, const ncgen_real *q, const ncgen_real *qd, ncgen_real *out)
{
    const ncgen_tree *tree = w->tree;
    const int n = r->n;
    ncgen_real *qdd = out + n + 1, *power = qdd + n;
    ncgen_tree_mass_at(r, w, t, q);
    int is_regular = go_outward(r, w, q, qd, 1) == NCGEN_OK;
    ncgen_copy(n, w->moved, out);
    if (ncgen_forces(r, t, q, out, w->force) != NCGEN_OK)
        is_regular = 0;
    if (!ncgen_has_pairs_alone(w))
        ncgen_tree_push_singles(w);
    is_regular &= solve(w);
    const ncgen_tree_element *element = w->element;
    for (const ncgen_tree_link *own = w->link, *end = own + tree->n_links; own < end; element += own->n_elements, ++own) {
        ncgen_real change[6];
        ncgen_set6(own->change, change);
        ncgen_add_times(1, own->wrench, change);
        ncgen_add_times(1, own->wrench + 3, change + 3);
        spread_change(element, own->n_elements, own->twist, change, w->moved);
    }
    for (int i = 0; i < tree->n_measured; ++i)
        w->moved[tree->measured[2 * i]] = tree->ratios[i] * w->screw[tree->measured[2 * i + 1]].push;
    ncgen_copy(n, w->moved, qdd);
    if (tree->n_closing)
        is_regular &= ncgen_gamma(r, t, q, out, w->gamma) == NCGEN_OK && ncgen_tree_close_loops(r, w, t, w->gamma, qdd);
    if (ncgen_power(r, t, q, out, power) != NCGEN_OK)
        is_regular = 0;
    out[n] = growth_of(w, is_regular && ncgen_is_finite(n, out) && ncgen_is_finite(n, qdd));
}

/* Momenta and pivots where nothing acts; 0 where a joint moves nothing. */
static int factor(const ncgen_run *r, ncgen_tree_work *w)
{
    for (int i = 0; i < r->n; ++i)
        w->force[i] = 0;
    return w->is_factored ? w->is_regular : solve(w);
}

/* What is left of the velocities, x, has the momentum T'M x over the rates, which changes them by (T'M T)^-1 T'M x. Loops are closed
 * before, too: there alone is the shared mass of bodies that share elements what the matrix has. */
void ncgen_tree_velocities(ncgen_run *r, ncgen_tree_work *w, ncgen_scalar t, const ncgen_real *q, const ncgen_real *qd, ncgen_real *out)
{
    const int n = r->n, closes_loops = w->tree->n_closing > 0;
    ncgen_tree_mass_at(r, w, t, q);
    int is_regular = go_outward(r, w, q, qd, 0) == NCGEN_OK;
    ncgen_copy(n, w->moved, out);
    is_regular &= factor(r, w);
    if (closes_loops)
        is_regular &= ncgen_tree_close_loops(r, w, t, NULL, out);
    for (int i = 0; i < n; ++i)
        w->bias[i] = qd[i] - out[i];
    ncgen_times_mass(r, w->mass, w->bias, w->force);
    ncgen_tree_respond(r, w, out);
    if (closes_loops)
        is_regular &= ncgen_tree_close_loops(r, w, t, NULL, out);
    out[n] = growth_of(w, is_regular && ncgen_is_finite(n, out));
}

/* The twist of a link without that of its joint. */
static inline void begin_twist(const ncgen_tree_work *w, ncgen_tree_link *own)
{
    const ncgen_real *before = w->link[own->parent].twist;
    ncgen_set6(before, own->twist);
    ncgen_add_cross(before, own->offset, own->twist + 3);
}

static inline void add_screws(ncgen_tree_link *own, const ncgen_tree_screw *screws)
{
    for (int k = 0; k < own->n_screws; ++k)
        ncgen_add_times(screws[k].rate, screws[k].axis, own->twist + (screws[k].turns ? 0 : 3));
}

/* Velocities of the coordinates at rates of the screws, their places being known. */
static void move_at_rates(ncgen_tree_work *w)
{
    const ncgen_tree *tree = w->tree;
    ncgen_tree_place at = ncgen_tree_begin(w);
    for (ncgen_tree_link *own = w->link, *end = own + tree->n_links; own < end; ++own) {
        begin_twist(w, own);
        add_screws(own, at.screw);
        spread_twist(at.element, own->n_elements, own->twist, w->moved);
        ncgen_tree_go_on(own, &at);
    }
    write_rates(w);
}

int ncgen_tree_joints(const ncgen_tree *tree)
{
    int count = 0;
    for (int k = 0; k < tree->n_screws; ++k)
        count += tree->leader[k] < 0;
    return count;
}

void ncgen_tree_measure(const ncgen_run *r, ncgen_tree_work *w, const ncgen_real *velocities, ncgen_real *chosen)
{
    int is_measured = 1;
    for (int k = 0; k < w->tree->n_screws; ++k)
        is_measured &= w->screw[k].coordinate >= 0 || w->screw[k].leader >= 0;
    ncgen_tree_place at = ncgen_tree_begin(w);
    for (ncgen_tree_link *own = w->link, *end = own + (is_measured ? 0 : w->tree->n_links); own < end; ++own) {
        begin_twist(w, own);
        ncgen_tree_find_rates(r, w, own, &at, velocities, own->twist);
        add_screws(own, at.screw);
        ncgen_tree_go_on(own, &at);
    }
    for (const ncgen_tree_screw *screw = w->screw, *end = screw + w->tree->n_screws; screw < end; ++screw)
        if (screw->leader < 0)
            *chosen++ = screw->coordinate >= 0 ? velocities[screw->coordinate] : screw->rate;
}

const ncgen_real *ncgen_tree_along(ncgen_tree_work *w, const ncgen_real *chosen)
{
    for (ncgen_tree_screw *screw = w->screw, *end = screw + w->tree->n_screws; screw < end; ++screw)
        screw->rate = screw->leader >= 0 ? screw->ratio * w->screw[screw->leader].rate : screw->slowness * *chosen++;
    move_at_rates(w);
    return w->moved;
}
