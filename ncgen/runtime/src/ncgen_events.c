/* ncgen_events.c: what happens at one instant: the actions of all events that are due, and of those that these bring about. */
#include "ncgen_events.h"
#include "ncgen_active.h"
#include "ncgen_breaks.h"
#include "ncgen_chain.h"
#include "ncgen_holding.h"
#include "ncgen_modes.h"
#include "ncgen_rubbing.h"

/* Instants ----------------------------------------------------------------------------------------------------- */

static ncgen_real energy(const ncgen_instant *i)
{
    ncgen_real out[3] = {0, 0, 0};
    if (i->d->model->energy)
        i->d->model->energy(i->moment->t, i->moment->q, i->moment->qd, i->p, out);
    return out[0] + out[1];
}

/* A lock that is closed where a motion begins. */
static int begin_locked(ncgen_instant *i, int hold)
{
    const ncgen_real before = energy(i);
    ncgen_copy(i->n, i->moment->qd, i->prior);
    const int status = ncgen_lock(i, hold);
    const ncgen_real lost = before - energy(i);
    i->moment->work -= lost;
    if (status == NCGEN_OK)
        ncgen_note(i->passage->log, i->n, i->moment, i->count + hold, NCGEN_RESTS, i->prior, 0, lost);
    return status;
}

/* Locks that an event closes or opens. */
static int act_on_locks(ncgen_instant *i, int event)
{
    const ncgen_events *e = i->events;
    int status = NCGEN_OK;
    for (int k = 0; status == NCGEN_OK && k < e->n_actions; ++k) {
        if (e->actions[k].event == event && e->actions[k].kind == NCGEN_LOCK)
            status = (event < 0 ? begin_locked : ncgen_lock)(i, e->actions[k].place);
        if (e->actions[k].event == event && e->actions[k].kind == NCGEN_FREE)
            i->p[e->holds[e->actions[k].place].on] = 0;
    }
    return status;
}

/* What an event does besides impacts, with the numbers of the state before it; -1: what is done where a motion begins. */
static int act(ncgen_instant *i, int event)
{
    const ncgen_events *e = i->events;
    const ncgen_real before = i->passage->log ? energy(i) : 0;
    int status, others = 0;
    ncgen_copy(i->n, i->moment->qd, i->prior);
    status = act_on_locks(i, event);
    if (status == NCGEN_OK)
        status = ncgen_find_numbers(i);
    for (int k = 0; status == NCGEN_OK && k < e->n_actions; ++k) {
        const ncgen_action *a = e->actions + k;
        if (a->event != event || a->kind == NCGEN_IMPACT)
            continue;
        if ((a->kind == NCGEN_SET || a->kind == NCGEN_SET_VELOCITY) && !ncgen_is_finite(1, i->numbers + a->value))
            return NCGEN_DOMAIN;
        if (a->kind == NCGEN_SET)
            i->p[a->place] = i->numbers[a->value];
        if (a->kind == NCGEN_STOP)
            *i->passage->stopped = 1;
        others = 1;
    }
    if (event < 0)
        return status;
    if (!ncgen_impact_of(e, event))
        i->passage->happened[event] += 1;
    if (status == NCGEN_OK && others)
        status = ncgen_set_velocities(i, event);
    if (i->passage->log && (others || !ncgen_impact_of(e, event)))
        ncgen_note(i->passage->log, i->n, i->moment, event, NCGEN_HAPPENS, i->prior, 0, before - energy(i));
    return status;
}

static int is_still(const ncgen_instant *i, int k)
{
    return ncgen_is_still_along(i, k, 1);
}

static int find_loads(void *context, int projected)
{
    const ncgen_instant *i = (const ncgen_instant *)context;
    (void)projected; /* gaps only */
    return ncgen_try_mode(i->d, i->events, i->p, i->moment, i->passage);
}

/* The gaps that are held from here on. resting (count): those whose bounces end; here those that nothing has hit are added */
static int choose_mode(ncgen_instant *i, const int *happened, int *resting)
{
    ncgen_passage *passage = i->passage;
    const int count = i->count, n = i->n, hit = ncgen_was_hit(i);
    int *kinds = i->taking, *needs = i->places, *before = needs + count, *closed = before + count, *still = i->sticks;
    int *wanted = passage->wanted, *released = wanted + count;
    for (int k = 0; k < count; ++k) {
        const ncgen_action *impact = ncgen_impact_of(i->events, k);
        kinds[k] = impact && !impact->place ? NCGEN_HOLDS_GAP : NCGEN_HOLDS_LOCK;
        needs[k] = -1;
        before[k] = ncgen_holds(i->events, passage, k);
        resting[k] |= before[k] && !hit;
        closed[k] = ncgen_is_closed(i, k);
        still[k] = is_still(i, k);
    }
    ncgen_active active = {count, kinds, needs, before, happened, resting, closed, still, wanted, released, passage->room + 2 * (n + count),
                           i, find_loads};
    ncgen_copy(n, i->moment->qd, i->prior);
    ncgen_begin_modes(n, i->moment, passage);
    const int status = ncgen_find_active(&active);
    for (int k = 0; k < count && status == NCGEN_OK; ++k) {
        if (wanted[k] != before[k])
            ncgen_note(passage->log, n, i->moment, k, wanted[k] ? NCGEN_RESTS : NCGEN_LEAVES, i->prior, 0, 0);
    }
    return status == NCGEN_OK ? ncgen_accelerate(i) : status;
}

/* The same of what may be held in the mechanism with switches. */
static int choose_held(ncgen_instant *i, const int *happened, const int *resting)
{
    int status = ncgen_choose_held(i, happened, resting, ncgen_was_hit(i));
    for (int k = ncgen_n_events(i); k < i->count; ++k) {
        const int way = ncgen_way(i->events, i->p, k);
        i->passage->signs[k] = way == NCGEN_UNWATCHED ? 0 : -way;
    }
    if (status == NCGEN_OK)
        status = ncgen_forget_sides(i);
    return status == NCGEN_OK ? ncgen_accelerate(i) : status;
}

/* The end of an instant: sides on which conditions go on, and gaps in which bounces accumulate. resting (count): which gaps are at rest */
static int finish(ncgen_instant *i, const ncgen_chain *chain, int *resting)
{
    const ncgen_real *rates = i->responses, *accelerations = rates + i->count; /* responses are no longer needed */
    int rested = 0, status = ncgen_accelerate_open(i, chain->happened, resting);
    ncgen_notes_follow(i->passage->log, 0);
    if (status == NCGEN_OK)
        status = ncgen_find_numbers(i);
    if (status == NCGEN_OK)
        status = i->events->rates(i->moment->t, i->moment->q, i->moment->qd, i->moment->qdd, i->p, i->responses);
    if (status != NCGEN_OK)
        return status;
    for (int k = 0; k < i->count; ++k) {
        const ncgen_action *impact = ncgen_impact_of(i->events, k);
        const int bounced = resting[k];
        resting[k] = 0;
        i->velocities[k] = -1; /* room for the time in which bounces end */
        if (!bounced || (rates[k] < 0 && !chain->happened[k])) /* it is still to be hit */
            continue;
        if (!ncgen_is_at_rest(i->values[2 * k], i->scales[k], rates[k], accelerations[k], i->events->noise))
            continue;
        i->velocities[k] = ncgen_time_of_bounces(rates[k], accelerations[k], i->numbers[impact->value]);
        if (impact->place)
            *i->passage->stopped = 1;
        else
            rested = resting[k] = 1;
    }
    if (i->events->n_modes || i->events->n_holds) {
        status = i->events->n_holds ? choose_held(i, chain->happened, resting) : choose_mode(i, chain->happened, resting);
        rested = 0;
    }
    if (status == NCGEN_OK)
        status = ncgen_find_sides(i, chain);
    for (int k = 0; k < i->count && status == NCGEN_OK; ++k)
        if (!(i->velocities[k] < 0))
            ncgen_note_limit(i->passage->log, i->n, k, i->velocities[k]);
    return status == NCGEN_OK && rested ? NCGEN_AT_REST : status;
}

/* The impacts and actions that are due. */
static int act_all(void *context)
{
    ncgen_instant *i = (ncgen_instant *)context;
    const int *due = i->passage->due;
    int hit = 0, status = ncgen_find_numbers(i);
    if (status == NCGEN_OK)
        status = ncgen_hit(i, due, &hit);
    for (int k = 0; k < ncgen_n_events(i) && status == NCGEN_OK; ++k)
        if (due[k] && (hit || !ncgen_impact_of(i->events, k)))
            status = act(i, k);
    return status == NCGEN_OK && (ncgen_was_hit(i) || i->events->n_holds) ? ncgen_hit_remaining(i) : status;
}

static int look_again(void *context)
{
    ncgen_instant *i = (ncgen_instant *)context;
    ncgen_notes_follow(i->passage->log, 1);
    return ncgen_look(i);
}

/* The chain of events of an instant. */
static ncgen_chain chain_of(ncgen_instant *i)
{
    int *due = i->passage->due;
    const ncgen_chain chain = {ncgen_n_events(i), i->events->directions, due,       due + 3 * i->count, due + 2 * i->count, i->values,
                               i->before, i->scales,            i,         look_again,         act_all};
    return chain;
}

static int happen(ncgen_instant *i)
{
    const ncgen_real before = energy(i);
    ncgen_chain chain = chain_of(i);
    ncgen_begin_notes(i->passage->log, i->count, chain.due);
    for (int k = ncgen_n_events(i); k < i->count; ++k)
        chain.happened[k] = chain.due[k];
    int status = ncgen_begin_instant(i);
    if (status == NCGEN_OK)
        status = ncgen_follow_chain(&chain);
    if (status == NCGEN_OK)
        status = finish(i, &chain, chain.done);
    for (int k = 0; k < i->count; ++k)
        chain.due[k] = 0;
    i->moment->work += energy(i) - before;
    return status;
}

int ncgen_apply_events(const ncgen_driven *d, const ncgen_events *events, ncgen_real *p, ncgen_moment *moment, ncgen_passage *passage)
{
    ncgen_instant i;
    ncgen_open_instant(&i, d, events, p, moment, passage);
    const int status = ncgen_look(&i);
    return status == NCGEN_OK ? happen(&i) : status;
}

/* What p says of what is held, and of the slip of joints, where a motion begins. */
static int begin_held(ncgen_instant *i)
{
    const ncgen_events *e = i->events;
    for (int h = 0; h < NCGEN_HELD_INTEGERS(e->n_holds); ++h)
        i->passage->flags[h] = 0;
    ncgen_write_held(e, NULL, 1, i->p);
    ncgen_begin_slip(i);
    int status = act(i, -1);
    if (status == NCGEN_OK)
        status = ncgen_look(i);
    return status == NCGEN_OK ? ncgen_accelerate(i) : status;
}

int ncgen_begin_events(const ncgen_driven *d, const ncgen_events *events, ncgen_real *p, ncgen_moment *moment, ncgen_passage *passage)
{
    ncgen_instant i;
    int some = 0;
    ncgen_open_instant(&i, d, events, p, moment, passage);
    int status = ncgen_look(&i);
    *passage->stopped = 0;
    if (events->n_modes)
        *passage->mode = 0;
    for (int k = 0; events->n_modes && k < 2 * i.count; ++k)
        passage->wanted[k] = 0;
    if (status == NCGEN_OK)
        status = begin_held(&i);
    if (status == NCGEN_OK)
        status = events->rates(moment->t, moment->q, moment->qd, moment->qdd, p, i.responses);
    if (status != NCGEN_OK)
        return status;
    ncgen_chain chain = chain_of(&i);
    for (int k = 0; k < i.count; ++k)
        passage->due[k] = 0;
    for (int k = 0; k < ncgen_n_events(&i); ++k) {
        i.taking[k] = ncgen_impact_of(events, k) != NULL;
        chain.done[k] = i.taking[k] && is_still(&i, k);
    }
    if (ncgen_find_first(&chain, i.responses, i.taking, chain.done, passage->signs) >= 0)
        return NCGEN_OVERLAP;
    for (int k = 0; k < i.count; ++k)
        some |= chain.due[k];
    return some || events->n_modes || events->n_holds ? happen(&i) : NCGEN_OK;
}

int ncgen_add_margins(const ncgen_driven *d, const ncgen_events *events, const ncgen_real *p, const ncgen_moment *moment,
    ncgen_passage *passage, ncgen_real *out)
{
    ncgen_moment here = *moment;
    ncgen_instant i;
    ncgen_open_instant(&i, d, events, (ncgen_real *)p, &here, passage);
    const int status = ncgen_look(&i);
    for (int k = 0; k < ncgen_n_events(&i); ++k)
        out[k] += ncgen_margin(&i, k);
    return status;
}

/* Look at the conditions, and mark events as ncgen_mark_events does. */
static int mark(ncgen_instant *i, int nearly)
{
    const ncgen_events *events = i->events;
    ncgen_passage *passage = i->passage;
    ncgen_entered in;
    int some = 0, status = ncgen_look(i);
    const int watches = nearly && events->n_holds, last = nearly ? i->count : ncgen_n_events(i);
    if (watches)
        ncgen_enter_held(i->d, events, i->p, passage, &in);
    if (watches && status == NCGEN_OK)
        status = ncgen_skip_blocked(i, &in);
    for (int k = 0; k < i->count && status == NCGEN_OK; ++k) {
        const int way = watches ? passage->directions[k] : ncgen_way(events, i->p, k), clear = !ncgen_is_closed(i, k), before = passage->signs[k];
        const ncgen_real value = i->values[2 * k] + (nearly ? ncgen_margin(i, k) : 0);
        const int side = (value > 0) - (value < 0), exactly = side ? side : way ? way : -1; /* to be at zero is to have come there */
        const int now = nearly || clear ? exactly : before;
        passage->due[k] = 0;
        if (k >= last || way == NCGEN_UNWATCHED || ncgen_holds(events, passage, k))
            continue;
        passage->due[k] = before && now != before && now * way >= 0;
        if (!passage->due[k] && (clear || (nearly && way < 0 && now > 0)))
            passage->signs[k] = exactly; /* what falls has to be above zero first, however little */
        some += passage->due[k];
    }
    if (status != NCGEN_OK || !(events->n_modes || events->n_holds))
        return status == NCGEN_OK ? some : -status;
    for (int k = 0; k < i->count && events->n_modes; ++k)
        passage->wanted[i->count + k] = 0;
    const int released = (events->n_holds ? ncgen_find_released : ncgen_release)(events, i->p, i->moment, nearly, passage);
    return released < 0 ? released : some + released;
}

int ncgen_mark_events(const ncgen_driven *d, const ncgen_events *events, const ncgen_real *p, const ncgen_moment *moment, int nearly,
    ncgen_passage *passage)
{
    ncgen_moment here = *moment;
    ncgen_instant i;
    ncgen_open_instant(&i, d, events, (ncgen_real *)p, &here, passage);
    return mark(&i, nearly);
}

static long events_so_far(const ncgen_events *events, const ncgen_passage *passage)
{
    long sum = 0;
    for (int k = 0; k < events->count; ++k)
        sum += passage->happened[k];
    return sum;
}

int ncgen_enter_present(const ncgen_driven *d, const ncgen_events *events, ncgen_real *p, ncgen_moment *moment, ncgen_passage *passage,
    ncgen_entered *in)
{
    ncgen_instant i;
    if (!events->n_holds) {
        ncgen_enter(d, events, passage, in);
        return NCGEN_OK;
    }
    ncgen_enter_held(d, events, p, passage, in);
    if (in->driven.model == d->model)
        return NCGEN_OK;
    ncgen_open_instant(&i, d, events, p, moment, passage);
    const int status = ncgen_look(&i);
    return status == NCGEN_OK ? ncgen_skip_blocked(&i, in) : status;
}

/* Of the conditions that were just looked at: is there an event at zero that has not happened yet, as where a motion was advanced to its very
 * instant? */
static int is_ahead(const ncgen_instant *i)
{
    int ahead = 0;
    for (int k = 0; k < ncgen_n_events(i); ++k) {
        const int way = ncgen_way(i->events, i->p, k), watched = way != NCGEN_UNWATCHED && !ncgen_holds(i->events, i->passage, k);
        ahead |= watched && ncgen_is_closed(i, k) && i->passage->signs[k] * way < 0;
    }
    return ahead;
}

int ncgen_advance_through_events(const ncgen_driven *d, const struct ncgen_breaks *breaks, const ncgen_events *events, ncgen_real *p,
    ncgen_moment *moment, ncgen_scalar t_end, int one, ncgen_passage *passage, ncgen_statistics *statistics)
{
    const long before = events_so_far(events, passage);
    int repeated = 0;
    ncgen_instant i;
    if (*passage->stopped)
        return NCGEN_STOPPED;
    ncgen_open_instant(&i, d, events, p, moment, passage);
    const int some = mark(&i, 0);
    int acted = some || !events->n_holds || !is_ahead(&i);
    int status = some < 0 ? -some : some > 0 ? ncgen_apply_events(d, events, p, moment, passage) : NCGEN_OK;
    while (status == NCGEN_OK && moment->t < t_end && !*passage->stopped && !(one && events_so_far(events, passage) > before)) {
        const ncgen_scalar from = moment->t;
        ncgen_entered in;
        status = ncgen_enter_present(d, events, p, moment, passage, &in);
        const ncgen_driven *mode = &in.driven;
        if (status != NCGEN_OK)
            break;
        in.watched.resumes &= acted; /* else what is due at the beginning is still to be carried out */
        status = breaks ? ncgen_advance_over_breaks(mode, breaks, p, moment, t_end, statistics) : ncgen_advance(mode, p, moment, t_end, statistics);
        if (status != NCGEN_OK || !statistics->stopped)
            continue;
        status = ncgen_mark_crossed(events, in.watched.count, in.watched.crossed, passage);
        if (status == NCGEN_OK)
            status = ncgen_apply_events(d, events, p, moment, passage);
        acted = 1;
        if (status == NCGEN_OK && ncgen_holds_others(events, p, passage))
            moment->h = 0; /* as it moves now another step may be right */
        repeated = moment->t > from ? 0 : repeated + 1;
        if (status == NCGEN_OK && repeated > NCGEN_MOST_REPEATED)
            status = NCGEN_ENDLESS;
    }
    return status;
}
