/* ncgen_explicit.c: explicit Runge-Kutta methods: with error control and dense output, or with a fixed step. */
#include "ncgen_explicit.h"
#include "ncgen_constrained.h"
#include "ncgen_method.h"
#include "ncgen_step_rules.h"
#include "ncgen_stiffness.h"

enum { REPEAT_LIMIT = 8 };

void ncgen_explicit_layout(ncgen_run *r, ncgen_stepping *w)
{
    w->new_y = ncgen_take(&r->space, r->ny);
    w->at = ncgen_take(&r->space, r->ny);
    ncgen_take_stages(r, w, tableaus[r->options->method].width);
    w->interpolated = 0;
    w->repeated = w->stiff.speaking = w->stiff.against = w->tiny = 0;
}

/* The derivative of new_y, brought onto the constraints; at the end of a step the statistics get how far it was moved. */
static int projected_derivative(ncgen_run *r, ncgen_stepping *w, ncgen_scalar t, int is_end, ncgen_real *yd)
{
    const ncgen_real largest = r->statistics->largest_projection;
    const int status = ncgen_end_derivative(r, t, w->new_y, w->repeated, yd);
    if (!is_end)
        r->statistics->largest_projection = largest;
    return status;
}

/* Where the tape has a stage of the step under way. */
static ncgen_real *taped_stage(const ncgen_run *r, const tableau *method, int stage)
{
    const ncgen_tape *tape = r->options->tape;
    return tape->states + ((size_t)tape->steps * (size_t)(2 * method->stages + 3) + 2 * (size_t)stage) * (size_t)r->n;
}

static void tape_stage(const ncgen_run *r, const tableau *method, int stage, const ncgen_real *y)
{
    ncgen_real *state = taped_stage(r, method, stage);
    ncgen_copy(r->n, y + r->n, state);
    ncgen_copy(r->n, y, state + r->n);
}

/* The step under way has come to its end. */
static void tape_step(const ncgen_run *r, const tableau *method, ncgen_scalar t, ncgen_scalar t_new, const ncgen_real *y_new)
{
    ncgen_tape *tape = r->options->tape;
    ncgen_copy(r->n, r->constrained->closed_position, taped_stage(r, method, method->stages + 1));
    if (r->statistics->factorisations > 0 && !tape->first_other)
        tape->first_other = tape->steps + 1;
    tape->times[tape->steps] = t;
    tape->times[tape->steps += 1] = t_new;
    tape_stage(r, method, 0, y_new);
}

/* One trial step: new_y, and the derivative there. NCGEN_DOMAIN if these are no numbers.
 *
 * Once it is repeated its stages are projected as well as its end: near a singular position the accelerations of a state that is
 * off the constraints by a truncation error are wrong by that error over the distance, and no step is short enough to pass. */
static int trial_step(ncgen_run *r, ncgen_stepping *w, const tableau *method, ncgen_scalar t, ncgen_scalar h)
{
    const int last = method->stages, projects = r->projecting = w->repeated && r->projects_stages;
    ncgen_tape *tape = r->options->tape;
    if (tape && !(r->constrained && r->constrained->closed_position))
        return NCGEN_ARGUMENT;
    if (tape && tape->steps == tape->capacity)
        return NCGEN_TAPE_FULL;
    if (tape) {
        if (projects && !tape->first_other)
            tape->first_other = tape->steps + 1;
        tape_stage(r, method, 0, r->y);
    }
    for (int s = 1; s <= last; ++s) {
        ncgen_advance_by_stages(r, w, h, &method->a[s], w->new_y);
        if (tape)
            tape_stage(r, method, s, w->new_y);
        const ncgen_scalar at = t + method->c[s] * h;
        int status = ncgen_report_attempt(r, at);
        if (status == NCGEN_OK && (s == last || projects))
            status = projected_derivative(r, w, at, s == last, w->stage_derivatives[s]);
        else if (status == NCGEN_OK)
            status = r->stage_derivative(r, at, w->new_y, w->stage_derivatives[s]);
        if (status != NCGEN_OK)
            return status;
    }
    w->interpolated = 0;
    return ncgen_is_finite(r->ny, w->new_y) && ncgen_is_finite(r->ny, w->stage_derivatives[last]) ? NCGEN_OK : NCGEN_DOMAIN;
}

/* The stages that only the interpolant needs; taken once a step, when first asked for. */
static int prepare_interpolant(ncgen_run *r, ncgen_stepping *w, const tableau *method, ncgen_scalar t, ncgen_scalar h)
{
    for (int s = method->stages + 1; s < method->width && !w->interpolated; ++s) {
        ncgen_advance_by_stages(r, w, h, &method->a[s], w->at);
        const int status = r->derivative(r, t + method->c[s] * h, w->at, w->stage_derivatives[s]);
        if (status != NCGEN_OK)
            return status;
    }
    w->interpolated = 1;
    return NCGEN_OK;
}

/* w->at: the state at t + s h, inside a step whose end is new_y. */
static int interpolate(ncgen_run *r, ncgen_stepping *w, ncgen_scalar t, ncgen_scalar h, ncgen_scalar s)
{
    const tableau *method = &tableaus[r->options->method];
    const int status = prepare_interpolant(r, w, method, t, h);
    if (status != NCGEN_OK)
        return status;
    ncgen_scalar weights[WIDTH];
    for (int j = 0; j < method->width; ++j)
        weights[j] = 0;
    for (int k = method->n_dense - 1; k >= 0; --k) {
        const ncgen_scalar factor = k % 2 ? 1 - s : s, *dense = method->dense[k];
        for (int j = 0; j < method->width; ++j)
            weights[j] = (weights[j] + dense[j]) * factor;
    }
    ncgen_advance_by_weights(r, w, h, method->width, weights, w->at);
    return NCGEN_OK;
}

static int finish_step(ncgen_run *r, ncgen_stepping *w, const tableau *method, ncgen_scalar t, ncgen_scalar t_new)
{
    if (r->options->tape)
        tape_step(r, method, t, t_new, w->new_y);
    const int status = ncgen_grid_step(r, w, t, t_new);
    ncgen_begin_at_stage(w, method->stages);
    return status;
}

/* The derivative at the start of a step whose inputs are not those of the last step's end. */
static int begin_anew(ncgen_run *r, ncgen_stepping *w, ncgen_scalar t)
{
    return r->is_driven ? r->derivative(r, t, r->y, w->stage_derivatives[0]) : NCGEN_OK;
}

/* A trial step and its error over the tolerance that it may have; NCGEN_NOT_CONVERGED where that is beyond all bounds. */
static int try_step(ncgen_run *r, ncgen_stepping *w, const tableau *method, ncgen_scalar t, ncgen_scalar h, ncgen_real *error)
{
    const int status = trial_step(r, w, method, t, h);
    *error = status == NCGEN_OK ? ncgen_step_error(r, w, method, h) / ncgen_tolerance_fraction(r, h) : 0;
    return status == NCGEN_OK && !(*error < R(1.0e30)) ? NCGEN_NOT_CONVERGED : status;
}

static int run_adaptive(ncgen_run *r, ncgen_stepping *w, const tableau *method)
{
    const ncgen_scalar end = r->times[r->n_times - 1];
    ncgen_scalar t = r->times[0];
    ncgen_scalar h = r->options->first_step > 0 ? r->options->first_step : ncgen_first_step(r, w, method->order, t, end - t);
    int repeats = 0, rejected = 0, near = 0, stiff = 0, trouble = NCGEN_STEP_TOO_SHORT;
    while (t < end) {
        if (r->options->max_step > 0 && h > r->options->max_step)
            h = r->options->max_step;
        const ncgen_scalar wanted = h, goal = ncgen_next_break(r, t, end);
        const int last = t + h >= goal;
        if (last)
            h = goal - t;
        if (!ncgen_is_step(r, t, h))
            return trouble;
        w->repeated = repeats || rejected || near;
        ncgen_real error;
        int status = try_step(r, w, method, t, h, &error);
        if (status == NCGEN_INTERRUPTED || status == NCGEN_TAPE_FULL)
            return status;
        if (status != NCGEN_OK) {
            trouble = status;
            if (++repeats > REPEAT_LIMIT)
                return trouble;
            r->statistics->repeated += 1;
            r->uses_exchanges = repeats > 1; /* again: it may be rounding */
            h *= R(0.25);
            continue;
        }
        ncgen_real factor = ncgen_length_factor(error, method->order);
        if (!(error < R(1.0))) {
            r->statistics->rejected += 1;
            r->uses_exchanges = rejected; /* again: it may be rounding */
            rejected = 1;
            h *= factor > R(0.2) ? factor : R(0.2);
            continue;
        }
        /* A repeated step that is far better than its length explains is better since its stages were projected: without that the next one,
         * which is no farther from the singular position, would be refused as well, and steps creep up to it. */
        near = (repeats || rejected) && r->projecting && factor > R(1.5);
        const ncgen_scalar max_factor = rejected ? R(1.0) : R(10.0);
        if (factor > max_factor)
            factor = max_factor;
        if (repeats == 0 && rejected == 0)
            trouble = NCGEN_STEP_TOO_SHORT; /* what was wrong is behind */
        repeats = rejected = 0;
        const ncgen_scalar t_new = last ? goal : t + h;
        stiff = !(h < wanted) && ncgen_is_stiff(r, w, method, h); /* one that is cut short does not count */
        r->statistics->stiff += stiff;
        status = finish_step(r, w, method, t, t_new);
        if (status != NCGEN_OK || r->statistics->stopped)
            return status;
        t = t_new;
        r->statistics->next_step = h = last && factor >= 1 && h * factor < wanted ? wanted : h * factor; /* what cut it short is behind */
        if (t < end && last && (status = begin_anew(r, w, t)) != NCGEN_OK)
            return status;
        if (t < end && ncgen_makes_no_progress(r, w, t))
            return NCGEN_STEP_TOO_SHORT;
        if (stiff && t < end && r->options->stop_when_stiff)
            return NCGEN_STIFF;
    }
    return NCGEN_OK;
}

static int run_fixed(ncgen_run *r, ncgen_stepping *w, const tableau *method)
{
    const ncgen_scalar end = r->times[r->n_times - 1];
    ncgen_scalar from = r->times[0];
    while (from < end) { /* from one row or break to the next */
        int row = r->rows;
        while (row < r->n_times && !(r->times[row] > from))
            ++row;
        const ncgen_scalar to = ncgen_next_break(r, from, row < r->n_times ? r->times[row] : end), span = to - from;
        const ncgen_scalar count = ncgen_step_count(r, span);
        if (!(count > 0))
            return NCGEN_ARGUMENT;
        for (ncgen_scalar i = 0; i < count; i += 1) {
            const ncgen_scalar t = from + i * (span / count);
            const int last = i + 1 >= count;
            const ncgen_scalar t_new = last ? to : from + (i + 1) * (span / count);
            if (!(t_new > t))
                return NCGEN_ARGUMENT;
            int status = trial_step(r, w, method, t, t_new - t);
            if (status == NCGEN_OK)
                status = finish_step(r, w, method, t, t_new);
            if (status == NCGEN_OK && t_new < end)
                status = begin_anew(r, w, t_new);
            if (status != NCGEN_OK || r->statistics->stopped)
                return status;
        }
        from = to;
    }
    return NCGEN_OK;
}

int ncgen_explicit(ncgen_run *r, ncgen_stepping *w)
{
    const tableau *method = &tableaus[r->options->method];
    int status = r->derivative(r, r->times[0], r->y, w->stage_derivatives[0]);
    if (status == NCGEN_OK && !ncgen_is_finite(r->ny, w->stage_derivatives[0]))
        status = NCGEN_DOMAIN;
    if (status == NCGEN_OK)
        (void)ncgen_accept(r, r->times[0], r->y);
    w->interpolate = interpolate;
    if (status == NCGEN_OK)
        status = ncgen_grid_begin(r, w);
    if (status != NCGEN_OK)
        return status;
    if (ncgen_is_fixed_explicit(r->options))
        return run_fixed(r, w, method);
    if (ncgen_begins_stiff(r, w, method)) {
        r->statistics->stiff += 1;
        return NCGEN_STIFF;
    }
    return run_adaptive(r, w, method);
}
