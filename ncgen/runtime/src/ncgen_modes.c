/* ncgen_modes.c: the mechanisms in which gaps are held closed. */
#include "ncgen_modes.h"
#include "ncgen_active.h"
#include "ncgen_vectors.h"

static const ncgen_mode *present(const ncgen_events *events, const ncgen_passage *passage)
{
    return events->n_modes > 0 && *passage->mode > 0 ? events->modes + *passage->mode - 1 : NULL;
}

static int has(const ncgen_mode *mode, int event)
{
    for (int i = 0; mode && i < mode->count; ++i)
        if (mode->held[i] == event)
            return 1;
    return 0;
}

int ncgen_holds(const ncgen_events *events, const ncgen_passage *passage, int event)
{
    return has(present(events, passage), event);
}

void ncgen_enter(const ncgen_driven *d, const ncgen_events *events, const ncgen_passage *passage, ncgen_entered *in)
{
    const ncgen_mode *mode = present(events, passage);
    in->driven = *d;
    in->options = *d->options;
    in->watched = *d->options->event;
    in->driven.options = &in->options;
    in->options.event = &in->watched;
    if (!mode)
        return;
    in->driven.model = mode->model;
    in->driven.dynamics = mode->dynamics;
    in->watched.count = events->count + mode->count;
    in->watched.n_loads = mode->count;
    in->watched.function = mode->conditions;
    in->watched.directions = passage->directions;
    for (int k = 0; k < events->count; ++k)
        passage->directions[k] = has(mode, k) ? NCGEN_UNWATCHED : events->directions[k];
    for (int i = events->count; i < in->watched.count; ++i) {
        passage->directions[i] = -1;
        passage->signs[i] = 1;
    }
}

void ncgen_mark_crossed_gaps(const ncgen_events *events, int count, const int *crossed, const ncgen_passage *passage)
{
    const ncgen_mode *mode = present(events, passage);
    for (int k = events->count; k < count; ++k)
        if (crossed[k])
            passage->wanted[events->count + mode->held[k - events->count]] = 1;
}

int ncgen_release(const ncgen_events *events, const ncgen_real *p, const ncgen_moment *moment, int nearly, ncgen_passage *passage)
{
    const ncgen_mode *mode = present(events, passage);
    int some = 0;
    if (!mode)
        return 0;
    const int status = mode->conditions(moment->t, moment->q, moment->qd, p, passage->room);
    for (int i = 0; i < mode->count && status == NCGEN_OK; ++i) {
        const ncgen_real *load = passage->room + 2 * (events->count + i);
        if (ncgen_is_used_up(load[0], load[1], nearly)) {
            passage->wanted[events->count + mode->held[i]] = 1;
            ++some;
        }
    }
    return status == NCGEN_OK ? some : -status;
}

/* The number of the mode that holds what is wanted, 0 for nothing, -1 where there is none. */
static int find(const ncgen_events *events, const int *wanted)
{
    int count = 0;
    for (int k = 0; k < events->count; ++k)
        count += wanted[k];
    for (int j = 0; count && j < events->n_modes; ++j) {
        int same = events->modes[j].count == count;
        for (int i = 0; same && i < count; ++i)
            same = wanted[events->modes[j].held[i]];
        if (same)
            return j + 1;
    }
    return count ? -1 : 0;
}

void ncgen_begin_modes(int n, const ncgen_moment *moment, const ncgen_passage *passage)
{
    ncgen_copy(n, moment->q, passage->room);
    ncgen_copy(n, moment->qd, passage->room + n);
}

int ncgen_try_mode(const ncgen_driven *d, const ncgen_events *events, const ncgen_real *p, ncgen_moment *moment, ncgen_passage *passage)
{
    const int n = d->model->n_coordinates, number = find(events, passage->wanted);
    ncgen_entered in;
    if (number < 0)
        return NCGEN_AT_REST;
    ncgen_copy(n, passage->room, moment->q);
    ncgen_copy(n, passage->room + n, moment->qd);
    *passage->mode = number;
    if (!number)
        return NCGEN_OK;
    ncgen_enter(d, events, passage, &in);
    const int status = ncgen_project_moment(&in.driven, p, moment);
    return status == NCGEN_OK ? in.watched.function(moment->t, moment->q, moment->qd, p, passage->room + 2 * n) : status;
}
