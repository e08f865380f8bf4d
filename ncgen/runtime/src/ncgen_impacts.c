/* ncgen_impacts.c: what impulses at one instant change of the velocities.
 *
 * They change by what the constraints leave of impulses: M dqd + Phi_q' mu = W' L, Phi_q dqd = 0, and velocities of gaps by W dqd. */
#include "ncgen_impacts.h"
#include "ncgen_active.h"
#include "ncgen_held.h"
#include "ncgen_impulses.h"
#include "ncgen_rates.h"
#include "ncgen_state.h"

const ncgen_action *ncgen_impact_of(const ncgen_events *events, int event)
{
    for (int k = 0; k < events->n_actions; ++k)
        if (events->actions[k].event == event && events->actions[k].kind == NCGEN_IMPACT)
            return events->actions + k;
    return NULL;
}

ncgen_real ncgen_margin(const ncgen_instant *i, int k)
{
    return ncgen_impact_of(i->events, k) ? R(1.0e-12) * i->scales[k] : 0;
}

static ncgen_real *response(const ncgen_instant *i, int k)
{
    return i->responses + (size_t)k * (size_t)i->n;
}

static void push(const ncgen_instant *i, int k, ncgen_real impulse)
{
    for (int j = 0; j < i->n; ++j)
        i->moment->qd[j] += impulse * response(i, k)[j];
}

static ncgen_real mobility(ncgen_instant *i, const ncgen_driven *d, const ncgen_real *direction, int *status)
{
    if (*status == NCGEN_OK)
        *status = ncgen_respond(d, i->p, i->moment, direction, i->kept);
    return *status == NCGEN_OK ? ncgen_dot(i->n, direction, i->kept) : 0;
}

int ncgen_was_hit(const ncgen_instant *i)
{
    int changed = 0;
    for (int j = 0; j < i->n; ++j)
        changed |= i->moment->qd[j] < i->arrived[j] || i->moment->qd[j] > i->arrived[j];
    return changed;
}

int ncgen_can_move(ncgen_instant *i, int condition, int *can)
{
    return ncgen_can_move_along(i, ncgen_gradient(i, condition), can);
}

int ncgen_can_move_along(ncgen_instant *i, const ncgen_real *direction, int *can)
{
    ncgen_entered in;
    int status = NCGEN_OK;
    ncgen_enter_held(i->d, i->events, i->p, NULL, &in);
    if (in.driven.model == i->d->model)
        return NCGEN_OK;
    const ncgen_real own = mobility(i, &in.driven, direction, &status), whole = mobility(i, i->d, direction, &status);
    *can = !ncgen_is_blocked(own, whole);
    return status;
}

int ncgen_set_velocities(ncgen_instant *i, int event)
{
    const ncgen_events *e = i->events;
    const ncgen_action *set = e->actions;
    ncgen_entered in;
    int count = 0, status = NCGEN_OK;
    ncgen_enter_held(i->d, e, i->p, NULL, &in); /* locks that are closed answer, too */
    for (int k = 0; k < e->n_actions; ++k)
        if (e->actions[k].event == event && e->actions[k].kind == NCGEN_SET_VELOCITY)
            set = count++ ? set : e->actions + k;
    for (int a = 0; a < count && status == NCGEN_OK; ++a) {
        for (int j = 0; j < i->n; ++j)
            i->kept[j] = j == set[a].place ? 1 : 0;
        status = ncgen_respond(&in.driven, i->p, i->moment, i->kept, response(i, a));
    }
    for (int a = 0; a < count; ++a)
        i->kept[a] = i->numbers[set[a].value];
    if (status == NCGEN_OK && ncgen_set_rates(i->n, count, &set->place, sizeof *set / sizeof(int), i->kept, i->d->dynamics->column_sizes,
                                              i->responses, i->moment->qd) >= 0)
        status = NCGEN_SINGULAR;
    return status;
}

static const ncgen_real *gradient_of_row(const ncgen_instant *i, int row)
{
    const int code = i->rows[row];
    return code < i->count ? ncgen_gradient(i, code) : ncgen_sliding_gradient(i, code - i->count);
}

/* Velocities of gaps and of sliding, what they are sums of, and how impulses change them. */
static int find_responses(ncgen_instant *i, ncgen_impact *impact)
{
    const ncgen_scalar *sizes = i->d->dynamics->column_sizes, speed = ncgen_speed(i, i->moment->qd);
    ncgen_entered in;
    ncgen_enter_held(i->d, i->events, i->p, NULL, &in); /* locks that are closed answer, too */
    for (int a = 0; a < impact->rows; ++a) {
        const ncgen_real *w = gradient_of_row(i, a), drift = i->rows[a] < i->count ? w[2 * i->n] : 0;
        i->terms[a] = NCGEN_ABS(drift);
        i->velocities[a] = drift + ncgen_dot(i->n, w, i->moment->qd);
        for (int j = 0; j < i->n; ++j)
            i->terms[a] += NCGEN_ABS(w[j]) * sizes[j] * speed;
        const int status = ncgen_respond(&in.driven, i->p, i->moment, w, response(i, a));
        if (status != NCGEN_OK)
            return status;
    }
    for (int a = 0; a < impact->rows; ++a)
        for (int b = 0; b < impact->rows; ++b)
            i->G[a * impact->rows + b] = ncgen_dot(i->n, gradient_of_row(i, a), response(i, b));
    return NCGEN_OK;
}

/* The friction of the gap of an event, or NULL. */
static const ncgen_rubbing *rubbing_of(const ncgen_instant *i, int event)
{
    for (int k = 0; k < i->events->n_rubbings; ++k)
        if (i->events->rubbings[k].event == event)
            return i->events->rubbings + k;
    return NULL;
}

/* One more gap or ratchet that takes part. */
static void take(ncgen_instant *i, ncgen_impact *impact, int condition, ncgen_real restitution)
{
    const int a = impact->count;
    const ncgen_rubbing *rubbing = rubbing_of(i, condition);
    i->taking[a] = condition;
    i->places[3 * a] = impact->rows;
    i->places[3 * a + 1] = rubbing ? rubbing->directions : 0;
    i->places[3 * a + 2] = rubbing ? rubbing->poisson : 0;
    i->coefficients[3 * a] = restitution;
    i->coefficients[3 * a + 1] = rubbing ? i->numbers[rubbing->value] : 0;
    i->coefficients[3 * a + 2] = rubbing ? i->numbers[rubbing->value + 1] : 0;
    i->rows[impact->rows++] = condition;
    for (int k = 0; rubbing && k < rubbing->directions; ++k)
        i->rows[impact->rows++] = i->count + rubbing->first + k;
    impact->count = a + 1;
}

/* Note which contacts impacts leave sticking, behind the other flags of what may be held. */
static void note_stuck(ncgen_instant *i, const ncgen_impact *impact)
{
    for (int a = 0; a < impact->count; ++a) {
        const ncgen_rubbing *rubbing = rubbing_of(i, i->taking[a]);
        if (rubbing && rubbing->stick >= 0 && i->sticks[a])
            ncgen_flags(i->events, i->passage, NCGEN_STUCK)[rubbing->stick] = 1;
    }
}

/* Does a gap or a ratchet move to this side, by more than rounding? */
static int moves(const ncgen_instant *i, int condition, int is_gap, int side)
{
    const ncgen_real *w = ncgen_gradient(i, condition);
    const ncgen_real velocity = is_gap ? w[2 * i->n] + ncgen_dot(i->n, w, i->moment->qd) : i->values[2 * condition];
    return velocity * (ncgen_real)side > 0 && !ncgen_is_still_along(i, condition, is_gap);
}

/* The gaps that take part: those that are closed, and those that are due; due: NULL, or which are. *wanted: are some due, or do some close? */
static int take_gaps(ncgen_instant *i, ncgen_impact *impact, const int *due, int *wanted)
{
    for (int k = 0; k < ncgen_n_events(i); ++k) {
        const ncgen_action *action = ncgen_impact_of(i->events, k);
        int can = 1;
        if (!action || !((due && due[k]) || ncgen_is_closed(i, k)))
            continue;
        const int status = ncgen_can_move(i, k, &can);
        if (status != NCGEN_OK)
            return status;
        if (!can)
            continue;
        *wanted |= (due && due[k]) || (ncgen_was_hit(i) && moves(i, k, 1, -1)); /* others happen at their own time */
        if (!(impact->law == NCGEN_SIMULTANEOUS && moves(i, k, 1, 1))) /* it opens */
            take(i, impact, k, i->numbers[action->value]);
    }
    return NCGEN_OK;
}

/* Ratchets, but for those that locks hold: all of them, or those that do not run forward. */
static int take_ratchets(ncgen_instant *i, ncgen_impact *impact, int all)
{
    const ncgen_events *e = i->events;
    int status = NCGEN_OK;
    for (int h = 0; h < e->n_holds && status == NCGEN_OK; ++h) {
        const int k = e->holds[h].condition;
        int can = 1;
        if (e->holds[h].kind != NCGEN_HOLDS_RATCHET || !(all || !moves(i, k, 0, 1)))
            continue;
        status = ncgen_can_move(i, k, &can);
        if (status == NCGEN_OK && can)
            take(i, impact, k, 0);
    }
    return status;
}

/* Does a ratchet run backward? Not one that only just turns, nor one that was held where nothing has been hit. */
static int find_backward(ncgen_instant *i, int *some)
{
    const ncgen_events *e = i->events;
    int status = NCGEN_OK;
    for (int h = 0; h < e->n_holds && status == NCGEN_OK && !*some; ++h) {
        const int k = e->holds[h].condition;
        if (e->holds[h].kind != NCGEN_HOLDS_RATCHET || i->passage->due[k] || (i->passage->flags[h] && !ncgen_was_hit(i)) || !moves(i, k, 0, -1))
            continue;
        *some = 1;
        status = ncgen_can_move(i, k, some);
    }
    return status;
}

/* What impulses have stopped does not move: less than rounding of the greatest velocity before, or of what impacts in turn leave. */
static void stop(const ncgen_instant *i, int in_turn)
{
    const ncgen_scalar rounding = 64 * ncgen_rounding(), nothing = in_turn && rounding < R(1.0e-11) ? R(1.0e-11) : rounding;
    const ncgen_real speed = ncgen_speed(i, i->prior);
    for (int j = 0; j < i->n; ++j)
        if (NCGEN_ABS(i->moment->qd[j] - i->prior[j]) > 0 && NCGEN_ABS(i->moment->qd[j]) <= nothing * speed * i->d->dynamics->column_sizes[j])
            i->moment->qd[j] = 0;
}

/* What is taken is hit. */
static int blow(ncgen_instant *i, ncgen_impact *impact)
{
    ncgen_real energies[3] = {0, 0, 0};
    int status = find_responses(i, impact);
    if (status == NCGEN_OK && i->d->model->energy)
        status = i->d->model->energy(i->moment->t, i->moment->q, i->moment->qd, i->p, energies);
    impact->energy = energies[0];
    if (status == NCGEN_OK)
        status = ncgen_impact_of_gaps(impact);
    ncgen_copy(i->n, i->moment->qd, i->prior);
    if (status != NCGEN_OK || !impact->closes)
        return status;
    for (int row = 0; row < impact->rows; ++row)
        push(i, row, i->impulses[row]);
    stop(i, impact->law == NCGEN_IN_TURN);
    for (int a = 0; a < impact->count; ++a) {
        const ncgen_real impulse = i->impulses[i->places[3 * a]];
        i->passage->happened[i->taking[a]] += impulse > 0 && i->taking[a] < i->count - i->events->n_velocities;
        if (impulse > 0)
            ncgen_note(i->passage->log, i->n, i->moment, i->taking[a], NCGEN_HAPPENS, i->prior, impulse, i->lost[a]);
    }
    note_stuck(i, impact);
    return status;
}

static ncgen_impact impact_of(ncgen_instant *i, int law)
{
    const ncgen_impact impact = {0, 0, law, i->places, i->coefficients, i->G, i->terms, 0, i->velocities, i->impulses, i->lost,
                                 i->sticks, 0, 0, 0, NULL, NULL, i->space};
    return impact;
}

/* Gaps need no law that ratchets alone couple, which have no other law than to be hit together: only those that do not open are taken then. */
static int choose_law(ncgen_instant *i, ncgen_impact *impact, const int *due, int *wanted)
{
    const int status = impact->count > 1 ? find_responses(i, impact) : NCGEN_OK;
    if (status != NCGEN_OK || (impact->count > 1 && ncgen_are_coupled(impact)))
        return status;
    *impact = impact_of(i, NCGEN_SIMULTANEOUS);
    return take_gaps(i, impact, due, wanted);
}

/* What closes is hit, with all that touches and does not open; due: as of take_gaps. *hit: whether something closes */
static int hit_closing(ncgen_instant *i, const int *due, int *hit)
{
    ncgen_impact impact = impact_of(i, i->events->law);
    int wanted = 0, status = take_gaps(i, &impact, due, &wanted);
    *hit = 0;
    if (status == NCGEN_OK && wanted && impact.law == NCGEN_NO_LAW)
        status = choose_law(i, &impact, due, &wanted);
    if (status != NCGEN_OK || !wanted)
        return status;
    status = take_ratchets(i, &impact, 0);
    if (status == NCGEN_OK)
        status = blow(i, &impact);
    *hit = impact.closes;
    return status;
}

/* What opened or ran forward before, and would not after that, is stopped with all that touches, without restitution. */
static int stop_others(ncgen_instant *i)
{
    ncgen_impact impact = impact_of(i, NCGEN_IN_TURN); /* takes those that open, too */
    int some = 0, status = take_gaps(i, &impact, NULL, &some);
    if (status == NCGEN_OK)
        status = find_backward(i, &some);
    if (status != NCGEN_OK || !some)
        return status;
    status = take_ratchets(i, &impact, 1);
    for (int a = 0; a < impact.count; ++a)
        i->coefficients[3 * a] = i->coefficients[3 * a + 2] = 0;
    impact.law = NCGEN_SIMULTANEOUS;
    return status == NCGEN_OK ? blow(i, &impact) : status;
}

int ncgen_hit(ncgen_instant *i, const int *due, int *hit)
{
    int status = hit_closing(i, due, hit);
    if (status == NCGEN_OK && *hit)
        status = ncgen_look(i);
    return status == NCGEN_OK && (*hit || !due) ? stop_others(i) : status;
}

int ncgen_hit_remaining(ncgen_instant *i)
{
    int hit, status = ncgen_look(i);
    if (status == NCGEN_OK)
        status = ncgen_find_numbers(i);
    return status == NCGEN_OK ? ncgen_hit(i, NULL, &hit) : status;
}
