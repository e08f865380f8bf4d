/* ncgen_modes.c: which gaps are held closed: all that may be, less those whose loads would have to pull, the worst one first. */
#include "ncgen_modes.h"
#include "ncgen_vectors.h"

enum { OFF = 2 };

/* A load on the wrong side by less than this share of all loads is held; one that was not held before has to push by as much. */
static const ncgen_scalar slack = R(1.0e-10);

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
    in->watched.function = mode->conditions;
    in->watched.directions = passage->directions;
    for (int k = 0; k < events->count; ++k)
        passage->directions[k] = has(mode, k) ? OFF : events->directions[k];
    for (int i = events->count; i < in->watched.count; ++i) {
        passage->directions[i] = -1;
        passage->signs[i] = 1;
    }
}

void ncgen_mark_crossed(const ncgen_events *events, int count, const int *crossed, ncgen_passage *passage)
{
    const ncgen_mode *mode = present(events, passage);
    for (int k = 0; k < events->count; ++k)
        passage->due[k] = crossed[k];
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
        if (load[0] < -slack * load[1] || (nearly && load[0] <= slack * load[1])) {
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

/* The held gap whose load is the worst, if it has to be released. */
static int worst(const ncgen_mode *mode, const ncgen_mode *before, int first, const ncgen_real *pairs)
{
    int found = -1;
    ncgen_scalar most = slack;
    for (int i = 0; i < mode->count; ++i) {
        const ncgen_real *load = pairs + 2 * (first + i);
        const ncgen_scalar over = (has(before, mode->held[i]) ? 0 : 2 * slack) - (load[1] > 0 ? load[0] / load[1] : 0);
        if (over > most) {
            most = over;
            found = mode->held[i];
        }
    }
    return found;
}

int ncgen_choose_mode(const ncgen_driven *d, const ncgen_events *events, const ncgen_real *p, ncgen_moment *moment, ncgen_passage *passage)
{
    const int n = d->model->n_coordinates;
    const ncgen_mode *before = present(events, passage);
    ncgen_real *q = passage->room, *qd = q + n, *pairs = qd + n;
    ncgen_entered in;
    ncgen_copy(n, moment->q, q);
    ncgen_copy(n, moment->qd, qd);
    for (;;) {
        const int number = find(events, passage->wanted);
        if (number < 0)
            return NCGEN_AT_REST;
        ncgen_copy(n, q, moment->q);
        ncgen_copy(n, qd, moment->qd);
        *passage->mode = number;
        if (!number)
            return NCGEN_OK;
        const ncgen_mode *mode = events->modes + number - 1;
        ncgen_enter(d, events, passage, &in);
        int status = ncgen_project_moment(&in.driven, p, moment);
        if (status == NCGEN_OK)
            status = mode->conditions(moment->t, moment->q, moment->qd, p, pairs);
        if (status != NCGEN_OK)
            return status;
        const int released = worst(mode, before, events->count, pairs);
        if (released < 0)
            return NCGEN_OK;
        passage->wanted[released] = 0;
    }
}
