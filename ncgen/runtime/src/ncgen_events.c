/* ncgen_events.c: what happens at one instant: the actions of all events that are due, and of those that these bring about. */
#include "ncgen_events.h"
#include "ncgen_breaks.h"
#include "ncgen_impacts.h"
#include "ncgen_modes.h"

enum { MOST_ROUNDS = 1000, OFF = 2 };

/* A bounce that stays lower than this many times what has no sign is none. */
static const ncgen_scalar at_rest = R(50.0);

static void begin(ncgen_instant *i, const ncgen_driven *d, const ncgen_events *events, ncgen_real *p, ncgen_moment *moment, ncgen_passage *passage)
{
    ncgen_space space = {passage->workspace, 0};
    const int n = d->model->n_coordinates, count = events->count;
    i->d = i->whole = d;
    i->events = events;
    i->p = p;
    i->moment = moment;
    i->passage = passage;
    i->n = n;
    i->count = count;
    i->values = ncgen_take(&space, 2 * count);
    i->before = ncgen_take(&space, 2 * count);
    i->scales = ncgen_take(&space, count);
    i->slopes = ncgen_take(&space, count * (2 * n + 1));
    i->responses = ncgen_take(&space, events->most * (n + 1));
    i->G = ncgen_take(&space, count * count);
    i->velocities = ncgen_take(&space, 2 * count);
    i->impulses = ncgen_take(&space, count);
    i->restitution = ncgen_take(&space, count);
    i->needed = ncgen_take(&space, count);
    i->kept = ncgen_take(&space, n);
    i->arrived = ncgen_take(&space, n);
    ncgen_copy(n, moment->qd, i->arrived);
    i->numbers = ncgen_take(&space, 0); /* the rest */
}

/* Scales: the sizes of terms, and what moving by natural sizes changes. */
int ncgen_look(ncgen_instant *i)
{
    const ncgen_moment *m = i->moment;
    int status = i->events->conditions(m->t, m->q, m->qd, i->p, i->values);
    if (status == NCGEN_OK)
        status = i->events->slopes(m->t, m->q, m->qd, i->p, i->slopes);
    for (int k = 0; k < i->count; ++k) {
        i->scales[k] = i->values[2 * k + 1];
        for (int j = 0; j < i->n; ++j)
            i->scales[k] += NCGEN_ABS(i->slopes[(size_t)k * (size_t)(2 * i->n + 1) + (size_t)j]) * i->d->dynamics->column_sizes[j];
    }
    for (int k = i->events->n_events; k < i->count; ++k) { /* velocities */
        ncgen_real *slopes = i->slopes + (size_t)k * (size_t)(2 * i->n + 1);
        ncgen_copy(i->n, slopes + i->n, slopes);
        slopes[2 * i->n] = 0;
    }
    return status;
}

static int sign_of(ncgen_real x)
{
    return (x > 0) - (x < 0);
}

/* Instants ----------------------------------------------------------------------------------------------------- */

static int find_numbers(ncgen_instant *i)
{
    return i->events->values ? i->events->values(i->moment->t, i->moment->q, i->moment->qd, i->p, i->numbers) : NCGEN_OK;
}

/* What an event does besides impacts, with the numbers of the state before it; -1: where a motion begins. */
static int act(ncgen_instant *i, int event)
{
    const ncgen_events *e = i->events;
    int status = NCGEN_OK, others = 0;
    for (int k = 0; status == NCGEN_OK && k < e->n_actions; ++k) {
        if (e->actions[k].event == event && e->actions[k].kind == NCGEN_LOCK)
            status = ncgen_lock(i, e->actions[k].place);
        if (e->actions[k].event == event && e->actions[k].kind == NCGEN_FREE)
            i->p[e->holds[e->actions[k].place].on] = 0;
    }
    if (status == NCGEN_OK)
        status = find_numbers(i);
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
    if (event >= 0 && !ncgen_impact_of(e, event))
        i->passage->happened[event] += 1;
    if (status != NCGEN_OK || !others)
        return status;
    ncgen_entered in;
    ncgen_enter(i->whole, e, i->p, NULL, &in);
    i->d = &in.driven;
    const int set = ncgen_set_velocities(i, event);
    i->d = i->whole;
    return set;
}

/* Events whose conditions the last actions carried to the other side. */
static int turned(ncgen_instant *i, const int *done)
{
    int count = 0;
    for (int k = 0; k < i->count; ++k) {
        const ncgen_real before = i->before[2 * k], after = i->values[2 * k];
        const int clear = !ncgen_is_closed(i, k) && NCGEN_ABS(before) > NCGEN_CLOSED * i->scales[k];
        i->passage->due[k] = k < i->events->n_events && clear && !done[k] && sign_of(before) != sign_of(after) && sign_of(after) * i->events->directions[k] >= 0;
        count += i->passage->due[k];
    }
    return count;
}

static ncgen_real energy(const ncgen_instant *i)
{
    ncgen_real out[3] = {0, 0, 0};
    if (i->d->model->energy)
        i->d->model->energy(i->moment->t, i->moment->q, i->moment->qd, i->p, out);
    return out[0] + out[1];
}

/* Is the next bounce of an impact one that cannot be told from none? */
static int rests(ncgen_instant *i, int k)
{
    const ncgen_real *first = i->responses, *second = first + i->count; /* responses are no longer needed */
    const ncgen_real speed = first[k] > 0 ? first[k] : 0, pull = -second[k];
    const ncgen_real deep = NCGEN_ABS(i->values[2 * k]), least = at_rest * i->events->noise * i->scales[k];
    return pull > 0 && speed * speed <= 2 * pull * (deep > least ? deep : least);
}

/* The accelerations of the mechanism with what p says is held. */
static int accelerate(ncgen_instant *i)
{
    ncgen_entered in;
    ncgen_enter(i->whole, i->events, i->p, NULL, &in);
    return ncgen_evaluate_moment(&in.driven, i->p, i->moment);
}

static int was_hit(const ncgen_instant *i)
{
    for (int j = 0; j < i->n; ++j)
        if (i->moment->qd[j] < i->arrived[j] || i->moment->qd[j] > i->arrived[j])
            return 1;
    return 0;
}

/* Where conditions of velocities go on: on the side from which they come. */
static void set_sides(ncgen_instant *i)
{
    for (int k = i->events->n_events; k < i->count; ++k) {
        const int way = ncgen_way(i->events, i->p, k);
        i->passage->signs[k] = way == OFF ? 0 : -way;
    }
}

/* The end of an instant: sides on which conditions go on, and gaps in which bounces accumulate; happened (count): what has. resting
 * (count): which gaps are at rest */
static int finish(ncgen_instant *i, const int *happened, int *resting)
{
    int rested = 0, status;
    ncgen_write_held(i->events, i->passage->flags, 0, i->p);
    status = accelerate(i);
    if (status == NCGEN_OK)
        status = i->events->rates(i->moment->t, i->moment->q, i->moment->qd, i->moment->qdd, i->p, i->responses);
    for (int k = 0; k < i->count && status == NCGEN_OK; ++k) {
        const int clear = !ncgen_is_closed(i, k), way = i->events->directions[k], side = i->passage->signs[k];
        const ncgen_action *impact = ncgen_impact_of(i->events, k);
        resting[k] = 0;
        if (k >= i->events->n_events)
            continue;
        if (happened[k])
            i->passage->signs[k] = way ? way : clear ? sign_of(i->values[2 * k]) : -side;
        else if (clear)
            i->passage->signs[k] = sign_of(i->values[2 * k]);
        if (!happened[k] || !impact || !rests(i, k))
            continue;
        if (impact->place)
            *i->passage->stopped = 1;
        else
            rested = resting[k] = 1;
    }
    if (status != NCGEN_OK || !i->events->n_holds)
        return status == NCGEN_OK && rested ? NCGEN_AT_REST : status;
    status = ncgen_choose_mode(i, happened, resting, was_hit(i));
    set_sides(i);
    return status == NCGEN_OK ? accelerate(i) : status;
}

static int happen(ncgen_instant *i)
{
    const ncgen_real before = energy(i);
    int *due = i->passage->due, *first = due + 2 * i->count, *done = due + 3 * i->count, status = NCGEN_OK, some = 1, hit = 0;
    for (int k = 0; k < i->count; ++k)
        first[k] = due[k];
    ncgen_read_held(i->events, i->p, i->passage->flags);
    ncgen_write_held(i->events, NULL, 0, i->p); /* impulses act on the mechanism with its locks alone */
    for (int round = 0; some && status == NCGEN_OK; ++round) {
        if (round == MOST_ROUNDS)
            return NCGEN_ENDLESS;
        ncgen_copy(2 * i->count, i->values, i->before);
        status = find_numbers(i);
        if (status == NCGEN_OK)
            status = ncgen_hit(i, &hit);
        for (int k = 0; k < i->events->n_events && status == NCGEN_OK; ++k) {
            done[k] = due[k];
            if (due[k] && (hit || !ncgen_impact_of(i->events, k)))
                status = act(i, k);
        }
        if (status == NCGEN_OK)
            status = ncgen_look(i);
        some = turned(i, done);
        for (int k = 0; k < i->count; ++k)
            first[k] |= due[k];
    }
    if (status == NCGEN_OK)
        status = ncgen_catch(i, first);
    if (status == NCGEN_OK)
        status = finish(i, first, done);
    for (int k = 0; k < i->count; ++k)
        due[k] = 0;
    i->moment->work += energy(i) - before;
    return status;
}

int ncgen_happen(const ncgen_driven *d, const ncgen_events *events, ncgen_real *p, ncgen_moment *moment, ncgen_passage *passage)
{
    ncgen_instant i;
    begin(&i, d, events, p, moment, passage);
    const int status = ncgen_look(&i);
    return status == NCGEN_OK ? happen(&i) : status;
}

/* Which events begin with their condition at zero, on the way in their direction; and what is where at the start. */
static int find_first(ncgen_instant *i, int *some)
{
    const ncgen_events *e = i->events;
    int status = accelerate(i);
    if (status == NCGEN_OK)
        status = e->rates(i->moment->t, i->moment->q, i->moment->qd, i->moment->qdd, i->p, i->responses);
    for (int k = 0; k < i->count && status == NCGEN_OK; ++k) {
        const ncgen_real value = i->values[2 * k], rate = i->responses[k];
        const int is_impact = ncgen_impact_of(e, k) != NULL, is_zero = ncgen_is_closed(i, k), way = sign_of(rate);
        i->passage->due[k] = 0;
        if (k >= e->n_events)
            continue;
        if (is_impact && value < 0 && !is_zero)
            return NCGEN_OVERLAP;
        i->passage->due[k] = is_zero && way && way * e->directions[k] >= 0;
        i->passage->signs[k] = is_impact ? 1 : is_zero ? way : sign_of(value);
        *some |= i->passage->due[k];
    }
    return status;
}

int ncgen_begin_events(const ncgen_driven *d, const ncgen_events *events, ncgen_real *p, ncgen_moment *moment, ncgen_passage *passage)
{
    ncgen_instant i;
    int some = 0;
    begin(&i, d, events, p, moment, passage);
    *passage->stopped = 0;
    for (int h = 0; h < 3 * events->n_holds; ++h)
        passage->flags[h] = 0;
    ncgen_write_held(events, NULL, 1, p);
    int status = ncgen_look(&i);
    if (status == NCGEN_OK) {
        ncgen_begin_slip(&i);
        status = act(&i, -1);
    }
    if (status == NCGEN_OK)
        status = ncgen_look(&i);
    if (status == NCGEN_OK)
        status = find_first(&i, &some);
    return status == NCGEN_OK && (some || events->n_holds) ? happen(&i) : status;
}

int ncgen_look_for_events(const ncgen_driven *d, const ncgen_events *events, const ncgen_real *p, const ncgen_moment *moment, int nearly,
    ncgen_passage *passage)
{
    ncgen_moment here = *moment;
    ncgen_instant i;
    int some = 0;
    begin(&i, d, events, (ncgen_real *)p, &here, passage);
    const int status = ncgen_look(&i), last = nearly ? i.count : events->n_events;
    for (int k = 0; k < i.count && status == NCGEN_OK; ++k) {
        const int way = ncgen_way(events, p, k), clear = !ncgen_is_closed(&i, k), before = passage->signs[k];
        const int side = sign_of(i.values[2 * k]), exactly = side ? side : way ? way : -1; /* to be at zero is to have come there */
        const int now = nearly || clear ? exactly : before;
        passage->due[k] = 0;
        if (k >= last || way == OFF)
            continue;
        passage->due[k] = before && now != before && now * way >= 0;
        if (!passage->due[k] && (clear || (nearly && way < 0 && now > 0)))
            passage->signs[k] = exactly; /* what falls has to be above zero first, however little */
        some += passage->due[k];
    }
    if (status != NCGEN_OK)
        return -status;
    const int released = ncgen_release(events, p, moment, nearly, passage);
    return released < 0 ? released : some + released;
}

static long events_so_far(const ncgen_events *events, const ncgen_passage *passage)
{
    long sum = 0;
    for (int k = 0; k < events->count; ++k)
        sum += passage->happened[k];
    return sum;
}

/* The mechanism with what is held, and what is watched in it. */
static int enter(const ncgen_driven *d, const ncgen_events *events, ncgen_real *p, ncgen_moment *moment, ncgen_passage *passage, ncgen_entered *in)
{
    ncgen_instant i;
    ncgen_enter(d, events, p, passage, in);
    if (in->driven.model == d->model)
        return NCGEN_OK;
    begin(&i, d, events, p, moment, passage);
    const int status = ncgen_look(&i);
    return status == NCGEN_OK ? ncgen_skip_blocked(&i, in) : status;
}

int ncgen_go_through_events(const ncgen_driven *d, const struct ncgen_breaks *breaks, const ncgen_events *events, ncgen_real *p,
    ncgen_moment *moment, ncgen_scalar t_end, int one, ncgen_passage *passage, ncgen_statistics *statistics)
{
    const long before = events_so_far(events, passage);
    if (*passage->stopped)
        return NCGEN_STOPPED;
    const int some = ncgen_look_for_events(d, events, p, moment, 0, passage);
    int status = some < 0 ? -some : some > 0 ? ncgen_happen(d, events, p, moment, passage) : NCGEN_OK;
    while (status == NCGEN_OK && moment->t < t_end && !*passage->stopped && !(one && events_so_far(events, passage) > before)) {
        ncgen_entered in;
        status = enter(d, events, p, moment, passage, &in);
        const ncgen_driven *mode = &in.driven;
        if (status == NCGEN_OK)
            status = breaks ? ncgen_go_on_in_parts(mode, breaks, p, moment, t_end, statistics) : ncgen_go_on(mode, p, moment, t_end, statistics);
        if (status != NCGEN_OK || !statistics->stopped)
            continue;
        for (int k = 0; k < events->count; ++k)
            passage->due[k] = d->options->event->crossed[k];
        for (int h = 0; h < events->n_holds; ++h)
            passage->flags[2 * events->n_holds + h] = 0;
        for (int k = events->count; k < in.watched.count; ++k)
            if (d->options->event->crossed[k])
                ncgen_release_load(events, k - events->count, passage);
        status = ncgen_happen(d, events, p, moment, passage);
    }
    return status;
}
