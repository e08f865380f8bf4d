/* ncgen_instant.c: the room of an instant, and what conditions are at it. */
#include "ncgen_instant.h"
#include "ncgen_active.h"
#include "ncgen_impulses.h"

void ncgen_open_instant(ncgen_instant *i, const ncgen_driven *d, const ncgen_events *events, ncgen_real *p, ncgen_moment *moment,
    ncgen_passage *passage)
{
    ncgen_space space = {passage->workspace, 0};
    const int n = d->model->n_coordinates, count = events->count;
    i->d = d;
    i->events = events;
    i->p = p;
    i->moment = moment;
    i->passage = passage;
    i->n = n;
    i->count = count;
    i->values = ncgen_take(&space, 2 * count);
    i->before = ncgen_take(&space, 2 * count);
    i->scales = ncgen_take(&space, count);
    i->derivatives = ncgen_take(&space, count * (2 * n + 1));
    i->responses = ncgen_take(&space, events->most * (n + 1));
    i->G = ncgen_take(&space, count * count);
    i->velocities = ncgen_take(&space, count);
    i->impulses = ncgen_take(&space, count);
    i->lost = ncgen_take(&space, count);
    i->terms = ncgen_take(&space, count);
    i->coefficients = ncgen_take(&space, 3 * count);
    i->space = ncgen_take(&space, NCGEN_IMPACT_WORKSPACE(count));
    i->taking = passage->due + count;
    i->places = passage->due + 4 * count;
    i->sticks = passage->due + 7 * count;
    i->rows = passage->due + 8 * count;
    i->kept = ncgen_take(&space, n);
    i->prior = ncgen_take(&space, n);
    i->arrived = ncgen_take(&space, n);
    i->unseen = ncgen_take(&space, n);
    ncgen_copy(n, moment->qd, i->arrived);
    i->sliding = ncgen_take(&space, events->n_sliding * (n + 1));
    i->numbers = space.base + space.used; /* the rest */
}

/* Scales: the sizes of terms, and what moving by natural sizes changes. */
int ncgen_look(ncgen_instant *i)
{
    const ncgen_moment *m = i->moment;
    int status = i->events->conditions(m->t, m->q, m->qd, i->p, i->values);
    if (status == NCGEN_OK)
        status = i->events->derivatives(m->t, m->q, m->qd, i->p, i->derivatives);
    if (status == NCGEN_OK && i->events->n_sliding)
        status = i->events->sliding(m->t, m->q, m->qd, i->p, i->sliding);
    for (int k = 0; k < i->count; ++k) {
        i->scales[k] = i->values[2 * k + 1];
        for (int j = 0; j < i->n; ++j)
            i->scales[k] += NCGEN_ABS(i->derivatives[(size_t)k * (size_t)(2 * i->n + 1) + (size_t)j]) * i->d->dynamics->column_sizes[j];
    }
    for (int k = ncgen_n_events(i); k < i->count; ++k) {
        ncgen_real *derivatives = i->derivatives + (size_t)k * (size_t)(2 * i->n + 1);
        ncgen_copy(i->n, derivatives + i->n, derivatives);
        derivatives[2 * i->n] = 0;
    }
    return status;
}

int ncgen_find_numbers(ncgen_instant *i)
{
    return i->events->values ? i->events->values(i->moment->t, i->moment->q, i->moment->qd, i->p, i->numbers) : NCGEN_OK;
}

ncgen_real ncgen_greatest_speed(const ncgen_instant *i)
{
    const ncgen_real now = ncgen_speed(i, i->moment->qd), before = ncgen_speed(i, i->arrived);
    return now > before ? now : before;
}

int ncgen_is_still_along(const ncgen_instant *i, int condition, int drifts)
{
    const ncgen_scalar *sizes = i->d->dynamics->column_sizes;
    const ncgen_real speed = ncgen_greatest_speed(i), *w = ncgen_gradient(i, condition), drift = drifts ? w[2 * i->n] : 0;
    ncgen_real terms = 0;
    for (int j = 0; j < i->n; ++j)
        terms += NCGEN_ABS(w[j]) * sizes[j] * speed;
    return ncgen_is_still(drift + ncgen_dot(i->n, w, i->moment->qd), terms, drift);
}
