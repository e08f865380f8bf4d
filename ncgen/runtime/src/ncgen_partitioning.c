/* ncgen_partitioning.c: coordinate partitioning.
 *
 * The state is y = [zd, z, W, qp]: velocities and positions of the independent coordinates, the work of drivers and forces without a
 * potential, and the dependent coordinates. These are integrated along only to give Newton's method a place to start, at every stage
 * as near as the stage is accurate; its result takes their place.
 * With rolling conditions there are fewer independent velocities than positions, and two choices of them.
 */
#include "ncgen_partitioning.h"
#include "ncgen_positive.h"

/* An amplification that leaves no digit of the solution. */
static const ncgen_scalar max_amplification = R(1.0e30);

enum { NEWTON_LIMIT = 40 };

/* After a Newton step from a residual below this, the next one is at rounding. */
static const ncgen_scalar quadratic_limit = sizeof(ncgen_scalar) > 4 ? R(1.0e-7) : R(3.0e-4);

/* The correction of the dependent coordinates for the phi there is. */
static int dense_step(ncgen_run *r, ncgen_scalar t)
{
    const int status = ncgen_dependent_factor(r, &r->partitioning->dependent, t, r->partitioning->positions);
    if (status != NCGEN_OK)
        return status;
    ncgen_dependent_solve(&r->partitioning->dependent, r->partitioning->phi, r->partitioning->step);
    for (int i = 0; i < r->partitioning->positions->of.n_dependent; ++i)
        r->partitioning->step[i] = -r->partitioning->step[i];
    return NCGEN_OK;
}

/* The basis R of the motions of the choice that has been factored: column z is the change of q for one independent coordinate. */
static void form_basis(const ncgen_run *r, ncgen_real *R)
{
    const ncgen_pattern *pattern = &r->model->phi_q_pattern;
    ncgen_partitioning *w = r->partitioning;
    const ncgen_partition *d = w->dependent.factored;
    for (int z = 0; z < d->n_independent; ++z) {
        for (int i = 0; i < r->model->n_rows; ++i) {
            w->lam[i] = 0;
            for (int k = pattern->indptr[i]; k < pattern->indptr[i + 1]; ++k)
                if (pattern->indices[k] == d->independent[z])
                    w->lam[i] = w->dependent.jacobian[k];
        }
        ncgen_dependent_solve(&w->dependent, w->lam, w->column);
        ncgen_real *column = R + (size_t)z * (size_t)r->n;
        for (int i = 0; i < r->n; ++i)
            column[i] = 0;
        column[d->independent[z]] = 1;
        for (int i = 0; i < d->n_dependent; ++i)
            column[d->dependent[i]] = -w->column[i];
    }
}

/* How much an error of one independent coordinate grows in the others, squared. */
static ncgen_real amplification_of(const ncgen_run *r, int independent, const ncgen_real *column)
{
    const ncgen_scalar *sizes = r->dynamics->column_sizes;
    ncgen_real sum = 0;
    for (int i = 0; i < r->n; ++i) {
        const ncgen_real grown = column[i] * sizes[independent] / sizes[i];
        sum += grown * grown;
    }
    return sum;
}

/* R of the positions at r->q, in place, and its amplification. */
int ncgen_partitioning_place(ncgen_run *r, ncgen_scalar t, ncgen_real *amplification)
{
    ncgen_partitioning *w = r->partitioning;
    const ncgen_partition *d = &w->positions->of;
    const int status = ncgen_dependent_factor(r, &w->dependent, t, w->positions);
    if (status != NCGEN_OK)
        return status;
    form_basis(r, w->place);
    *amplification = 0;
    for (int z = 0; z < d->n_independent; ++z)
        *amplification += amplification_of(r, d->independent[z], w->place + z * r->n);
    return NCGEN_OK;
}

/* Power of drivers and of forces without a potential; w->missing holds the forces less M times what is not of zdd, and is overwritten. */
static int find_power(ncgen_run *r, ncgen_scalar t, const ncgen_real *qd, const ncgen_real *zdd, ncgen_real *power)
{
    ncgen_partitioning *w = r->partitioning;
    if (ncgen_power(r, t, r->q, qd, power) != NCGEN_OK)
        return NCGEN_DOMAIN;
    if (!r->model->nu)
        return NCGEN_OK;
    for (int z = 0; z < r->nz; ++z)
        for (int i = 0; i < r->n; ++i)
            w->missing[i] -= w->MR[z * r->n + i] * zdd[z];
    ncgen_dependent_multipliers(r, &w->dependent, w->missing, w->lam);
    *power -= ncgen_dot(r->m, w->nu, w->lam);
    return NCGEN_OK;
}

/* qd, zdd, power and amplification at r->q for the speeds zd, by the model's kernels; factors of Phi_q^d, R, M R and reduced mass stay. */
int ncgen_partitioning_accelerate(ncgen_run *r, ncgen_scalar t, const ncgen_real *zd)
{
    ncgen_partitioning *w = r->partitioning;
    const ncgen_partition *d = &w->velocities->of;
    ncgen_real *qd = w->out, *zdd = w->out + r->n;
    int status = ncgen_dependent_factor(r, &w->dependent, t, w->velocities);
    if (status != NCGEN_OK)
        return status;
    form_basis(r, w->R);
    for (int i = 0; i < r->m; ++i)
        w->nu[i] = 0;
    if (r->model->nu)
        status |= r->model->nu(t, r->q, r->p, w->nu);
    ncgen_dependent_solve(&w->dependent, w->nu, w->column);
    for (int i = 0; i < r->n; ++i) {
        qd[i] = w->bias[i] = 0;
        for (int z = 0; z < r->nz; ++z)
            qd[i] += w->R[z * r->n + i] * zd[z];
    }
    for (int i = 0; i < d->n_dependent; ++i)
        qd[d->dependent[i]] += w->column[i];
    status |= ncgen_gamma(r, t, r->q, qd, w->gamma);
    ncgen_dependent_solve(&w->dependent, w->gamma, w->column);
    for (int i = 0; i < d->n_dependent; ++i)
        w->bias[d->dependent[i]] = w->column[i];
    if (r->model->mass)
        status |= r->model->mass(t, r->q, r->p, w->mass);
    if (status != NCGEN_OK)
        return NCGEN_DOMAIN;
    status = ncgen_forces(r, t, r->q, qd, w->force);
    if (status != NCGEN_OK)
        return status;
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
        amplification += amplification_of(r, d->independent[z], column);
    }
    status = ncgen_solve_positive(r->nz, w->reduced, zdd);
    if (status != NCGEN_OK)
        return status;
    w->out[r->n + r->nz + 1] = amplification;
    return find_power(r, t, qd, zdd, w->out + r->n + r->nz);
}

/* Does the emitted elimination serve? Where a step is repeated, its pivots may be what is wrong. */
static int is_emitted(const ncgen_run *r)
{
    return r->dynamics->acceleration && !(r->uses_exchanges && r->partitioning->dependent.lu);
}

/* The same as the emitted function writes it, where there is one and it did not divide by zero. */
static int accelerate(ncgen_run *r, ncgen_scalar t, const ncgen_real *zd)
{
    const ncgen_partitioning *w = r->partitioning;
    const int known = ncgen_read_inputs(r, t);
    if (known != NCGEN_OK)
        return known;
    if (is_emitted(r)) {
        const int status = r->dynamics->acceleration(t, r->q, zd, r->p, w->out);
        if (!w->dependent.lu || (status == NCGEN_OK && w->out[r->n + r->nz + 1] < max_amplification))
            return status;
    }
    r->statistics->fallbacks += r->dynamics->acceleration != NULL;
    return ncgen_partitioning_accelerate(r, t, zd);
}

/* The dependent coordinates as newton wrote them in closed form. */
static int take_places(ncgen_run *r, ncgen_real *dependent)
{
    const ncgen_partition *d = &r->partitioning->positions->of;
    for (int i = 0; i < d->n_dependent; ++i)
        dependent[i] = r->q[d->dependent[i]] = r->partitioning->step[i];
    r->statistics->newton_steps += 1;
    return NCGEN_OK;
}

/* The dependent coordinates of y at time t for the independent ones. */
int ncgen_partitioning_position(ncgen_run *r, ncgen_scalar t, ncgen_real *y)
{
    const ncgen_partition *d = &r->partitioning->positions->of;
    ncgen_real *dependent = y + r->error_size;
    const int emitted = is_emitted(r);
    for (int i = 0; i < d->n_dependent; ++i)
        r->q[d->dependent[i]] = dependent[i];
    for (int i = 0; i < d->n_independent; ++i)
        r->q[d->independent[i]] = y[r->nz + i];
    for (int iteration = 0; iteration <= NEWTON_LIMIT; ++iteration) {
        /* An emitted step has phi in it; most often one is needed, so it is not worth a look at phi beforehand. */
        int status = emitted ? r->dynamics->newton(t, r->q, r->p, r->partitioning->step) : ncgen_phi(r, t, r->q, r->partitioning->phi);
        if (status != NCGEN_OK)
            return status;
        if (emitted && r->dynamics->closed_form)
            return take_places(r, dependent);
        const ncgen_real size = ncgen_largest(r->m, r->partitioning->phi, r->dynamics->row_sizes);
        if (!(size < R(1.0e30)))
            return ncgen_is_finite(1, &size) ? NCGEN_NOT_CONVERGED : NCGEN_DOMAIN;
        if (!emitted || (r->partitioning->dependent.lu && !ncgen_is_finite(d->n_dependent, r->partitioning->step)))
            status = dense_step(r, t);
        if (status != NCGEN_OK)
            return status;
        for (int i = 0; i < d->n_dependent; ++i)
            dependent[i] = r->q[d->dependent[i]] += r->partitioning->step[i];
        r->statistics->newton_steps += 1;
        /* The first guess is often this good already; even then a step is taken, since what is left would add up. */
        if (size <= quadratic_limit)
            return NCGEN_OK;
    }
    return NCGEN_NOT_CONVERGED;
}

/* yd at (t, y); q, qd and the accelerations stay in r->q and r->partitioning->out. */
static int derivative(ncgen_run *r, ncgen_scalar t, ncgen_real *y, ncgen_real *yd)
{
    ncgen_partitioning *w = r->partitioning;
    const ncgen_partition *d = &w->positions->of;
    r->statistics->evaluations += 1;
    w->velocities->orientation = w->positions->orientation = w->velocities->has_turned = w->positions->has_turned = 0;
    int status = ncgen_partitioning_position(r, t, y);
    if (status != NCGEN_OK)
        return status;
    status = accelerate(r, t, y);
    if (status != NCGEN_OK)
        return status;
    if (w->velocities->has_turned || w->positions->has_turned)
        w->turned_at = t;
    if (!(w->out[r->n + r->nz + 1] < max_amplification) || w->velocities->has_turned || w->positions->has_turned)
        return NCGEN_PIVOT;
    for (int i = 0; i < r->nz; ++i)
        yd[i] = w->out[r->n + i];
    for (int i = 0; i < d->n_independent; ++i)
        yd[r->nz + i] = w->out[d->independent[i]];
    yd[r->error_size - 1] = w->out[r->n + r->nz];
    for (int i = 0; i < d->n_dependent; ++i)
        yd[r->error_size + i] = w->out[d->dependent[i]];
    return NCGEN_OK;
}

/* The same at the end of a step, which has not passed a singular position. */
static int end_derivative(ncgen_run *r, ncgen_scalar t, ncgen_real *y, int precise, ncgen_real *yd)
{
    ncgen_partitioning *w = r->partitioning;
    const int status = derivative(r, t, y, yd);
    (void)precise;
    if (status != NCGEN_OK || !ncgen_dependent_has_passed(r, &w->dependent, w->velocities))
        return status;
    w->turned_at = t;
    return NCGEN_PIVOT;
}

/* Has the amplification of a choice grown since the start? */
static int has_grown(const ncgen_run *r, ncgen_choice *choice, ncgen_real amplification)
{
    if (!(choice->amplification > 0))
        choice->amplification = amplification;
    return amplification > r->options->max_growth * choice->amplification;
}

/* Does the run only creep up to a singular position? A stage of a longer step was beyond one, and the step up to here or what is left up to
 * there is a small share of the longest step. */
static int is_before_a_turn(ncgen_partitioning *w, ncgen_scalar t)
{
    const ncgen_scalar length = t - w->accepted, ahead = w->turned_at - t;
    w->accepted = t;
    w->longest = length > w->longest ? length : w->longest;
    return ahead > 0 && (ahead < length ? ahead : length) < R(1.0e-4) * w->longest;
}

/* NCGEN_PIVOT and NCGEN_SINGULAR_AHEAD mean that other independent coordinates may serve better from here on, or have to. */
static int accept(ncgen_run *r, ncgen_scalar t)
{
    ncgen_partitioning *w = r->partitioning;
    int grown = has_grown(r, w->velocities, w->out[r->n + r->nz + 1]);
    ncgen_dependent_note_start(&w->dependent, w->velocities);
    if (w->positions != w->velocities) {
        ncgen_real amplification;
        const int status = ncgen_partitioning_place(r, t, &amplification);
        grown |= status != NCGEN_OK || has_grown(r, w->positions, amplification);
        ncgen_dependent_note_start(&w->dependent, w->positions);
    }
    if (is_before_a_turn(w, t))
        return NCGEN_SINGULAR_AHEAD;
    return grown ? NCGEN_PIVOT : NCGEN_OK;
}

static int state(ncgen_run *r, ncgen_scalar t, ncgen_real *y)
{
    const int status = ncgen_partitioning_position(r, t, y);
    return status == NCGEN_OK ? accelerate(r, t, y) : status;
}

void ncgen_partitioning_layout(ncgen_run *r, ncgen_partitioning *w)
{
    const ncgen_dynamics *dynamics = r->dynamics;
    const ncgen_partition velocities = {dynamics->n_independent, dynamics->n_dependent, dynamics->independent, dynamics->dependent,
                                        dynamics->rows};
    const int n = r->n, m = r->m, d = velocities.n_dependent;
    ncgen_space *space = &r->space;
    r->partitioning = w;
    w->choices[0].of = velocities;
    w->velocities = w->positions = w->choices;
    if (dynamics->positions) {
        w->choices[1].of = *dynamics->positions;
        w->positions = w->choices + 1;
    }
    w->dependent.factored = &w->velocities->of;
    r->error_size = r->nz + w->positions->of.n_independent + 1;
    r->ny = r->error_size + w->positions->of.n_dependent;
    r->q = ncgen_take(space, n);
    w->out = ncgen_take(space, n + r->nz + 2);
    r->qd = w->out;
    w->step = ncgen_take(space, d + m);
    w->phi = w->step ? w->step + d : NULL;
    w->dependent.lu = NULL;
    if (dynamics->newton && !dynamics->rows)
        return;
    ncgen_dependent_layout(r, &w->dependent, d);
    for (int k = 0; k < (dynamics->positions ? 2 : 1); ++k)
        ncgen_dependent_start_layout(r, w->choices + k, k, d);
    w->mass = ncgen_take(space, ncgen_nonzeros(&r->model->mass_pattern));
    w->R = ncgen_take(space, n * r->nz);
    w->MR = ncgen_take(space, n * r->nz);
    w->place = dynamics->positions ? ncgen_take(space, n * w->positions->of.n_independent) : w->R;
    w->reduced = ncgen_take(space, r->nz * r->nz);
    w->bias = ncgen_take(space, n);
    w->force = ncgen_take(space, n);
    w->missing = ncgen_take(space, n);
    w->nu = ncgen_take(space, m);
    w->gamma = ncgen_take(space, m);
    w->lam = ncgen_take(space, m);
    w->column = ncgen_take(space, d);
}

void ncgen_partitioning_begin(ncgen_run *r, const ncgen_real *velocities)
{
    ncgen_partitioning *w = r->partitioning;
    const ncgen_partition *d = &w->positions->of;
    r->derivative = r->stage_derivative = derivative;
    r->project_state = end_derivative;
    r->accept = accept;
    r->state = state;
    for (int k = 0; k < 2; ++k)
        ncgen_dependent_begin(w->choices + k);
    w->turned_at = w->accepted = r->times[0];
    w->longest = 0;
    ncgen_copy(r->nz, velocities, r->y);
    for (int i = 0; i < d->n_independent; ++i)
        r->y[r->nz + i] = r->start_q[d->independent[i]];
    r->y[r->error_size - 1] = 0;
    for (int i = 0; i < d->n_dependent; ++i)
        r->y[r->error_size + i] = r->start_q[d->dependent[i]];
}
