/* ncgen_grid.c: what an integrator's steps become: rows of the time grid, and the end of a run at the first of its conditions.
 *
 * An integrator reports here that it has come from t to t + h, and how to interpolate in between.
 */
#include "ncgen_grid.h"

/* A row nearer to the end of a step than this share of it takes the state of the step itself. */
static const ncgen_scalar grid_tolerance = R(1.0e-9);

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

/* Rows of the grid before the share `end` of the step from t to t + h, by interpolation. Where they are many the run may be
 * ended between two of them. */
static int write_inside(ncgen_run *r, ncgen_stepping *w, ncgen_scalar t, ncgen_scalar h, ncgen_scalar end)
{
    while (r->rows < r->n_times && r->times[r->rows] < t + end * h) {
        const int status = ncgen_state_inside(r, w, t, h, (r->times[r->rows] - t) / h);
        if (status != NCGEN_OK)
            return status;
        ncgen_write_row(r, w->at[r->error_size - 1]);
        const ncgen_scalar row = r->times[r->rows - 1];
        if (ncgen_report_progress(r, row) != NCGEN_OK) { /* the end of the step is lost with the rows before it */
            ncgen_save_state(r, row, w->at[r->error_size - 1]);
            return NCGEN_INTERRUPTED;
        }
    }
    return NCGEN_OK;
}

/* After an accepted step: ends the run at the first of its conditions, if one happens in it. */
static int stop_at_event(ncgen_run *r, ncgen_stepping *w, ncgen_scalar t, ncgen_scalar t_new)
{
    const ncgen_scalar h = t_new - t;
    ncgen_scalar s = 1;
    int happens = 0;
    int status = ncgen_conditions_step(r, w, t, h, &happens, &s);
    if (status != NCGEN_OK || !happens)
        return status;
    ncgen_save_state(r, s < 1 ? t + s * h : t_new, w->at[r->error_size - 1]);
    status = write_inside(r, w, t, h, s);
    r->statistics->stopped = status == NCGEN_OK;
    return status;
}

/* Has the step under way rows before a time that must be of their own times? Movable rows alone wait for its end. */
static int has_rows_before(const ncgen_run *r, ncgen_scalar t)
{
    const int *movable = r->options->movable;
    int row = r->rows;
    while (movable && row < r->n_times && movable[row])
        ++row;
    return row < r->n_times && r->times[row] < t;
}

/* Rows up to a time have the state of the step's end. */
static void write_end(ncgen_run *r, ncgen_scalar t_new, ncgen_scalar until)
{
    for (; r->rows < r->n_times && r->times[r->rows] <= until; ncgen_write_row(r, r->y[r->error_size - 1]))
        if (r->options->movable && r->options->movable[r->rows])
            r->options->row_times[r->rows] = t_new;
}

/* After an accepted step with error control: have 100,000 of them come no farther than a millionth of the run, or are they as many as
 * the options allow? */
int ncgen_makes_no_progress(const ncgen_run *r, ncgen_stepping *w, ncgen_scalar t)
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
    r->step_start = *t;
    ncgen_save_state(r, *t, r->y[r->error_size - 1]);
    write_end(r, *t, *t);
    return 1;
}

int ncgen_grid_begin(ncgen_run *r, ncgen_stepping *w)
{
    int status = ncgen_check_state(r, r->y[r->error_size - 1]);
    w->mark = r->times[0];
    if (status == NCGEN_OK && r->options->event)
        status = ncgen_conditions_begin(r, r->times[0]);
    if (status == NCGEN_OK)
        ncgen_write_row(r, r->y[r->error_size - 1]);
    return status;
}

int ncgen_grid_step(ncgen_run *r, ncgen_stepping *w, ncgen_scalar t, ncgen_scalar t_new)
{
    const ncgen_scalar h = t_new - t;
    int status = r->partitioning ? ncgen_check_state(r, w->new_y[r->error_size - 1]) : NCGEN_OK; /* else it is new_y, which is finite */
    if (status != NCGEN_OK)
        return status;
    status = ncgen_accept(r, t_new, w->new_y);
    r->statistics->steps += 1;
    int has_left = r->partitioning || r->options->event; /* r->q, r->qd the end of the step */
    int trouble = r->options->event ? stop_at_event(r, w, t, t_new) : NCGEN_OK;
    if (r->statistics->stopped)
        return trouble;
    if (trouble == NCGEN_OK && has_rows_before(r, t + (1 - grid_tolerance) * h)) {
        trouble = write_inside(r, w, t, h, 1 - grid_tolerance);
        has_left = 1;
    }
    if (trouble != NCGEN_OK)
        return trouble;
    r->step_start = t_new;
    if (has_left) {
        ncgen_copy(r->n, r->start_q, r->q);
        ncgen_copy(r->n, r->start_qd, r->qd);
    }
    ncgen_real *before = r->y;
    r->y = w->new_y;
    w->new_y = before;
    write_end(r, t_new, t_new + grid_tolerance * h);
    return status == NCGEN_OK ? ncgen_choose(r) : status;
}

/* The cubic between two states and their derivatives. */
void ncgen_interpolate_cubic(ncgen_run *r, ncgen_stepping *w, const ncgen_real *first, const ncgen_real *last, ncgen_scalar h,
                             ncgen_scalar s)
{
    for (int i = 0; i < r->ny; ++i) {
        const ncgen_real change = w->new_y[i] - r->y[i];
        w->at[i] = r->y[i] + s * (change + (1 - s) * ((1 - s) * (h * first[i] - change) - s * (h * last[i] - change)));
    }
}
