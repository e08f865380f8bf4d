/* ncgen_run.c: the entry of the runtime: workspace, the first state, and the choice of formalism and integrator. */
#include "ncgen_explicit.h"
#include "ncgen_implicit_run.h"
#include "ncgen_method.h"
#include "ncgen_projection.h"
#ifndef NCGEN_WITHOUT_PARTITIONING
#include "ncgen_partitioning.h"
#else /* runs are those of formalisms over all coordinates */
typedef int ncgen_partitioning;
#define ncgen_partitioning_layout(r, w) ((void)(w))
#define ncgen_partitioning_begin(r, velocities) ((void)(velocities))
#endif

typedef struct parts {
    ncgen_partitioning partitioning;
    ncgen_constrained constrained;
    ncgen_stepping stepping;
    ncgen_implicit_workspace implicit;
    int is_implicit;
    ncgen_real *inspected; /* values of phi_q, and of nu, for an inspection */
} parts;

/* The parts of a run and its workspace; with an empty space this only counts. */
static void lay_out(ncgen_run *r, parts *w)
{
    ncgen_state_layout(r);
    if (r->options->formalism == NCGEN_COORDINATE_PARTITIONING)
        ncgen_partitioning_layout(r, &w->partitioning);
    else
        ncgen_constrained_layout(r, &w->constrained);
    r->y = ncgen_take(&r->space, r->ny);
    w->is_implicit = ncgen_implicit_run_layout(r, &w->stepping, &w->implicit);
    if (!w->is_implicit)
        ncgen_explicit_layout(r, &w->stepping);
    w->inspected = r->options->inspection ? ncgen_take(&r->space, ncgen_nonzeros(&r->model->phi_q_pattern) + r->m) : NULL;
}

size_t ncgen_workspace(const ncgen_model *model, const ncgen_dynamics *dynamics, const ncgen_options *options)
{
    parts w;
    ncgen_run r;
    ncgen_describe(&r, model, dynamics, options);
    lay_out(&r, &w);
    return r.space.used;
}

/* Is every time after the one before? They are not where the clock's own number is too large to distinguish them. */
static int is_ascending(int n_times, const ncgen_scalar *times)
{
    for (int i = 1; i < n_times; ++i)
        if (!(times[i] > times[i - 1]))
            return 0;
    return 1;
}

/* Everything ready for a run from the position q. */
static int begin(ncgen_run *r, parts *w, const ncgen_real *q, const ncgen_real *velocities)
{
    lay_out(r, w);
    ncgen_begin(r);
    for (int i = 0; i < r->n; ++i) {
        r->start[i] = q[i];
        r->start[r->n + i] = 0;
    }
    const int status = ncgen_choose(r);
    if (r->partitioning) {
        ncgen_partitioning_begin(r, velocities);
        return status;
    }
    r->project_state = r->options->project ? ncgen_project_state : NULL;
    r->state = ncgen_projected_state;
    return status == NCGEN_OK ? ncgen_constrained_begin(r, velocities) : status;
}

int ncgen_dynamics_jacobian(const ncgen_model *model, const ncgen_dynamics *dynamics, const ncgen_options *options,
                            ncgen_scalar t, const ncgen_real *p, const ncgen_real *q, const ncgen_real *velocities,
                            ncgen_real *jacobian, ncgen_real *workspace, int *integers)
{
    parts w;
    ncgen_statistics statistics;
    ncgen_run r;
    ncgen_describe(&r, model, dynamics, options);
    r.p = p;
    r.statistics = &statistics;
    r.space.base = workspace;
    r.integers = integers;
    r.times = &t;
    r.n_times = 1;
    if (!dynamics->tangents)
        return NCGEN_ARGUMENT;
    const int status = begin(&r, &w, q, velocities);
    if (!r.jacobian)
        return NCGEN_ARGUMENT;
    return status == NCGEN_OK ? r.jacobian(&r, t, r.y, jacobian) : status;
}

/* What velocities leave of phi_q qd = nu, relative to row_sizes, in *remainder if it is the largest so far. Velocities of rest satisfy rows
 * without drivers and rolling conditions. */
static int look_for_remainder(const ncgen_run *r, ncgen_scalar t, const ncgen_real *q, const ncgen_real *qd, ncgen_real *phi_q,
                              ncgen_real *remainder)
{
    ncgen_real *nu = phi_q + ncgen_nonzeros(&r->model->phi_q_pattern);
    int status = NCGEN_OK, is_moved = r->dynamics->rolling != NULL;
    if (!r->model->nu && !is_moved)
        return NCGEN_OK;
    for (int i = 0; i < r->m; ++i)
        nu[i] = 0;
    if (r->model->nu)
        status = r->model->nu(t, q, r->p, nu);
    for (int i = 0; i < r->m; ++i)
        is_moved |= nu[i] != 0;
    if (status != NCGEN_OK || !is_moved)
        return status;
    status = ncgen_phi_q(r, t, q, phi_q);
    for (int i = 0; i < r->m; ++i) {
        const ncgen_real rest = NCGEN_ABS(ncgen_row_times(&r->model->phi_q_pattern, phi_q, qd, i) - nu[i]) / r->dynamics->row_sizes[i];
        if (rest > *remainder || rest != rest)
            *remainder = rest;
    }
    return status;
}

/* The inspection of a run that has written all its rows; times: of these. */
static void inspect(const ncgen_run *r, const ncgen_scalar *times, ncgen_real *phi_q, ncgen_inspection *result)
{
    ncgen_real first = 0, change = 0, kinetic = 0, remainder = 0;
    for (int k = 0; k < result->count; ++k) {
        const int row = result->rows[k];
        const ncgen_real *q = r->out_q + (size_t)row * (size_t)r->n, *qd = r->out_qd + (size_t)row * (size_t)r->n;
        ncgen_real energies[3] = {0};
        if ((r->model->energy && r->model->energy(times[row], q, qd, r->p, energies) != NCGEN_OK)
            || look_for_remainder(r, times[row], q, qd, phi_q, &remainder) != NCGEN_OK)
            return;
        const ncgen_real total = energies[0] + energies[1] - r->out_work[row];
        first = k ? first : total;
        const ncgen_real away = NCGEN_ABS(total - first);
        if (away > change || away != away)
            change = away;
        kinetic = energies[0] > kinetic ? energies[0] : kinetic;
    }
    result->energy = first;
    result->change = change;
    result->kinetic = kinetic;
    result->remainder = remainder;
    result->is_known = change - change == 0 && remainder - remainder == 0;
}

int ncgen_simulate(const ncgen_model *model, const ncgen_dynamics *dynamics, const ncgen_options *options,
                   const ncgen_real *p, const ncgen_real *q, const ncgen_real *velocities, int n_times,
                   const ncgen_scalar *times, ncgen_real *out_q, ncgen_real *out_qd, ncgen_real *out_work, int *rows,
                   ncgen_statistics *statistics, ncgen_real *workspace, int *integers)
{
    *rows = 0;
    if (options->inspection)
        options->inspection->is_known = 0;
    if (n_times < 2 || !ncgen_is_possible(model, dynamics, options) || !is_ascending(n_times, times))
        return NCGEN_ARGUMENT;
    parts w;
    ncgen_run r;
    ncgen_describe(&r, model, dynamics, options);
    r.p = p;
    r.statistics = statistics;
    r.space.base = workspace;
    r.integers = integers;
    r.n_times = n_times;
    r.times = times;
    r.out_q = out_q;
    r.out_qd = out_qd;
    r.out_work = out_work;
    int status = begin(&r, &w, q, velocities);
    if (status == NCGEN_OK)
        status = w.is_implicit ? ncgen_implicit_run(&r, &w.stepping, &w.implicit) : ncgen_explicit(&r, &w.stepping);
    *rows = r.rows;
    ncgen_copy(r.n, r.start_q, out_q + (size_t)n_times * (size_t)r.n);
    ncgen_copy(r.n, r.start_qd, out_qd + (size_t)n_times * (size_t)r.n);
    out_work[n_times] = r.start_work;
    if (options->inspection && r.rows == n_times && !r.is_driven && !options->parameter_rule)
        inspect(&r, options->row_times ? options->row_times : times, w.inspected, options->inspection);
    return status == NCGEN_PIVOT && r.rows == n_times ? NCGEN_OK : status; /* other coordinates have nothing left to do */
}
