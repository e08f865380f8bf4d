/* ncgen_driven.c: a motion that continues from call to call: a run that is begun anew every time, which costs next to nothing. */
#include "ncgen_driven.h"
#include "ncgen_constrained.h"
#include "ncgen_explicit.h"
#include "ncgen_method.h"
#include "ncgen_projection.h"
#include "ncgen_solution.h"

typedef struct parts {
    ncgen_constrained constrained;
    ncgen_stepping stepping;
} parts;

/* With an empty space this only counts. */
static void lay_out(ncgen_run *r, parts *w)
{
    ncgen_state_layout(r);
    ncgen_constrained_layout(r, &w->constrained);
    r->y = ncgen_take(&r->space, r->ny);
    ncgen_explicit_layout(r, &w->stepping);
}

size_t ncgen_driven_workspace(const ncgen_driven *d)
{
    parts w;
    ncgen_run r;
    ncgen_describe(&r, d->model, d->dynamics, d->options);
    lay_out(&r, &w);
    return r.space.used;
}

/* Everything ready for a run over these times from a moment; NCGEN_ARGUMENT unless it is one of the kind that is meant here. */
static int begin(ncgen_run *r, parts *w, const ncgen_driven *d, const ncgen_options *options, const ncgen_real *p,
                 const ncgen_moment *moment, int n_times, const ncgen_scalar *times, ncgen_statistics *statistics)
{
    if (options->formalism == NCGEN_COORDINATE_PARTITIONING || ncgen_is_stepper(options) || ncgen_is_implicit(options) ||
        !ncgen_is_possible(d->model, d->dynamics, options))
        return NCGEN_ARGUMENT;
    ncgen_describe(r, d->model, d->dynamics, options);
    r->p = p;
    r->statistics = statistics;
    r->space.base = d->workspace;
    r->integers = d->integers;
    r->n_times = n_times;
    r->times = times;
    r->out_q = r->out_qd = r->out_work = NULL;
    lay_out(r, w);
    ncgen_begin(r);
    ncgen_copy(r->n, moment->q, r->start);
    r->project_state = options->project ? ncgen_project_state : NULL;
    r->state = ncgen_projected_state;
    return ncgen_constrained_begin(r, moment->qd);
}

/* The moment as a state and its derivative have it. */
static void keep(const ncgen_run *r, const ncgen_real *q, const ncgen_real *qd, const ncgen_real *derivative, ncgen_moment *moment)
{
    ncgen_copy(r->n, q, moment->q);
    ncgen_copy(r->n, qd, moment->qd);
    ncgen_copy(r->n, derivative, moment->qdd);
    moment->power = derivative[2 * r->n];
}

int ncgen_advance(const ncgen_driven *d, const ncgen_real *p, ncgen_moment *moment, ncgen_scalar t_end, ncgen_statistics *statistics)
{
    const ncgen_scalar times[2] = {moment->t, t_end};
    ncgen_options options = *d->options;
    parts w;
    ncgen_run r;
    if (!(t_end > moment->t))
        return NCGEN_ARGUMENT;
    options.first_step = moment->h;
    int status = begin(&r, &w, d, &options, p, moment, 2, times, statistics);
    if (status == NCGEN_OK)
        status = ncgen_explicit(&r, &w.stepping);
    if (status != NCGEN_OK)
        return status;
    moment->t = statistics->stopped ? r.start_t : t_end;
    moment->h = statistics->next_step;
    moment->work += r.start_work;
    keep(&r, r.start_q, r.start_qd, w.stepping.stage_derivatives[0], moment);
    return NCGEN_OK;
}

void ncgen_advance_each(const ncgen_driven *d, int count, int n_p, const ncgen_real *p, ncgen_moment *moments, ncgen_scalar h,
    int *statuses, ncgen_statistics *statistics)
{
    for (int k = 0; k < count; ++k)
        statuses[k] = ncgen_advance(d, p + (size_t)k * (size_t)n_p, moments + k, moments[k].t + h, statistics);
}

/* The derivative of the state in r->y, and the moment as both have it; the derivative's velocities are those that the joints allow. */
static int evaluate(ncgen_run *r, parts *w, ncgen_moment *moment)
{
    ncgen_real *derivative = w->stepping.stage_derivatives[0];
    const int status = r->derivative(r, moment->t, r->y, derivative);
    if (status != NCGEN_OK)
        return status;
    if (!ncgen_is_finite(r->ny, derivative))
        return NCGEN_SINGULAR;
    keep(r, r->y + r->n, derivative + r->n, derivative, moment);
    return NCGEN_OK;
}

int ncgen_evaluate_moment(const ncgen_driven *d, const ncgen_real *p, ncgen_moment *moment)
{
    parts w;
    ncgen_run r;
    ncgen_statistics statistics;
    const int status = begin(&r, &w, d, d->options, p, moment, 1, &moment->t, &statistics);
    return status == NCGEN_OK ? evaluate(&r, &w, moment) : status;
}

int ncgen_project_moment(const ncgen_driven *d, const ncgen_real *p, ncgen_moment *moment)
{
    parts w;
    ncgen_run r;
    ncgen_statistics statistics;
    int status = begin(&r, &w, d, d->options, p, moment, 1, &moment->t, &statistics);
    if (status == NCGEN_OK)
        status = ncgen_project_state(&r, moment->t, r.y, 2, NULL);
    return status == NCGEN_OK ? evaluate(&r, &w, moment) : status;
}

int ncgen_multipliers(const ncgen_driven *d, const ncgen_real *p, const ncgen_moment *moment, ncgen_real *lam)
{
    parts w;
    ncgen_run r;
    ncgen_statistics statistics;
    int status = begin(&r, &w, d, d->options, p, moment, 1, &moment->t, &statistics);
    if (status != NCGEN_OK)
        return status;
    ncgen_copy(r.n, moment->qd, r.qd);
    status = ncgen_constrained_accelerations(&r, moment->t);
    if (status == NCGEN_OK && !ncgen_is_finite(r.m, w.constrained.solution + r.n))
        status = NCGEN_SINGULAR;
    if (status == NCGEN_OK)
        ncgen_copy(r.m, w.constrained.solution + r.n, lam);
    return status;
}

/* w->right: what is on the right of M and of the rows; the solution is added to `to`. */
static int solve(ncgen_run *r, parts *w, ncgen_real *to)
{
    r->projecting = 1; /* as many digits as there are */
    const int status = ncgen_constrained_solve(r);
    if (status != NCGEN_OK || !ncgen_is_finite(r->n, w->constrained.solution))
        return status != NCGEN_OK ? status : NCGEN_SINGULAR;
    for (int i = 0; i < r->n; ++i)
        to[i] += w->constrained.solution[i];
    return NCGEN_OK;
}

/* Everything ready for a solution at a moment. */
static int factor(ncgen_run *r, parts *w, const ncgen_driven *d, const ncgen_real *p, const ncgen_moment *moment, ncgen_statistics *statistics)
{
    int status = begin(r, w, d, d->options, p, moment, 1, &moment->t, statistics);
    if (status == NCGEN_OK)
        status = ncgen_constrained_matrices(r, moment->t);
    return status == NCGEN_OK ? ncgen_constrained_factor(r) : status;
}

int ncgen_project_velocities(const ncgen_driven *d, const ncgen_real *p, ncgen_moment *moment)
{
    parts w;
    ncgen_run r;
    ncgen_statistics statistics;
    int status = factor(&r, &w, d, p, moment, &statistics);
    if (status == NCGEN_OK && r.model->nu)
        status = r.model->nu(moment->t, r.q, p, w.constrained.nu);
    if (status != NCGEN_OK)
        return status;
    ncgen_row_velocities(&r, w.constrained.kkt.values + w.constrained.n_mass, moment->qd, w.constrained.residual);
    for (int i = 0; i < r.n; ++i)
        w.constrained.right[i] = 0;
    for (int i = 0; i < r.m; ++i)
        w.constrained.right[r.n + i] = (r.model->nu ? w.constrained.nu[i] : 0) - w.constrained.residual[i];
    return solve(&r, &w, moment->qd);
}

int ncgen_respond(const ncgen_driven *d, const ncgen_real *p, const ncgen_moment *moment, const ncgen_real *impulses, ncgen_real *change)
{
    parts w;
    ncgen_run r;
    ncgen_statistics statistics;
    const int status = factor(&r, &w, d, p, moment, &statistics);
    if (status != NCGEN_OK)
        return status;
    ncgen_copy(r.n, impulses, w.constrained.right);
    for (int i = 0; i < r.m; ++i)
        w.constrained.right[r.n + i] = 0;
    for (int i = 0; i < r.n; ++i)
        change[i] = 0;
    return solve(&r, &w, change);
}
