/* ncgen_block.c: the state derivative of NCGEN_LANES states, and what becomes of them. */
#include "ncgen_block.h"
#include "ncgen_rows.h"

enum {
    NEWTON_LIMIT = 40,
    CHAINS = 4 /* of operations that do not wait for each other */
};

/* After a Newton step from a residual below this, the next one is at rounding: it need not be looked at. */
static const double quadratic_limit = 1e-7;

static ncgen_real *take(ncgen_real **workspace, int count)
{
    ncgen_real *part = *workspace;
    *workspace += count;
    return part;
}

size_t ncgen_block_workspace(const ncgen_model *model, const ncgen_dynamics *dynamics)
{
    const size_t n = (size_t)model->n_coordinates, nz = (size_t)dynamics->n_independent, ny = 2 * nz + 1;
    const size_t numbers = (size_t)model->n_parameters + 6 * n + nz + 2 + (size_t)dynamics->n_dependent + 2 * (size_t)model->n_rows +
                           (3 + WIDTH) * ny;
    return NCGEN_LANES * numbers;
}

void ncgen_block_lay_out(ncgen_block *r, ncgen_real *workspace)
{
    r->n = r->model->n_coordinates;
    r->nz = r->dynamics->n_independent;
    r->ny = 2 * r->nz + 1;
    r->given = r->dynamics->closed_form ? r->n : 0;
    r->given_end = r->dynamics->closed_form ? 0 : r->n;
    for (int i = 0; i < r->nz && r->dynamics->closed_form; ++i) {
        const int place = r->dynamics->independent[i];
        r->given = place < r->given ? place : r->given;
        r->given_end = place >= r->given_end ? place + 1 : r->given_end;
    }
    r->first_together = r->dynamics->closed_form && r->dynamics->n_dependent ? r->dynamics->dependent[0] : -1;
    for (int i = 0; i < r->dynamics->n_dependent && r->first_together >= 0; ++i)
        r->first_together = r->dynamics->dependent[i] == r->dynamics->dependent[0] + i ? r->first_together : -1;
    r->output_start = 0;
    r->p = take(&workspace, r->model->n_parameters);
    r->q = take(&workspace, r->n);
    r->out = take(&workspace, r->n + r->nz + 2);
    r->step = take(&workspace, r->dynamics->n_dependent);
    r->phi = take(&workspace, r->model->n_rows);
    r->per_size = take(&workspace, r->model->n_rows);
    for (int i = 0; i < r->model->n_rows; ++i)
        r->per_size[i] = ncgen_splat(1.0 / r->dynamics->row_sizes[i]);
    r->start_q = take(&workspace, r->n);
    r->start_qd = take(&workspace, r->n);
    r->end_q = take(&workspace, r->n);
    r->end_qd = take(&workspace, r->n);
    r->y = take(&workspace, r->ny);
    r->new_y = take(&workspace, r->ny);
    r->at = take(&workspace, r->ny);
    r->k[0] = take(&workspace, WIDTH * r->ny);
    for (int s = 1; s < WIDTH; ++s)
        r->k[s] = r->k[0] + s * r->ny;
}

int ncgen_block_is_stopped(ncgen_common *shared)
{
    int stopped;
    ATOMIC(read)
    stopped = shared->stopped;
    return stopped;
}

void ncgen_block_report(ncgen_common *shared)
{
    long arrived;
    ATOMIC(read)
    arrived = shared->completed;
    shared->attempts_left = shared->options->progress(shared->options->context, (double)arrived / (double)shared->count);
    if (shared->attempts_left <= 0) {
        ATOMIC(write)
        shared->stopped = 1;
    }
}

void ncgen_block_end(ncgen_block *r, ncgen_mask lanes, int status)
{
    long ended = 0;
    lanes &= r->running;
    for (int lane = 0; lane < NCGEN_LANES; ++lane)
        if (lanes[lane]) {
            r->to.status[lane] = status;
            ended += 1;
        }
    r->running &= ~lanes;
    if (ended && status == NCGEN_OK) {
        ATOMIC(update)
        r->shared->completed += ended;
    }
}

void ncgen_block_fail(ncgen_block *r, ncgen_mask lanes)
{
    ncgen_block_end(r, lanes & r->not_finite, NCGEN_DOMAIN);
    ncgen_block_end(r, lanes & r->singular, NCGEN_SINGULAR);
    ncgen_block_end(r, lanes, NCGEN_NOT_CONVERGED);
}

void ncgen_block_report_attempt(ncgen_block *r)
{
    ncgen_common *shared = r->shared;
    if (r->reports && --shared->attempts_left <= 0)
        ncgen_block_report(shared);
    if (ncgen_block_is_stopped(shared))
        ncgen_block_end(r, r->running, NCGEN_INTERRUPTED);
}

/* The larger of two numbers that are not negative, in every lane: their bits ascend as they do, and those of what is no number are above. */
static ncgen_real larger(ncgen_real a, ncgen_real b)
{
    return ncgen_select((ncgen_mask)a > (ncgen_mask)b, a, b);
}

/* The largest |phi| relative to the rows' sizes; not a number if one of them is not. */
static ncgen_real residual(const ncgen_block *r)
{
    ncgen_real largest[CHAINS] = {{0}};
    for (int first = 0; first < r->model->n_rows; first += CHAINS)
        for (int k = 0; k < CHAINS && first + k < r->model->n_rows; ++k)
            largest[k] = larger(NCGEN_ABS(r->phi[first + k]) * r->per_size[first + k], largest[k]);
    for (int k = 1; k < CHAINS; ++k)
        largest[0] = larger(largest[k], largest[0]);
    return largest[0];
}

/* Lanes in which all of some numbers are finite: an infinite one or a NaN makes their sum the same. */
static ncgen_mask sensible(int count, const ncgen_real *x)
{
    ncgen_real sum[CHAINS] = {{0}};
    int first = 0;
    for (; first + CHAINS <= count; first += CHAINS)
        for (int k = 0; k < CHAINS; ++k)
            sum[k] += x[first + k];
    for (; first < count; ++first)
        sum[0] += x[first];
    for (int k = 1; k < CHAINS; ++k)
        sum[0] += sum[k];
    return sum[0] - sum[0] == 0.0;
}

/* The dependent coordinates of some lanes as newton wrote them in closed form. */
static ncgen_mask take_places(ncgen_block *r, ncgen_mask lanes)
{
    const ncgen_dynamics *d = r->dynamics;
#pragma GCC unroll 4
    for (int i = 0; i < d->n_dependent; ++i)
        r->q[d->dependent[i]] = ncgen_select(lanes, r->step[i], r->q[d->dependent[i]]);
    return lanes;
}

ncgen_mask ncgen_block_close(ncgen_block *r, ncgen_real t, ncgen_mask open)
{
    const ncgen_dynamics *d = r->dynamics;
    ncgen_mask solved = {0};
    if (r->first_together >= 0 && ncgen_all(open)) /* newton writes them where they belong; it reads none of them */
        return d->newton(t, r->q, r->p, r->q + r->first_together) == NCGEN_OK ? open : solved;
    for (int iteration = 0; iteration <= NEWTON_LIMIT && ncgen_any(open); ++iteration) {
        if (d->newton(t, r->q, r->p, r->step) != NCGEN_OK)
            break;
        if (d->closed_form)
            return take_places(r, open);
        const ncgen_real size = residual(r);
        if (iteration == 0)
            r->not_finite |= open & ~(size == size);
        open &= size < max_residual;
        for (int i = 0; i < d->n_dependent; ++i)
            r->q[d->dependent[i]] += (ncgen_real)((ncgen_mask)r->step[i] & open);
        /* As with one state a step is taken even where the guess is good: a position in closed form has phi = 0. */
        const ncgen_mask near = open & (size <= quadratic_limit);
        solved |= near;
        open &= ~near;
    }
    return solved;
}

ncgen_mask ncgen_block_accelerate(ncgen_block *r, ncgen_real t, const ncgen_real *zd, ncgen_mask closed)
{
    if (!ncgen_any(closed) || r->dynamics->acceleration(t, r->q, zd, r->p, r->out) != NCGEN_OK)
        return closed & 0;
    const ncgen_mask regular = closed & (r->out[r->n + r->nz + 1] < max_residual);
    const ncgen_mask finite = sensible(r->n + r->nz + 1 - r->output_start, r->out + r->output_start);
    r->singular |= closed & ~regular;
    r->not_finite |= regular & ~finite;
    return regular & finite;
}

ncgen_mask ncgen_block_evaluate(ncgen_block *r, ncgen_real t, const ncgen_real *y, ncgen_mask wanted)
{
    const ncgen_real ahead = t - r->start_t;
    for (int i = 0; i < r->n && !r->dynamics->closed_form; ++i)
        r->q[i] = r->start_q[i] + ahead * r->start_qd[i];
    for (int i = 0; i < r->nz; ++i)
        r->q[r->dynamics->independent[i]] = y[r->nz + i];
    return ncgen_block_accelerate(r, t, y, ncgen_block_close(r, t, wanted));
}

ncgen_mask ncgen_block_derivative(ncgen_block *r, ncgen_real t, const ncgen_real *y, ncgen_real *yd, ncgen_mask wanted)
{
    const ncgen_mask good = ncgen_block_evaluate(r, t, y, wanted);
    for (int i = 0; i < r->nz; ++i) {
        yd[i] = r->out[r->n + i];
        yd[r->nz + i] = r->out[r->dynamics->independent[i]];
    }
    yd[2 * r->nz] = r->out[r->n + r->nz];
    return good;
}

void ncgen_block_accept(ncgen_block *r, ncgen_mask lanes, ncgen_real t, const ncgen_real *y, const ncgen_real *yd)
{
    for (int i = 0; i < r->n; ++i) {
        r->start_q[i] = ncgen_select(lanes, r->q[i], r->start_q[i]);
        r->start_qd[i] = ncgen_select(lanes, r->out[i], r->start_qd[i]);
    }
    for (int i = 0; i < r->ny; ++i) {
        r->y[i] = ncgen_select(lanes, y[i], r->y[i]);
        r->k[0][i] = ncgen_select(lanes, yd[i], r->k[0][i]);
    }
    r->start_t = ncgen_select(lanes, t, r->start_t);
    for (int lane = 0; lane < NCGEN_LANES; ++lane)
        if (lanes[lane])
            r->to.reached[lane] = t[lane];
}

void ncgen_block_write(ncgen_block *r, ncgen_mask lanes, const ncgen_real *q, const ncgen_real *qd, ncgen_real work)
{
    for (int lane = 0; lane < NCGEN_LANES; ++lane) {
        if (!lanes[lane])
            continue;
        const size_t row = (size_t)lane * (size_t)r->to.n_times + (size_t)r->row[lane];
        for (int i = 0; i < r->n; ++i) {
            r->to.q[row * (size_t)r->n + (size_t)i] = q[i][lane];
            r->to.qd[row * (size_t)r->n + (size_t)i] = qd[i][lane];
        }
        r->to.work[row] = work[lane];
        r->row[lane] += 1;
    }
}

void ncgen_block_begin(ncgen_block *r, int count, const double *q, const double *zd, const double *p, int p_stride)
{
    const double t = r->to.times[0];
    const ncgen_mask none = {0};
    for (int lane = 0; lane < NCGEN_LANES; ++lane) {
        r->running[lane] = lane < count ? -1 : 0;
        r->row[lane] = 0;
        r->stiff[lane].speaking = r->stiff[lane].against = 0;
    }
    ncgen_spread(r->model->n_parameters, count, p_stride, p, r->p);
    ncgen_spread(r->n, count, r->n, q, r->start_q);
    ncgen_spread(r->nz, count, r->nz, zd, r->y);
    for (int i = 0; i < r->nz; ++i)
        r->y[r->nz + i] = r->start_q[r->dynamics->independent[i]];
    r->y[2 * r->nz] = ncgen_splat(0.0);
    for (int i = 0; i < r->n; ++i)
        r->start_qd[i] = ncgen_splat(0.0);
    r->start_t = ncgen_splat(t);
    r->not_finite = r->singular = none;
    ncgen_block_fail(r, ~ncgen_block_derivative(r, r->start_t, r->y, r->k[0], r->running));
    r->amplification = r->out[r->n + r->nz + 1];
    ncgen_block_accept(r, r->running, r->start_t, r->y, r->k[0]);
    ncgen_block_write(r, r->running, r->start_q, r->start_qd, r->y[2 * r->nz]);
}
