/* ncgen_impacts.c: what impulses at one instant change of the velocities.
 *
 * They change by what the constraints leave of impulses: M dqd + Phi_q' mu = W' L, Phi_q dqd = 0, and velocities of gaps by W dqd. */
#include "ncgen_impacts.h"
#include "ncgen_impulses.h"

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

/* Velocities of gaps, what they are sums of, and how impulses on gaps change them. */
static int find_responses(ncgen_instant *i, ncgen_impact *impact)
{
    const ncgen_scalar *sizes = i->d->dynamics->column_sizes, speed = ncgen_largest(i->n, i->moment->qd, sizes);
    for (int a = 0; a < impact->count; ++a) {
        const ncgen_real *w = ncgen_gradient(i, i->taking[a]), drift = w[2 * i->n];
        i->terms[a] = NCGEN_ABS(drift);
        i->velocities[a] = drift + ncgen_dot(i->n, w, i->moment->qd);
        for (int j = 0; j < i->n; ++j)
            i->terms[a] += NCGEN_ABS(w[j]) * sizes[j] * speed;
        const int status = ncgen_respond(i->d, i->p, i->moment, w, response(i, a));
        if (status != NCGEN_OK)
            return status;
    }
    for (int a = 0; a < impact->count; ++a)
        for (int b = 0; b < impact->count; ++b)
            i->G[a * impact->count + b] = ncgen_dot(i->n, ncgen_gradient(i, i->taking[a]), response(i, b));
    return NCGEN_OK;
}

/* The gaps that take part: those that are due, and those that are closed already. Returns whether some are due. */
static int take_gaps(ncgen_instant *i, ncgen_impact *impact)
{
    int wanted = 0;
    for (int k = 0; k < i->count; ++k) {
        const ncgen_action *action = ncgen_impact_of(i->events, k);
        const int a = impact->count;
        if (!action || !(i->passage->due[k] || ncgen_is_closed(i, k)))
            continue;
        wanted |= i->passage->due[k];
        i->taking[a] = k;
        i->places[3 * a] = a;
        i->places[3 * a + 1] = i->places[3 * a + 2] = 0;
        i->coefficients[3 * a] = i->numbers[action->value];
        i->coefficients[3 * a + 1] = i->coefficients[3 * a + 2] = 0;
        impact->count = impact->rows = a + 1;
    }
    return wanted;
}

int ncgen_hit(ncgen_instant *i, int *hit)
{
    ncgen_impact impact = {0, 0, i->events->law, i->places, i->coefficients, i->G, i->terms, 0, i->velocities, i->impulses, i->lost,
                           i->sticks, 0, 0, 0, NULL, NULL, i->space};
    ncgen_real energies[3] = {0, 0, 0};
    *hit = 0;
    if (!take_gaps(i, &impact))
        return NCGEN_OK;
    int status = find_responses(i, &impact);
    if (status == NCGEN_OK && i->d->model->energy)
        status = i->d->model->energy(i->moment->t, i->moment->q, i->moment->qd, i->p, energies);
    impact.energy = energies[0];
    if (status == NCGEN_OK)
        status = ncgen_impact_of_gaps(&impact);
    *hit = impact.closes;
    ncgen_copy(i->n, i->moment->qd, i->prior);
    for (int a = 0; a < impact.count && status == NCGEN_OK && impact.closes; ++a) {
        push(i, a, i->impulses[a]);
        i->passage->happened[i->taking[a]] += i->impulses[a] > 0;
    }
    for (int a = 0; a < impact.count && status == NCGEN_OK && impact.closes; ++a)
        if (i->impulses[a] > 0)
            ncgen_note(i->passage->log, i->n, i->moment, i->taking[a], NCGEN_HAPPENS, i->prior, i->impulses[a], i->lost[a]);
    return status;
}
