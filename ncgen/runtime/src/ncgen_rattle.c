/* ncgen_rattle.c: half a kick, a drift onto the constraints, half a kick onto their velocities (Andersen 1983).
 *
 * Where masses are constant and forces depend on position only, it is written with the accelerations of a formalism on all
 * coordinates, which leave the factors of [M Phi_q'; Phi_q -E] behind, and with projections along M^-1 Phi_q' with these factors.
 * What an acceleration has along that direction does not matter: the projection that follows puts it right.
 * Else the drift is found by Newton's method.
 */
#include "ncgen_jacobian.h"
#include "ncgen_projection.h"
#include "ncgen_steppers.h"

enum { ITERATION_LIMIT = 30 };

/* Forces depend on position only, so the acceleration and the factors at the end of a step are those at the start of the next. */
int ncgen_rattle(ncgen_run *r, ncgen_stepping *w, ncgen_correction *c, ncgen_scalar t, ncgen_scalar h)
{
    const int n = r->n;
    const ncgen_real *velocity = r->y, *position = r->y + n;
    const ncgen_real *acceleration = r->constrained->solution;
    int status = ncgen_report_attempt(r, t + h);
    (void)w;
    if (status == NCGEN_OK && !r->constrained->is_reusable) {
        ncgen_copy(n, position, r->q);
        ncgen_copy(n, velocity, r->qd);
        status = ncgen_constrained_accelerations(r, t);
    }
    for (int i = 0; i < n; ++i)
        r->q[i] = position[i] + h * (velocity[i] + h / 2 * acceleration[i]);
    if (status == NCGEN_OK)
        status = ncgen_project_along(r, t + h, c->steps);
    for (int i = 0; i < n; ++i)
        r->qd[i] = (r->q[i] - position[i]) / h;
    ncgen_constrained_rows(r, 0);
    if (status == NCGEN_OK)
        status = ncgen_constrained_accelerations(r, t + h);
    for (int i = 0; i < n; ++i)
        r->qd[i] += h / 2 * acceleration[i];
    r->constrained->is_reusable = 1;
    return status == NCGEN_OK ? ncgen_project_velocity_along(r, t + h, c->steps) : status;
}

/* The velocity of the drift, in r->qd, for which Phi = 0 at the end: h/2 (Q - Phi_q' lam) = M (velocity of drift - velocity)
 * with Q of this velocity, all else at the start of the step. */
static int drift(ncgen_run *r, ncgen_correction *c, ncgen_scalar t, ncgen_scalar h)
{
    const int n = r->n;
    const ncgen_real *velocity = r->y, *position = r->y + n;
    ncgen_real *end = c->base, last = R(1.0e30);
    ncgen_copy(n, position, r->q);
    int status = ncgen_constrained_matrices(r, t);
    ncgen_copy(r->constrained->n_phi_q, ncgen_phi_q_values(r), c->left);
    for (int i = 0; i < n; ++i)
        r->qd[i] = velocity[i] + h / 2 * r->linearisation->qdd[i];
    for (int pass = 0; pass < ITERATION_LIMIT && status == NCGEN_OK; ++pass) {
        status = ncgen_begin_correction(r, t + h);
        if (status == NCGEN_OK)
            status = ncgen_find_forces(r, c, t);
        if (status == NCGEN_OK)
            status = ncgen_find_tangents(r, t);
        ncgen_subtract_multipliers(r, c->left, c->residual);
        for (int i = 0; i < n; ++i) {
            c->auxiliary[i] = r->qd[i] - velocity[i];
            end[i] = position[i] + h * r->qd[i];
        }
        ncgen_times_mass(r, r->constrained->kkt.values, c->auxiliary, c->change);
        for (int i = 0; i < n; ++i)
            c->residual[i] = h / 2 * c->residual[i] - c->change[i];
        if (status == NCGEN_OK)
            status = ncgen_find_position_residual(r, c, t, h, end);
        if (status == NCGEN_OK)
            status = ncgen_solve_with_multipliers(r, c, h / 2, 0, c->left, h);
        if (status != NCGEN_OK)
            return status;
        for (int i = 0; i < n; ++i) {
            r->qd[i] += c->change[i];
            c->change[i] *= h;
        }
        for (int i = 0; i < r->m; ++i)
            r->linearisation->lam[i] += 2 / h * c->change[n + i];
        const ncgen_real size = ncgen_constrained_size(r, c->change);
        if (ncgen_is_rounding(r, size, last))
            return NCGEN_OK;
        last = size;
    }
    return status == NCGEN_OK ? NCGEN_NOT_CONVERGED : status;
}

/* RATTLE where the kicks depend on the velocity: both take that of the drift, which keeps the symmetry. */
int ncgen_rattle_with_tangents(ncgen_run *r, ncgen_stepping *w, ncgen_correction *c, ncgen_scalar t, ncgen_scalar h)
{
    const int n = r->n;
    int status = drift(r, c, t, h);
    if (status != NCGEN_OK)
        return status;
    for (int i = 0; i < n; ++i)
        r->q[i] = r->y[n + i] + h * r->qd[i];
    status = ncgen_constrained_matrices(r, t + h);
    if (status == NCGEN_OK)
        status = ncgen_find_forces(r, c, t + h);
    for (int i = 0; i < r->m; ++i)
        c->change[i] = 0;
    if (status == NCGEN_OK && r->model->nu)
        status = r->model->nu(t + h, r->q, r->p, c->change);
    ncgen_row_velocities(r, ncgen_phi_q_values(r), r->qd, c->residual + n);
    for (int i = 0; i < r->m; ++i)
        c->residual[n + i] -= c->change[i];
    for (int i = 0; i < n; ++i)
        c->residual[i] *= h / 2;
    if (status == NCGEN_OK)
        status = ncgen_solve_with_multipliers(r, c, 0, 0, ncgen_phi_q_values(r), 1);
    if (status != NCGEN_OK)
        return status;
    for (int i = 0; i < n; ++i) {
        r->qd[i] += c->change[i];
        r->linearisation->qdd[i] = 2 / h * c->change[i];
    }
    for (int i = 0; i < r->m; ++i)
        r->linearisation->lam[i] = 2 / h * c->change[n + i];
    return ncgen_end_step(r, w, c, t, h);
}
