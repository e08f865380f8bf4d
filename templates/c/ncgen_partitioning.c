/* ncgen_partitioning.c: coordinate partitioning.
 *
 * The state is y = [zd, z, W, qp]: velocities and positions of the independent coordinates, the work of drivers and forces
 * without a potential, and the dependent coordinates. These are integrated along only to tell Newton's method where to
 * start, at every stage as near as the stage is accurate; what it finds takes their place.
 */
#include "ncgen_internal.h"

/* An amplification that leaves no digit of the solution. */
static const ncgen_scalar broken_down = R(1.0e30);

enum { NEWTON_LIMIT = 40 };

/* After a Newton step from a residual below this, the next one is at rounding: it need not be looked at. */
static const ncgen_scalar nearly_converged = sizeof(ncgen_scalar) > 4 ? R(1.0e-7) : R(3.0e-4);

/* The largest |phi| relative to the rows' sizes; not a number if one of them is not. */
static ncgen_real residual(const ncgen_run *r)
{
    ncgen_real largest = 0;
    for (int i = 0; i < r->model->n_rows; ++i) {
        const ncgen_real size = NCGEN_ABS(r->partitioning->phi[i]) / r->dynamics->row_sizes[i];
        if (size != size)
            return size;
        if (size > largest)
            largest = size;
    }
    return largest;
}

/* Phi_q at (t, q), and the factors of its dependent columns over the kept rows. */
static int factor_jacobian(ncgen_run *r, ncgen_scalar t)
{
    const ncgen_dynamics *d = r->dynamics;
    const ncgen_pattern *pattern = &r->model->phi_q_pattern;
    ncgen_partitioning *w = r->partitioning;
    const int size = d->n_dependent;
    const int status = r->model->phi_q(t, r->q, r->p, w->jacobian);
    if (status != NCGEN_OK)
        return status;
    for (int i = 0; i < size; ++i) {
        ncgen_real *row = w->lu + (size_t)i * (size_t)size;
        ncgen_real *full = w->bias; /* n numbers that are free here */
        for (int c = 0; c < r->n; ++c)
            full[c] = 0;
        for (int k = pattern->indptr[d->rows[i]]; k < pattern->indptr[d->rows[i] + 1]; ++k)
            full[pattern->indices[k]] = w->jacobian[k];
        for (int c = 0; c < size; ++c)
            row[c] = full[d->dependent[c]];
    }
    return ncgen_lu_factor(size, w->lu, w->order, &w->orientation);
}

/* x of A x = right over kept rows; right is indexed like the model's rows. */
void ncgen_partitioning_solve(const ncgen_run *r, const ncgen_real *right, ncgen_real *x)
{
    const int size = r->dynamics->n_dependent;
    const ncgen_partitioning *w = r->partitioning;
    for (int i = 0; i < size; ++i) {
        const ncgen_real *row = w->lu + (size_t)i * (size_t)size;
        ncgen_real sum = right[r->dynamics->rows[w->order[i]]];
        for (int c = 0; c < i; ++c)
            sum -= row[c] * x[c];
        x[i] = sum;
    }
    for (int i = size - 1; i >= 0; --i) {
        const ncgen_real *row = w->lu + (size_t)i * (size_t)size;
        for (int c = i + 1; c < size; ++c)
            x[i] -= row[c] * x[c];
        x[i] /= row[i];
    }
}

/* lam of A' lam = right over the dependent coordinates, written to the model's rows; rows that are not kept get zero. */
void ncgen_partitioning_multipliers(const ncgen_run *r, const ncgen_real *right, ncgen_real *lam)
{
    const int size = r->dynamics->n_dependent;
    const ncgen_partitioning *w = r->partitioning;
    ncgen_real *x = w->column;
    for (int i = 0; i < size; ++i) {
        ncgen_real sum = right[r->dynamics->dependent[i]];
        for (int c = 0; c < i; ++c)
            sum -= w->lu[(size_t)c * (size_t)size + (size_t)i] * x[c];
        x[i] = sum / w->lu[(size_t)i * (size_t)size + (size_t)i];
    }
    for (int i = size - 1; i >= 0; --i)
        for (int c = i + 1; c < size; ++c)
            x[i] -= w->lu[(size_t)c * (size_t)size + (size_t)i] * x[c];
    for (int i = 0; i < r->model->n_rows; ++i)
        lam[i] = 0;
    for (int i = 0; i < size; ++i)
        lam[r->dynamics->rows[w->order[i]]] = x[i];
}

/* The correction of the dependent coordinates for the phi there is. */
static int dense_step(ncgen_run *r, ncgen_scalar t)
{
    const int status = factor_jacobian(r, t);
    if (status != NCGEN_OK)
        return status;
    ncgen_partitioning_solve(r, r->partitioning->phi, r->partitioning->step);
    for (int i = 0; i < r->dynamics->n_dependent; ++i)
        r->partitioning->step[i] = -r->partitioning->step[i];
    return NCGEN_OK;
}

/* The basis R of the motions: column z of an n x nz matrix is qd for a unit speed of one independent coordinate. */
static void form_basis(const ncgen_run *r)
{
    const ncgen_dynamics *d = r->dynamics;
    const ncgen_pattern *pattern = &r->model->phi_q_pattern;
    ncgen_partitioning *w = r->partitioning;
    for (int z = 0; z < r->nz; ++z) {
        for (int i = 0; i < r->model->n_rows; ++i) {
            w->lam[i] = 0;
            for (int k = pattern->indptr[i]; k < pattern->indptr[i + 1]; ++k)
                if (pattern->indices[k] == d->independent[z])
                    w->lam[i] = w->jacobian[k];
        }
        ncgen_partitioning_solve(r, w->lam, w->column);
        ncgen_real *column = w->R + (size_t)z * (size_t)r->n;
        for (int i = 0; i < r->n; ++i)
            column[i] = 0;
        column[d->independent[z]] = 1;
        for (int i = 0; i < d->n_dependent; ++i)
            column[d->dependent[i]] = -w->column[i];
    }
}

/* qd, zdd, power and amplification at r->q for the speeds zd, with the model's kernels; the factors of Phi_q^d, R, M R and
 * the reduced mass matrix stay. */
int ncgen_partitioning_accelerate(ncgen_run *r, ncgen_scalar t, const ncgen_real *zd)
{
    const ncgen_model *model = r->model;
    const ncgen_dynamics *d = r->dynamics;
    ncgen_partitioning *w = r->partitioning;
    ncgen_real *qd = r->partitioning->out, *zdd = r->partitioning->out + r->n;
    int status = factor_jacobian(r, t);
    if (status != NCGEN_OK)
        return status;
    form_basis(r);
    for (int i = 0; i < model->n_rows; ++i)
        w->nu[i] = 0;
    if (model->nu)
        status |= model->nu(t, r->q, r->p, w->nu);
    ncgen_partitioning_solve(r, w->nu, w->column);
    for (int i = 0; i < r->n; ++i) {
        qd[i] = 0;
        w->bias[i] = w->force[i] = 0;
        for (int z = 0; z < r->nz; ++z)
            qd[i] += w->R[z * r->n + i] * zd[z];
    }
    for (int i = 0; i < d->n_dependent; ++i)
        qd[d->dependent[i]] += w->column[i];
    status |= model->gamma(t, r->q, qd, r->p, w->gamma);
    ncgen_partitioning_solve(r, w->gamma, w->column);
    for (int i = 0; i < d->n_dependent; ++i)
        w->bias[d->dependent[i]] = w->column[i];
    if (model->mass)
        status |= model->mass(t, r->q, r->p, w->mass);
    if (model->force)
        status |= model->force(t, r->q, qd, r->p, w->force);
    if (status != NCGEN_OK)
        return NCGEN_DOMAIN;
    ncgen_times_mass(r, w->mass, w->bias, w->missing);
    for (int i = 0; i < r->n; ++i)
        w->missing[i] = w->force[i] - w->missing[i];
    ncgen_real amplification = 0;
    for (int z = 0; z < r->nz; ++z) {
        const ncgen_real *column = w->R + z * r->n;
        ncgen_times_mass(r, w->mass, column, w->MR + z * r->n);
        for (int j = 0; j <= z; ++j)
            w->reduced[z * r->nz + j] = ncgen_dot(r->n, column, w->MR + j * r->n);
        zdd[z] = ncgen_dot(r->n, column, w->missing);
        for (int i = 0; i < r->n; ++i) {
            const ncgen_real grown = column[i] * d->column_sizes[d->independent[z]] / d->column_sizes[i];
            amplification += grown * grown;
        }
    }
    status = ncgen_solve_positive(r->nz, w->reduced, zdd);
    if (status != NCGEN_OK)
        return status;
    ncgen_real power = 0;
    if (model->energy) {
        ncgen_real energy[3];
        if (model->energy(t, r->q, qd, r->p, energy) != NCGEN_OK)
            return NCGEN_DOMAIN;
        power = energy[2];
    }
    if (model->nu) {
        for (int z = 0; z < r->nz; ++z)
            for (int i = 0; i < r->n; ++i)
                w->missing[i] -= w->MR[z * r->n + i] * zdd[z];
        ncgen_partitioning_multipliers(r, w->missing, w->lam);
        power -= ncgen_dot(model->n_rows, w->nu, w->lam);
    }
    r->partitioning->out[r->n + r->nz] = power;
    r->partitioning->out[r->n + r->nz + 1] = amplification;
    return NCGEN_OK;
}

/* Does the emitted elimination serve? Where a step is repeated, its pivots may be what is wrong. */
static int is_emitted(const ncgen_run *r)
{
    return r->dynamics->acceleration && !(r->careful && r->partitioning->lu);
}

/* The same as the emitted function writes it, where there is one and it did not divide by zero. */
static int accelerate(ncgen_run *r, ncgen_scalar t, const ncgen_real *zd)
{
    const ncgen_partitioning *w = r->partitioning;
    if (is_emitted(r)) {
        const int status = r->dynamics->acceleration(t, r->q, zd, r->p, w->out);
        if (!w->lu || (status == NCGEN_OK && w->out[r->n + r->nz + 1] < broken_down))
            return status;
    }
    r->statistics->fallbacks += r->dynamics->acceleration != NULL;
    return ncgen_partitioning_accelerate(r, t, zd);
}

/* The dependent coordinates of y at time t for the independent ones. */
int ncgen_partitioning_position(ncgen_run *r, ncgen_scalar t, ncgen_real *y)
{
    const ncgen_dynamics *d = r->dynamics;
    ncgen_real *dependent = y + r->weighed;
    const int emitted = is_emitted(r);
    for (int i = 0; i < d->n_dependent; ++i)
        r->q[d->dependent[i]] = dependent[i];
    for (int i = 0; i < r->nz; ++i)
        r->q[d->independent[i]] = y[r->nz + i];
    for (int iteration = 0; iteration <= NEWTON_LIMIT; ++iteration) {
        /* An emitted step has phi in it; most often one is needed, so it is not worth a look at phi beforehand. */
        int status = emitted ? d->newton(t, r->q, r->p, r->partitioning->step) : r->model->phi(t, r->q, r->p, r->partitioning->phi);
        if (status != NCGEN_OK)
            return status;
        const ncgen_real size = residual(r);
        if (!(size < R(1.0e30)))
            return ncgen_is_finite(1, &size) ? NCGEN_NOT_CONVERGED : NCGEN_DOMAIN;
        if (!emitted || (r->partitioning->lu && !ncgen_is_finite(d->n_dependent, r->partitioning->step)))
            status = dense_step(r, t);
        if (status != NCGEN_OK)
            return status;
        for (int i = 0; i < d->n_dependent; ++i)
            dependent[i] = r->q[d->dependent[i]] += r->partitioning->step[i];
        r->statistics->newton_steps += 1;
        /* The first guess is often this good already; even then a step is taken, since what is left would add up. */
        if (size <= nearly_converged)
            return NCGEN_OK;
    }
    return NCGEN_NOT_CONVERGED;
}

/* yd at (t, y); q, qd and the accelerations stay in r->q and r->partitioning->out. */
static int derivative(ncgen_run *r, ncgen_scalar t, ncgen_real *y, ncgen_real *yd)
{
    r->statistics->evaluations += 1;
    int status = ncgen_partitioning_position(r, t, y);
    if (status != NCGEN_OK)
        return status;
    status = accelerate(r, t, y);
    if (status != NCGEN_OK)
        return status;
    if (!(r->partitioning->out[r->n + r->nz + 1] < broken_down))
        return NCGEN_PIVOT;
    if (r->partitioning->first_orientation == 0)
        r->partitioning->first_orientation = r->partitioning->orientation;
    if (r->partitioning->orientation != r->partitioning->first_orientation)
        return NCGEN_PIVOT; /* beyond a position where Phi_q^d is singular, perhaps on another branch */
    for (int i = 0; i < r->nz; ++i) {
        yd[i] = r->partitioning->out[r->n + i];
        yd[r->nz + i] = r->partitioning->out[r->dynamics->independent[i]];
    }
    yd[2 * r->nz] = r->partitioning->out[r->n + r->nz];
    for (int i = 0; i < r->dynamics->n_dependent; ++i)
        yd[r->weighed + i] = r->partitioning->out[r->dynamics->dependent[i]];
    return NCGEN_OK;
}

/* NCGEN_PIVOT means that other independent coordinates may serve better from here on: the amplification has grown since
 * the start. */
static int accept(ncgen_run *r, ncgen_scalar t)
{
    const ncgen_real amplification = r->partitioning->out[r->n + r->nz + 1];
    (void)t;
    if (r->partitioning->amplification == 0)
        r->partitioning->amplification = amplification;
    return amplification > r->options->growth * r->partitioning->amplification ? NCGEN_PIVOT : NCGEN_OK;
}

static int state(ncgen_run *r, ncgen_scalar t, ncgen_real *y)
{
    const int status = ncgen_partitioning_position(r, t, y);
    return status == NCGEN_OK ? accelerate(r, t, y) : status;
}

void ncgen_partitioning_layout(ncgen_run *r, ncgen_partitioning *w)
{
    const int n = r->n, m = r->m, d = r->dynamics->n_dependent;
    ncgen_space *space = &r->space;
    r->partitioning = w;
    r->weighed = 2 * r->nz + 1;
    r->ny = r->weighed + d;
    r->q = ncgen_take(space, n);
    w->out = ncgen_take(space, n + r->nz + 2);
    r->qd = w->out;
    w->step = ncgen_take(space, d + m);
    w->phi = w->step ? w->step + d : NULL;
    w->lu = NULL;
    if (r->dynamics->newton && !r->dynamics->rows)
        return;
    w->jacobian = ncgen_take(space, r->model->phi_q_pattern.indptr ? r->model->phi_q_pattern.indptr[m] : 0);
    w->mass = ncgen_take(space, r->model->mass_pattern.indptr ? r->model->mass_pattern.indptr[n] : 0);
    w->lu = ncgen_take(space, d * d);
    w->R = ncgen_take(space, n * r->nz);
    w->MR = ncgen_take(space, n * r->nz);
    w->reduced = ncgen_take(space, r->nz * r->nz);
    w->bias = ncgen_take(space, n);
    w->force = ncgen_take(space, n);
    w->missing = ncgen_take(space, n);
    w->nu = ncgen_take(space, m);
    w->gamma = ncgen_take(space, m);
    w->lam = ncgen_take(space, m);
    w->column = ncgen_take(space, d);
    w->order = r->integers;
}

void ncgen_partitioning_begin(ncgen_run *r, const ncgen_real *velocities)
{
    r->derivative = derivative;
    r->accept = accept;
    r->state = state;
    r->jacobian = ncgen_partitioning_jacobian;
    r->partitioning->amplification = 0;
    r->partitioning->orientation = r->partitioning->first_orientation = 0;
    for (int i = 0; i < r->nz; ++i) {
        r->y[i] = velocities[i];
        r->y[r->nz + i] = r->start_q[r->dynamics->independent[i]];
    }
    r->y[2 * r->nz] = 0;
    for (int i = 0; i < r->dynamics->n_dependent; ++i)
        r->y[r->weighed + i] = r->start_q[r->dynamics->dependent[i]];
}
