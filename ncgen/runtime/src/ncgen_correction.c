/* ncgen_correction.c: Newton's steps on the equations of a step, with stiffness and damping, in dense matrices without units.
 *
 * What the methods for constrained equations share that solve these by Newton's method.
 */
#include "ncgen_constrained.h"
#include "ncgen_correction.h"
#include "ncgen_jacobian.h"
#include "ncgen_lu.h"

/* Are changes of this size rounding, after those of size `last`? */
int ncgen_is_rounding(const ncgen_run *r, ncgen_real size, ncgen_real last)
{
    return size <= 64 * r->rounding || (size < R(1.0e5) * r->rounding && size > last / 4);
}

ncgen_real *ncgen_phi_q_values(const ncgen_run *r)
{
    return r->constrained->kkt.values + r->constrained->n_mass;
}

/* forces -= Phi_q' lam. */
void ncgen_subtract_multipliers(const ncgen_run *r, const ncgen_real *values, ncgen_real *forces)
{
    const ncgen_pattern *phi_q = &r->model->phi_q_pattern;
    for (int i = 0; i < r->m; ++i)
        for (int k = phi_q->indptr[i]; k < phi_q->indptr[i + 1]; ++k)
            forces[phi_q->indices[k]] -= values[k] * r->linearisation->lam[i];
}

int ncgen_begin_correction(ncgen_run *r, ncgen_scalar t)
{
    r->statistics->evaluations += 1;
    r->statistics->newton_steps += 1;
    r->statistics->jacobians += 1;
    return ncgen_report_attempt(r, t);
}

/* Forces as they are at r->q and r->qd, in c->residual. */
int ncgen_find_forces(ncgen_run *r, ncgen_correction *c, ncgen_scalar t)
{
    const int status = ncgen_read_inputs(r, t);
    return status == NCGEN_OK ? ncgen_forces(r, t, r->q, r->qd, c->residual) : status;
}

/* Equations of velocities alone close a step from t to t + h by their integral, with the midpoint rule: Phi_q (end - start) - h nu
 * in the middle. It takes the place of what the rest and Phi_q have for them at the end. */
static int close_rolling(ncgen_run *r, ncgen_correction *c, ncgen_scalar t, ncgen_scalar h, const ncgen_real *end)
{
    const ncgen_pattern *phi_q = &r->model->phi_q_pattern;
    ncgen_real *values = ncgen_phi_q_values(r), *middle = c->rolled, *nu = c->rolled + r->n;
    const ncgen_real *start = r->y + r->n;
    for (int i = 0; i < r->n; ++i)
        middle[i] = (start[i] + end[i]) / 2;
    for (int i = 0; i < r->m; ++i)
        nu[i] = 0;
    int status = ncgen_phi_q(r, t + h / 2, middle, c->halfway);
    if (status == NCGEN_OK && r->model->nu)
        status = r->model->nu(t + h / 2, middle, r->p, nu);
    for (int i = 0; i < r->m; ++i) {
        ncgen_real way = 0;
        for (int k = phi_q->indptr[i]; k < (r->dynamics->rolling[i] ? phi_q->indptr[i + 1] : phi_q->indptr[i]); ++k) {
            values[k] = c->halfway[k];
            way += values[k] * (end[phi_q->indices[k]] - start[phi_q->indices[k]]);
        }
        if (r->dynamics->rolling[i])
            c->residual[r->n + i] = way - h * nu[i];
    }
    return status;
}

/* What is missing of the rows at the end of a step from t to t + h, in rest, and how it changes with the position there, in Phi_q. */
int ncgen_find_position_residual(ncgen_run *r, ncgen_correction *c, ncgen_scalar t, ncgen_scalar h, const ncgen_real *end)
{
    int status = ncgen_phi(r, t + h, end, c->residual + r->n);
    if (status == NCGEN_OK)
        status = ncgen_phi_q(r, t + h, end, ncgen_phi_q_values(r));
    return status == NCGEN_OK && r->dynamics->rolling ? close_rolling(r, c, t, h, end) : status;
}

/* M, Phi_q, K and C at r->q and r->qd, the end of a step from t to t + h; rest = [Q - M qdd - Phi_q' lam, rows], with qdd and lam of
 * r->linearisation. Phi_q by which the multipliers act is in c->left. */
int ncgen_find_residual(ncgen_run *r, ncgen_correction *c, ncgen_scalar t, ncgen_scalar h)
{
    const ncgen_constrained *all = r->constrained;
    int status = ncgen_begin_correction(r, t + h);
    if (status == NCGEN_OK)
        status = ncgen_constrained_matrices(r, t + h);
    if (status == NCGEN_OK)
        status = ncgen_find_forces(r, c, t + h);
    if (status == NCGEN_OK)
        status = ncgen_phi(r, t + h, r->q, c->residual + r->n);
    if (status == NCGEN_OK)
        status = ncgen_find_tangents(r, t + h);
    ncgen_times_mass(r, all->kkt.values, r->linearisation->qdd, c->change);
    for (int i = 0; i < r->n; ++i)
        c->residual[i] -= c->change[i];
    ncgen_copy(all->n_phi_q, ncgen_phi_q_values(r), c->left);
    ncgen_subtract_multipliers(r, c->left, c->residual);
    return status == NCGEN_OK && r->dynamics->rolling ? close_rolling(r, c, t, h, r->q) : status;
}

/* Add factor A, in natural sizes, to the upper left part of the matrix. */
static void add_scaled(const ncgen_run *r, ncgen_correction *c, const ncgen_pattern *pattern, const ncgen_real *values,
                       ncgen_real factor)
{
    const ncgen_scalar *sizes = r->dynamics->column_sizes;
    for (int i = 0; i < (pattern->indptr ? pattern->rows : 0); ++i)
        for (int k = pattern->indptr[i]; k < pattern->indptr[i + 1]; ++k)
            c->matrix[(size_t)i * (size_t)c->size + (size_t)pattern->indices[k]] +=
                factor * values[k] * sizes[i] * sizes[pattern->indices[k]];
}

/* The matrix becomes M + by_qd C + by_q K without units. */
void ncgen_fill_weight(const ncgen_run *r, ncgen_correction *c, ncgen_real by_qd, ncgen_real by_q)
{
    const ncgen_tangents *tangents = r->dynamics->tangents;
    for (int i = 0; i < c->size * c->size; ++i)
        c->matrix[i] = 0;
    add_scaled(r, c, &r->model->mass_pattern, r->constrained->kkt.values, 1);
    add_scaled(r, c, &tangents->damping_pattern, r->linearisation->damping, by_qd);
    add_scaled(r, c, &tangents->stiffness_pattern, r->linearisation->stiffness, by_q);
    for (int i = 0; i < r->n; ++i)
        if (NCGEN_ABS(c->matrix[i * c->size + i]) > c->unit)
            c->unit = NCGEN_ABS(c->matrix[i * c->size + i]);
    if (!(c->unit > 0))
        c->unit = 1;
    for (int i = 0; i < c->size * c->size; ++i)
        c->matrix[i] /= c->unit;
}

/* change of [weight left'; Phi_q 0] change = [rest of forces, -rest of rows / step], where weight = M + by_qd C + by_q K and
 * left is Phi_q, perhaps at another position, with gap along' added; rows that others imply keep their multipliers. */
int ncgen_solve_with_multipliers(ncgen_run *r, ncgen_correction *c, ncgen_real by_qd, ncgen_real by_q, const ncgen_real *left,
                                  ncgen_real step)
{
    const ncgen_pattern *phi_q = &r->model->phi_q_pattern;
    const ncgen_constrained *all = r->constrained;
    const ncgen_real *values = ncgen_phi_q_values(r);
    const ncgen_scalar *columns = r->dynamics->column_sizes, *rows = r->dynamics->row_sizes;
    const int n = r->n, size = c->size;
    ncgen_fill_weight(r, c, by_qd, by_q);
    for (int i = 0; i < n; ++i)
        c->right[i] = columns[i] * c->residual[i] / c->unit;
    for (int i = 0; i < r->m; ++i) {
        c->matrix[(n + i) * size + n + i] = all->is_left_out[i] ? 1 : 0;
        c->right[n + i] = all->is_left_out[i] ? 0 : -c->residual[n + i] / (step * rows[i]);
        for (int k = phi_q->indptr[i]; k < (all->is_left_out[i] ? phi_q->indptr[i] : phi_q->indptr[i + 1]); ++k) {
            const int j = phi_q->indices[k];
            c->matrix[(n + i) * size + j] = values[k] * columns[j] / rows[i];
            c->matrix[j * size + n + i] = left[k] * columns[j] / rows[i];
        }
    }
    for (int i = 0; i < (c->is_corrected ? r->m : 0); ++i)
        for (int j = 0; j < n; ++j)
            c->matrix[j * size + n + i] += all->is_left_out[i] ? 0 : c->gap[i] * c->along[j] * columns[j] / rows[i];
    int orientation;
    const int status = ncgen_lu_factor(size, c->matrix, c->order, &orientation);
    if (status != NCGEN_OK)
        return status;
    ncgen_lu_solve(size, c->matrix, c->order, c->right, c->x);
    for (int i = 0; i < n; ++i)
        c->change[i] = columns[i] * c->x[i];
    for (int i = 0; i < r->m; ++i)
        c->change[n + i] = c->unit * c->x[n + i] / rows[i];
    return NCGEN_OK;
}

/* The state in r->q, r->qd ends the step: its rows, and its work by the trapezoidal rule. */
int ncgen_end_step(ncgen_run *r, ncgen_stepping *w, ncgen_correction *c, ncgen_scalar t, ncgen_scalar h)
{
    const ncgen_real before = c->power;
    int status = NCGEN_OK;
    ncgen_constrained_rows(r, 0);
    if (!r->dynamics->conservative) {
        status = ncgen_constrained_accelerations(r, t + h);
        if (status == NCGEN_OK)
            status = ncgen_constrained_power(r, t + h, &c->power);
    }
    w->new_y[2 * r->n] = r->y[2 * r->n] + h / 2 * (before + c->power);
    return status;
}
