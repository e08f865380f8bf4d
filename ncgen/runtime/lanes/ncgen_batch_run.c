/* ncgen_batch_run.c: calls for many states: blocks of NCGEN_LANES of them, shared by threads. */
#include "ncgen_batch_run.h"
#include "ncgen_block.h"
#include "ncgen_rows.h"

/* More fixed steps than a number can count. */
static const double countless = 1e15;

size_t ncgen_batch_run_workspace(const ncgen_model *model, const ncgen_dynamics *dynamics)
{
    return ncgen_block_workspace(model, dynamics);
}

static int is_calling_thread(void)
{
#ifdef _OPENMP
    return omp_get_thread_num() == 0;
#else
    return 1;
#endif
}

/* The share of the workspace of the thread that asks. */
static ncgen_real *own_workspace(const ncgen_model *model, const ncgen_dynamics *dynamics, double *workspace)
{
#ifdef _OPENMP
    return (ncgen_real *)workspace + (size_t)omp_get_thread_num() * (ncgen_block_workspace(model, dynamics) / NCGEN_LANES);
#else
    (void)model, (void)dynamics;
    return (ncgen_real *)workspace;
#endif
}

/* Is the method one of those here, with steps that can be counted and times that ascend? */
static int possible(const ncgen_options *options, int n_times, const double *times)
{
    if (n_times < 2 || options->method < 0 || options->method >= N_TABLEAUS || !tableaus[options->method].stages)
        return 0;
    const int fixed = tableaus[options->method].n_errors == 0;
    for (int i = 1; i < n_times; ++i) {
        const double span = times[i] - times[i - 1];
        if (!(span > 0) || (fixed && !(options->max_step > 0 && span / options->max_step < countless)))
            return 0;
    }
    return 1;
}

/* A block of states from `first` on, unless the call has been ended. */
static void simulate_block(ncgen_block *r, int count, const double *q, const double *zd, const double *p, int p_stride)
{
    for (int lane = 0; lane < count; ++lane) {
        r->to.reached[lane] = r->to.times[0];
        r->to.steps[lane] = 0;
        r->to.status[lane] = NCGEN_INTERRUPTED;
    }
    if (ncgen_block_is_stopped(r->shared))
        return;
    ncgen_block_begin(r, count, q, zd, p, p_stride);
    ncgen_block_run(r, &tableaus[r->options->method]);
}

/* The calling thread has nothing left to do, and listens until the others have nothing left, either. */
static void wait_for_others(ncgen_common *shared)
{
#ifdef _OPENMP
    for (int idle = 0; !ncgen_block_is_stopped(shared);) {
        ATOMIC(read)
        idle = shared->idle;
        if (idle == omp_get_num_threads())
            return;
        ncgen_block_report(shared);
    }
#else
    (void)shared;
#endif
}

int ncgen_batch_simulate(const ncgen_model *model, const ncgen_dynamics *dynamics, const ncgen_options *options, long count,
                         const double *q, const double *zd, const double *p, int p_stride, const int *break_start,
                         const double *breaks, int n_times, const double *times, double *out_q, double *out_qd, double *out_work,
                         int *status, long *steps, double *reached, int threads, double *workspace)
{
    const long n = model->n_coordinates, nz = dynamics->n_independent, blocks = (count + NCGEN_LANES - 1) / NCGEN_LANES;
    ncgen_common shared = {.options = options, .count = count, .attempts_left = options->attempts_left};
    if (!possible(options, n_times, times))
        return NCGEN_ARGUMENT;
    (void)threads;
#ifdef _OPENMP
#pragma omp parallel num_threads(threads)
#endif
    {
        ncgen_block r = {.model = model, .dynamics = dynamics, .options = options, .shared = &shared};
        r.reports = options->progress && is_calling_thread();
        ncgen_block_lay_out(&r, own_workspace(model, dynamics, workspace));
#ifdef _OPENMP
#pragma omp for schedule(dynamic) nowait
#endif
        for (long b = 0; b < blocks; ++b) {
            const long first = b * NCGEN_LANES, left = count - first;
            r.to = (ncgen_output){n_times, times, out_q + first * n_times * n, out_qd + first * n_times * n,
                            out_work + first * n_times, status + first, steps + first, reached + first,
                            break_start ? break_start + first : NULL, breaks};
            simulate_block(&r, left < NCGEN_LANES ? (int)left : NCGEN_LANES, q + first * n, zd + first * nz, p + first * p_stride, p_stride);
        }
        ATOMIC(update)
        shared.idle += 1;
        if (r.reports)
            wait_for_others(&shared);
    }
    return shared.stopped ? NCGEN_INTERRUPTED : NCGEN_OK;
}

void ncgen_batch_accelerate(const ncgen_model *model, const ncgen_dynamics *dynamics, const ncgen_options *options, long count,
                            const double *q, const double *zd, const double *p, int p_stride, double t, double *out_q,
                            double *out_qd, double *out_zdd, int *status, int threads, double *workspace)
{
    const long n = model->n_coordinates, nz = dynamics->n_independent, blocks = (count + NCGEN_LANES - 1) / NCGEN_LANES;
    const ncgen_mask none = {0};
    (void)threads;
#ifdef _OPENMP
#pragma omp parallel num_threads(threads)
#endif
    {
        ncgen_block r = {.model = model, .dynamics = dynamics, .options = options};
        ncgen_block_lay_out(&r, own_workspace(model, dynamics, workspace));
        r.output_start = out_qd ? 0 : r.n;
        const int in_place = out_q == q && r.first_together >= 0, changed = in_place ? r.first_together : 0;
        const int changed_end = in_place ? changed + dynamics->n_dependent : r.n;
#ifdef _OPENMP
#pragma omp for schedule(static)
#endif
        for (long b = 0; b < blocks; ++b) {
            const long first = b * NCGEN_LANES, left = count - first;
            const int block = left < NCGEN_LANES ? (int)left : NCGEN_LANES;
            ncgen_spread(r.given_end - r.given, block, n, q + first * n + r.given, r.q + r.given);
            ncgen_spread(r.nz, block, nz, zd + first * nz, r.y);
            ncgen_spread(model->n_parameters, block, p_stride, p + first * p_stride, r.p);
            if (left >= 2 * NCGEN_LANES) {
                ncgen_prefetch(NCGEN_LANES * n, q + (first + NCGEN_LANES) * n);
                ncgen_prefetch(NCGEN_LANES * nz, zd + (first + NCGEN_LANES) * nz);
                ncgen_prefetch(NCGEN_LANES * p_stride, p + (first + NCGEN_LANES) * p_stride);
                ncgen_prefetch(NCGEN_LANES * nz, out_zdd + (first + NCGEN_LANES) * nz);
            }
            r.not_finite = r.singular = none;
            ncgen_mask good = ncgen_block_accelerate(&r, ncgen_splat(t), r.y, ncgen_block_close(&r, ncgen_splat(t), ~none));
            for (int i = 0; i < r.nz; ++i)
                r.singular |= good & ~(NCGEN_ABS(r.out[r.n + i]) < max_residual);
            good &= ~r.singular;
            ncgen_collect_part(changed_end - changed, block, n, r.q + changed, out_q + first * n + changed);
            if (out_qd)
                ncgen_collect(r.n, block, r.out, out_qd + first * n);
            ncgen_collect(r.nz, block, r.out + r.n, out_zdd + first * nz);
            const int all_good = ncgen_all(good);
            for (int lane = 0; lane < block; ++lane)
                status[first + lane] = all_good || good[lane] ? NCGEN_OK
                                       : r.not_finite[lane] ? NCGEN_DOMAIN
                                       : r.singular[lane]  ? NCGEN_SINGULAR
                                                           : NCGEN_NOT_CONVERGED;
        }
    }
}
