/* ncgen_batch_run.c: coordinate partitioning with explicit Runge-Kutta methods, NCGEN_LANES states side by side. The method
 * is that of ncgen_partitioning.c and ncgen_explicit.c; what is a branch there is a mask here.
 */
#include "ncgen_batch_run.h"
#include "ncgen_rows.h"

#include "ncgen_math.h"

#define R(x) ((ncgen_scalar)(x##L))
#include "ncgen_tableaus.h"

#ifdef _OPENMP
#include <omp.h>
#define PRAGMA(text) _Pragma(#text)
#define ATOMIC(how) PRAGMA(omp atomic how)
#else
#define ATOMIC(how)
#endif

enum {
    NEWTON_LIMIT = 40,
    REPEAT_LIMIT = 8,
    CHAINS = 4 /* of operations that do not wait for each other */
};

/* A residual or an amplification that leaves no digit of the solution. */
static const double broken_down = 1e30;

/* After a Newton step from a residual below this, the next one is at rounding: it need not be looked at. */
static const double nearly_converged = 1e-7;

/* More fixed steps than a number can count. */
static const double countless = 1e15;

/* What the threads of a call have in common. The calling one alone asks the watch; the others look at what it was told. */
typedef struct common {
    const ncgen_options *options;
    long count;    /* states */
    long arrived;  /* states that have */
    long patience; /* steps until the watch is asked again */
    int idle;      /* threads that have nothing left to do */
    int stopped;   /* 1: the watch has ended the call */
} common;

/* Where results go. */
typedef struct output {
    int n_times;
    const double *times;
    double *q, *qd, *work;
    int *status;
    long *steps;
    double *reached;
} output;

/* A block of states. Masks say which lanes a function is asked about, and which of them succeeded. */
typedef struct run {
    const ncgen_model *model;
    const ncgen_dynamics *dynamics;
    const ncgen_options *options;
    output to;               /* of the block's first state */
    int n, nz, ny;
    int given, given_end;    /* the coordinates from which positions are closed: the independent ones and those between, or all */
    int together;            /* the first of the dependent coordinates if they follow one another and are found in closed form, else -1 */
    common *shared;
    int listens;             /* 1: in the thread that asks the watch */
    ncgen_mask running;
    ncgen_mask senseless;    /* lanes in which the last evaluation met what is not a number */
    ncgen_mask singular;     /* lanes in which it met a singular position */
    int row[NCGEN_LANES];    /* how many rows are written */
    ncgen_real *p, *q, *out; /* out = qd, zdd, power, amplification of the last evaluation */
    ncgen_real *step, *phi;  /* one behind the other: an emitted Newton step writes both */
    ncgen_real *per_size;    /* one over the rows' sizes: vectors divide slowly */
    ncgen_real *start_q, *start_qd, *end_q, *end_qd;
    ncgen_real start_t, amplification;
    ncgen_real *y, *new_y, *at, *k[WIDTH];
} run;

static ncgen_real at_most(ncgen_real x, double limit)
{
    return ncgen_select(x > limit, ncgen_splat(limit), x);
}

static ncgen_real *take(ncgen_real **workspace, int count)
{
    ncgen_real *part = *workspace;
    *workspace += count;
    return part;
}

size_t ncgen_batch_run_workspace(const ncgen_model *model, const ncgen_dynamics *dynamics)
{
    const size_t n = (size_t)model->n_coordinates, nz = (size_t)dynamics->n_independent, ny = 2 * nz + 1;
    const size_t numbers = (size_t)model->n_parameters + 6 * n + nz + 2 + (size_t)dynamics->n_dependent + 2 * (size_t)model->n_rows +
                           (3 + WIDTH) * ny;
    return NCGEN_LANES * numbers;
}

static void lay_out(run *r, ncgen_real *workspace)
{
    r->n = r->model->n_coordinates;
    r->nz = r->dynamics->n_independent;
    r->ny = 2 * r->nz + 1;
    r->given = r->dynamics->closes ? r->n : 0;
    r->given_end = r->dynamics->closes ? 0 : r->n;
    for (int i = 0; i < r->nz && r->dynamics->closes; ++i) {
        const int place = r->dynamics->independent[i];
        r->given = place < r->given ? place : r->given;
        r->given_end = place >= r->given_end ? place + 1 : r->given_end;
    }
    r->together = r->dynamics->closes && r->dynamics->n_dependent ? r->dynamics->dependent[0] : -1;
    for (int i = 0; i < r->dynamics->n_dependent && r->together >= 0; ++i)
        r->together = r->dynamics->dependent[i] == r->dynamics->dependent[0] + i ? r->together : -1;
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
    for (int s = 0; s < WIDTH; ++s)
        r->k[s] = take(&workspace, r->ny);
}

static int is_stopped(common *shared)
{
    int stopped;
    ATOMIC(read)
    stopped = shared->stopped;
    return stopped;
}

/* Ask the watch, which may end the call. */
static void ask(common *shared)
{
    long arrived;
    ATOMIC(read)
    arrived = shared->arrived;
    shared->patience = shared->options->watch(shared->options->context, (double)arrived / (double)shared->count);
    if (shared->patience <= 0) {
        ATOMIC(write)
        shared->stopped = 1;
    }
}

/* Lanes end with a status; those that have ended already keep theirs. */
static void end(run *r, ncgen_mask lanes, int status)
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
        r->shared->arrived += ended;
    }
}

/* Lanes end because their last evaluation failed. */
static void fail(run *r, ncgen_mask lanes)
{
    end(r, lanes & r->senseless, NCGEN_DOMAIN);
    end(r, lanes & r->singular, NCGEN_SINGULAR);
    end(r, lanes, NCGEN_NOT_CONVERGED);
}

/* Before every step that is tried: may the block go on? */
static void listen(run *r)
{
    common *shared = r->shared;
    if (r->listens && --shared->patience <= 0)
        ask(shared);
    if (is_stopped(shared))
        end(r, r->running, NCGEN_INTERRUPTED);
}

/* The larger of two numbers that are not negative, in every lane: their bits ascend as they do, and those of what is no number are above. */
static ncgen_real larger(ncgen_real a, ncgen_real b)
{
    return ncgen_select((ncgen_mask)a > (ncgen_mask)b, a, b);
}

/* The largest |phi| relative to the rows' sizes; not a number if one of them is not. */
static ncgen_real residual(const run *r)
{
    ncgen_real largest[CHAINS] = {{0}};
    for (int first = 0; first < r->model->n_rows; first += CHAINS)
        for (int k = 0; k < CHAINS && first + k < r->model->n_rows; ++k)
            largest[k] = larger(NCGEN_ABS(r->phi[first + k]) * r->per_size[first + k], largest[k]);
    for (int k = 1; k < CHAINS; ++k)
        largest[0] = larger(largest[k], largest[0]);
    return largest[0];
}

/* Lanes in which all of some numbers are finite: an infinite one or one that is none makes their sum the same. */
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
static ncgen_mask take_places(run *r, ncgen_mask lanes)
{
    const ncgen_dynamics *d = r->dynamics;
#pragma GCC unroll 4
    for (int i = 0; i < d->n_dependent; ++i)
        r->q[d->dependent[i]] = ncgen_select(lanes, r->step[i], r->q[d->dependent[i]]);
    return lanes;
}

/* The dependent coordinates of some lanes at time t, from r->q on, which has the independent ones; those that close. */
static ncgen_mask close_position(run *r, ncgen_real t, ncgen_mask open)
{
    const ncgen_dynamics *d = r->dynamics;
    ncgen_mask solved = {0};
    if (r->together >= 0 && ncgen_all(open)) /* newton writes them where they belong; it reads none of them */
        return d->newton(t, r->q, r->p, r->q + r->together) == NCGEN_OK ? open : solved;
    for (int iteration = 0; iteration <= NEWTON_LIMIT && ncgen_any(open); ++iteration) {
        if (d->newton(t, r->q, r->p, r->step) != NCGEN_OK)
            break;
        if (d->closes)
            return take_places(r, open);
        const ncgen_real size = residual(r);
        if (iteration == 0)
            r->senseless |= open & ~(size == size);
        open &= size < broken_down;
        for (int i = 0; i < d->n_dependent; ++i)
            r->q[d->dependent[i]] += (ncgen_real)((ncgen_mask)r->step[i] & open);
        /* As with one state a step is taken even where the guess is good: what closes at once says that phi is 0. */
        const ncgen_mask near = open & (size <= nearly_converged);
        solved |= near;
        open &= ~near;
    }
    return solved;
}

/* Accelerations of the lanes that are closed, in r->out; those that have them. */
static ncgen_mask accelerate(run *r, ncgen_real t, const ncgen_real *zd, ncgen_mask closed)
{
    if (!ncgen_any(closed) || r->dynamics->acceleration(t, r->q, zd, r->p, r->out) != NCGEN_OK)
        return closed & 0;
    const ncgen_mask regular = closed & (r->out[r->n + r->nz + 1] < broken_down);
    const ncgen_mask finite = sensible(r->n + r->nz + 1, r->out);
    r->singular |= closed & ~regular;
    r->senseless |= regular & ~finite;
    return regular & finite;
}

/* q in r->q, extrapolated from the last state and closed; velocities and accelerations in r->out. */
static ncgen_mask evaluate(run *r, ncgen_real t, const ncgen_real *y, ncgen_mask wanted)
{
    const ncgen_real ahead = t - r->start_t;
    for (int i = 0; i < r->n && !r->dynamics->closes; ++i)
        r->q[i] = r->start_q[i] + ahead * r->start_qd[i];
    for (int i = 0; i < r->nz; ++i)
        r->q[r->dynamics->independent[i]] = y[r->nz + i];
    return accelerate(r, t, y, close_position(r, t, wanted));
}

static ncgen_mask derivative(run *r, ncgen_real t, const ncgen_real *y, ncgen_real *yd, ncgen_mask wanted)
{
    const ncgen_mask good = evaluate(r, t, y, wanted);
    for (int i = 0; i < r->nz; ++i) {
        yd[i] = r->out[r->n + i];
        yd[r->nz + i] = r->out[r->dynamics->independent[i]];
    }
    yd[2 * r->nz] = r->out[r->n + r->nz];
    return good;
}

/* The last evaluation and y become the state of some lanes, with the derivative yd. */
static void accept(run *r, ncgen_mask lanes, ncgen_real t, const ncgen_real *y, const ncgen_real *yd)
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

/* Lanes whose independent coordinates have become bad: errors grow in the others more than at the start. */
static ncgen_mask degraded(const run *r, ncgen_mask lanes)
{
    return lanes & (r->out[r->n + r->nz + 1] > r->options->growth * r->amplification);
}

static void write_rows(run *r, ncgen_mask lanes, const ncgen_real *q, const ncgen_real *qd, ncgen_real work)
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

/* The mean square of x in units of the tolerance at y and b. */
static ncgen_real mean_square(const run *r, const ncgen_real *x, const ncgen_real *b)
{
    ncgen_real sum = ncgen_splat(0.0);
    for (int i = 0; i < r->ny; ++i) {
        const ncgen_real u = NCGEN_ABS(r->y[i]), v = NCGEN_ABS(b[i]);
        const double atol = r->options->atol * (r->options->sizes ? r->options->sizes[i] : 1.0);
        const ncgen_real scaled = x[i] / (atol + r->options->rtol * ncgen_select(u > v, u, v));
        sum += scaled * scaled;
    }
    return sum / (double)r->ny;
}

/* A first step from the sizes of y, yd and an estimate of ydd (Hairer, Norsett & Wanner, II.4). */
static ncgen_real first_step(run *r, int order, double span)
{
    const ncgen_real d0 = NCGEN_SQRT(mean_square(r, r->y, r->y)), d1 = NCGEN_SQRT(mean_square(r, r->k[0], r->y));
    const ncgen_mask tiny = (d0 < 1e-5) | (d1 < 1e-5);
    const ncgen_real guess = at_most(ncgen_select(tiny, ncgen_splat(1e-6), 0.01 * d0 / d1), span);
    for (int i = 0; i < r->ny; ++i)
        r->new_y[i] = r->y[i] + guess * r->k[0][i];
    const ncgen_mask good = derivative(r, r->start_t + guess, r->new_y, r->k[1], r->running);
    for (int i = 0; i < r->ny; ++i)
        r->k[2][i] = r->k[1][i] - r->k[0][i];
    const ncgen_real d2 = NCGEN_SQRT(mean_square(r, r->k[2], r->y)) / guess;
    const ncgen_real largest = ncgen_select(d1 > d2, d1, d2), root = ncgen_splat(1.0 / (order + 1));
    ncgen_real better = ncgen_select(largest <= 1e-15, guess * 1e-3, NCGEN_POW(0.01 / largest, root));
    better = ncgen_select(better > 100.0 * guess, 100.0 * guess, better);
    return ncgen_select(good, at_most(better, span), guess * 0.01);
}

/* sum = sum over the stages of weight times slope. */
static void combine(const run *r, int stages, const double *weights, ncgen_real *sum)
{
    for (int i = 0; i < r->ny; ++i)
        sum[i] = ncgen_splat(0.0);
    for (int j = 0; j < stages; ++j)
        for (int i = 0; i < r->ny && fabs(weights[j]) > 0; ++i)
            sum[i] += weights[j] * r->k[j][i];
}

static void advance(const run *r, ncgen_real h, int stages, const double *weights, ncgen_real *y_new)
{
    combine(r, stages, weights, y_new);
    for (int i = 0; i < r->ny; ++i)
        y_new[i] = r->y[i] + h * y_new[i];
}

/* One trial step of the lanes that run: new_y, and the slope there. Those that have one. */
static ncgen_mask trial_step(run *r, const tableau *method, ncgen_real t, ncgen_real h)
{
    const ncgen_mask none = {0};
    ncgen_mask good = r->running;
    r->senseless = r->singular = none;
    for (int s = 1; s <= method->stages; ++s) {
        advance(r, h, s, method->a[s], r->new_y);
        good = derivative(r, t + method->c[s] * h, r->new_y, r->k[s], good);
    }
    return good;
}

/* Estimate k of the error over h, squared. */
static ncgen_real estimate(run *r, const tableau *method, int k)
{
    combine(r, method->stages + 1, method->errors[k], r->at);
    return mean_square(r, r->at, r->new_y);
}

static ncgen_real error_of(run *r, const tableau *method, ncgen_real h)
{
    const ncgen_real error = estimate(r, method, 0);
    if (method->n_errors == 1)
        return h * NCGEN_SQRT(error);
    const ncgen_real both = error + 0.01 * estimate(r, method, 1);
    return ncgen_select(both > 0.0, h * error / NCGEN_SQRT(both), both);
}

/* The stages that only the interpolant needs. */
static ncgen_mask prepare_interpolant(run *r, const tableau *method, ncgen_real t, ncgen_real h, ncgen_mask wanted)
{
    for (int s = method->stages + 1; s < method->width; ++s) {
        advance(r, h, s, method->a[s], r->at);
        wanted = derivative(r, t + method->c[s] * h, r->at, r->k[s], wanted);
    }
    return wanted;
}

/* r->at: the state at t + s h, inside a step whose end is new_y. */
static void interpolate(run *r, const tableau *method, ncgen_real h, ncgen_real s)
{
    for (int i = 0; i < r->ny; ++i)
        r->at[i] = ncgen_splat(0.0);
    for (int j = 0; j < method->width; ++j) {
        ncgen_real weight = ncgen_splat(0.0);
        for (int k = method->n_dense - 1; k >= 0; --k)
            weight = (weight + method->dense[k][j]) * (k % 2 ? 1.0 - s : s);
        for (int i = 0; i < r->ny; ++i)
            r->at[i] += weight * r->k[j][i];
    }
    for (int i = 0; i < r->ny; ++i)
        r->at[i] = r->y[i] + h * r->at[i];
}

/* Rows of the grid inside the last step of some lanes, from t over h; y and the slopes are still those of the step. */
static void write_inside(run *r, const tableau *method, ncgen_mask lanes, ncgen_real t, ncgen_real h, ncgen_real t_new)
{
    for (int round = 0;; ++round) {
        ncgen_real time = t_new;
        for (int lane = 0; lane < NCGEN_LANES; ++lane)
            if (r->row[lane] < r->to.n_times)
                time[lane] = r->to.times[r->row[lane]];
        const ncgen_mask inside = lanes & r->running & (time < t_new);
        if (!ncgen_any(inside))
            return;
        if (round == 0)
            fail(r, inside & ~prepare_interpolant(r, method, t, h, inside));
        interpolate(r, method, h, (time - t) / h);
        const ncgen_mask good = evaluate(r, time, r->at, inside & r->running);
        write_rows(r, inside & good, r->q, r->out, r->at[2 * r->nz]);
        fail(r, inside & ~good);
    }
}

/* What follows a successful step of some lanes: rows inside it, and the new state is the present one. */
static void accept_step(run *r, const tableau *method, ncgen_mask lanes, ncgen_real t, ncgen_real h, ncgen_real t_new)
{
    /* Newton's method for rows inside starts from the old state, so that state has to stand until they are written. */
    for (int i = 0; i < r->n; ++i) {
        r->end_q[i] = r->q[i];
        r->end_qd[i] = r->out[i];
    }
    write_inside(r, method, lanes, t, h, t_new);
    for (int i = 0; i < r->n; ++i) {
        r->q[i] = r->end_q[i];
        r->out[i] = r->end_qd[i];
    }
    lanes &= r->running;
    accept(r, lanes, t_new, r->new_y, r->k[method->stages]);
    for (int lane = 0; lane < NCGEN_LANES; ++lane)
        if (lanes[lane])
            r->to.steps[lane] += 1;
    const ncgen_mask ended = lanes & (t_new >= r->to.times[r->to.n_times - 1]);
    write_rows(r, ended, r->start_q, r->start_qd, r->y[2 * r->nz]);
    end(r, ended, NCGEN_OK);
}

/* Lanes that have taken as many steps as they may. */
static ncgen_mask exhausted(const run *r)
{
    ncgen_mask lanes = {0};
    for (int lane = 0; lane < NCGEN_LANES; ++lane)
        if (r->running[lane] && r->options->max_steps > 0 && r->to.steps[lane] >= r->options->max_steps)
            lanes[lane] = -1;
    return lanes;
}

static void run_adaptive(run *r, const tableau *method)
{
    const double stop = r->to.times[r->to.n_times - 1], longest = r->options->max_step;
    const ncgen_real power = ncgen_splat(-1.0 / (method->order + 1));
    ncgen_real t = r->start_t, h = first_step(r, method->order, stop - r->to.times[0]);
    ncgen_mask rejected = {0}, repeats = {0};
    for (listen(r); ncgen_any(r->running); listen(r)) {
        if (longest > 0)
            h = at_most(h, longest);
        const ncgen_mask last = t + h >= stop;
        h = ncgen_select(last, stop - t, h);
        fail(r, ~(t + h > t));
        const ncgen_mask stepped = trial_step(r, method, t, h);
        const ncgen_real error = error_of(r, method, h);
        const ncgen_mask good = stepped & (error < broken_down);
        const ncgen_mask failed = r->running & ~good, accepted = r->running & good & (error < 1.0);
        const ncgen_mask too_large = r->running & good & ~accepted;

        repeats = (repeats - failed) & ~accepted; /* a mask is -1 */
        fail(r, failed & (repeats > REPEAT_LIMIT));
        rejected = (rejected | too_large) & ~failed;
        ncgen_real factor = at_most(ncgen_select(error > 0.0, 0.9 * NCGEN_POW(error, power), ncgen_splat(10.0)), 10.0);
        factor = ncgen_select(factor < 0.2, ncgen_splat(0.2), factor);
        factor = ncgen_select(accepted & rejected, at_most(factor, 1.0), factor);
        factor = ncgen_select(failed, ncgen_splat(0.25), factor);
        rejected &= ~accepted;

        const ncgen_real t_new = ncgen_select(last, ncgen_splat(stop), t + h);
        if (ncgen_any(accepted)) {
            const ncgen_mask bad = degraded(r, accepted) & (t_new < stop);
            accept_step(r, method, accepted, t, h, t_new);
            end(r, bad, NCGEN_PIVOT);
            end(r, exhausted(r), NCGEN_NOT_CONVERGED);
        }
        t = ncgen_select(accepted, t_new, t);
        h *= factor;
    }
}

static void fixed_step(run *r, const tableau *method, ncgen_real t, ncgen_real h)
{
    listen(r);
    fail(r, ~trial_step(r, method, t, h));
    accept(r, r->running, t + h, r->new_y, r->k[method->stages]);
    for (int lane = 0; lane < NCGEN_LANES; ++lane)
        if (r->running[lane])
            r->to.steps[lane] += 1;
}

static void run_fixed(run *r, const tableau *method)
{
    const double longest = r->options->max_step, *times = r->to.times;
    for (int row = 1; row < r->to.n_times && ncgen_any(r->running); ++row) {
        const double span = times[row] - times[row - 1];
        long long count = (long long)(span / longest + 0.999999);
        if (count < 1)
            count = 1;
        for (long long i = 0; i < count && ncgen_any(r->running); ++i) {
            const double t = times[row - 1] + (double)i * (span / (double)count);
            fixed_step(r, method, ncgen_splat(t), ncgen_splat(i + 1 == count ? times[row] - t : span / (double)count));
            if (i + 1 == count)
                write_rows(r, r->running, r->start_q, r->start_qd, r->y[2 * r->nz]);
            if (i + 1 < count || row + 1 < r->to.n_times)
                end(r, degraded(r, r->running), NCGEN_PIVOT);
        }
    }
    end(r, r->running, NCGEN_OK);
}

/* The states of a block, from their rows, and the first row of the grid; lanes beyond `count` repeat the last one and are
 * not running. */
static void begin(run *r, int count, const double *q, const double *zd, const double *p, int p_stride)
{
    const double t = r->to.times[0];
    const ncgen_mask none = {0};
    for (int lane = 0; lane < NCGEN_LANES; ++lane) {
        r->running[lane] = lane < count ? -1 : 0;
        r->row[lane] = 0;
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
    r->senseless = r->singular = none;
    fail(r, ~derivative(r, r->start_t, r->y, r->k[0], r->running));
    r->amplification = r->out[r->n + r->nz + 1];
    accept(r, r->running, r->start_t, r->y, r->k[0]);
    write_rows(r, r->running, r->start_q, r->start_qd, r->y[2 * r->nz]);
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
    return (ncgen_real *)workspace + (size_t)omp_get_thread_num() * (ncgen_batch_run_workspace(model, dynamics) / NCGEN_LANES);
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
static void simulate_block(run *r, int count, const double *q, const double *zd, const double *p, int p_stride)
{
    const tableau *method = &tableaus[r->options->method];
    for (int lane = 0; lane < count; ++lane) {
        r->to.reached[lane] = r->to.times[0];
        r->to.steps[lane] = 0;
        r->to.status[lane] = NCGEN_INTERRUPTED;
    }
    if (is_stopped(r->shared))
        return;
    begin(r, count, q, zd, p, p_stride);
    if (method->n_errors == 0)
        run_fixed(r, method);
    else
        run_adaptive(r, method);
}

/* The calling thread has nothing left to do, and listens until the others have nothing left, either. */
static void wait_for_others(common *shared)
{
#ifdef _OPENMP
    for (int idle = 0; !is_stopped(shared);) {
        ATOMIC(read)
        idle = shared->idle;
        if (idle == omp_get_num_threads())
            return;
        ask(shared);
    }
#else
    (void)shared;
#endif
}

int ncgen_batch_simulate(const ncgen_model *model, const ncgen_dynamics *dynamics, const ncgen_options *options, long count,
                         const double *q, const double *zd, const double *p, int p_stride, int n_times, const double *times,
                         double *out_q, double *out_qd, double *out_work, int *status, long *steps, double *reached,
                         int threads, double *workspace)
{
    const long n = model->n_coordinates, nz = dynamics->n_independent, blocks = (count + NCGEN_LANES - 1) / NCGEN_LANES;
    common shared = {.options = options, .count = count, .patience = options->patience};
    if (!possible(options, n_times, times))
        return NCGEN_ARGUMENT;
    (void)threads;
#ifdef _OPENMP
#pragma omp parallel num_threads(threads)
#endif
    {
        run r = {.model = model, .dynamics = dynamics, .options = options, .shared = &shared};
        r.listens = options->watch && is_calling_thread();
        lay_out(&r, own_workspace(model, dynamics, workspace));
#ifdef _OPENMP
#pragma omp for schedule(dynamic) nowait
#endif
        for (long b = 0; b < blocks; ++b) {
            const long first = b * NCGEN_LANES, left = count - first;
            r.to = (output){n_times, times, out_q + first * n_times * n, out_qd + first * n_times * n,
                            out_work + first * n_times, status + first, steps + first, reached + first};
            simulate_block(&r, left < NCGEN_LANES ? (int)left : NCGEN_LANES, q + first * n, zd + first * nz, p + first * p_stride, p_stride);
        }
        ATOMIC(update)
        shared.idle += 1;
        if (r.listens)
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
        run r = {.model = model, .dynamics = dynamics, .options = options};
        lay_out(&r, own_workspace(model, dynamics, workspace));
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
                ncgen_foresee(NCGEN_LANES * n, q + (first + NCGEN_LANES) * n);
                ncgen_foresee(NCGEN_LANES * nz, zd + (first + NCGEN_LANES) * nz);
                ncgen_foresee(NCGEN_LANES * p_stride, p + (first + NCGEN_LANES) * p_stride);
                ncgen_foresee(NCGEN_LANES * nz, out_zdd + (first + NCGEN_LANES) * nz);
            }
            r.senseless = r.singular = none;
            ncgen_mask good = accelerate(&r, ncgen_splat(t), r.y, close_position(&r, ncgen_splat(t), ~none));
            for (int i = 0; i < r.nz; ++i)
                r.singular |= good & ~(NCGEN_ABS(r.out[r.n + i]) < broken_down);
            good &= ~r.singular;
            ncgen_collect(r.n, block, r.q, out_q + first * n);
            if (out_qd)
                ncgen_collect(r.n, block, r.out, out_qd + first * n);
            ncgen_collect(r.nz, block, r.out + r.n, out_zdd + first * nz);
            const int all_good = ncgen_all(good);
            for (int lane = 0; lane < block; ++lane)
                status[first + lane] = all_good || good[lane] ? NCGEN_OK
                                       : r.senseless[lane] ? NCGEN_DOMAIN
                                       : r.singular[lane]  ? NCGEN_SINGULAR
                                                           : NCGEN_NOT_CONVERGED;
        }
    }
}
