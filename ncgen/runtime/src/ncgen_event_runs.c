/* ncgen_event_runs.c: motions with events over a grid of times, one after the other; see ncgen_event_runs.h. */
#include "ncgen_event_runs.h"
#include "ncgen_event_log.h"
#include "ncgen_events.h"
#include "ncgen_held.h"
#include "ncgen_vectors.h"

size_t ncgen_events_workspace(int count, int most, int n, int values)
{
    return (size_t)(NCGEN_EVENTS_WORKSPACE(count, most, n, values));
}

int ncgen_events_integers(int count)
{
    return NCGEN_EVENTS_INTEGERS(count);
}

int ncgen_held_integers(int holds)
{
    return NCGEN_HELD_INTEGERS(holds);
}

/* What is needed to go back to the begin of a part, besides arrays. */
typedef struct ncgen_kept {
    ncgen_moment moment;
    long steps;
    int row, notes, mode, stopped;
} ncgen_kept;

static size_t rows_size(const ncgen_event_runs *runs)
{
    return (size_t)runs->n_times * (size_t)runs->driven.model->n_coordinates;
}

static void copy_integers(int count, const int *from, int *to)
{
    for (int k = 0; k < count; ++k)
        to[k] = from[k];
}

/* Arrays of the present motion into the room for them, or back. */
static void exchange(ncgen_event_runs *runs, int back)
{
    const ncgen_model *model = runs->driven.model;
    const int n = model->n_coordinates, n_p = model->n_parameters, count = runs->events->count;
    ncgen_real *own[] = {runs->moment.q, runs->moment.qd, runs->moment.qdd, runs->own_p}, *kept = runs->kept;
    for (int k = 0; k < 4; ++k) {
        const int size = k < 3 ? n : n_p;
        ncgen_copy(size, back ? kept : own[k], back ? own[k] : kept);
        kept += size;
    }
    int *integers[] = {runs->passage.signs, runs->passage.happened};
    for (int k = 0; k < 2; ++k)
        copy_integers(count, back ? runs->kept_integers + k * count : integers[k], back ? integers[k] : runs->kept_integers + k * count);
}

static ncgen_kept keep(ncgen_event_runs *runs)
{
    exchange(runs, 0);
    const ncgen_kept kept = {runs->moment, runs->steps[runs->at], runs->row, runs->passage.log->count, *runs->passage.mode, *runs->passage.stopped};
    return kept;
}

static int go_back(ncgen_event_runs *runs, const ncgen_kept *kept, int status)
{
    exchange(runs, 1);
    runs->moment = kept->moment;
    runs->steps[runs->at] = kept->steps;
    runs->row = kept->row;
    runs->passage.log->count = kept->notes;
    *runs->passage.mode = kept->mode;
    *runs->passage.stopped = kept->stopped;
    return status;
}

static int is_full(const ncgen_event_runs *runs)
{
    return runs->passage.log->count > runs->passage.log->room;
}

/* The breaks of the present motion. */
static void take_breaks(ncgen_event_runs *runs)
{
    if (!runs->signals)
        return;
    runs->signals->breaks = runs->breaks + runs->first_break[runs->at];
    runs->signals->n_breaks = runs->first_break[runs->at + 1] - runs->first_break[runs->at];
}

/* The inputs at the present instant, behind a jump there. */
static int read_inputs(ncgen_event_runs *runs)
{
    const ncgen_model *model = runs->driven.model;
    const ncgen_scalar t = runs->moment.t;
    if (!runs->signals || !runs->signals->inputs || model->n_inputs == 0)
        return NCGEN_OK;
    return runs->signals->inputs(runs->signals->context, t, t, runs->own_p + model->n_parameters - model->n_inputs);
}

/* The present motion at its start, with the events there. */
static int begin(ncgen_event_runs *runs)
{
    const ncgen_model *model = runs->driven.model;
    const int n = model->n_coordinates, n_p = model->n_parameters, notes = runs->passage.log->count;
    ncgen_moment *moment = &runs->moment;
    ncgen_copy(n, runs->q + runs->at * n, moment->q);
    ncgen_copy(n, runs->qd + runs->at * n, moment->qd);
    ncgen_copy(n_p, runs->p + runs->at * n_p, runs->own_p);
    moment->t = runs->times[0];
    moment->h = moment->work = 0;
    runs->row = 0;
    runs->steps[runs->at] = 0;
    runs->passage.log->owner = (int)runs->at;
    runs->passage.log->cause = NCGEN_AT_START;
    runs->passage.log->follows = 0;
    for (int k = 0; runs->passage.log->sampled && k < runs->events->count; ++k)
        runs->passage.log->sampled[k] = 0;
    for (int k = 0; k < runs->events->count; ++k)
        runs->passage.signs[k] = runs->passage.happened[k] = runs->passage.due[k] = 0;
    take_breaks(runs);
    int status = read_inputs(runs);
    if (status == NCGEN_OK)
        status = ncgen_evaluate_moment(&runs->driven, runs->own_p, moment);
    if (status == NCGEN_OK)
        status = ncgen_begin_events(&runs->driven, runs->events, runs->own_p, moment, &runs->passage);
    if (status == NCGEN_OK && is_full(runs))
        status = NCGEN_LOG_FULL;
    if (status != NCGEN_OK)
        runs->passage.log->count = notes;
    runs->passage.log->cause = NCGEN_WATCHED;
    return status;
}

/* Rows of a part into those of the motion, but for its first one where that is no row of the grid. */
static void take_rows(ncgen_event_runs *runs, int first, int rows)
{
    const int n = runs->driven.model->n_coordinates;
    const size_t start = (size_t)runs->at * rows_size(runs);
    for (int k = first; k < rows; ++k, ++runs->row) {
        const size_t from = (size_t)k * (size_t)n, to = start + (size_t)runs->row * (size_t)n;
        ncgen_copy(n, runs->part_q + from, runs->out_q + to);
        ncgen_copy(n, runs->part_qd + from, runs->out_qd + to);
        runs->out_work[runs->at * runs->n_times + runs->row] = runs->moment.work + runs->part_work[k];
    }
}

/* A part to the next event, or to the end. */
static int run(ncgen_event_runs *runs, const ncgen_entered *in, ncgen_statistics *statistics)
{
    const int n = runs->driven.model->n_coordinates, left = runs->n_times - runs->row;
    const int fresh = runs->times[runs->row] > runs->moment.t, n_times = left + fresh;
    int rows = 0;
    runs->part_times[0] = runs->moment.t;
    for (int k = 0; k < left; ++k)
        runs->part_times[fresh + k] = runs->times[runs->row + k];
    const int status = ncgen_simulate(in->driven.model, in->driven.dynamics, &in->options, runs->own_p, runs->moment.q, runs->moment.qd,
                                      n_times, runs->part_times, runs->part_q, runs->part_qd, runs->part_work, &rows, statistics,
                                      runs->driven.workspace, runs->driven.integers);
    if (status != NCGEN_OK)
        return status;
    take_rows(runs, fresh, rows);
    ncgen_copy(n, runs->part_q + (size_t)n_times * (size_t)n, runs->moment.q);
    ncgen_copy(n, runs->part_qd + (size_t)n_times * (size_t)n, runs->moment.qd);
    runs->moment.work += runs->part_work[n_times];
    runs->moment.t = statistics->stopped ? statistics->t : runs->times[runs->n_times - 1];
    runs->moment.h = statistics->next_step;
    runs->steps[runs->at] += statistics->steps;
    return NCGEN_OK;
}

/* Has the instant that was last changed what is held? */
static int has_changed(const ncgen_event_runs *runs, int mode)
{
    const ncgen_events *events = runs->events;
    return *runs->passage.mode != mode || ncgen_holds_others(events, runs->own_p, &runs->passage);
}

/* The events at the end of a part. Where that was so near to the end that its last row was written, too, the motion ends there. */
static int happen(ncgen_event_runs *runs, const ncgen_event *watched)
{
    ncgen_passage *passage = &runs->passage;
    int status = read_inputs(runs);
    if (status == NCGEN_OK)
        status = ncgen_mark_crossed(runs->events, watched->count, watched->crossed, passage);
    if (status == NCGEN_OK)
        status = ncgen_apply_events(&runs->driven, runs->events, runs->own_p, &runs->moment, passage);
    if (status == NCGEN_OK && runs->row == runs->n_times && !*passage->stopped) {
        runs->row -= 1;
        runs->moment.t = runs->times[runs->n_times - 1];
    }
    return status;
}

/* A part with the events at its end; where that fails all is as it was. */
static int advance(ncgen_event_runs *runs)
{
    ncgen_passage *passage = &runs->passage;
    const int mode = *passage->mode;
    const ncgen_kept before = keep(runs);
    ncgen_statistics statistics;
    ncgen_entered in;
    int status = ncgen_enter_present(&runs->driven, runs->events, runs->own_p, &runs->moment, passage, &in);
    in.options.first_step = runs->moment.h;
    if (status == NCGEN_OK)
        status = run(runs, &in, &statistics);
    if (status == NCGEN_OK && statistics.stopped)
        status = happen(runs, &in.watched);
    if (status == NCGEN_OK && is_full(runs))
        status = NCGEN_LOG_FULL;
    if (status == NCGEN_OK && statistics.stopped && has_changed(runs, mode))
        runs->moment.h = 0;
    return status == NCGEN_OK ? status : go_back(runs, &before, status);
}

/* Rows from the end of the motion on: one at its very instant shows the state behind the events there, and so do all where it has arrived. */
static void finish(ncgen_event_runs *runs)
{
    const int n = runs->driven.model->n_coordinates;
    const ncgen_moment *moment = &runs->moment;
    while (runs->row > 0 && *runs->passage.stopped && runs->times[runs->row - 1] >= moment->t)
        --runs->row;
    for (; runs->row < runs->n_times && !(runs->times[runs->row] > moment->t); ++runs->row) {
        const size_t to = (size_t)runs->at * rows_size(runs) + (size_t)runs->row * (size_t)n;
        ncgen_copy(n, moment->q, runs->out_q + to);
        ncgen_copy(n, moment->qd, runs->out_qd + to);
        runs->out_work[runs->at * runs->n_times + runs->row] = moment->work;
    }
    runs->rows[runs->at] = runs->row;
    runs->ended[runs->at] = moment->t;
}

static int complete(ncgen_event_runs *runs)
{
    int status = runs->begun ? NCGEN_OK : begin(runs), repeated = 0;
    runs->begun = status == NCGEN_OK;
    while (status == NCGEN_OK && !*runs->passage.stopped && runs->moment.t < runs->times[runs->n_times - 1]) {
        const ncgen_scalar before = runs->moment.t;
        status = advance(runs);
        repeated = runs->moment.t > before ? 0 : repeated + 1;
        if (status == NCGEN_OK && repeated > NCGEN_MOST_REPEATED)
            status = NCGEN_ENDLESS;
    }
    if (status == NCGEN_OK)
        finish(runs);
    return status;
}

int ncgen_go_on_with_runs(ncgen_event_runs *runs)
{
    for (; runs->at < runs->count; ++runs->at, runs->begun = 0) {
        const int status = complete(runs);
        if (status != NCGEN_OK)
            return status;
    }
    return NCGEN_OK;
}
