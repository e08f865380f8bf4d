/* ncgen_run.c: the entry of the runtime: workspace, the first state, and the choice of formalism and integrator. */
#include "ncgen_explicit.h"
#include "ncgen_implicit.h"
#include "ncgen_jacobian.h"
#include "ncgen_method.h"
#include "ncgen_partitioning.h"
#include "ncgen_projection.h"
#include "ncgen_steppers.h"

typedef struct parts {
    ncgen_partitioning partitioning;
    ncgen_constrained constrained;
    ncgen_slopes slopes;
    ncgen_stepping stepping;
    ncgen_implicit implicit;
    ncgen_correction correction;
} parts;

/* The parts of a run and its workspace; with an empty space this only counts. */
static int lay_out(ncgen_run *r, parts *w)
{
    r->n = r->model->n_coordinates;
    r->m = r->model->n_rows;
    r->nz = r->dynamics->n_independent;
    r->start_q = ncgen_take(&r->space, r->n);
    r->start_qd = ncgen_take(&r->space, r->n);
    if (r->options->formalism == NCGEN_COORDINATE_PARTITIONING)
        ncgen_partitioning_layout(r, &w->partitioning);
    else
        ncgen_constrained_layout(r, &w->constrained);
    r->y = ncgen_take(&r->space, r->ny);
    if (r->dynamics->tangents)
        ncgen_slopes_layout(r, &w->slopes);
    if (ncgen_is_implicit(r->options))
        ncgen_implicit_layout(r, &w->stepping, &w->implicit);
    else if (ncgen_is_stepper(r->options))
        ncgen_steppers_layout(r, &w->stepping, &w->correction);
    else
        ncgen_explicit_layout(r, &w->stepping);
    return NCGEN_OK;
}

/* A run without workspace. */
static void describe(ncgen_run *r, const ncgen_model *model, const ncgen_dynamics *dynamics, const ncgen_options *options)
{
    r->model = model;
    r->dynamics = dynamics;
    r->options = options;
    r->space.base = NULL;
    r->space.used = 0;
    r->integers = NULL;
    r->partitioning = NULL;
    r->constrained = NULL;
    r->slopes = NULL;
    r->settle = NULL;
    r->accept = NULL;
    r->settles_stages = 1;
    r->careful = r->rows = 0;
    r->patience = options->patience > 1 ? options->patience : 1;
}

static void clear_statistics(ncgen_statistics *s, ncgen_scalar t)
{
    s->steps = s->rejected = s->repeated = s->evaluations = s->newton_steps = 0;
    s->factorisations = s->perturbed = s->refinements = s->jacobians = s->fallbacks = 0;
    s->stopped = 0;
    s->stiff = 0;
    s->largest_projection = 0;
    s->t = s->tried = t;
}

size_t ncgen_workspace(const ncgen_model *model, const ncgen_dynamics *dynamics, const ncgen_options *options)
{
    parts w;
    ncgen_run r;
    describe(&r, model, dynamics, options);
    lay_out(&r, &w);
    return r.space.used;
}

/* Is every instant after the one before? They are not where the clock's own number is too large to tell them apart. */
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
    r->rounding = 1;
    for (volatile ncgen_scalar more = 2; more > 1; more = 1 + r->rounding / 2)
        r->rounding /= 2;
    r->start_t = r->times[0];
    for (int i = 0; i < r->n; ++i) {
        r->start_q[i] = q[i];
        r->start_qd[i] = 0;
    }
    if (r->partitioning) {
        ncgen_partitioning_begin(r, velocities);
        r->jacobian = ncgen_partitioning_jacobian;
        return NCGEN_OK;
    }
    r->settle = r->options->project ? ncgen_settle : NULL;
    r->state = ncgen_projected_state;
    r->jacobian = ncgen_constrained_jacobian;
    return ncgen_constrained_begin(r, velocities);
}

int ncgen_dynamics_jacobian(const ncgen_model *model, const ncgen_dynamics *dynamics, const ncgen_options *options,
                            ncgen_scalar t, const ncgen_real *p, const ncgen_real *q, const ncgen_real *velocities,
                            ncgen_real *jacobian, ncgen_real *workspace, int *integers)
{
    parts w;
    ncgen_statistics statistics;
    ncgen_run r;
    clear_statistics(&statistics, t);
    describe(&r, model, dynamics, options);
    r.p = p;
    r.statistics = &statistics;
    r.space.base = workspace;
    r.integers = integers;
    r.times = &t;
    r.n_times = 1;
    if (!dynamics->tangents)
        return NCGEN_ARGUMENT;
    const int status = begin(&r, &w, q, velocities);
    return status == NCGEN_OK ? r.jacobian(&r, t, r.y, jacobian) : status;
}

int ncgen_simulate(const ncgen_model *model, const ncgen_dynamics *dynamics, const ncgen_options *options,
                   const ncgen_real *p, const ncgen_real *q, const ncgen_real *velocities, int n_times,
                   const ncgen_scalar *times, ncgen_real *out_q, ncgen_real *out_qd, ncgen_real *out_work, int *rows,
                   ncgen_statistics *statistics, ncgen_real *workspace, int *integers)
{
    *rows = 0;
    if (n_times < 2 || !ncgen_is_possible(model, dynamics, options) || !is_ascending(n_times, times))
        return NCGEN_ARGUMENT;
    parts w;
    ncgen_run r;
    clear_statistics(statistics, times[0]);
    describe(&r, model, dynamics, options);
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
    if (status == NCGEN_OK && ncgen_is_stepper(options))
        status = ncgen_steppers(&r, &w.stepping, &w.correction);
    else if (status == NCGEN_OK && options->method == NCGEN_RADAU)
        status = ncgen_radau(&r, &w.stepping, &w.implicit);
    else if (status == NCGEN_OK && ncgen_is_implicit(options))
        status = ncgen_trapezoidal(&r, &w.stepping, &w.implicit);
    else if (status == NCGEN_OK)
        status = ncgen_explicit(&r, &w.stepping);
    *rows = r.rows;
    ncgen_copy(r.n, r.start_q, out_q + (size_t)n_times * (size_t)r.n);
    ncgen_copy(r.n, r.start_qd, out_qd + (size_t)n_times * (size_t)r.n);
    out_work[n_times] = r.start_work;
    return status == NCGEN_PIVOT && r.rows == n_times ? NCGEN_OK : status; /* other coordinates have nothing left to do */
}
