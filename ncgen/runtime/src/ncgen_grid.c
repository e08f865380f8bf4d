/* ncgen_grid.c: what an integrator's steps become: rows of the time grid, and the event that ends a run.
 *
 * An integrator tells here that it has come from t to t + h, and how to interpolate in between.
 */
#include "ncgen_crossing.h"
#include "ncgen_grid.h"

/* A value of the event's function below this, in units of rounding and over its size, has no sign. */
static const ncgen_scalar event_noise = R(1000.0);

/* A row nearer to the end of a step than this share of it takes the state of the step itself. */
static const ncgen_scalar on_the_grid = R(1.0e-9);

/* NCGEN_DOMAIN unless the state that was evaluated last, and its work, are numbers. */
static int check_state(const ncgen_run *r, ncgen_real work)
{
    return ncgen_is_finite(r->n, r->q) && ncgen_is_finite(r->n, r->qd) && ncgen_is_finite(1, &work) ? NCGEN_OK : NCGEN_DOMAIN;
}

/* The number of the first break after t. */
static int break_after(const ncgen_signals *signals, ncgen_scalar t)
{
    int low = 0, high = signals->n_breaks;
    while (low < high) {
        const int middle = low + (high - low) / 2;
        if (signals->breaks[middle] > t)
            high = middle;
        else
            low = middle + 1;
    }
    return low;
}

ncgen_scalar ncgen_next_break(const ncgen_run *r, ncgen_scalar t, ncgen_scalar end)
{
    const ncgen_signals *signals = r->options->signals;
    const int k = signals ? break_after(signals, t) : 0;
    return signals && k < signals->n_breaks && signals->breaks[k] < end ? signals->breaks[k] : end;
}

ncgen_scalar ncgen_next_goal(const ncgen_run *r, ncgen_scalar t, ncgen_scalar end)
{
    const ncgen_scalar goal = ncgen_next_break(r, t, end);
    int row = r->rows;
    if (!(r->options->max_step < 0))
        return goal;
    while (row < r->n_times && !(r->times[row] > t))
        ++row;
    return row < r->n_times && r->times[row] < goal ? r->times[row] : goal;
}

/* q and qd at t + s h. */
static int state_inside(ncgen_run *r, ncgen_stepping *w, ncgen_scalar t, ncgen_scalar h, ncgen_scalar s)
{
    int status = w->interpolate(r, w, t, h, s);
    if (status == NCGEN_OK)
        status = r->state(r, t + s * h, w->at);
    return status == NCGEN_OK ? check_state(r, w->at[r->weighed - 1]) : status;
}

/* The event's function at the state there is, signed so that it stops when it becomes positive. */
static int event_value(ncgen_run *r, ncgen_scalar t, ncgen_real *value)
{
    const ncgen_event *event = r->options->event;
    if (event->coordinate >= r->n)
        *value = r->qd[event->coordinate - r->n] - event->value;
    else if (event->coordinate >= 0)
        *value = r->q[event->coordinate] - event->value;
    else if (event->function(t, r->q, r->qd, r->p, value) != NCGEN_OK)
        return NCGEN_DOMAIN;
    return NCGEN_OK;
}

/* The event's function at the share s of the step, of the state on the constraints. */
static int event_inside(ncgen_run *r, ncgen_stepping *w, ncgen_scalar t, ncgen_scalar h, ncgen_scalar s, ncgen_real *value)
{
    const int status = state_inside(r, w, t, h, s);
    return status == NCGEN_OK ? event_value(r, t + s * h, value) : status;
}

/* Where the event's coordinate or velocity stands in y itself, which then is a polynomial in time within a step; else -1. */
static int place_in_state(const ncgen_run *r)
{
    const int k = r->options->event->coordinate;
    if (k < 0 || !r->constrained)
        return -1;
    return k < r->n ? r->n + k : k - r->n;
}

/* The event's function at the shares 0, 1/8, ... 1 of the step; the first and the last one are there. */
static int sample_event(ncgen_run *r, ncgen_stepping *w, ncgen_scalar t, ncgen_scalar h, ncgen_real *values)
{
    const int place = place_in_state(r);
    int status = NCGEN_OK;
    for (int k = 1; k < NCGEN_CROSSING_DEGREE && status == NCGEN_OK; ++k) {
        const ncgen_scalar s = (ncgen_scalar)k / (ncgen_scalar)NCGEN_CROSSING_DEGREE;
        if (place < 0) {
            status = event_inside(r, w, t, h, s, &values[k]);
        } else {
            status = w->interpolate(r, w, t, h, s);
            values[k] = w->at[place] - r->options->event->value;
        }
    }
    return status;
}

/* Does the event happen within the step? Then between the shares *low and *high of it. */
static int find_event(ncgen_run *r, ncgen_stepping *w, ncgen_scalar t, ncgen_scalar h, ncgen_real before, int *found, ncgen_scalar *low,
                      ncgen_scalar *high)
{
    ncgen_real values[NCGEN_CROSSING_DEGREE + 1];
    values[0] = before;
    values[NCGEN_CROSSING_DEGREE] = w->event;
    const int status = sample_event(r, w, t, h, values);
    ncgen_scalar size = NCGEN_ABS(r->options->event->value);
    for (int k = 0; k <= NCGEN_CROSSING_DEGREE; ++k)
        if (NCGEN_ABS(values[k]) > size)
            size = NCGEN_ABS(values[k]);
    *found = status == NCGEN_OK && ncgen_first_crossing(values, event_noise * r->rounding * size, r->options->event->direction, low, high);
    return status;
}

/* The share *s of the step, first the end of what it may be, at which the event happens: Illinois' rule on the interpolant. */
static int locate(ncgen_run *r, ncgen_stepping *w, ncgen_scalar t, ncgen_scalar h, ncgen_real at_low, ncgen_real at_high, ncgen_scalar low,
                  ncgen_scalar *s)
{
    ncgen_scalar high = *s;
    int side = 0;
    for (int k = 0; k < 60 && high - low > 64 * r->rounding; ++k) {
        ncgen_real value = 0;
        *s = low + (high - low) * (at_low / (at_low - at_high));
        const int status = event_inside(r, w, t, h, *s, &value);
        if (status != NCGEN_OK)
            return status;
        if (!(NCGEN_ABS(value) > 0))
            return NCGEN_OK;
        const int beyond = (value > 0) == (at_high > 0);
        if (beyond) {
            high = *s;
            at_high = value;
            at_low *= side > 0 ? R(0.5) : R(1.0);
        } else {
            low = *s;
            at_low = value;
            at_high *= side < 0 ? R(0.5) : R(1.0);
        }
        side = beyond ? 1 : -1;
    }
    *s = high;
    return state_inside(r, w, t, h, *s);
}

/* The same between two shares; the state on the constraints may turn a little beside the interpolant, and then it is the second one. */
static int locate_between(ncgen_run *r, ncgen_stepping *w, ncgen_scalar t, ncgen_scalar h, ncgen_real before, ncgen_scalar low,
                          ncgen_scalar *s)
{
    ncgen_real at_low = before, at_high = w->event;
    int status = NCGEN_OK;
    if (low > 0)
        status = event_inside(r, w, t, h, low, &at_low);
    if (status == NCGEN_OK && *s < 1)
        status = event_inside(r, w, t, h, *s, &at_high);
    if (status != NCGEN_OK)
        return status;
    if ((at_low < 0 && at_high > 0) || (at_low > 0 && at_high < 0))
        return locate(r, w, t, h, at_low, at_high, low, s);
    return state_inside(r, w, t, h, *s);
}

/* Rows of the grid before the share `end` of the step from t to t + h, by interpolation. Where they are many the run may be
 * ended between two of them. */
static int write_inside(ncgen_run *r, ncgen_stepping *w, ncgen_scalar t, ncgen_scalar h, ncgen_scalar end)
{
    while (r->rows < r->n_times && r->times[r->rows] < t + end * h) {
        const int status = state_inside(r, w, t, h, (r->times[r->rows] - t) / h);
        if (status != NCGEN_OK)
            return status;
        ncgen_write_row(r, w->at[r->weighed - 1]);
        const ncgen_scalar row = r->times[r->rows - 1];
        if (ncgen_tell(r, row) != NCGEN_OK) { /* the end of the step is lost with the rows before it */
            ncgen_keep_state(r, row, w->at[r->weighed - 1]);
            return NCGEN_INTERRUPTED;
        }
    }
    return NCGEN_OK;
}

/* After an accepted step: ends the run at the event, if it happens in it. */
static int stop_at_event(ncgen_run *r, ncgen_stepping *w, ncgen_scalar t, ncgen_scalar t_new)
{
    const ncgen_scalar h = t_new - t;
    const ncgen_real before = w->event;
    ncgen_scalar low = 0, s = 1;
    int happens = 0;
    int status = event_value(r, t_new, &w->event);
    if (status == NCGEN_OK)
        status = find_event(r, w, t, h, before, &happens, &low, &s);
    if (status == NCGEN_OK && happens)
        status = locate_between(r, w, t, h, before, low, &s);
    if (status != NCGEN_OK || !happens)
        return status;
    ncgen_keep_state(r, t + s * h, w->at[r->weighed - 1]);
    status = write_inside(r, w, t, h, s);
    r->statistics->stopped = status == NCGEN_OK;
    return status;
}

/* Has the step under way rows before a time that must be of their own instants? Looks alone wait for its end. */
static int has_rows_before(const ncgen_run *r, ncgen_scalar t)
{
    const int *looks = r->options->looks;
    int row = r->rows;
    while (looks && row < r->n_times && looks[row])
        ++row;
    return row < r->n_times && r->times[row] < t;
}

/* Rows up to a time have the state of the step's end. */
static void write_end(ncgen_run *r, ncgen_scalar t_new, ncgen_scalar until)
{
    for (; r->rows < r->n_times && r->times[r->rows] <= until; ncgen_write_row(r, r->y[r->weighed - 1]))
        if (r->options->looks && r->options->looks[r->rows])
            r->options->looked[r->rows] = t_new;
}

/* After an accepted step with error control: have 100,000 of them come no farther than a millionth of the run, or are they as many as
 * the options allow? */
int ncgen_creeps(const ncgen_run *r, ncgen_stepping *w, ncgen_scalar t)
{
    const long steps = r->statistics->steps;
    const ncgen_scalar span = r->times[r->n_times - 1] - r->times[0];
    if (r->options->max_steps && steps >= r->options->max_steps)
        return 1;
    if (steps % 100000)
        return 0;
    const int creeps = t - w->mark < R(1.0e-6) * span;
    w->mark = t;
    return creeps;
}

int ncgen_cross_break(ncgen_run *r, ncgen_scalar *t, ncgen_scalar end)
{
    const ncgen_signals *signals = r->options->signals;
    if (!signals || break_after(signals, *t) % 2 == 0)
        return 0;
    *t = ncgen_next_break(r, *t, end);
    r->from = *t;
    ncgen_keep_state(r, *t, r->y[r->weighed - 1]);
    write_end(r, *t, *t);
    return 1;
}

int ncgen_grid_begin(ncgen_run *r, ncgen_stepping *w)
{
    int status = check_state(r, r->y[r->weighed - 1]);
    w->mark = r->times[0];
    if (status == NCGEN_OK && r->options->event)
        status = event_value(r, r->times[0], &w->event);
    if (status == NCGEN_OK)
        ncgen_write_row(r, r->y[r->weighed - 1]);
    return status;
}

int ncgen_grid_step(ncgen_run *r, ncgen_stepping *w, ncgen_scalar t, ncgen_scalar t_new)
{
    const ncgen_scalar h = t_new - t;
    int status = check_state(r, w->new_y[r->weighed - 1]);
    if (status != NCGEN_OK)
        return status;
    status = ncgen_accept(r, t_new, w->new_y);
    r->statistics->steps += 1;
    int trouble = r->options->event ? stop_at_event(r, w, t, t_new) : NCGEN_OK;
    if (r->statistics->stopped)
        return trouble;
    if (trouble == NCGEN_OK && has_rows_before(r, t + (1 - on_the_grid) * h))
        trouble = write_inside(r, w, t, h, 1 - on_the_grid);
    if (trouble != NCGEN_OK)
        return trouble;
    r->from = t_new;
    ncgen_copy(r->n, r->start_q, r->q);
    ncgen_copy(r->n, r->start_qd, r->qd);
    ncgen_copy(r->ny, w->new_y, r->y);
    write_end(r, t_new, t_new + on_the_grid * h);
    return status == NCGEN_OK ? ncgen_choose(r) : status;
}

/* The cubic between two states and their slopes. */
void ncgen_interpolate_cubic(ncgen_run *r, ncgen_stepping *w, const ncgen_real *first, const ncgen_real *last, ncgen_scalar h,
                             ncgen_scalar s)
{
    for (int i = 0; i < r->ny; ++i) {
        const ncgen_real change = w->new_y[i] - r->y[i];
        w->at[i] = r->y[i] + s * (change + (1 - s) * ((1 - s) * (h * first[i] - change) - s * (h * last[i] - change)));
    }
}
