/* ncgen_jacobian.c: how the accelerations change with velocities and positions, exact, from the tangent kernels.
 *
 * M qdd + Phi_q' lam - Q and the second derivative of the rows stay zero when q and qd change, hence
 *   [M Phi_q'; Phi_q 0] [dqdd; dlam] = -[K; Phidd_q] dq - [C; Phidd_qd] dqd.
 * Of independent coordinates z: dq = R dz and Phi_q dqd = -Phid_q dq, where Phid_q is half of Phidd_qd, but of rolling conditions
 * what qdd = qd adds to Phidd_q.
 */
#include "ncgen_constrained.h"
#include "ncgen_jacobian.h"
#include "ncgen_positive.h"
#include "ncgen_solution.h"
#ifndef NCGEN_WITHOUT_PARTITIONING
#include "ncgen_partitioning.h"
#endif

void ncgen_linearisation_layout(ncgen_run *r, ncgen_linearisation *w)
{
    const ncgen_tangents *tangents = r->dynamics->tangents;
    r->linearisation = w;
    w->stiffness = ncgen_take(&r->space, ncgen_nonzeros(&tangents->stiffness_pattern));
    w->damping = ncgen_take(&r->space, ncgen_nonzeros(&tangents->damping_pattern));
    w->phidd_q = ncgen_take(&r->space, ncgen_nonzeros(&tangents->phidd_q_pattern));
    w->phidd_qd = ncgen_take(&r->space, ncgen_nonzeros(&tangents->phidd_qd_pattern));
    w->rolled = r->dynamics->rolling ? ncgen_take(&r->space, ncgen_nonzeros(&tangents->phidd_q_pattern)) : NULL;
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
    const ncgen_linearisation *w = r->linearisation;
    int status = NCGEN_OK;
    if (tangents->stiffness)
        status |= tangents->stiffness(t, r->q, r->qd, w->qdd, w->lam, r->p, w->stiffness);
    if (tangents->damping)
        status |= tangents->damping(t, r->q, r->qd, r->p, w->damping);
    return status == NCGEN_OK ? NCGEN_OK : NCGEN_DOMAIN;
}

/* What qdd = qd adds to Phidd_q. */
static int find_rolled(ncgen_run *r, ncgen_scalar t)
{
    const ncgen_tangents *tangents = r->dynamics->tangents;
    const ncgen_linearisation *w = r->linearisation;
    for (int i = 0; i < r->n; ++i)
        w->dq[i] = 0;
    int status = tangents->phidd_q(t, r->q, r->qd, r->qd, r->p, w->rolled);
    status |= tangents->phidd_q(t, r->q, r->qd, w->dq, r->p, w->phidd_q);
    for (int k = 0; k < ncgen_nonzeros(&tangents->phidd_q_pattern); ++k)
        w->rolled[k] -= w->phidd_q[k];
    return status;
}

/* sum += factor d(Phi_q qd - nu)/dq x. */
static void add_phidd_change(const ncgen_run *r, const ncgen_real *x, ncgen_real factor, ncgen_real *sum)
{
    const ncgen_tangents *tangents = r->dynamics->tangents;
    const ncgen_linearisation *w = r->linearisation;
    for (int i = 0; i < r->m; ++i)
        if (r->dynamics->rolling && r->dynamics->rolling[i])
            sum[i] += factor * ncgen_row_times(&tangents->phidd_q_pattern, w->rolled, x, i);
        else
            sum[i] += factor / 2 * ncgen_row_times(&tangents->phidd_qd_pattern, w->phidd_qd, x, i);
}

/* The four matrices at r->q, r->qd and the accelerations and multipliers in w. */
static int find_linearisation(ncgen_run *r, ncgen_scalar t)
{
    const ncgen_tangents *tangents = r->dynamics->tangents;
    const ncgen_linearisation *w = r->linearisation;
    int status = ncgen_find_tangents(r, t);
    if (tangents->phidd_q && r->dynamics->rolling)
        status |= find_rolled(r, t);
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
    const ncgen_linearisation *w = r->linearisation;
    for (int i = 0; i < r->n + r->m; ++i)
        w->change[i] = 0;
    add_product(&tangents->stiffness_pattern, w->stiffness, w->dq, -1, w->change);
    add_product(&tangents->damping_pattern, w->damping, w->dqd, -1, w->change);
    add_product(&tangents->phidd_q_pattern, w->phidd_q, w->dq, -1, w->change + r->n);
    add_product(&tangents->phidd_qd_pattern, w->phidd_qd, w->dqd, -1, w->change + r->n);
}

#ifndef NCGEN_WITHOUT_PARTITIONING
/* Coordinate partitioning -------------------------------------------------------------------------------------- */

/* dzdd = (R'M R)^-1 R'(change of forces - M b), where b is what the rows demand of the dependent accelerations. */
static void independent_change(ncgen_run *r, ncgen_real *column, int stride)
{
    ncgen_partitioning *part = r->partitioning;
    const ncgen_partition *d = &part->velocities->of;
    const ncgen_linearisation *w = r->linearisation;
    find_change(r);
    ncgen_dependent_solve(&part->dependent, w->change + r->n, part->column);
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
    ncgen_partitioning *part = r->partitioning;
    const ncgen_partition *d = &part->velocities->of;
    const ncgen_linearisation *w = r->linearisation;
    ncgen_real *rate = w->change + r->n;
    for (int i = 0; i < r->m; ++i)
        rate[i] = 0;
    add_phidd_change(r, w->dq, -1, rate);
    ncgen_dependent_solve(&part->dependent, rate, part->column);
    for (int i = 0; i < r->n; ++i)
        w->dqd[i] = 0;
    for (int i = 0; i < d->n_dependent; ++i)
        w->dqd[d->dependent[i]] = part->column[i];
}

/* A column of the derivatives: of the independent velocities, and of positions where these are more than velocities. */
static void write_column(ncgen_run *r, ncgen_real *column, int stride)
{
    const ncgen_partitioning *part = r->partitioning;
    const ncgen_partition *d = &part->positions->of;
    independent_change(r, column, stride);
    for (int i = 0; i < (part->positions == part->velocities ? 0 : d->n_independent); ++i)
        column[(r->nz + i) * stride] = r->linearisation->dqd[d->independent[i]];
}

int ncgen_partitioning_jacobian(ncgen_run *r, ncgen_scalar t, ncgen_real *y, ncgen_real *jacobian)
{
    ncgen_partitioning *part = r->partitioning;
    const ncgen_linearisation *w = r->linearisation;
    const int nz = r->nz, n = r->n, positions = part->positions->of.n_independent, width = nz + positions;
    ncgen_real amplification;
    int status = ncgen_partitioning_position(r, t, y);
    if (status == NCGEN_OK && part->positions != part->velocities)
        status = ncgen_partitioning_place(r, t, &amplification);
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
    ncgen_dependent_multipliers(r, &part->dependent, part->missing, w->lam);
    if ((status = find_linearisation(r, t)) != NCGEN_OK)
        return status;
    for (int z = 0; z < nz; ++z) {
        for (int i = 0; i < n; ++i)
            w->dq[i] = 0;
        ncgen_copy(n, part->R + (size_t)z * (size_t)n, w->dqd);
        write_column(r, jacobian + z, width);
    }
    for (int z = 0; z < positions; ++z) {
        ncgen_copy(n, part->place + (size_t)z * (size_t)n, w->dq);
        velocity_change(r);
        write_column(r, jacobian + nz + z, width);
    }
    return NCGEN_OK;
}

#endif
/* All coordinates ---------------------------------------------------------------------------------------------- */

/* dqdd of one change dq, dqd, with the terms that Baumgarte's stabilisation adds to the rows. */
static int full_change(ncgen_run *r, ncgen_real *column, int stride)
{
    const ncgen_options *o = r->options;
    ncgen_constrained *all = r->constrained;
    const ncgen_linearisation *w = r->linearisation;
    const ncgen_scalar damping = o->damping * o->frequency, stiffness = o->frequency * o->frequency;
    find_change(r);
    if (stiffness > 0) {
        const ncgen_pattern *phi_q = &r->model->phi_q_pattern;
        const ncgen_real *values = all->kkt.values + all->n_mass;
        add_phidd_change(r, w->dq, -2 * damping, w->change + r->n);
        for (int i = 0; i < r->m; ++i) {
            w->change[r->n + i] -= 2 * damping * ncgen_row_times(phi_q, values, w->dqd, i);
            if (!(r->dynamics->rolling && r->dynamics->rolling[i]))
                w->change[r->n + i] -= stiffness * ncgen_row_times(phi_q, values, w->dq, i);
        }
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
    const ncgen_linearisation *w = r->linearisation;
    const int n = r->n;
    ncgen_copy(n, y, r->qd);
    ncgen_copy(n, y + n, r->q);
    all->has_phi_q = 0;
    int status = ncgen_constrained_accelerations(r, t);
    if (status == NCGEN_OK)
        status = ncgen_constrained_factor(r);
    ncgen_copy(n, all->solution, w->qdd);
    ncgen_copy(r->m, all->solution + n, w->lam);
    if (status == NCGEN_OK)
        status = find_linearisation(r, t);
    for (int j = 0; j < 2 * n && status == NCGEN_OK; ++j) {
        for (int i = 0; i < n; ++i) {
            w->dqd[i] = i == j;
            w->dq[i] = n + i == j;
        }
        status = full_change(r, jacobian + j, 2 * n);
    }
    return status;
}
