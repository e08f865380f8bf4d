/* ncgen_steppers.c: methods with a fixed step that discretise the constrained equations themselves.
 *
 * RATTLE and the energy-momentum method are written with what the formalisms on all coordinates have: accelerations at a
 * state, which leave the factors of [M Phi_q'; Phi_q -E] there behind, and projections along M^-1 Phi_q' with those factors.
 * What an acceleration has along that direction does not matter: the projection that follows puts it right.
 *
 * Generalized-alpha (Arnold and Bruels 2007), the index-3 augmented Lagrangian (Bayo and Ledesma 1996), RATTLE where forces
 * depend on velocities or masses on position, and the energy-momentum method for any forces and constraints (Gonzalez 1996) solve
 * the equations of a step by Newton's method with stiffness and damping, in dense matrices without units.
 */
#include "ncgen_internal.h"

enum {
    ITERATION_LIMIT = 30,
    PROJECTION_LIMIT = 6
};

/* A step that moves less than this, in natural sizes, needs no correction: it would be rounding over rounding. */
static const ncgen_scalar still = R(1.0e-10);

void ncgen_steppers_layout(ncgen_run *r, ncgen_stepping *w, ncgen_correction *c)
{
    const int n = r->n;
    w->new_y = ncgen_take(&r->space, r->ny);
    w->at = ncgen_take(&r->space, r->ny);
    if (!ncgen_uses_tangents(r->model, r->dynamics, r->options))
        return;
    c->size = r->options->formalism == NCGEN_ALI3P ? n : n + r->m;
    c->matrix = ncgen_take(&r->space, c->size * c->size);
    c->right = ncgen_take(&r->space, c->size);
    c->x = ncgen_take(&r->space, c->size);
    c->rest = ncgen_take(&r->space, n + r->m);
    c->change = ncgen_take(&r->space, n + r->m);
    c->auxiliary = ncgen_take(&r->space, n);
    c->base = ncgen_take(&r->space, 2 * n);
    c->left = ncgen_take(&r->space, r->constrained->n_phi_q);
    c->gap = ncgen_take(&r->space, r->m);
    c->along = ncgen_take(&r->space, n);
    c->order = r->integers ? r->integers + n + 2 * r->m : NULL;
}

/* The largest |x| in natural sizes; not a number if one of them is not. */
static ncgen_real scaled_size(const ncgen_run *r, const ncgen_real *x)
{
    ncgen_real largest = 0;
    for (int i = 0; i < r->n; ++i) {
        const ncgen_real size = NCGEN_ABS(x[i]) / r->dynamics->column_sizes[i];
        if (!(size <= largest))
            largest = size;
    }
    return largest;
}

/* Are changes of this size rounding, after those of size `last`? */
static int is_rounding(const ncgen_run *r, ncgen_real size, ncgen_real last)
{
    return size <= 64 * r->rounding || (size < R(1.0e5) * r->rounding && size > last / 4);
}

/* The cubic through both ends of a step and its derivative; the work in proportion. */
static int interpolate(ncgen_run *r, ncgen_stepping *w, ncgen_scalar t, ncgen_scalar h, ncgen_scalar s)
{
    const int n = r->n;
    const ncgen_real *v0 = r->y, *q0 = r->y + n, *v1 = w->new_y, *q1 = w->new_y + n;
    (void)t;
    for (int i = 0; i < n; ++i) {
        const ncgen_real change = q1[i] - q0[i], first = h * v0[i] - change, last = h * v1[i] - change;
        w->at[n + i] = q0[i] + s * (change + (1 - s) * ((1 - s) * first - s * last));
        w->at[i] = (change + (1 - s) * (1 - 3 * s) * first - s * (2 - 3 * s) * last) / h;
    }
    w->at[2 * n] = r->y[2 * n] + s * (w->new_y[2 * n] - r->y[2 * n]);
    return NCGEN_OK;
}

/* With accelerations -------------------------------------------------------------------------------------------- */

/* Half a kick, a drift onto the constraints, half a kick onto their velocities (Andersen 1983). Forces depend on position
 * only, so the acceleration and the factors at the end of a step are those at the start of the next. */
static int rattle(ncgen_run *r, ncgen_stepping *w, ncgen_correction *c, ncgen_scalar t, ncgen_scalar h)
{
    const int n = r->n;
    const ncgen_real *velocity = r->y, *position = r->y + n;
    const ncgen_real *acceleration = r->constrained->solution;
    int status = NCGEN_OK;
    (void)w;
    (void)c;
    if (!r->constrained->kept) {
        ncgen_copy(n, position, r->q);
        ncgen_copy(n, velocity, r->qd);
        status = ncgen_constrained_accelerations(r, t);
    }
    for (int i = 0; i < n; ++i)
        r->q[i] = position[i] + h * (velocity[i] + h / 2 * acceleration[i]);
    if (status == NCGEN_OK)
        status = ncgen_constrained_position(r, t + h);
    for (int i = 0; i < n; ++i)
        r->qd[i] = (r->q[i] - position[i]) / h;
    ncgen_constrained_rows(r);
    if (status == NCGEN_OK)
        status = ncgen_constrained_accelerations(r, t + h);
    for (int i = 0; i < n; ++i)
        r->qd[i] += h / 2 * acceleration[i];
    r->constrained->kept = 1;
    return status == NCGEN_OK ? ncgen_constrained_velocity(r, t + h) : status;
}

/* The midpoint rule with Phi = 0 at the end: M (v1 - v0) / h = Q - Phi_q' lam in the middle, q1 - q0 = h (v0 + v1) / 2.
 * With a constant mass matrix, quadratic constraints and a linear potential it keeps the energy. */
static int energy_momentum(ncgen_run *r, ncgen_stepping *w, ncgen_correction *c, ncgen_scalar t, ncgen_scalar h)
{
    const int n = r->n;
    const ncgen_real *velocity = r->y, *position = r->y + n, *acceleration = r->constrained->solution;
    ncgen_real *end = w->new_y + n, *change = w->at;
    ncgen_real last = 0;
    (void)c;
    for (int i = 0; i < n; ++i)
        end[i] = position[i] + h * velocity[i];
    for (int pass = 0; pass < ITERATION_LIMIT; ++pass) {
        for (int i = 0; i < n; ++i) {
            r->q[i] = (position[i] + end[i]) / 2;
            r->qd[i] = (end[i] - position[i]) / h;
        }
        int status = ncgen_constrained_accelerations(r, t + h / 2);
        for (int i = 0; i < n; ++i)
            r->q[i] = position[i] + h * (velocity[i] + h / 2 * acceleration[i]);
        if (status == NCGEN_OK)
            status = ncgen_constrained_position(r, t + h);
        if (status != NCGEN_OK)
            return status;
        for (int i = 0; i < n; ++i) {
            change[i] = r->q[i] - end[i];
            end[i] = r->q[i];
        }
        const ncgen_real size = scaled_size(r, change);
        if (size <= 4 * r->rounding || (pass > 1 && size < R(1.0e4) * r->rounding && size > last / 4)) {
            for (int i = 0; i < n; ++i)
                r->qd[i] = 2 * (end[i] - position[i]) / h - velocity[i];
            ncgen_constrained_rows(r);
            return NCGEN_OK;
        }
        last = size;
    }
    return NCGEN_NOT_CONVERGED;
}

/* With stiffness and damping ------------------------------------------------------------------------------------ */

static ncgen_real *phi_q_values(const ncgen_run *r)
{
    return r->constrained->kkt.values + r->constrained->n_mass;
}

/* forces -= Phi_q' lam. */
static void take_multipliers(const ncgen_run *r, const ncgen_real *values, ncgen_real *forces)
{
    const ncgen_pattern *phi_q = &r->model->phi_q_pattern;
    for (int i = 0; i < r->m; ++i)
        for (int k = phi_q->indptr[i]; k < phi_q->indptr[i + 1]; ++k)
            forces[phi_q->indices[k]] -= values[k] * r->slopes->lam[i];
}

static void count_correction(ncgen_run *r)
{
    r->statistics->evaluations += 1;
    r->statistics->newton_steps += 1;
    r->statistics->jacobians += 1;
}

/* M, Phi_q, K and C at r->q and r->qd; rest = [Q - M qdd - Phi_q' lam, Phi], with qdd and lam of r->slopes. */
static int find_rest(ncgen_run *r, ncgen_correction *c, ncgen_scalar t)
{
    const ncgen_constrained *all = r->constrained;
    int status = ncgen_constrained_matrices(r, t);
    count_correction(r);
    for (int i = 0; i < r->n; ++i)
        c->rest[i] = 0;
    if (status == NCGEN_OK && r->model->force)
        status = r->model->force(t, r->q, r->qd, r->p, c->rest);
    if (status == NCGEN_OK)
        status = r->model->phi(t, r->q, r->p, c->rest + r->n);
    if (status == NCGEN_OK)
        status = ncgen_find_tangents(r, t);
    ncgen_times_mass(r, all->kkt.values, r->slopes->qdd, c->change);
    for (int i = 0; i < r->n; ++i)
        c->rest[i] -= c->change[i];
    take_multipliers(r, phi_q_values(r), c->rest);
    return status;
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
static void fill_weight(const ncgen_run *r, ncgen_correction *c, ncgen_real by_qd, ncgen_real by_q)
{
    const ncgen_tangents *tangents = r->dynamics->tangents;
    for (int i = 0; i < c->size * c->size; ++i)
        c->matrix[i] = 0;
    add_scaled(r, c, &r->model->mass_pattern, r->constrained->kkt.values, 1);
    add_scaled(r, c, &tangents->damping_pattern, r->slopes->damping, by_qd);
    add_scaled(r, c, &tangents->stiffness_pattern, r->slopes->stiffness, by_q);
    c->unit = 0;
    for (int i = 0; i < r->n; ++i)
        if (NCGEN_ABS(c->matrix[i * c->size + i]) > c->unit)
            c->unit = NCGEN_ABS(c->matrix[i * c->size + i]);
    for (int i = 0; i < c->size * c->size; ++i)
        c->matrix[i] /= c->unit;
}

/* change of [weight left'; Phi_q 0] change = [rest of forces, -rest of rows / step], where weight = M + by_qd C + by_q K and
 * left is Phi_q, perhaps at another position, with gap along' added; rows that others imply keep their multipliers. */
static int solve_with_multipliers(ncgen_run *r, ncgen_correction *c, ncgen_real by_qd, ncgen_real by_q, const ncgen_real *left,
                                  ncgen_real step)
{
    const ncgen_pattern *phi_q = &r->model->phi_q_pattern;
    const ncgen_constrained *all = r->constrained;
    const ncgen_real *values = phi_q_values(r);
    const ncgen_scalar *columns = r->dynamics->column_sizes, *rows = r->dynamics->row_sizes;
    const int n = r->n, size = c->size;
    fill_weight(r, c, by_qd, by_q);
    for (int i = 0; i < n; ++i)
        c->right[i] = columns[i] * c->rest[i] / c->unit;
    for (int i = 0; i < r->m; ++i) {
        c->matrix[(n + i) * size + n + i] = all->let_go[i] ? 1 : 0;
        c->right[n + i] = all->let_go[i] ? 0 : -c->rest[n + i] / (step * rows[i]);
        for (int k = phi_q->indptr[i]; k < (all->let_go[i] ? phi_q->indptr[i] : phi_q->indptr[i + 1]); ++k) {
            const int j = phi_q->indices[k];
            c->matrix[(n + i) * size + j] = values[k] * columns[j] / rows[i];
            c->matrix[j * size + n + i] = left[k] * columns[j] / rows[i];
        }
    }
    for (int i = 0; i < (c->is_corrected ? r->m : 0); ++i)
        for (int j = 0; j < n; ++j)
            c->matrix[j * size + n + i] += all->let_go[i] ? 0 : c->gap[i] * c->along[j] * columns[j] / rows[i];
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

/* A step of the midpoint rule with the velocities w->new_y at its end: its state, its work, and if wanted the velocities onto the
 * constraints. */
static int end_midpoint(ncgen_run *r, ncgen_stepping *w, const ncgen_correction *c, ncgen_scalar t, ncgen_scalar h)
{
    ncgen_real energy[3] = {0, 0, 0};
    ncgen_real *nu = c->rest + r->n;
    for (int i = 0; i < r->n; ++i) {
        r->qd[i] = (r->y[i] + w->new_y[i]) / 2;
        r->q[i] = r->y[r->n + i] + h / 2 * r->qd[i];
    }
    int status = r->model->energy ? r->model->energy(t + h / 2, r->q, r->qd, r->p, energy) : NCGEN_OK;
    if (status == NCGEN_OK && r->model->nu) {
        status = r->model->nu(t + h / 2, r->q, r->p, nu);
        energy[2] -= ncgen_dot(r->m, nu, r->slopes->lam);
    }
    w->new_y[2 * r->n] = r->y[2 * r->n] + h * energy[2];
    for (int i = 0; i < r->n; ++i) {
        r->q[i] = r->y[r->n + i] + h * r->qd[i];
        r->qd[i] = w->new_y[i];
    }
    ncgen_constrained_rows(r);
    if (status != NCGEN_OK || !r->options->project)
        return status;
    status = ncgen_constrained_matrices(r, t + h);
    if (status == NCGEN_OK)
        status = ncgen_constrained_factor(r);
    return status == NCGEN_OK ? ncgen_constrained_velocity(r, t + h) : status;
}

/* The state in r->q, r->qd ends the step: its rows, and its work by the trapezoidal rule. */
static int end_step(ncgen_run *r, ncgen_stepping *w, ncgen_correction *c, ncgen_scalar t, ncgen_scalar h)
{
    const ncgen_real before = c->power;
    int status = NCGEN_OK;
    ncgen_constrained_rows(r);
    if (!r->dynamics->conservative) {
        status = ncgen_constrained_accelerations(r, t + h);
        if (status == NCGEN_OK)
            status = ncgen_constrained_power(r, t + h, &c->power);
    }
    w->new_y[2 * r->n] = r->y[2 * r->n] + h / 2 * (before + c->power);
    return status;
}

/* Forces as they are at r->q and r->qd, in c->rest. */
static int find_forces(ncgen_run *r, ncgen_correction *c, ncgen_scalar t)
{
    for (int i = 0; i < r->n; ++i)
        c->rest[i] = 0;
    return r->model->force ? r->model->force(t, r->q, r->qd, r->p, c->rest) : NCGEN_OK;
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
    ncgen_copy(r->constrained->n_phi_q, phi_q_values(r), c->left);
    for (int i = 0; i < n; ++i)
        r->qd[i] = velocity[i] + h / 2 * r->slopes->qdd[i];
    for (int pass = 0; pass < ITERATION_LIMIT && status == NCGEN_OK; ++pass) {
        count_correction(r);
        status = find_forces(r, c, t);
        if (status == NCGEN_OK)
            status = ncgen_find_tangents(r, t);
        take_multipliers(r, c->left, c->rest);
        for (int i = 0; i < n; ++i) {
            c->auxiliary[i] = r->qd[i] - velocity[i];
            end[i] = position[i] + h * r->qd[i];
        }
        ncgen_times_mass(r, r->constrained->kkt.values, c->auxiliary, c->change);
        for (int i = 0; i < n; ++i)
            c->rest[i] = h / 2 * c->rest[i] - c->change[i];
        if (status == NCGEN_OK)
            status = r->model->phi(t + h, end, r->p, c->rest + n);
        if (status == NCGEN_OK)
            status = r->model->phi_q(t + h, end, r->p, phi_q_values(r));
        if (status == NCGEN_OK)
            status = solve_with_multipliers(r, c, h / 2, 0, c->left, h);
        if (status != NCGEN_OK)
            return status;
        for (int i = 0; i < n; ++i) {
            r->qd[i] += c->change[i];
            c->change[i] *= h;
        }
        for (int i = 0; i < r->m; ++i)
            r->slopes->lam[i] += 2 / h * c->change[n + i];
        const ncgen_real size = scaled_size(r, c->change);
        if (is_rounding(r, size, last))
            return NCGEN_OK;
        last = size;
    }
    return status == NCGEN_OK ? NCGEN_NOT_CONVERGED : status;
}

/* RATTLE where the kicks depend on the velocity: both take that of the drift, which keeps the symmetry. */
static int rattle_with_damping(ncgen_run *r, ncgen_stepping *w, ncgen_correction *c, ncgen_scalar t, ncgen_scalar h)
{
    const int n = r->n;
    int status = drift(r, c, t, h);
    if (status != NCGEN_OK)
        return status;
    for (int i = 0; i < n; ++i)
        r->q[i] = r->y[n + i] + h * r->qd[i];
    status = ncgen_constrained_matrices(r, t + h);
    if (status == NCGEN_OK)
        status = find_forces(r, c, t + h);
    for (int i = 0; i < r->m; ++i)
        c->change[i] = 0;
    if (status == NCGEN_OK && r->model->nu)
        status = r->model->nu(t + h, r->q, r->p, c->change);
    ncgen_row_rates(r, phi_q_values(r), r->qd, c->rest + n);
    for (int i = 0; i < r->m; ++i)
        c->rest[n + i] -= c->change[i];
    for (int i = 0; i < n; ++i)
        c->rest[i] *= h / 2;
    if (status == NCGEN_OK)
        status = solve_with_multipliers(r, c, 0, 0, phi_q_values(r), 1);
    if (status != NCGEN_OK)
        return status;
    for (int i = 0; i < n; ++i) {
        r->qd[i] += c->change[i];
        r->slopes->qdd[i] = 2 / h * c->change[i];
    }
    for (int i = 0; i < r->m; ++i)
        r->slopes->lam[i] = 2 / h * c->change[n + i];
    return end_step(r, w, c, t, h);
}

/* Kinetic and potential energy and power; zero without bodies. */
static int find_energy(ncgen_run *r, ncgen_scalar t, const ncgen_real *q, const ncgen_real *qd, ncgen_real energy[3])
{
    energy[0] = energy[1] = energy[2] = 0;
    return r->model->energy ? r->model->energy(t, q, qd, r->p, energy) : NCGEN_OK;
}

/* Gonzalez' discrete gradient. Phi_q and Q in the middle, r->q and r->qd, are in c->left and c->rest; what is added to them
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
    ncgen_row_rates(r, c->left, moved, rates);
    status = r->model->phi(t + h, end_q, r->p, c->gap);
    for (int i = 0; i < r->m; ++i)
        c->gap[i] -= rates[i];
    if (status == NCGEN_OK)
        status = r->model->phi(t, position, r->p, rates);
    for (int i = 0; i < r->m; ++i) {
        c->gap[i] -= rates[i];
        rates[i] = 0;
    }
    if (status == NCGEN_OK && r->model->nu)
        status = r->model->nu(t + h / 2, r->q, r->p, rates);
    for (int i = 0; i < r->m; ++i)
        c->gap[i] += h * rates[i];
    /* c->change is M (end_qd - velocity) */
    missing = before[1] - after[1] + h * middle[2] + ncgen_dot(n, r->qd, c->change) - (after[0] - before[0]) - ncgen_dot(n, c->rest, moved);
    for (int i = 0; i < n; ++i)
        c->rest[i] += missing * c->along[i];
    return status;
}

/* The midpoint rule with the discrete gradient: T + V - W is kept to rounding for any masses, forces and constraints. */
static int energy_momentum_corrected(ncgen_run *r, ncgen_stepping *w, ncgen_correction *c, ncgen_scalar t, ncgen_scalar h)
{
    const int n = r->n;
    const ncgen_real *velocity = r->y, *position = r->y + n;
    ncgen_real *end_qd = w->new_y, *end_q = c->base, *lam = r->slopes->lam, *qdd = r->slopes->qdd;
    ncgen_real last = R(1.0e30);
    ncgen_copy(n, velocity, end_qd);
    for (int pass = 0; pass < ITERATION_LIMIT; ++pass) {
        for (int i = 0; i < n; ++i) {
            r->qd[i] = (velocity[i] + end_qd[i]) / 2;
            r->q[i] = position[i] + h / 2 * r->qd[i];
            end_q[i] = position[i] + h * r->qd[i];
            qdd[i] = (end_qd[i] - velocity[i]) / h;
        }
        count_correction(r);
        int status = ncgen_constrained_matrices(r, t + h / 2);
        ncgen_copy(r->constrained->n_phi_q, phi_q_values(r), c->left);
        if (status == NCGEN_OK)
            status = find_forces(r, c, t + h / 2);
        if (status == NCGEN_OK)
            status = ncgen_find_tangents(r, t + h / 2);
        for (int i = 0; i < n; ++i)
            c->auxiliary[i] = h * qdd[i];
        ncgen_times_mass(r, r->constrained->kkt.values, c->auxiliary, c->change);
        if (status == NCGEN_OK)
            status = correct_along(r, c, t, h, end_q, end_qd);
        take_multipliers(r, c->left, c->rest);
        const ncgen_real extra = c->is_corrected ? ncgen_dot(r->m, c->gap, lam) : 0;
        for (int i = 0; i < n; ++i)
            c->rest[i] = h * (c->rest[i] - extra * c->along[i]) - c->change[i];
        if (status == NCGEN_OK)
            status = r->model->phi(t + h, end_q, r->p, c->rest + n);
        if (status == NCGEN_OK)
            status = r->model->phi_q(t + h, end_q, r->p, phi_q_values(r));
        if (status == NCGEN_OK)
            status = solve_with_multipliers(r, c, h / 2, h * h / 4, c->left, h / 2);
        c->is_corrected = 0;
        if (status != NCGEN_OK)
            return status;
        for (int i = 0; i < n; ++i) {
            end_qd[i] += c->change[i];
            c->change[i] *= h / 2;
        }
        for (int i = 0; i < r->m; ++i)
            lam[i] += c->change[n + i] / h;
        const ncgen_real size = scaled_size(r, c->change);
        if (is_rounding(r, size, last))
            return end_midpoint(r, w, c, t, h);
        last = size;
    }
    return NCGEN_NOT_CONVERGED;
}

/* Phi = 0 and M qdd + Phi_q' lam = Q at the end; positions and velocities follow from the auxiliary accelerations a by
 * Newmark's formulas, and (1 - alpha_m) a1 + alpha_m a0 = (1 - alpha_f) qdd1 + alpha_f qdd0. */
static int generalized_alpha(ncgen_run *r, ncgen_stepping *w, ncgen_correction *c, ncgen_scalar t, ncgen_scalar h)
{
    const int n = r->n;
    const ncgen_scalar alpha_m = r->options->alpha_m, alpha_f = r->options->alpha_f;
    const ncgen_scalar gamma = R(0.5) - alpha_m + alpha_f, beta = (gamma + R(0.5)) * (gamma + R(0.5)) / 4;
    const ncgen_scalar share = (1 - alpha_f) / (1 - alpha_m), by_q = h * h * beta * share, by_qd = h * gamma * share;
    const ncgen_real *velocity = r->y, *position = r->y + n;
    ncgen_real *a = c->auxiliary, *qdd = r->slopes->qdd, *lam = r->slopes->lam, *qd0 = c->base, *q0 = c->base + n;
    ncgen_real last = R(1.0e30);
    for (int i = 0; i < n; ++i) {
        const ncgen_real base = (alpha_f * qdd[i] - alpha_m * a[i]) / (1 - alpha_m); /* a1 = base + share qdd1 */
        q0[i] = position[i] + h * velocity[i] + h * h * ((R(0.5) - beta) * a[i] + beta * base);
        qd0[i] = velocity[i] + h * ((1 - gamma) * a[i] + gamma * base);
        a[i] = base;
        /* Newton starts from the straight motion: accelerations of stiff springs would take it to another branch. */
        qdd[i] = (position[i] + h * velocity[i] - q0[i]) / by_q;
    }
    for (int pass = 0; pass < ITERATION_LIMIT; ++pass) {
        for (int i = 0; i < n; ++i) {
            r->q[i] = q0[i] + by_q * qdd[i];
            r->qd[i] = qd0[i] + by_qd * qdd[i];
        }
        int status = find_rest(r, c, t + h);
        if (status == NCGEN_OK)
            status = solve_with_multipliers(r, c, by_qd, by_q, phi_q_values(r), by_q);
        if (status != NCGEN_OK)
            return status;
        for (int i = 0; i < n; ++i) {
            qdd[i] += c->change[i];
            c->change[i] *= by_q;
        }
        for (int i = 0; i < r->m; ++i)
            lam[i] += c->change[n + i];
        const ncgen_real size = scaled_size(r, c->change);
        if (is_rounding(r, size, last)) {
            for (int i = 0; i < n; ++i) {
                r->q[i] = q0[i] + by_q * qdd[i];
                r->qd[i] = qd0[i] + by_qd * qdd[i];
                a[i] += share * qdd[i];
            }
            return end_step(r, w, c, t, h);
        }
        last = size;
    }
    return NCGEN_NOT_CONVERGED;
}

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
    const ncgen_real *values = phi_q_values(r);
    fill_weight(r, c, h / 2, h * h / 4);
    for (int i = 0; i < r->m; ++i)
        for (int k = phi_q->indptr[i]; k < phi_q->indptr[i + 1]; ++k)
            for (int l = phi_q->indptr[i]; l < phi_q->indptr[i + 1]; ++l) {
                const int row = phi_q->indices[k], column = phi_q->indices[l];
                c->matrix[row * c->size + column] += r->options->penalty * (values[k] * columns[row] / rows[i]) *
                                                     (values[l] * columns[column] / rows[i]);
            }
    int orientation;
    return ncgen_lu_factor(c->size, c->matrix, c->order, &orientation);
}

/* change = x of P x + alpha Phi_q'(Phi_q x - gap) = force; force is NULL for zero. */
static void solve_penalty(ncgen_run *r, ncgen_correction *c, const ncgen_real *force, ncgen_real factor, const ncgen_real *gap)
{
    const ncgen_pattern *phi_q = &r->model->phi_q_pattern;
    const ncgen_real *values = phi_q_values(r);
    for (int i = 0; i < r->n; ++i)
        c->right[i] = force ? factor * force[i] : 0;
    for (int i = 0; i < r->m; ++i)
        for (int k = phi_q->indptr[i]; k < phi_q->indptr[i + 1]; ++k)
            c->right[phi_q->indices[k]] += values[k] * pushed(r, c, gap, i);
    for (int i = 0; i < r->n; ++i)
        c->right[i] *= r->dynamics->column_sizes[i] / c->unit;
    ncgen_lu_solve(c->size, c->matrix, c->order, c->right, c->x);
    for (int i = 0; i < r->n; ++i)
        c->change[i] = r->dynamics->column_sizes[i] * c->x[i];
}

/* x becomes the nearest in the metric of P with Phi_q x = right; each pass divides the violation by about alpha. */
static void project_mass_orthogonally(ncgen_run *r, ncgen_correction *c, ncgen_real *x, const ncgen_real *right)
{
    ncgen_real *gap = c->rest + r->n, last = R(1.0e30);
    for (int pass = 0; pass < PROJECTION_LIMIT; ++pass) {
        ncgen_real largest = 0;
        ncgen_row_rates(r, phi_q_values(r), x, gap);
        for (int i = 0; i < r->m; ++i) {
            gap[i] = right[i] - gap[i];
            const ncgen_real size = NCGEN_ABS(gap[i]) / r->dynamics->row_sizes[i];
            if (!(size <= largest))
                largest = size;
        }
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
        r->slopes->qdd[i] = 2 / h * (r->qd[i] - r->y[i]) - c->auxiliary[i];
    }
}

/* Positions by Newton's method on h^2/4 (M qdd + Phi_q' (lam + alpha Phi) - Q), then velocities and accelerations onto the
 * constraints with the same matrix. */
static int ali3p(ncgen_run *r, ncgen_stepping *w, ncgen_correction *c, ncgen_scalar t, ncgen_scalar h)
{
    const int n = r->n, m = r->m;
    const ncgen_scalar quarter = h * h / 4;
    ncgen_real *qdd = r->slopes->qdd, *lam = r->slopes->lam, *gap = c->rest + n, *more = c->change + n;
    ncgen_real last = R(1.0e30);
    int status = NCGEN_OK, done = 0;
    ncgen_copy(n, qdd, c->auxiliary);
    for (int i = 0; i < n; ++i)
        r->q[i] = r->y[n + i] + h * r->y[i];
    for (int pass = 0; !done; ++pass) {
        if (pass == ITERATION_LIMIT)
            return NCGEN_NOT_CONVERGED;
        follow_position(r, c, h);
        status = find_rest(r, c, t + h);
        if (status == NCGEN_OK)
            status = factor_penalty(r, c, h);
        if (status != NCGEN_OK)
            return status;
        for (int i = 0; i < m; ++i)
            gap[i] = -gap[i];
        solve_penalty(r, c, c->rest, quarter, gap);
        ncgen_row_rates(r, phi_q_values(r), c->change, more);
        for (int i = 0; i < m; ++i) {
            more[i] -= gap[i];
            lam[i] += pushed(r, c, more, i) / quarter;
        }
        for (int i = 0; i < n; ++i)
            r->q[i] += c->change[i];
        const ncgen_real size = scaled_size(r, c->change);
        done = is_rounding(r, size, last);
        last = size;
    }
    follow_position(r, c, h);
    status = find_rest(r, c, t + h);
    if (status == NCGEN_OK)
        status = factor_penalty(r, c, h);
    for (int i = 0; i < m; ++i)
        more[i] = 0;
    if (status == NCGEN_OK && r->model->nu)
        status = r->model->nu(t + h, r->q, r->p, more);
    if (status != NCGEN_OK)
        return status;
    project_mass_orthogonally(r, c, r->qd, more);
    status = r->model->gamma(t + h, r->q, r->qd, r->p, more);
    project_mass_orthogonally(r, c, qdd, more);
    return status == NCGEN_OK ? end_step(r, w, c, t, h) : status;
}

typedef int stepper(ncgen_run *r, ncgen_stepping *w, ncgen_correction *c, ncgen_scalar t, ncgen_scalar h);

/* Accelerations, multipliers and power at the start. */
static int begin(ncgen_run *r, ncgen_correction *c)
{
    r->constrained->kept = 0;
    c->is_corrected = 0;
    ncgen_copy(r->n, r->y, r->qd);
    ncgen_keep_state(r, r->times[0], 0);
    if (!ncgen_uses_tangents(r->model, r->dynamics, r->options))
        return NCGEN_OK;
    const int status = ncgen_constrained_accelerations(r, r->times[0]);
    ncgen_copy(r->n, r->constrained->solution, r->slopes->qdd);
    ncgen_copy(r->n, r->constrained->solution, c->auxiliary);
    ncgen_copy(r->m, r->constrained->solution + r->n, r->slopes->lam);
    return status == NCGEN_OK ? ncgen_constrained_power(r, r->times[0], &c->power) : status;
}

int ncgen_steppers(ncgen_run *r, ncgen_stepping *w, ncgen_correction *c)
{
    const int tangents = ncgen_uses_tangents(r->model, r->dynamics, r->options);
    stepper *step = r->options->method == NCGEN_RATTLE              ? (tangents ? rattle_with_damping : rattle)
                    : r->options->method == NCGEN_ENERGY_MOMENTUM   ? (tangents ? energy_momentum_corrected : energy_momentum)
                    : r->options->method == NCGEN_GENERALIZED_ALPHA ? generalized_alpha
                                                                    : ali3p;
    const ncgen_scalar start = r->times[0], end = r->times[r->n_times - 1];
    const ncgen_scalar count = ncgen_step_count(r, end - start), h = (end - start) / count;
    w->interpolate = interpolate;
    int status = begin(r, c);
    if (status == NCGEN_OK)
        status = ncgen_grid_begin(r, w);
    for (ncgen_scalar i = 0; i < count && status == NCGEN_OK && !r->statistics->stopped; i += 1) {
        w->new_y[2 * r->n] = 0;
        status = step(r, w, c, start + i * h, h);
        ncgen_copy(r->n, r->qd, w->new_y);
        ncgen_copy(r->n, r->q, w->new_y + r->n);
        if (status == NCGEN_OK)
            status = ncgen_grid_step(r, w, start + i * h, i + 1 < count ? start + (i + 1) * h : end);
    }
    return status;
}
