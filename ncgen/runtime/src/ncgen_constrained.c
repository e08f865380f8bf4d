/* ncgen_constrained.c: formalisms on all coordinates, y = [qd, q, work, 0], the last being room for a growth among derivatives.
 *
 * Accelerations and multipliers solve [M Phi_q'; Phi_q -E] [qdd; lam] = [Q; gamma], where the diagonal E is zero for
 * lagrange and the inverse of a penalty else: the augmented Lagrangian removes its effect by iteration, penalty leaves it
 * in. Where M is singular lagrange goes the same way, since M + Phi_q' Phi_q / E is positive definite all the same.
 */
#include "ncgen_dense.h"
#include "ncgen_method.h"
#include "ncgen_pivots.h"
#include "ncgen_redundant.h"
#include "ncgen_solution.h"

int ncgen_constrained_is_dense(const ncgen_run *r)
{
    return r->options->formalism >= NCGEN_NULL_SPACE;
}

void ncgen_constrained_layout(ncgen_run *r, ncgen_constrained *w)
{
    const ncgen_dynamics *d = r->dynamics;
    ncgen_space *space = &r->space;
    r->constrained = w;
    w->iterated = r->options->formalism == NCGEN_AUGMENTED_LAGRANGIAN || (d->singular_mass && r->options->formalism != NCGEN_PENALTY);
    r->error_size = 2 * r->n + 1;
    r->ny = r->error_size + 1;
    r->qd = ncgen_take(space, 2 * r->n); /* as in y */
    r->q = r->qd ? r->qd + r->n : NULL;
    w->n_mass = ncgen_nonzeros(&r->model->mass_pattern);
    w->n_phi_q = ncgen_nonzeros(&r->model->phi_q_pattern);
    ncgen_kkt_layout(&w->kkt, d->elimination, w->n_mass + w->n_phi_q, space);
    w->right = ncgen_take(space, r->n + r->m);
    w->solution = ncgen_take(space, r->n + r->m);
    w->residual = ncgen_take(space, r->n + r->m);
    w->nu = ncgen_take(space, r->m);
    w->phi = ncgen_take(space, r->m);
    const int may_recur = r->options->formalism == NCGEN_LAGRANGE && !(r->options->frequency > 0);
    w->motion = may_recur ? d->motion : NULL;
    w->is_recursive = may_recur && (d->motion || d->tree);
    if (w->is_recursive && !w->motion)
        ncgen_tree_layout(r, &w->tree);
    if (w->is_recursive) {
        w->emitted = ncgen_take(space, 2 * r->n + r->m + 2);
        w->offset = ncgen_take(space, r->n);
        w->closed_position = r->options->tape ? ncgen_take(space, r->n) : NULL;
    }
    w->diagonal = ncgen_take(space, r->m);
    w->reduced = ncgen_take(space, r->m);
    w->natural = ncgen_take(space, r->n);
    w->redundant = d->n_dependent != 0 ? d->n_dependent < r->m : r->m > 0 && w->n_phi_q == 0;
    w->redundant = w->redundant && r->options->formalism != NCGEN_PENALTY; /* which needs all of them */
    if (w->redundant) {
        w->combinations = ncgen_take(space, ncgen_combination_count(r->m, d->n_dependent) * (r->n + r->m));
        w->probe = ncgen_take(space, r->n + r->m);
    }
    if (ncgen_constrained_is_dense(r)) {
        w->jacobian = ncgen_take(space, r->n * r->m);
        w->scaled = ncgen_take(space, 4 * (r->n + r->m));
        w->basis = ncgen_take(space, r->n * r->n);
        w->square = ncgen_take(space, (r->n + r->m) * r->n);
    }
    w->columns = r->integers;
    w->is_left_out = r->integers ? r->integers + r->n + r->m : NULL;
}

/* Accelerations ------------------------------------------------------------------------------------------------ */

/* M and Phi_q at r->q, with sizes and diagonal of the matrix, which most runs by an emitted motion never need. */
static int prepare(ncgen_run *r, ncgen_scalar t)
{
    ncgen_constrained *w = r->constrained;
    int status = r->model->mass ? r->model->mass(t, r->q, r->p, w->kkt.values) : NCGEN_OK;
    if (status == NCGEN_OK)
        status = ncgen_constrained_phi_q(r, t);
    if (status != NCGEN_OK)
        return status;
    ncgen_find_pivot_sizes(r, w);
    for (int i = 0; i < r->m; ++i)
        w->is_left_out[i] = 0;
    if (w->redundant)
        status = ncgen_choose_rows(r, w);
    else
        ncgen_set_diagonal(r, w, 0);
    w->is_prepared = status == NCGEN_OK;
    return status;
}

/* M, unless it is constant and known. */
static int find_mass(ncgen_run *r, ncgen_scalar t)
{
    const ncgen_model *model = r->model;
    if (!r->constrained->is_prepared)
        return prepare(r, t);
    return model->mass && !model->mass_is_constant ? model->mass(t, r->q, r->p, r->constrained->kkt.values) : NCGEN_OK;
}

int ncgen_constrained_phi_q(ncgen_run *r, ncgen_scalar t)
{
    ncgen_constrained *w = r->constrained;
    return ncgen_phi_q(r, t, r->q, w->kkt.values + w->n_mass);
}

int ncgen_constrained_matrices(ncgen_run *r, ncgen_scalar t)
{
    const int status = find_mass(r, t);
    return status == NCGEN_OK ? ncgen_constrained_phi_q(r, t) : status;
}

int ncgen_constrained_factor(ncgen_run *r)
{
    r->statistics->factorisations += 1;
    const int status = ncgen_kkt_factor(&r->constrained->kkt);
    r->statistics->perturbed += r->constrained->kkt.perturbed;
    return status;
}

ncgen_real ncgen_constrained_size(const ncgen_run *r, const ncgen_real *x)
{
    return ncgen_largest(r->n, x, r->dynamics->column_sizes);
}

ncgen_real ncgen_constrained_violation(const ncgen_run *r, const ncgen_real *rows)
{
    return ncgen_largest(r->m, rows, r->dynamics->row_sizes);
}

/* gamma - 2 xi omega Phid - omega^2 Phi at the rows of w->right. */
static int stabilise(ncgen_run *r, ncgen_constrained *w, ncgen_scalar t)
{
    const ncgen_options *o = r->options;
    const int status = ncgen_phi(r, t, r->q, w->phi);
    ncgen_row_velocities(r, w->kkt.values + w->n_mass, r->qd, w->residual);
    for (int i = 0; i < r->m; ++i)
        w->right[r->n + i] -= 2 * o->damping * o->frequency * (w->residual[i] - w->nu[i]) + o->frequency * o->frequency * w->phi[i];
    return status;
}

/* M, Phi_q and the right side at the state in r->q, r->qd. */
static int find_equations(ncgen_run *r, ncgen_constrained *w, ncgen_scalar t)
{
    const ncgen_model *model = r->model;
    int status = find_mass(r, t);
    if (status == NCGEN_OK && !w->has_phi_q)
        status = ncgen_constrained_phi_q(r, t);
    w->has_phi_q = 0;
    if (status == NCGEN_OK && model->nu)
        status = model->nu(t, r->q, r->p, w->nu);
    if (status == NCGEN_OK)
        status = ncgen_read_inputs(r, t);
    if (status == NCGEN_OK)
        status = ncgen_forces(r, t, r->q, r->qd, w->right);
    if (status == NCGEN_OK)
        status = ncgen_gamma(r, t, r->q, r->qd, w->right + r->n);
    if (status == NCGEN_OK && r->options->frequency > 0)
        status = stabilise(r, w, t);
    return status;
}

int ncgen_constrained_accelerations(ncgen_run *r, ncgen_scalar t)
{
    ncgen_constrained *w = r->constrained;
    r->statistics->evaluations += 1;
    int status = find_equations(r, w, t);
    if (status == NCGEN_OK && ncgen_constrained_is_dense(r))
        return ncgen_dense_accelerations(r, w);
    if (status == NCGEN_OK)
        status = ncgen_constrained_factor(r);
    return status == NCGEN_OK ? ncgen_constrained_solve(r) : status;
}

int ncgen_constrained_power(ncgen_run *r, ncgen_scalar t, ncgen_real *power)
{
    if (ncgen_power(r, t, r->q, r->qd, power) != NCGEN_OK)
        return NCGEN_DOMAIN;
    if (r->model->nu)
        *power -= ncgen_dot(r->m, r->constrained->nu, r->constrained->solution + r->n);
    return NCGEN_OK;
}

/* Not part of its caller, which saves and restores less without it. */
static NCGEN_NOINLINE void derivative_with_forces(ncgen_run *r, ncgen_scalar t, const ncgen_real *q, const ncgen_real *qd, ncgen_real *out)
{
    if (ncgen_external_forces(r, t, q, qd) == NCGEN_OK)
        r->constrained->motion->forced(t, q, qd, r->external, r->p, out);
    else
        *ncgen_growth_in(r, out) = R(1.0e30); /* the same is found again, and reported, on the way by the matrix */
}

/* What the exported function below does, which position-independent code does not inline: 40 instructions a step. */
static inline void write_derivative(ncgen_run *r, ncgen_scalar t, const ncgen_real *q, const ncgen_real *qd, ncgen_real *out)
{
    ncgen_constrained *w = r->constrained;
    if (!w->motion)
        ncgen_tree_derivative(r, &w->tree, t, q, qd, out);
    else if (!r->external)
        w->motion->derivative(t, q, qd, r->p, out);
    else
        derivative_with_forces(r, t, q, qd, out);
}

void ncgen_recursive_derivative(ncgen_run *r, ncgen_scalar t, const ncgen_real *q, const ncgen_real *qd, ncgen_real *out)
{
    write_derivative(r, t, q, qd, out);
}

void ncgen_recursive_velocities(ncgen_run *r, ncgen_scalar t, const ncgen_real *q, const ncgen_real *qd, ncgen_real *out)
{
    ncgen_constrained *w = r->constrained;
    if (w->motion)
        w->motion->velocities(t, q, qd, r->p, out);
    else
        ncgen_tree_velocities(r, &w->tree, t, q, qd, out);
}

int ncgen_recursive_projected(ncgen_run *r, ncgen_scalar t, const ncgen_real *q, const ncgen_real *qd, ncgen_real *out)
{
    const ncgen_motion *motion = r->constrained->motion;
    const int comes_along = motion && motion->projected && ncgen_read_inputs(r, t) == NCGEN_OK;
    if (comes_along)
        motion->projected(t, q, qd, r->p, out);
    else
        ncgen_recursive_velocities(r, t, q, qd, out);
    return comes_along;
}

void ncgen_recursive_closing(ncgen_run *r, ncgen_scalar t, const ncgen_real *q, ncgen_real *out)
{
    ncgen_constrained *w = r->constrained;
    if (w->motion)
        w->motion->closing(t, q, r->p, out);
    else
        ncgen_tree_closing(r, &w->tree, t, q, out);
}

int ncgen_recursive_rows(const ncgen_run *r)
{
    const ncgen_motion *motion = r->constrained->motion;
    return motion ? motion->n_closing_rows : r->m;
}

int ncgen_follows_from_measured(const ncgen_run *r)
{
    const ncgen_constrained *w = r->constrained;
    return w->motion ? w->motion->follow_from_angles : ncgen_tree_is_in_closed_form(&w->tree);
}

int ncgen_recursive_joints(const ncgen_run *r)
{
    return r->dynamics->motion ? 0 : ncgen_tree_joints(r->dynamics->tree);
}

void ncgen_recursive_measure(ncgen_run *r, const ncgen_real *velocities, ncgen_real *chosen)
{
    ncgen_tree_measure(r, &r->constrained->tree, velocities, chosen);
}

const ncgen_real *ncgen_recursive_along(ncgen_run *r, const ncgen_real *chosen)
{
    return ncgen_tree_along(r, &r->constrained->tree, chosen);
}

/* Is what a motion has written into yd a derivative? 0 where the order of elimination is a bad one. */
static int take(ncgen_run *r, ncgen_constrained *w, ncgen_real *yd)
{
    w->pivot_growth = *ncgen_growth_in(r, yd);
    if (ncgen_has_pivot_growth(r, w->pivot_growth))
        return 0;
    *ncgen_growth_in(r, yd) = 0;
    w->is_factored = w->has_phi_q = 0;
    r->statistics->evaluations += 1;
    return 1;
}

/* Are velocities of a stage farther from those that the joints allow than steps without error control may be? Not part of its callers, few of which
 * come here. */
static NCGEN_NOINLINE int leaves_allowed(const ncgen_run *r, const ncgen_real *qd, const ncgen_real *allowed)
{
    const ncgen_scalar *sizes = r->dynamics->column_sizes;
    ncgen_real largest = 0;
    for (int i = 0; i < r->n; ++i) {
        const ncgen_real difference = NCGEN_ABS(allowed[i] - qd[i]) / sizes[i];
        largest = difference > largest ? difference : largest;
    }
    return largest > NCGEN_HARMLESS_SHARE * ncgen_largest(r->n, qd, sizes);
}

/* Do small pivots multiply the error of a stage by more than a digit? See ncgen_closing_rules.h. */
static int multiplies_errors(const ncgen_run *r, ncgen_real growth, const ncgen_real *qd, const ncgen_real *allowed)
{
    return r->options->tape && ncgen_is_fixed_explicit(r->options) && !(growth < NCGEN_GROWTH_OF_A_DIGIT) &&
           leaves_allowed(r, qd, allowed);
}

/* The derivative of the state (q, qd) by the recursion; 0 where its order of elimination is a bad one. */
static int by_recursion(ncgen_run *r, ncgen_scalar t, const ncgen_real *q, const ncgen_real *qd, ncgen_real *yd)
{
    ncgen_constrained *w = r->constrained;
    if (ncgen_read_inputs(r, t) != NCGEN_OK)
        return 0; /* the same is found again, and reported, on the way by the matrix */
    write_derivative(r, t, q, qd, yd);
    return !multiplies_errors(r, *ncgen_growth_in(r, yd), qd, yd + r->n) && take(r, w, yd);
}

int ncgen_recursive_taken(ncgen_run *r, ncgen_real *yd)
{
    return r->constrained->came_along && take(r, r->constrained, yd);
}

/* Which way the next step goes: all of its stages the same, since off the constraints, where they are, the two differ. */
static int choose_form(ncgen_run *r, ncgen_scalar t)
{
    const ncgen_scalar usual = R(1.5);
    ncgen_constrained *w = r->constrained;
    if (w->is_factored) {
        ncgen_recursive_velocities(r, t, r->q, r->qd, w->emitted);
        w->pivot_growth = *ncgen_growth_in(r, w->emitted);
    }
    w->uses_matrix = !(w->pivot_growth < ncgen_pivot_growth_limit(r, NCGEN_SOON_BAD_GROWTH));
    r->projects_stages = !(w->pivot_growth < usual);
    if (w->uses_matrix && w->redundant && w->is_prepared) {
        const int status = ncgen_constrained_matrices(r, t);
        if (status != NCGEN_OK)
            return status;
        w->has_phi_q = 0;
        ncgen_constrained_rows(r, 0);
    }
    return NCGEN_OK;
}

/* Not part of its caller, which saves and restores less without it. */
static NCGEN_NOINLINE int by_matrix(ncgen_run *r, ncgen_scalar t, const ncgen_real *y, ncgen_real *yd)
{
    ncgen_constrained *w = r->constrained;
    const int n = r->n;
    w->is_factored = 1;
    ncgen_copy(2 * n, y, r->qd);
    r->statistics->fallbacks += w->is_recursive;
    const int status = ncgen_constrained_accelerations(r, t);
    if (status != NCGEN_OK)
        return status;
    ncgen_copy(n, w->solution, yd);
    ncgen_copy(n, r->qd, yd + n);
    *ncgen_growth_in(r, yd) = 0;
    return ncgen_constrained_power(r, t, yd + 2 * n);
}

/* In a stage r->q, r->qd may stay those of another state. */
static int stage_derivative(ncgen_run *r, ncgen_scalar t, ncgen_real *y, ncgen_real *yd)
{
    const ncgen_constrained *w = r->constrained;
    const int has_derivative = w->is_recursive && !w->uses_matrix && by_recursion(r, t, y + r->n, y, yd);
    return has_derivative ? NCGEN_OK : by_matrix(r, t, y, yd);
}

static int derivative(ncgen_run *r, ncgen_scalar t, ncgen_real *y, ncgen_real *yd)
{
    ncgen_copy(2 * r->n, y, r->qd);
    return stage_derivative(r, t, y, yd);
}

/* A matrix without factors is left as it is: the evaluation that follows finds the same, and reports it. */
void ncgen_constrained_rows(ncgen_run *r, int factors_are_near)
{
    ncgen_constrained *w = r->constrained;
    if (!w->redundant || !w->is_prepared || (!factors_are_near && ncgen_constrained_factor(r) != NCGEN_OK))
        return;
    if (!ncgen_rows_are_good(r, w))
        ncgen_choose_rows(r, w);
}

int ncgen_constrained_begin(ncgen_run *r, const ncgen_real *velocities)
{
    ncgen_constrained *w = r->constrained;
    const int n = r->n;
    const ncgen_scalar t = r->times[0];
    r->derivative = derivative;
    r->stage_derivative = stage_derivative;
    ncgen_copy(n, velocities, r->y);
    ncgen_copy(n, r->start_q, r->y + n);
    ncgen_copy(n, velocities, r->start + n);
    ncgen_copy(n, r->start_q, r->q);
    r->y[2 * n] = r->y[2 * n + 1] = 0;
    w->has_phi_q = 0;
    w->is_factored = 1;
    w->uses_matrix = 0;
    r->accept = w->is_recursive ? choose_form : NULL;
    w->is_prepared = 0;
    for (int i = 0; i < n; ++i)
        w->right[i] = 0;
    for (int i = 0; i < r->m; ++i)
        w->nu[i] = 0;
    return w->is_recursive ? NCGEN_OK : prepare(r, t);
}
