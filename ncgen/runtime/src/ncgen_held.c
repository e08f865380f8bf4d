/* ncgen_held.c: the mechanism with what p says is held, and the loads that hold it. */
#include "ncgen_held.h"
#include "ncgen_active.h"
#include "ncgen_sliding.h"
#include "ncgen_vectors.h"

void ncgen_read_held(const ncgen_events *events, const ncgen_real *p, int *held)
{
    for (int h = 0; h < events->n_holds; ++h)
        held[h] = p[events->holds[h].on] > 0;
}

void ncgen_write_held(const ncgen_events *events, const int *held, int all, ncgen_real *p)
{
    for (int h = 0; h < events->n_holds; ++h)
        if (all || !ncgen_is_lock(events->holds + h))
            p[events->holds[h].on] = held && held[h] ? 1 : 0;
}

int ncgen_holds_others(const ncgen_events *events, const ncgen_real *p, const ncgen_passage *passage)
{
    int changed = 0;
    for (int h = 0; h < events->n_holds; ++h)
        changed |= passage->flags[h] != (p[events->holds[h].on] > 0);
    return changed;
}

int ncgen_way(const ncgen_events *events, const ncgen_real *p, int condition)
{
    for (int k = 0; k < events->n_rubbings; ++k)
        if (events->rubbings[k].condition == condition || events->rubbings[k].turn == condition)
            return ncgen_way_of(NCGEN_HOLDS_CONTACT, 0, ncgen_slides(events, p, events->rubbings + k), 0, 0);
    for (int h = 0; h < events->n_holds; ++h) {
        const ncgen_hold *hold = events->holds + h;
        const int slip = hold->kind == NCGEN_HOLDS_JOINT ? (p[hold->slip] > 0) - (p[hold->slip] < 0) : 0;
        if (hold->condition == condition)
            return ncgen_way_of(hold->kind, p[hold->on] > 0, 0, slip, events->directions[condition]);
    }
    return events->directions[condition];
}

void ncgen_enter_held(const ncgen_driven *d, const ncgen_events *events, const ncgen_real *p, const ncgen_passage *passage, ncgen_entered *in)
{
    int some = events->follows_loads;
    in->driven = *d;
    in->options = *d->options;
    in->watched = *d->options->event;
    in->watched.resumes = 1; /* behind the events of the last instant */
    in->driven.options = &in->options;
    in->options.event = &in->watched;
    for (int h = 0; h < events->n_holds; ++h)
        some |= p[events->holds[h].on] > 0;
    if (some) {
        in->dynamics = *events->held_dynamics;
        if (!events->rubs)
            in->dynamics.external = d->dynamics->external;
        in->dynamics.conservative = d->dynamics->conservative && events->held_dynamics->conservative;
        in->driven.model = events->held_model;
        in->driven.dynamics = &in->dynamics;
        in->watched.count = events->count + events->n_loads;
        in->watched.n_loads = events->n_loads;
        in->watched.function = events->held_conditions;
    }
    if (!passage || !events->n_holds)
        return;
    in->watched.directions = passage->directions;
    for (int k = 0; k < events->count; ++k)
        passage->directions[k] = ncgen_way(events, p, k);
    for (int k = events->count; k < events->count + events->n_loads; ++k) {
        passage->directions[k] = NCGEN_UNWATCHED;
        passage->signs[k] = 1;
    }
    for (int h = 0; h < events->n_holds; ++h)
        for (int l = 0; l < ncgen_loads_of(events->holds[h].kind); ++l)
            passage->directions[events->count + events->holds[h].load + l] = p[events->holds[h].on] > 0 ? -1 : NCGEN_UNWATCHED;
    if (events->rubs)
        passage->directions[events->count + events->n_loads - 1] = -1;
}

int ncgen_is_determined(const ncgen_events *events, const ncgen_real *pairs)
{
    return !events->rubs || ncgen_is_positive(pairs[2 * (events->count + events->n_loads - 1)], 1);
}

int ncgen_mark_crossed(const ncgen_events *events, int count, const int *crossed, const ncgen_passage *passage)
{
    for (int k = 0; k < events->count; ++k)
        passage->due[k] = crossed[k];
    if (!events->n_holds)
        ncgen_mark_crossed_gaps(events, count, crossed, passage);
    for (int h = 0; h < events->n_holds; ++h) {
        int *released = ncgen_flags(events, passage, NCGEN_RELEASED);
        released[h] = 0;
        for (int l = 0; l < ncgen_loads_of(events->holds[h].kind); ++l)
            if (events->count + events->holds[h].load + l < count && crossed[events->count + events->holds[h].load + l])
                released[h] = ncgen_side_of(events->holds[h].kind, l);
    }
    const int last = events->count + events->n_loads - 1;
    if (events->rubs && last < count && crossed[last])
        return NCGEN_UNDETERMINED;
    return NCGEN_OK;
}

int ncgen_find_released(const ncgen_events *events, const ncgen_real *p, const ncgen_moment *moment, int nearly, ncgen_passage *passage)
{
    int some = events->follows_loads;
    for (int h = 0; h < events->n_holds; ++h) {
        some |= p[events->holds[h].on] > 0;
        ncgen_flags(events, passage, NCGEN_RELEASED)[h] = 0;
    }
    if (!some)
        return 0;
    const int status = events->held_conditions(moment->t, moment->q, moment->qd, p, passage->room);
    some = 0;
    if (status == NCGEN_OK && !ncgen_is_determined(events, passage->room))
        return -NCGEN_UNDETERMINED;
    for (int h = 0; h < events->n_holds && status == NCGEN_OK; ++h)
        for (int l = 0; p[events->holds[h].on] > 0 && l < ncgen_loads_of(events->holds[h].kind); ++l) {
            const ncgen_real *load = passage->room + 2 * (events->count + events->holds[h].load + l);
            if (ncgen_is_used_up(load[0], load[1], nearly)) {
                ncgen_flags(events, passage, NCGEN_RELEASED)[h] = ncgen_side_of(events->holds[h].kind, l);
                ++some;
            }
        }
    return status == NCGEN_OK ? some : -status;
}
