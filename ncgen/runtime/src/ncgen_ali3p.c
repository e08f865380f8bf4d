/* ncgen_ali3p.c: index-3 augmented Lagrangian by the trapezoidal rule, with mass-orthogonal projections of velocities and
 * accelerations (Bayo and Ledesma 1996).
 */
#include "ncgen_constrained.h"
#include "ncgen_jacobian.h"
#include "ncgen_lu.h"
#include "ncgen_steppers.h"

enum {
    ITERATION_LIMIT = 30,
    PROJECTION_LIMIT = 6
};

/* alpha gap: the multiplier that the violation of row i calls forth. */
static ncgen_real pushed(const ncgen_run *r, const ncgen_correction *c, const ncgen_real *gap, int i)
{
    return r->options->penalty * c->unit * gap[i] / (r->dynamics->row_sizes[i] * r->dynamics->row_sizes[i]);
}

/* Factor P + alpha Phi_q' Phi_q, where P = M + h/2 C + h^2/4 K. */
static int factor_penalty(ncgen_run *r, ncgen_correction *c, ncgen_scalar h)
{
    const ncgen_pattern *phi_q = &r->model->phi_q_pattern;
    const ncgen_scalar *columns = r->dynamics->column_sizes, *rows = r->dynamics->row_sizes;
    const ncgen_real *values = ncgen_phi_q_values(r);
    ncgen_fill_weight(r, c, h / 2, h * h / 4);
    for (int i = 0; i < r->m; ++i)
        for (int k = phi_q->indptr[i]; k < phi_q->indptr[i + 1]; ++k)
            for (int l = phi_q->indptr[i]; l < phi_q->indptr[i + 1]; ++l) {
                const int row = phi_q->indices[k], column = phi_q->indices[l];
                c->matrix[row * c->size + column] += r->options->penalty * (c->left[k] * columns[row] / rows[i]) *
                                                     (values[l] * columns[column] / rows[i]);
            }
    int orientation;
    return ncgen_lu_factor(c->size, c->matrix, c->order, &orientation);
}

/* change = x of P x + alpha Phi_q'(Phi_q x - gap) = force; force is NULL for zero. */
static void solve_penalty(ncgen_run *r, ncgen_correction *c, const ncgen_real *force, ncgen_real factor, const ncgen_real *gap)
{
    const ncgen_pattern *phi_q = &r->model->phi_q_pattern;
    for (int i = 0; i < r->n; ++i)
        c->right[i] = force ? factor * force[i] : 0;
    for (int i = 0; i < r->m; ++i)
        for (int k = phi_q->indptr[i]; k < phi_q->indptr[i + 1]; ++k)
            c->right[phi_q->indices[k]] += c->left[k] * pushed(r, c, gap, i);
    for (int i = 0; i < r->n; ++i)
        c->right[i] *= r->dynamics->column_sizes[i] / c->unit;
    ncgen_lu_solve(c->size, c->matrix, c->order, c->right, c->x);
    for (int i = 0; i < r->n; ++i)
        c->change[i] = r->dynamics->column_sizes[i] * c->x[i];
}

/* x becomes the nearest in the metric of P with Phi_q x = right; each pass divides the violation by about alpha. */
static void project_mass_orthogonally(ncgen_run *r, ncgen_correction *c, ncgen_real *x, const ncgen_real *right)
{
    ncgen_real *gap = c->residual + r->n, last = R(1.0e30);
    for (int pass = 0; pass < PROJECTION_LIMIT; ++pass) {
        ncgen_row_velocities(r, c->left, x, gap);
        for (int i = 0; i < r->m; ++i)
            gap[i] = right[i] - gap[i];
        const ncgen_real largest = ncgen_constrained_violation(r, gap);
        if (!(largest < last / 4))
            return;
        solve_penalty(r, c, NULL, 0, gap);
        for (int i = 0; i < r->n; ++i)
            x[i] += c->change[i];
        last = largest;
    }
}

/* Velocities and accelerations of the trapezoidal rule at the position r->q. */
static void follow_position(ncgen_run *r, const ncgen_correction *c, ncgen_scalar h)
{
    for (int i = 0; i < r->n; ++i) {
        r->qd[i] = 2 / h * (r->q[i] - r->y[r->n + i]) - r->y[i];
        r->linearisation->qdd[i] = 2 / h * (r->qd[i] - r->y[i]) - c->auxiliary[i];
    }
}

/* Positions by Newton's method on h^2/4 (M qdd + Phi_q' (lam + alpha Phi) - Q), then velocities and accelerations onto the
 * constraints with the same matrix. */
int ncgen_ali3p(ncgen_run *r, ncgen_stepping *w, ncgen_correction *c, ncgen_scalar t, ncgen_scalar h)
{
    const int n = r->n, m = r->m;
    const ncgen_scalar quarter = h * h / 4;
    ncgen_real *qdd = r->linearisation->qdd, *lam = r->linearisation->lam, *gap = c->residual + n, *more = c->change + n;
    ncgen_real last = R(1.0e30);
    int status = NCGEN_OK, done = 0;
    ncgen_copy(n, qdd, c->auxiliary);
    for (int i = 0; i < n; ++i)
        r->q[i] = r->y[n + i] + h * r->y[i];
    for (int pass = 0; !done; ++pass) {
        if (pass == ITERATION_LIMIT)
            return NCGEN_NOT_CONVERGED;
        follow_position(r, c, h);
        status = ncgen_find_residual(r, c, t, h);
        if (status == NCGEN_OK)
            status = factor_penalty(r, c, h);
        if (status != NCGEN_OK)
            return status;
        for (int i = 0; i < m; ++i)
            gap[i] = -gap[i];
        solve_penalty(r, c, c->residual, quarter, gap);
        ncgen_row_velocities(r, ncgen_phi_q_values(r), c->change, more);
        for (int i = 0; i < m; ++i) {
            more[i] -= gap[i];
            lam[i] += pushed(r, c, more, i) / quarter;
        }
        for (int i = 0; i < n; ++i)
            r->q[i] += c->change[i];
        const ncgen_real size = ncgen_constrained_size(r, c->change);
        done = ncgen_is_rounding(r, size, last);
        last = size;
    }
    follow_position(r, c, h);
    status = ncgen_find_residual(r, c, t, h);
    if (status == NCGEN_OK)
        status = factor_penalty(r, c, h);
    for (int i = 0; i < m; ++i)
        more[i] = 0;
    if (status == NCGEN_OK && r->model->nu)
        status = r->model->nu(t + h, r->q, r->p, more);
    if (status != NCGEN_OK)
        return status;
    project_mass_orthogonally(r, c, r->qd, more);
    status = ncgen_gamma(r, t + h, r->q, r->qd, more);
    project_mass_orthogonally(r, c, qdd, more);
    return status == NCGEN_OK ? ncgen_end_step(r, w, c, t, h) : status;
}
