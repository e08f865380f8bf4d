/* ncgen_jacobian.c: how the accelerations change with velocities and positions, exact, from the tangent kernels.
 *
 * M qdd + Phi_q' lam - Q and the second derivative of the rows stay zero when q and qd change, hence
 *   [M Phi_q'; Phi_q 0] [dqdd; dlam] = -[K; Phidd_q] dq - [C; Phidd_qd] dqd.
 * Of independent coordinates z: dq = R dz and Phi_q dqd = -Phid_q dq, where Phid_q is half of Phidd_qd.
 */
#include "ncgen_internal.h"

static int values_of(const ncgen_pattern *pattern)
{
    return pattern->indptr ? pattern->indptr[pattern->rows] : 0;
}

void ncgen_slopes_layout(ncgen_run *r, ncgen_slopes *w)
{
    const ncgen_tangents *tangents = r->dynamics->tangents;
    r->slopes = w;
    w->stiffness = ncgen_take(&r->space, values_of(&tangents->stiffness_pattern));
    w->damping = ncgen_take(&r->space, values_of(&tangents->damping_pattern));
    w->phidd_q = ncgen_take(&r->space, values_of(&tangents->phidd_q_pattern));
    w->phidd_qd = ncgen_take(&r->space, values_of(&tangents->phidd_qd_pattern));
    w->qdd = ncgen_take(&r->space, r->n);
    w->lam = ncgen_take(&r->space, r->m);
    w->dq = ncgen_take(&r->space, r->n);
    w->dqd = ncgen_take(&r->space, r->n);
    w->change = ncgen_take(&r->space, r->n + r->m);
}

/* sum += factor A x. */
static void add_product(const ncgen_pattern *pattern, const ncgen_real *values, const ncgen_real *x, ncgen_real factor,
                        ncgen_real *sum)
{
    for (int i = 0; i < (pattern->indptr ? pattern->rows : 0); ++i)
        for (int k = pattern->indptr[i]; k < pattern->indptr[i + 1]; ++k)
            sum[i] += factor * values[k] * x[pattern->indices[k]];
}

int ncgen_find_tangents(ncgen_run *r, ncgen_scalar t)
{
    const ncgen_tangents *tangents = r->dynamics->tangents;
    const ncgen_slopes *w = r->slopes;
    int status = NCGEN_OK;
    if (tangents->stiffness)
        status |= tangents->stiffness(t, r->q, r->qd, w->qdd, w->lam, r->p, w->stiffness);
    if (tangents->damping)
        status |= tangents->damping(t, r->q, r->qd, r->p, w->damping);
    return status == NCGEN_OK ? NCGEN_OK : NCGEN_DOMAIN;
}

/* The four matrices at r->q, r->qd and the accelerations and multipliers in w. */
static int find_slopes(ncgen_run *r, ncgen_scalar t)
{
    const ncgen_tangents *tangents = r->dynamics->tangents;
    const ncgen_slopes *w = r->slopes;
    int status = ncgen_find_tangents(r, t);
    if (tangents->phidd_q)
        status |= tangents->phidd_q(t, r->q, r->qd, w->qdd, r->p, w->phidd_q);
    if (tangents->phidd_qd)
        status |= tangents->phidd_qd(t, r->q, r->qd, r->p, w->phidd_qd);
    return status == NCGEN_OK ? NCGEN_OK : NCGEN_DOMAIN;
}

/* change = -[K; Phidd_q] dq - [C; Phidd_qd] dqd. */
static void find_change(const ncgen_run *r)
{
    const ncgen_tangents *tangents = r->dynamics->tangents;
    const ncgen_slopes *w = r->slopes;
    for (int i = 0; i < r->n + r->m; ++i)
        w->change[i] = 0;
    add_product(&tangents->stiffness_pattern, w->stiffness, w->dq, -1, w->change);
    add_product(&tangents->damping_pattern, w->damping, w->dqd, -1, w->change);
    add_product(&tangents->phidd_q_pattern, w->phidd_q, w->dq, -1, w->change + r->n);
    add_product(&tangents->phidd_qd_pattern, w->phidd_qd, w->dqd, -1, w->change + r->n);
}

/* Coordinate partitioning -------------------------------------------------------------------------------------- */

/* dzdd = (R'M R)^-1 R'(change of forces - M b), where b is what the rows demand of the dependent accelerations. */
static void independent_change(ncgen_run *r, ncgen_real *column, int stride)
{
    const ncgen_dynamics *d = r->dynamics;
    ncgen_partitioning *part = r->partitioning;
    const ncgen_slopes *w = r->slopes;
    find_change(r);
    ncgen_partitioning_solve(r, w->change + r->n, part->column);
    for (int i = 0; i < r->n; ++i)
        part->bias[i] = 0;
    for (int i = 0; i < d->n_dependent; ++i)
        part->bias[d->dependent[i]] = part->column[i];
    ncgen_times_mass(r, part->mass, part->bias, part->missing);
    for (int i = 0; i < r->n; ++i)
        part->missing[i] = w->change[i] - part->missing[i];
    for (int z = 0; z < r->nz; ++z)
        part->bias[z] = ncgen_dot(r->n, part->R + (size_t)z * (size_t)r->n, part->missing);
    ncgen_solve_positive_again(r->nz, part->reduced, part->bias);
    for (int z = 0; z < r->nz; ++z)
        column[z * stride] = part->bias[z];
}

/* dqd of a change dq of position with the independent velocities as they are. */
static void velocity_change(ncgen_run *r)
{
    const ncgen_dynamics *d = r->dynamics;
    ncgen_partitioning *part = r->partitioning;
    const ncgen_slopes *w = r->slopes;
    ncgen_real *rate = w->change + r->n;
    for (int i = 0; i < r->m; ++i)
        rate[i] = 0;
    add_product(&r->dynamics->tangents->phidd_qd_pattern, w->phidd_qd, w->dq, -R(0.5), rate);
    ncgen_partitioning_solve(r, rate, part->column);
    for (int i = 0; i < r->n; ++i)
        w->dqd[i] = 0;
    for (int i = 0; i < d->n_dependent; ++i)
        w->dqd[d->dependent[i]] = part->column[i];
}

int ncgen_partitioning_jacobian(ncgen_run *r, ncgen_scalar t, ncgen_real *y, ncgen_real *jacobian)
{
    ncgen_partitioning *part = r->partitioning;
    const ncgen_slopes *w = r->slopes;
    const int nz = r->nz, n = r->n;
    int status = ncgen_partitioning_position(r, t, y);
    if (status == NCGEN_OK)
        status = ncgen_partitioning_accelerate(r, t, y);
    if (status != NCGEN_OK)
        return status;
    ncgen_copy(n, part->bias, w->qdd);
    for (int z = 0; z < nz; ++z)
        for (int i = 0; i < n; ++i)
            w->qdd[i] += part->R[z * n + i] * part->out[n + z];
    ncgen_times_mass(r, part->mass, w->qdd, part->missing);
    for (int i = 0; i < n; ++i)
        part->missing[i] = part->force[i] - part->missing[i];
    ncgen_partitioning_multipliers(r, part->missing, w->lam);
    if ((status = find_slopes(r, t)) != NCGEN_OK)
        return status;
    for (int z = 0; z < nz; ++z) {
        for (int i = 0; i < n; ++i)
            w->dq[i] = 0;
        ncgen_copy(n, part->R + (size_t)z * (size_t)n, w->dqd);
        independent_change(r, jacobian + z, 2 * nz);
        ncgen_copy(n, part->R + (size_t)z * (size_t)n, w->dq);
        velocity_change(r);
        independent_change(r, jacobian + nz + z, 2 * nz);
    }
    return NCGEN_OK;
}

/* All coordinates ---------------------------------------------------------------------------------------------- */

/* dqdd of one change dq, dqd, with the terms that Baumgarte's stabilisation adds to the rows. */
static int full_change(ncgen_run *r, ncgen_real *column, int stride)
{
    const ncgen_options *o = r->options;
    ncgen_constrained *all = r->constrained;
    const ncgen_slopes *w = r->slopes;
    const ncgen_scalar damping = o->damping * o->frequency, stiffness = o->frequency * o->frequency;
    find_change(r);
    if (stiffness > 0) {
        ncgen_real *combined = w->dq; /* not needed any more */
        add_product(&r->dynamics->tangents->phidd_qd_pattern, w->phidd_qd, w->dq, -damping, w->change + r->n);
        for (int i = 0; i < r->n; ++i)
            combined[i] = stiffness * w->dq[i] + 2 * damping * w->dqd[i];
        add_product(&r->model->phi_q_pattern, all->kkt.values + all->n_mass, combined, -1, w->change + r->n);
    }
    ncgen_copy(r->n + r->m, w->change, all->right);
    const int status = ncgen_constrained_solve(r);
    for (int i = 0; i < r->n; ++i)
        column[i * stride] = all->solution[i];
    return status;
}

int ncgen_constrained_jacobian(ncgen_run *r, ncgen_scalar t, ncgen_real *y, ncgen_real *jacobian)
{
    ncgen_constrained *all = r->constrained;
    const ncgen_slopes *w = r->slopes;
    const int n = r->n;
    ncgen_copy(n, y, r->qd);
    ncgen_copy(n, y + n, r->q);
    all->jacobian_is_there = 0;
    int status = ncgen_constrained_accelerations(r, t);
    if (status == NCGEN_OK)
        status = ncgen_constrained_factor(r);
    ncgen_copy(n, all->solution, w->qdd);
    ncgen_copy(r->m, all->solution + n, w->lam);
    if (status == NCGEN_OK)
        status = find_slopes(r, t);
    for (int j = 0; j < 2 * n && status == NCGEN_OK; ++j) {
        for (int i = 0; i < n; ++i) {
            w->dqd[i] = i == j;
            w->dq[i] = n + i == j;
        }
        status = full_change(r, jacobian + j, 2 * n);
    }
    return status;
}
