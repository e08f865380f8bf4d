/* ncgen_block_steps.c: steps of explicit Runge-Kutta methods, every lane at its own time, where its own error allows. */
#include "ncgen_block.h"
#include "ncgen_stage_sums.h"
#include "ncgen_step_rules.h"

enum { REPEAT_LIMIT = 8 };

/* Shorter steps, over the run's length, move no clock: the square of rounding. */
static const double shortest = 4.9e-32;

/* Lanes whose independent coordinates have become bad: errors grow in the others more than at the start. */
static ncgen_mask degraded(const ncgen_block *r, ncgen_mask lanes)
{
    return lanes & (r->out[r->n + r->nz + 1] > r->options->max_growth * r->amplification);
}

static ncgen_real mean_square(const ncgen_block *r, int count, const ncgen_real *x, const ncgen_real *b)
{
    return ncgen_mean_square(r->options, r->ny, count, x, r->y, b);
}

/* A first step, without work as in ncgen_step_error.c. */
static ncgen_real first_step(ncgen_block *r, int order, double span)
{
    const int count = r->ny - 1;
    const ncgen_real d0 = NCGEN_SQRT(mean_square(r, count, r->y, r->y)), d1 = NCGEN_SQRT(mean_square(r, count, r->k[0], r->y));
    const ncgen_real guess = ncgen_first_guess(d0, d1, ncgen_splat(span));
    for (int i = 0; i < r->ny; ++i)
        r->new_y[i] = r->y[i] + guess * r->k[0][i];
    const ncgen_mask good = ncgen_block_derivative(r, r->start_t + guess, r->new_y, r->k[1], r->running);
    for (int i = 0; i < r->ny; ++i)
        r->k[2][i] = r->k[1][i] - r->k[0][i];
    const ncgen_real d2 = NCGEN_SQRT(mean_square(r, count, r->k[2], r->y)) / guess;
    return ncgen_select(good, ncgen_better_guess(guess, d1, d2, order, ncgen_splat(span)), guess * 0.01);
}

static void advance(const ncgen_block *r, ncgen_real h, const tableau_row *row, ncgen_real *y_new)
{
    ncgen_sum_stages(r->ny, row, r->k, r->y, h, y_new);
}

/* One trial step of the lanes that run: new_y, and the derivative there. Those that have one. */
static ncgen_mask trial_step(ncgen_block *r, const tableau *method, ncgen_real t, ncgen_real h)
{
    const ncgen_mask none = {0};
    ncgen_mask good = r->running;
    r->not_finite = r->singular = none;
    for (int s = 1; s <= method->stages; ++s) {
        advance(r, h, &method->a[s], r->new_y);
        good = ncgen_block_derivative(r, t + method->c[s] * h, r->new_y, r->k[s], good);
    }
    return good;
}

/* Estimate k of the error over h, squared. */
static ncgen_real estimate(ncgen_block *r, const tableau *method, int k)
{
    ncgen_sum_stages(r->ny, &method->errors[k], r->k, NULL, ncgen_splat(1.0), r->at);
    return mean_square(r, r->ny, r->at, r->new_y);
}

static ncgen_real error_of(ncgen_block *r, const tableau *method, ncgen_real h)
{
    const ncgen_real error = estimate(r, method, 0);
    if (method->n_errors == 1)
        return h * NCGEN_SQRT(error);
    return ncgen_damped_error(h, error, estimate(r, method, 1));
}

/* The stages that only the interpolant needs. */
static ncgen_mask prepare_interpolant(ncgen_block *r, const tableau *method, ncgen_real t, ncgen_real h, ncgen_mask wanted)
{
    for (int s = method->stages + 1; s < method->width; ++s) {
        advance(r, h, &method->a[s], r->at);
        wanted = ncgen_block_derivative(r, t + method->c[s] * h, r->at, r->k[s], wanted);
    }
    return wanted;
}

/* r->at: the state at t + s h, inside a step whose end is new_y. */
static void interpolate(ncgen_block *r, const tableau *method, ncgen_real h, ncgen_real s)
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

/* Rows of the grid inside the last step of some lanes, from t over h; y and the stage derivatives are still those of the step. */
static void write_inside(ncgen_block *r, const tableau *method, ncgen_mask lanes, ncgen_real t, ncgen_real h, ncgen_real t_new)
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
            ncgen_block_fail(r, inside & ~prepare_interpolant(r, method, t, h, inside));
        interpolate(r, method, h, (time - t) / h);
        const ncgen_mask good = ncgen_block_evaluate(r, time, r->at, inside & r->running);
        ncgen_block_write(r, inside & good, r->q, r->out, r->at[2 * r->nz]);
        ncgen_block_fail(r, inside & ~good);
    }
}

/* Those of some lanes that still run have taken a step, which ends at t_new; returns which these are. */
static ncgen_mask take_step(ncgen_block *r, const tableau *method, ncgen_mask lanes, ncgen_real t_new)
{
    lanes &= r->running;
    ncgen_block_accept(r, lanes, t_new, r->new_y, r->k[method->stages]);
    for (int lane = 0; lane < NCGEN_LANES; ++lane)
        if (lanes[lane])
            r->to.steps[lane] += 1;
    return lanes;
}

/* What follows a successful step of some lanes: rows inside it, and the new state is the present one. */
static void accept_step(ncgen_block *r, const tableau *method, ncgen_mask lanes, ncgen_real t, ncgen_real h, ncgen_real t_new)
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
    lanes = take_step(r, method, lanes, t_new);
    const ncgen_mask ended = lanes & (t_new >= r->to.times[r->to.n_times - 1]);
    ncgen_block_write(r, ended, r->start_q, r->start_qd, r->y[2 * r->nz]);
    ncgen_block_end(r, ended, NCGEN_OK);
}

/* Lanes that have taken as many steps as they may. */
static ncgen_mask exhausted(const ncgen_block *r)
{
    ncgen_mask lanes = {0};
    for (int lane = 0; lane < NCGEN_LANES; ++lane)
        if (r->running[lane] && r->options->max_steps > 0 && r->to.steps[lane] >= r->options->max_steps)
            lanes[lane] = -1;
    return lanes;
}

/* Where the next steps of the lanes have to end at the latest, at a break or at the end; t does not go back from call to call. */
static ncgen_real next_breaks(ncgen_block *r, ncgen_real t, double end)
{
    ncgen_real goal = ncgen_splat(end);
    if (!r->to.break_start)
        return goal;
    for (int lane = 0; lane < NCGEN_LANES; ++lane) {
        if (!r->running[lane])
            continue;
        const int stop = r->to.break_start[lane + 1];
        while (r->ahead[lane] < stop && !(r->to.breaks[r->ahead[lane]] > t[lane]))
            ++r->ahead[lane];
        if (r->ahead[lane] < stop && r->to.breaks[r->ahead[lane]] < end)
            goal[lane] = r->to.breaks[r->ahead[lane]];
    }
    return goal;
}

/* Lanes of those that have taken a step of h to t_new in which Radau would serve better from here on; r->y is still where it began. Every
 * lane is looked at after steps of its own, so that it does not depend on the others. */
static ncgen_mask stiff_lanes(ncgen_block *r, const tableau *method, ncgen_mask lanes, ncgen_real h, ncgen_real t_new)
{
    const double stop = r->to.times[r->to.n_times - 1], cost = ncgen_implicit_cost(r->nz);
    const int last = method->stages;
    const ncgen_stage_pair pair = {h, r->y, r->new_y, r->at, r->k[last - 1], r->k[last]};
    const ncgen_mask far = lanes & (stop - t_new > h * cost);
    ncgen_mask due = {0}, stiff = {0};
    ncgen_real moved;
    for (int lane = 0; lane < NCGEN_LANES; ++lane)
        if (far[lane] && (r->stiff[lane].speaking || (r->to.steps[lane] + 1) % NCGEN_STIFF_EVERY == 0))
            due[lane] = -1;
    if (!ncgen_any(due))
        return stiff;
    advance(r, h, &method->a[last - 1], r->at);
    const double needed = pow(r->options->rtol, 1.0 / (method->order + 1));
    const ncgen_mask speaks = ncgen_is_held_by_stability(r->options, r->ny - 1, &pair, needed, method->stability, &moved);
    for (int lane = 0; lane < NCGEN_LANES; ++lane)
        if (due[lane] && ncgen_counts_as_stiff(&r->stiff[lane], speaks[lane] != 0))
            stiff[lane] = -1;
    return stiff;
}

static void run_adaptive(ncgen_block *r, const tableau *method)
{
    const double stop = r->to.times[r->to.n_times - 1], longest = r->options->max_step, span = stop - r->to.times[0];
    ncgen_real t = r->start_t, h = first_step(r, method->order, span);
    ncgen_mask rejected = {0}, repeats = {0};
    for (ncgen_block_report_attempt(r); ncgen_any(r->running); ncgen_block_report_attempt(r)) {
        if (longest > 0)
            h = ncgen_at_most(h, ncgen_splat(longest));
        const ncgen_real goal = next_breaks(r, t, stop), wanted = h;
        const ncgen_mask last = t + h >= goal;
        h = ncgen_select(last, goal - t, h);
        ncgen_block_fail(r, ~((t + h > t) & (h > shortest * span))); /* as ncgen_is_step */
        const ncgen_mask stepped = trial_step(r, method, t, h);
        const ncgen_real error = error_of(r, method, h);
        const ncgen_mask good = stepped & (error < max_residual);
        const ncgen_mask failed = r->running & ~good, accepted = r->running & good & (error < 1.0);
        const ncgen_mask too_large = r->running & good & ~accepted;

        repeats = (repeats - failed) & ~accepted; /* a mask is -1 */
        ncgen_block_fail(r, failed & (repeats > REPEAT_LIMIT));
        rejected = (rejected | too_large) & ~failed;
        ncgen_real factor = ncgen_at_most(ncgen_length_factor(error, method->order), ncgen_splat(10.0));
        factor = ncgen_select(factor < 0.2, ncgen_splat(0.2), factor);
        factor = ncgen_select(accepted & rejected, ncgen_at_most(factor, ncgen_splat(1.0)), factor);
        factor = ncgen_select(failed, ncgen_splat(0.25), factor);
        rejected &= ~accepted;

        const ncgen_real t_new = ncgen_select(last, goal, t + h);
        if (ncgen_any(accepted)) {
            const ncgen_mask bad = degraded(r, accepted) & (t_new < stop), full = accepted & ~(h < wanted); /* one that is cut short does not count */
            const ncgen_mask stiff = r->options->stop_when_stiff ? stiff_lanes(r, method, full, h, t_new) : (ncgen_mask){0};
            accept_step(r, method, accepted, t, h, t_new);
            ncgen_block_end(r, stiff, NCGEN_STIFF);
            ncgen_block_end(r, bad, NCGEN_PIVOT);
            ncgen_block_end(r, exhausted(r), NCGEN_NOT_CONVERGED);
        }
        t = ncgen_select(accepted, t_new, t);
        const ncgen_mask shortened = accepted & last & (factor >= 1.0) & (h * factor < wanted); /* what cut it short is behind */
        h = ncgen_select(shortened, wanted, h * factor);
    }
}

/* A step of some lanes, which ends at t_new. */
static void fixed_step(ncgen_block *r, const tableau *method, ncgen_real t, ncgen_real h, ncgen_real t_new, ncgen_mask lanes)
{
    ncgen_block_report_attempt(r);
    ncgen_block_fail(r, lanes & ~trial_step(r, method, t, h));
    take_step(r, method, lanes, t_new);
}

/* From one row to the next where there are breaks: what is left up to the next of them is divided into equal steps. */
static void fixed_steps_between_breaks(ncgen_block *r, const tableau *method, double from, double to)
{
    ncgen_real t = ncgen_splat(from);
    for (ncgen_mask lanes = r->running; ncgen_any(lanes); lanes = r->running & (t < to)) {
        const ncgen_real goal = next_breaks(r, t, to);
        ncgen_real h = ncgen_select(lanes, goal - t, ncgen_splat(0.0)), t_new = ncgen_select(lanes, goal, t);
        for (int lane = 0; lane < NCGEN_LANES; ++lane) {
            const long long count = (long long)(h[lane] / r->options->max_step + 0.999999);
            if (count > 1) {
                h[lane] /= (double)count;
                t_new[lane] = t[lane] + h[lane];
            }
        }
        fixed_step(r, method, t, h, t_new, lanes);
        t = t_new;
    }
}

static void run_fixed(ncgen_block *r, const tableau *method)
{
    const double longest = r->options->max_step, *times = r->to.times;
    for (int row = 1; row < r->to.n_times && ncgen_any(r->running); ++row) {
        const double span = times[row] - times[row - 1];
        if (r->to.break_start) {
            fixed_steps_between_breaks(r, method, times[row - 1], times[row]);
            ncgen_block_write(r, r->running, r->start_q, r->start_qd, r->y[2 * r->nz]);
            if (row + 1 < r->to.n_times)
                ncgen_block_end(r, degraded(r, r->running), NCGEN_PIVOT);
            continue;
        }
        long long count = (long long)(span / longest + 0.999999);
        if (count < 1)
            count = 1;
        for (long long i = 0; i < count && ncgen_any(r->running); ++i) {
            const double t = times[row - 1] + (double)i * (span / (double)count);
            const double h = i + 1 == count ? times[row] - t : span / (double)count;
            fixed_step(r, method, ncgen_splat(t), ncgen_splat(h), ncgen_splat(t + h), r->running);
            if (i + 1 == count)
                ncgen_block_write(r, r->running, r->start_q, r->start_qd, r->y[2 * r->nz]);
            if (i + 1 < count || row + 1 < r->to.n_times)
                ncgen_block_end(r, degraded(r, r->running), NCGEN_PIVOT);
        }
    }
    ncgen_block_end(r, r->running, NCGEN_OK);
}

void ncgen_block_run(ncgen_block *r, const tableau *method)
{
    for (int lane = 0; lane < NCGEN_LANES && r->to.break_start; ++lane)
        r->ahead[lane] = r->running[lane] ? r->to.break_start[lane] : 0;
    if (method->n_errors == 0)
        run_fixed(r, method);
    else
        run_adaptive(r, method);
}
