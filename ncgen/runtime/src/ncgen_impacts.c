/* ncgen_impacts.c: what impulses at one instant change of the velocities.
 *
 * They change by what the constraints leave of impulses: M dqd + Phi_q' mu = W' L, Phi_q dqd = 0. With the gaps' velocities
 * u = W qd + dg/dt, Newton's law of impact is 0 <= L, u_after + e u_before >= 0, one of both zero (Moreau 1988).
 */
#include "ncgen_impacts.h"
#include "ncgen_modes.h"

enum { MOST_TURNS = 10000, MOST_SWEEPS = 100000 };

const ncgen_action *ncgen_impact_of(const ncgen_events *events, int event)
{
    for (int k = 0; k < events->n_actions; ++k)
        if (events->actions[k].event == event && events->actions[k].kind == NCGEN_IMPACT)
            return events->actions + k;
    return NULL;
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

/* Velocities of what actions of an event set; those of other coordinates follow with the least kinetic energy of the change: one after the
 * other, each by a change that leaves those before it. */
int ncgen_set_velocities(ncgen_instant *i, int event)
{
    const ncgen_events *e = i->events;
    const ncgen_action *set = e->actions;
    int count = 0;
    for (int k = 0; k < e->n_actions; ++k)
        if (e->actions[k].event == event && e->actions[k].kind == NCGEN_SET_VELOCITY)
            set = count++ ? set : e->actions + k;
    for (int a = 0; a < count; ++a) {
        ncgen_real *own = response(i, a);
        for (int j = 0; j < i->n; ++j)
            i->kept[j] = j == set[a].place ? 1 : 0;
        const int status = ncgen_respond(i->d, i->p, i->moment, i->kept, own);
        if (status != NCGEN_OK)
            return status;
        const ncgen_real whole = own[set[a].place];
        for (int b = 0; b < a; ++b) {
            const ncgen_real *other = response(i, b), share = own[set[b].place] / other[set[b].place];
            for (int j = 0; other[set[b].place] > 0 && j < i->n; ++j)
                own[j] -= share * other[j];
        }
        if (!(own[set[a].place] > R(1.0e-12) * whole)) /* it follows from the others, or cannot change */
            for (int j = 0; j < i->n; ++j)
                own[j] = 0;
        else
            push(i, a, (i->numbers[set[a].value] - i->moment->qd[set[a].place]) / own[set[a].place]);
    }
    for (int a = 0; a < count; ++a) {
        const ncgen_real wanted = i->numbers[set[a].value], off = NCGEN_ABS(i->moment->qd[set[a].place] - wanted);
        if (off > R(1.0e-9) * (NCGEN_ABS(wanted) + ncgen_largest(i->n, i->moment->qd, i->d->dynamics->column_sizes) *
                                                       i->d->dynamics->column_sizes[set[a].place]))
            return NCGEN_SINGULAR;
    }
    return NCGEN_OK;
}

/* Of the gaps, and whether they close. */
static int find_velocities(ncgen_instant *i, const int *taking, int count)
{
    int closing = 0;
    for (int a = 0; a < count; ++a) {
        const ncgen_real *w = ncgen_gradient(i, taking[a]), drift = w[2 * i->n];
        ncgen_real size = NCGEN_ABS(drift), sum = drift;
        for (int j = 0; j < i->n; ++j) {
            sum += w[j] * i->moment->qd[j];
            size += NCGEN_ABS(w[j]) * NCGEN_ABS(i->moment->qd[j]);
        }
        i->velocities[2 * a] = sum;
        i->velocities[2 * a + 1] = sum < -NCGEN_OPENING * size ? 1 : 0;
        closing += sum < -NCGEN_OPENING * size;
    }
    return closing;
}

static ncgen_real *entry(const ncgen_instant *i, int a, int b)
{
    return i->G + (size_t)a * (size_t)i->count + (size_t)b;
}

/* How impulses on gaps change their velocities; locks that are closed answer, too. */
static int find_responses(ncgen_instant *i, const int *taking, int count)
{
    ncgen_entered in;
    ncgen_enter(i->whole, i->events, i->p, NULL, &in);
    for (int a = 0; a < count; ++a) {
        const int status = ncgen_respond(&in.driven, i->p, i->moment, ncgen_gradient(i, taking[a]), response(i, a));
        if (status != NCGEN_OK)
            return status;
    }
    for (int a = 0; a < count; ++a)
        for (int b = 0; b < count; ++b)
            *entry(i, a, b) = ncgen_dot(i->n, ncgen_gradient(i, taking[a]), response(i, b));
    for (int a = 0; a < count; ++a)
        if (!(*entry(i, a, a) > 0))
            return NCGEN_SINGULAR;
    return NCGEN_OK;
}

static int are_coupled(const ncgen_instant *i, int count)
{
    for (int a = 0; a < count; ++a)
        for (int b = 0; b < a; ++b)
            if (NCGEN_ABS(*entry(i, a, b)) > NCGEN_OPENING * NCGEN_SQRT(*entry(i, a, a) * *entry(i, b, b)))
                return 1;
    return 0;
}

/* One gap after the other, the one that closes fastest first. */
static int hit_in_turn(ncgen_instant *i, const int *taking, int count)
{
    for (int turn = 0; turn < MOST_TURNS; ++turn) {
        int fastest = -1;
        if (!find_velocities(i, taking, count))
            return NCGEN_OK;
        for (int a = 0; a < count; ++a)
            if (i->velocities[2 * a + 1] > 0 && (fastest < 0 || i->velocities[2 * a] < i->velocities[2 * fastest]))
                fastest = a;
        const ncgen_real impulse = -(1 + i->restitution[fastest]) * i->velocities[2 * fastest] / *entry(i, fastest, fastest);
        push(i, fastest, impulse);
        i->impulses[fastest] += impulse;
    }
    return NCGEN_ENDLESS;
}

/* All together: sweeps of Gauss and Seidel, each impulse as much as its gap needs and none that pulls. */
static int hit_all(ncgen_instant *i, int count)
{
    for (int a = 0; a < count; ++a)
        i->needed[a] = (1 + i->restitution[a]) * i->velocities[2 * a];
    ncgen_real last = R(1.0e30);
    for (int sweep = 0; sweep < MOST_SWEEPS; ++sweep) {
        ncgen_real moved = 0, size = 0;
        for (int a = 0; a < count; ++a) {
            ncgen_real rest = i->needed[a];
            for (int b = 0; b < count; ++b)
                rest += *entry(i, a, b) * i->impulses[b];
            const ncgen_real before = i->impulses[a], next = before - rest / *entry(i, a, a);
            i->impulses[a] = next > 0 ? next : 0;
            moved += NCGEN_ABS(i->impulses[a] - before);
            size += i->impulses[a];
        }
        if (moved <= R(1.0e-6) * size && !(moved < last)) /* at rounding */
            break;
        last = moved;
    }
    for (int a = 0; a < count; ++a)
        push(i, a, i->impulses[a]);
    return NCGEN_OK;
}

/* One more gap or ratchet that takes part. */
static void take(ncgen_instant *i, int *taking, int *count, int condition, ncgen_real restitution)
{
    i->restitution[*count] = restitution;
    i->impulses[*count] = 0;
    taking[(*count)++] = condition;
}

/* Ratchets that run backward, but for those that are due. */
static void take_ratchets(ncgen_instant *i, const int *due, int *taking, int *count)
{
    const ncgen_events *e = i->events;
    for (int h = 0; h < e->n_holds; ++h) {
        const int k = e->holds[h].condition;
        if (e->holds[h].kind == NCGEN_HOLDS_RATCHET && !due[k] && i->values[2 * k] <= 0)
            take(i, taking, count, k, 0);
    }
}

/* The impacts of events that are due, with the gaps that are closed already; *hit: whether a gap closes. */
int ncgen_hit(ncgen_instant *i, int *hit)
{
    int *due = i->passage->due, *taking = i->passage->due + i->count, count = 0, wanted = 0, status; /* room for numbers behind `due` */
    *hit = 0;
    for (int k = 0; k < i->events->n_events; ++k) {
        const ncgen_action *impact = ncgen_impact_of(i->events, k);
        int moves = 1;
        if (!impact || !(due[k] || ncgen_is_closed(i, k)))
            continue;
        if ((status = ncgen_can_move(i, k, &moves)) != NCGEN_OK)
            return status;
        wanted += moves && due[k];
        if (moves)
            take(i, taking, &count, k, i->numbers[impact->value]);
    }
    if (!wanted)
        return NCGEN_OK;
    take_ratchets(i, due, taking, &count);
    *hit = find_velocities(i, taking, count);
    if (!*hit)
        return NCGEN_OK;
    status = find_responses(i, taking, count);
    if (status != NCGEN_OK)
        return status;
    if (i->events->law == NCGEN_NO_LAW && are_coupled(i, count))
        return NCGEN_NO_ORDER;
    status = i->events->law == NCGEN_IN_TURN ? hit_in_turn(i, taking, count) : hit_all(i, count);
    for (int a = 0; a < count; ++a)
        i->passage->happened[taking[a]] += i->impulses[a] > 0;
    return status;
}

int ncgen_catch(ncgen_instant *i, const int *happened)
{
    int *taking = i->passage->due + i->count, count = 0;
    take_ratchets(i, happened, taking, &count);
    if (!count || !find_velocities(i, taking, count))
        return NCGEN_OK;
    const int status = find_responses(i, taking, count);
    return status == NCGEN_OK ? hit_all(i, count) : status;
}
