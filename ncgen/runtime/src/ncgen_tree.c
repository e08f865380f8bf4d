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
#include "ncgen_tree_singles.h"
#include "ncgen_tree_solve.h"

/* Where a link and its axes are. */
static inline void place(const ncgen_tree_work *w, ncgen_tree_link *own, ncgen_tree_screw *screw, const int n_screws)
{
    const ncgen_real *values = w->values;
    const ncgen_real origin[3] = {values[own->reference[0]], values[own->reference[1]], values[own->reference[2]]};
    ncgen_real before[3];
    ncgen_get3(ncgen_lane_before(w, own), ORIGIN, before);
    for (int i = 0; i < 3; ++i)
        own->offset[i] = origin[i] - before[i];
    ncgen_put3(origin, own->lane, ORIGIN);
    for (int k = 0; k < n_screws; ++k, ++screw) {
        for (int i = 0; i < 3; ++i)
            screw->axis[i] = screw->weight * values[screw->c[i]];
        for (int s = screw->first_term; s < screw->end_term; ++s)
            for (int i = 0; i < 3; ++i)
                screw->axis[i] += w->tree->weights[s] * values[w->tree->terms[3 * s + i]];
    }
}

/* Where all links, their axes and elements, and their bodies are. */
static void place_all(const ncgen_run *r, ncgen_tree_work *w)
{
    ncgen_tree_screw *screw = w->screw;
    for (ncgen_tree_link *own = w->link, *end = own + w->tree->n_links; own < end; screw += own->n_screws, ++own)
        if (own->n_screws == 1)
            place(w, own, screw, 1);
        else
            place(w, own, screw, own->n_screws);
    ncgen_tree_place_bodies(r, w);
}

/* How a link moves: its twist, and what its acceleration is without that of the joints. */
typedef struct motion {
    ncgen_real twist[6], change[6];
} motion;

/* What the acceleration of a link is without that of the joints, in place of its parent's; before, twist: of its parent, and its own. */
static inline void find_change(const ncgen_tree_link *own, const ncgen_tree_screw *screws, const int is_hinge, const ncgen_real *before,
                               const ncgen_real *twist, ncgen_real *change)
{
    const ncgen_real faster[3] = {twist[3] - before[3], twist[4] - before[4], twist[5] - before[5]};
    ncgen_real turned_axis[3];
    ncgen_add_cross(change, own->offset, change + 3);
    ncgen_add_cross(before, faster, change + 3);
    for (int k = 0; k < (is_hinge ? 1 : own->n_screws); ++k) {
        ncgen_cross(before, screws[k].axis, turned_axis);
        ncgen_add_times(screws[k].is_carried * screws[k].rate, turned_axis, change + (is_hinge || screws[k].turns ? 0 : 3));
    }
    ncgen_put6(change, own->lane, CHANGE);
}

/* The twist of a link without that of its joint, in place of its parent's. */
static inline void begin_twist(const ncgen_tree_link *own, ncgen_real *twist)
{
    ncgen_add_cross(twist, own->offset, twist + 3);
}

/* From the motion of a link's parent to its own; is_hinge: whether it is one, known to the compiler. */
static inline int go_on(const ncgen_run *r, ncgen_tree_work *w, const ncgen_tree_link *own, const ncgen_tree_place *at,
                        const ncgen_real *qd, motion *moves, const int with_changes, const int is_hinge)
{
    const int n_screws = is_hinge ? 1 : own->n_screws;
    ncgen_real twist[6], before[6];
    int status = NCGEN_OK;
    ncgen_set6(moves->twist, before);
    ncgen_set6(before, twist);
    begin_twist(own, twist);
    if (is_hinge)
        at->screw->rate = qd[at->screw->coordinate] * at->screw->slowness;
    else
        status = ncgen_tree_find_rates(r, w, own, at, qd, twist);
    for (int k = 0; k < n_screws; ++k)
        ncgen_add_times(at->screw[k].rate, at->screw[k].axis, twist + (is_hinge || at->screw[k].turns ? 0 : 3));
    ncgen_put6(twist, own->lane, TWIST);
    ncgen_set6(twist, moves->twist);
    if (with_changes)
        find_change(own, at->screw, is_hinge, before, twist, moves->change);
    return status;
}

static inline motion motion_before(const ncgen_tree_work *w, const ncgen_tree_link *own)
{
    motion moves;
    ncgen_get6(ncgen_lane_before(w, own), TWIST, moves.twist);
    ncgen_get6(ncgen_lane_before(w, own), CHANGE, moves.change);
    return moves;
}

/* How hinges move that hang on one another: the first link that is not one of them. In a loop that calls nothing what goes from link to link
 * need not be stored in between. */
static inline int go_along_hinges(const ncgen_run *r, ncgen_tree_work *w, int link, ncgen_tree_place *at, const ncgen_real *qd,
                                  const int with_changes)
{
    const ncgen_tree_link *own = w->link + link, *end = w->link + w->tree->n_links;
    motion moves = motion_before(w, own);
    do {
        go_on(r, w, own, at, qd, &moves, with_changes, 1);
        ncgen_tree_go_on(own, at);
        ++own;
    } while (own < end && own->is_hinge && w->link + own->parent == own - 1);
    return (int)(own - w->link);
}

static int is_same(int count, const ncgen_real *a, const ncgen_real *b)
{
    for (int i = 0; i < count; ++i)
        if (!(a[i] <= b[i] && a[i] >= b[i]))
            return 0;
    return 1;
}

/* Outward: where links are, how they move, and their bodies; at the position of the evaluation before this one only how they move: the
 * velocities of all coordinates in `moved`. Wrenches are those of mass that is the same along all axes without accelerations of the joints,
 * or none. */
static inline int go_outward(const ncgen_run *r, ncgen_tree_work *w, const ncgen_real *q, const ncgen_real *qd, ncgen_real *moved,
                             const int with_changes)
{
    const ncgen_tree *tree = w->tree;
    ncgen_tree_place at = ncgen_tree_begin(w);
    int status = NCGEN_OK;
    w->is_factored = w->is_factored && is_same(r->n, q, w->values);
    w->are_there = w->are_there && w->is_factored;
    if (!w->is_factored) {
        ncgen_copy(r->n, q, w->values);
        place_all(r, w);
    }
    for (int link = 0; link < tree->n_links;) {
        const ncgen_tree_link *own = w->link + link;
        if (own->is_hinge) {
            link = go_along_hinges(r, w, link, &at, qd, with_changes);
            continue;
        }
        motion moves = motion_before(w, own);
        if (go_on(r, w, own, &at, qd, &moves, with_changes, 0) != NCGEN_OK)
            status = NCGEN_SINGULAR;
        ncgen_tree_go_on(own, &at);
        ++link;
    }
    if (with_changes)
        ncgen_tree_set_wrenches(w);
    else
        ncgen_tree_spread_twists(w);
    ncgen_tree_measure_rates(w);
    ncgen_tree_take(r, w, moved);
    return status;
}

/* What forces along the coordinates give the joints; 0 where one of them moves nothing. */
static int solve(ncgen_tree_work *w)
{
    ncgen_tree_begin_pushes(w);
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
    ncgen_real *qdd = out, *allowed = out + n, *power = allowed + n, *growth = power + 1;
    ncgen_tree_mass_at(r, w, t, q);
    int is_regular = go_outward(r, w, q, qd, allowed, 1) == NCGEN_OK;
    if (ncgen_forces(r, t, q, allowed, w->force) != NCGEN_OK)
        is_regular = 0;
    if (!ncgen_has_pairs_alone(w))
        ncgen_tree_push_singles(w);
    ncgen_tree_put(r, w, FORCE, w->force);
    ncgen_tree_add_forces(w, 1);
    is_regular &= solve(w);
    ncgen_tree_spread_changes(w);
    ncgen_tree_measure_pushes(w);
    ncgen_tree_take(r, w, qdd);
    if (tree->n_closing)
        is_regular &= ncgen_gamma(r, t, q, allowed, w->gamma) == NCGEN_OK && ncgen_tree_close_loops(r, w, t, w->gamma, qdd);
    if (ncgen_power(r, t, q, allowed, power) != NCGEN_OK)
        is_regular = 0;
    *growth = growth_of(w, is_regular && ncgen_is_finite(2 * n, out));
}

/* Momenta and pivots where nothing acts; 0 where a joint moves nothing. */
static int factor(const ncgen_run *r, ncgen_tree_work *w)
{
    for (int i = 0; i < r->n; ++i)
        w->force[i] = 0;
    return w->is_factored ? w->is_regular : solve(w);
}

/* x changed by what the momentum of w->bias changes of the velocities. Of bodies that share elements, or have mass that is not the same along
 * all axes, it is M times that. */
static void respond_to_bias(const ncgen_run *r, ncgen_tree_work *w, ncgen_real *x)
{
    const ncgen_tree *tree = w->tree;
    if (tree->n_closing || !ncgen_has_pairs_alone(w)) {
        ncgen_times_mass(r, w->mass, w->bias, w->force);
        ncgen_tree_respond(r, w, x);
        return;
    }
    for (int i = 0; i < (tree->n_rotors ? tree->n_measured : 0); ++i) {
        const int c = tree->measured[2 * i];
        w->force[c] = ncgen_row_times(&r->model->mass_pattern, w->mass, w->bias, c);
    }
    ncgen_tree_set_momenta(r, w);
    ncgen_tree_respond_to_wrenches(r, w, x);
}

/* What is left of the velocities, x, has the momentum T'M x over the rates, which changes them by (T'M T)^-1 T'M x. Loops are closed
 * before, too: there alone is the shared mass of bodies that share elements what the matrix has. */
void ncgen_tree_velocities(ncgen_run *r, ncgen_tree_work *w, ncgen_scalar t, const ncgen_real *q, const ncgen_real *qd, ncgen_real *out)
{
    const int n = r->n, closes_loops = w->tree->n_closing > 0;
    ncgen_real *allowed = out + n, *growth = allowed + n + 1;
    ncgen_tree_mass_at(r, w, t, q);
    int is_regular = go_outward(r, w, q, qd, allowed, 0) == NCGEN_OK;
    is_regular &= factor(r, w);
    if (closes_loops)
        is_regular &= ncgen_tree_close_loops(r, w, t, NULL, allowed);
    for (int i = 0; i < n; ++i)
        w->bias[i] = qd[i] - allowed[i];
    respond_to_bias(r, w, allowed);
    if (closes_loops)
        is_regular &= ncgen_tree_close_loops(r, w, t, NULL, allowed);
    *growth = growth_of(w, is_regular && ncgen_is_finite(n, allowed));
}

static inline void add_screws(const ncgen_tree_link *own, const ncgen_tree_screw *screws, ncgen_real *twist)
{
    for (int k = 0; k < own->n_screws; ++k)
        ncgen_add_times(screws[k].rate, screws[k].axis, twist + (screws[k].turns ? 0 : 3));
    ncgen_put6(twist, own->lane, TWIST);
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
        ncgen_real twist[6];
        ncgen_get6(ncgen_lane_before(w, own), TWIST, twist);
        begin_twist(own, twist);
        ncgen_tree_find_rates(r, w, own, &at, velocities, twist);
        add_screws(own, at.screw, twist);
        ncgen_tree_go_on(own, &at);
    }
    for (const ncgen_tree_screw *screw = w->screw, *end = screw + w->tree->n_screws; screw < end; ++screw)
        if (screw->leader < 0)
            *chosen++ = screw->coordinate >= 0 ? velocities[screw->coordinate] : screw->rate;
}

const ncgen_real *ncgen_tree_along(const ncgen_run *r, ncgen_tree_work *w, const ncgen_real *chosen)
{
    ncgen_tree_place at = ncgen_tree_begin(w);
    for (ncgen_tree_screw *screw = w->screw, *end = screw + w->tree->n_screws; screw < end; ++screw)
        screw->rate = screw->leader >= 0 ? screw->ratio * w->screw[screw->leader].rate : screw->slowness * *chosen++;
    for (ncgen_tree_link *own = w->link, *end = own + w->tree->n_links; own < end; ++own) {
        ncgen_real twist[6];
        ncgen_get6(ncgen_lane_before(w, own), TWIST, twist);
        begin_twist(own, twist);
        add_screws(own, at.screw, twist);
        ncgen_tree_go_on(own, &at);
    }
    ncgen_tree_spread_twists(w);
    ncgen_tree_measure_rates(w);
    ncgen_tree_take(r, w, w->moved);
    return w->moved;
}
