/* ncgen_energy_momentum.c: the midpoint rule with Phi = 0 at the end: M (v1 - v0) / h = Q - Phi_q' lam in the middle and
 * q1 - q0 = h (v0 + v1) / 2.
 *
 * With a constant mass matrix, quadratic constraints and a linear potential it keeps the energy, and is written with
 * accelerations and projections like RATTLE. Else what is missing is added along the step (Gonzalez 1996).
 */
#include "ncgen_jacobian.h"
#include "ncgen_projection.h"
#include "ncgen_steppers.h"

enum { ITERATION_LIMIT = 30 };

/* A step that moves less than this, in natural sizes, needs no correction: it would be rounding over rounding. */
static const ncgen_scalar still = R(1.0e-10);

/* If wanted the velocities at the end of a step onto the constraints. */
static int project_end(ncgen_run *r, ncgen_scalar t)
{
    if (!r->options->project)
        return NCGEN_OK;
    int status = ncgen_constrained_matrices(r, t);
    if (status == NCGEN_OK)
        status = ncgen_constrained_factor(r);
    return status == NCGEN_OK ? ncgen_project_velocity(r, t) : status;
}

/* Where nothing is missing. */
int ncgen_energy_momentum(ncgen_run *r, ncgen_stepping *w, ncgen_correction *c, ncgen_scalar t, ncgen_scalar h)
{
    const int n = r->n;
    const ncgen_real *velocity = r->y, *position = r->y + n, *acceleration = r->constrained->solution;
    ncgen_real *end = w->new_y + n, *change = w->at;
    ncgen_real last = 0;
    for (int i = 0; i < n; ++i)
        end[i] = position[i] + h * velocity[i];
    for (int pass = 0; pass < ITERATION_LIMIT; ++pass) {
        for (int i = 0; i < n; ++i) {
            r->q[i] = (position[i] + end[i]) / 2;
            r->qd[i] = (end[i] - position[i]) / h;
        }
        int status = ncgen_report_attempt(r, t + h / 2);
        if (status == NCGEN_OK)
            status = ncgen_constrained_accelerations(r, t + h / 2);
        for (int i = 0; i < n; ++i)
            r->q[i] = position[i] + h * (velocity[i] + h / 2 * acceleration[i]);
        if (status == NCGEN_OK)
            status = ncgen_project_along(r, t + h, c->steps);
        if (status != NCGEN_OK)
            return status;
        for (int i = 0; i < n; ++i) {
            change[i] = r->q[i] - end[i];
            end[i] = r->q[i];
        }
        const ncgen_real size = ncgen_constrained_size(r, change);
        if (size <= 4 * r->rounding || (pass > 1 && size < R(1.0e4) * r->rounding && size > last / 4)) {
            for (int i = 0; i < n; ++i)
                r->qd[i] = 2 * (end[i] - position[i]) / h - velocity[i];
            ncgen_constrained_rows(r, 0);
            return project_end(r, t + h);
        }
        last = size;
    }
    return NCGEN_NOT_CONVERGED;
}

/* Kinetic and potential energy and power; zero without bodies. */
static int find_energy(ncgen_run *r, ncgen_scalar t, const ncgen_real *q, const ncgen_real *qd, ncgen_real energy[3])
{
    const int status = ncgen_read_inputs(r, t);
    return status == NCGEN_OK ? ncgen_energies(r, t, q, qd, energy) : status;
}

/* Gonzalez' discrete gradient. Phi_q and Q in the middle, r->q and r->qd, are in c->left and c->residual; what is added to them
 * along the step, gap along' and forces, makes their work that of Phi and of the energies at the ends. */
static int correct_along(ncgen_run *r, ncgen_correction *c, ncgen_scalar t, ncgen_scalar h, const ncgen_real *end_q,
                         const ncgen_real *end_qd)
{
    const int n = r->n;
    const ncgen_scalar *sizes = r->dynamics->column_sizes;
    const ncgen_real *velocity = r->y, *position = r->y + n;
    ncgen_real before[3], after[3], middle[3], square = 0, missing = 0;
    ncgen_real *moved = c->base + n, *rates = c->change + n;
    int status = find_energy(r, t, position, velocity, before);
    status |= find_energy(r, t + h, end_q, end_qd, after);
    status |= find_energy(r, t + h / 2, r->q, r->qd, middle);
    for (int i = 0; i < n; ++i) {
        moved[i] = end_q[i] - position[i];
        c->along[i] = moved[i] / (sizes[i] * sizes[i]);
        square += moved[i] * c->along[i];
    }
    c->is_corrected = square > still * still;
    if (status != NCGEN_OK || !c->is_corrected)
        return status == NCGEN_OK ? NCGEN_OK : NCGEN_DOMAIN;
    for (int i = 0; i < n; ++i)
        c->along[i] /= square;
    ncgen_row_velocities(r, c->left, moved, rates);
    status = ncgen_phi(r, t + h, end_q, c->gap);
    for (int i = 0; i < r->m; ++i)
        c->gap[i] -= rates[i];
    if (status == NCGEN_OK)
        status = ncgen_phi(r, t, position, rates);
    for (int i = 0; i < r->m; ++i) {
        c->gap[i] -= rates[i];
        rates[i] = 0;
    }
    if (status == NCGEN_OK && r->model->nu)
        status = r->model->nu(t + h / 2, r->q, r->p, rates);
    for (int i = 0; i < r->m; ++i)
        c->gap[i] = r->dynamics->rolling && r->dynamics->rolling[i] ? 0 : c->gap[i] + h * rates[i];
    /* c->change is M (end_qd - velocity) */
    missing = before[1] - after[1] + h * middle[2] + ncgen_dot(n, r->qd, c->change) - (after[0] - before[0]) - ncgen_dot(n, c->residual, moved);
    for (int i = 0; i < n; ++i)
        c->residual[i] += missing * c->along[i];
    return status;
}

/* A step of the midpoint rule with the velocities w->new_y at its end: its state, its work, and if wanted the velocities onto the
 * constraints. */
static int end_midpoint(ncgen_run *r, ncgen_stepping *w, const ncgen_correction *c, ncgen_scalar t, ncgen_scalar h)
{
    ncgen_real energy[3] = {0, 0, 0};
    ncgen_real *nu = c->residual + r->n;
    for (int i = 0; i < r->n; ++i) {
        r->qd[i] = (r->y[i] + w->new_y[i]) / 2;
        r->q[i] = r->y[r->n + i] + h / 2 * r->qd[i];
    }
    int status = find_energy(r, t + h / 2, r->q, r->qd, energy);
    if (status == NCGEN_OK && r->model->nu) {
        status = r->model->nu(t + h / 2, r->q, r->p, nu);
        energy[2] -= ncgen_dot(r->m, nu, r->linearisation->lam);
    }
    w->new_y[2 * r->n] = r->y[2 * r->n] + h * energy[2];
    for (int i = 0; i < r->n; ++i) {
        r->q[i] = r->y[r->n + i] + h * r->qd[i];
        r->qd[i] = w->new_y[i];
    }
    ncgen_constrained_rows(r, 0);
    return status == NCGEN_OK ? project_end(r, t + h) : status;
}

/* The midpoint rule with the discrete gradient: T + V - W is kept to rounding for any masses, forces and constraints. */
int ncgen_energy_momentum_with_tangents(ncgen_run *r, ncgen_stepping *w, ncgen_correction *c, ncgen_scalar t, ncgen_scalar h)
{
    const int n = r->n;
    const ncgen_real *velocity = r->y, *position = r->y + n;
    ncgen_real *end_qd = w->new_y, *end_q = c->base, *lam = r->linearisation->lam, *qdd = r->linearisation->qdd;
    ncgen_real last = R(1.0e30);
    ncgen_copy(n, velocity, end_qd);
    for (int pass = 0; pass < ITERATION_LIMIT; ++pass) {
        for (int i = 0; i < n; ++i) {
            r->qd[i] = (velocity[i] + end_qd[i]) / 2;
            r->q[i] = position[i] + h / 2 * r->qd[i];
            end_q[i] = position[i] + h * r->qd[i];
            qdd[i] = (end_qd[i] - velocity[i]) / h;
        }
        int status = ncgen_begin_correction(r, t + h / 2);
        if (status == NCGEN_OK)
            status = ncgen_constrained_matrices(r, t + h / 2);
        ncgen_copy(r->constrained->n_phi_q, ncgen_phi_q_values(r), c->left);
        if (status == NCGEN_OK)
            status = ncgen_find_forces(r, c, t + h / 2);
        if (status == NCGEN_OK)
            status = ncgen_find_tangents(r, t + h / 2);
        for (int i = 0; i < n; ++i)
            c->auxiliary[i] = h * qdd[i];
        ncgen_times_mass(r, r->constrained->kkt.values, c->auxiliary, c->change);
        if (status == NCGEN_OK)
            status = correct_along(r, c, t, h, end_q, end_qd);
        ncgen_subtract_multipliers(r, c->left, c->residual);
        const ncgen_real extra = c->is_corrected ? ncgen_dot(r->m, c->gap, lam) : 0;
        for (int i = 0; i < n; ++i)
            c->residual[i] = h * (c->residual[i] - extra * c->along[i]) - c->change[i];
        if (status == NCGEN_OK)
            status = ncgen_find_position_residual(r, c, t, h, end_q);
        if (status == NCGEN_OK)
            status = ncgen_solve_with_multipliers(r, c, h / 2, h * h / 4, c->left, h / 2);
        c->is_corrected = 0;
        if (status != NCGEN_OK)
            return status;
        for (int i = 0; i < n; ++i) {
            end_qd[i] += c->change[i];
            c->change[i] *= h / 2;
        }
        for (int i = 0; i < r->m; ++i)
            lam[i] += c->change[n + i] / h;
        const ncgen_real size = ncgen_constrained_size(r, c->change);
        if (ncgen_is_rounding(r, size, last))
            return end_midpoint(r, w, c, t, h);
        last = size;
    }
    return NCGEN_NOT_CONVERGED;
}
