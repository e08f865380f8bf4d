/* ncgen_rubbing.c: contacts with friction in the mechanism with switches.
 *
 * The loads of contacts that slide are determined, whatever acts on them, where the determinants of all parts of them are positive: of the
 * mechanism in which only these are closed. */
#include "ncgen_rubbing.h"

enum { MOST_PARTS = 12 /* contacts of which all parts are looked at; of more only the single ones and pairs */ };

/* A contact did not come to rest whose velocity is above this share of what it was. */
static const ncgen_scalar turning = R(1.0e-9);

const ncgen_rubbing *ncgen_rubbing_of(const ncgen_events *events, int hold)
{
    for (int k = 0; k < events->n_rubbings; ++k)
        if (events->rubbings[k].stick == hold)
            return events->rubbings + k;
    return NULL;
}

static ncgen_real norm(int count, const ncgen_real *x)
{
    return NCGEN_SQRT(ncgen_dot(count, x, x));
}

int ncgen_contact_is_still(const ncgen_instant *i, const ncgen_rubbing *rubbing, ncgen_real speed)
{
    const ncgen_scalar *sizes = i->d->dynamics->column_sizes;
    ncgen_real velocity = 0, terms = 0;
    for (int k = rubbing->first; k < rubbing->first + rubbing->directions; ++k) {
        ncgen_real sum = 0;
        for (int j = 0; j < i->n; ++j)
            sum += NCGEN_ABS(ncgen_sliding_gradient(i, k)[j]) * sizes[j];
        terms = sum > terms ? sum : terms;
        velocity = NCGEN_ABS(i->sliding[k]) > velocity ? NCGEN_ABS(i->sliding[k]) : velocity;
    }
    return ncgen_is_still(velocity, terms * speed, 0);
}

int ncgen_slides_in_space(const ncgen_events *events, int condition)
{
    int is_known = 0;
    for (int k = 0; k < events->n_rubbings; ++k)
        is_known |= events->rubbings[k].condition == condition && events->rubbings[k].directions > 1;
    return is_known;
}

int ncgen_comes_to_rest(const ncgen_instant *i, const ncgen_rubbing *rubbing)
{
    ncgen_real before[2] = {0, 0};
    for (int k = 0; k < rubbing->directions; ++k)
        before[k] = i->p[rubbing->slip[k]];
    return rubbing->directions == 1 || norm(2, i->sliding + rubbing->first) <= turning * norm(2, before);
}

void ncgen_keep_ways(const ncgen_instant *i, const int *which, const ncgen_real *pairs)
{
    const ncgen_events *e = i->events;
    for (int k = 0; k < e->n_rubbings; ++k) {
        const int h = e->rubbings[k].stick, n = e->rubbings[k].directions;
        ncgen_real *way = i->passage->ways + 2 * h;
        if (h < 0 || !which[h])
            continue;
        for (int l = 0; l < n; ++l)
            way[l] = pairs[2 * (e->count + e->holds[h].load + 1 + l)];
        const ncgen_real size = norm(n, way);
        for (int l = 0; l < n && size > 0; ++l)
            way[l] /= size;
    }
}

void ncgen_write_ways(const ncgen_instant *i, const ncgen_active *active)
{
    const ncgen_events *e = i->events;
    for (int k = 0; k < e->n_rubbings; ++k) {
        const ncgen_rubbing *rubbing = e->rubbings + k;
        const int h = rubbing->stick, n = rubbing->directions;
        if (h < 0)
            continue;
        const ncgen_real *w = i->sliding + rubbing->first, size = norm(n, w);
        const int slides = active->wanted[rubbing->gap] && !active->wanted[h];
        ncgen_real before[2] = {i->p[rubbing->slip[0]], i->p[rubbing->slip[1]]}, longest = norm(2, before);
        longest = longest > size ? longest : size; /* of this slide */
        for (int l = 0; l < n; ++l) {
            if (!slides)
                i->p[rubbing->slip[l]] = 0;
            else if (active->released[h])
                i->p[rubbing->slip[l]] = i->passage->ways[2 * h + l];
            else if (size > 0)
                i->p[rubbing->slip[l]] = n > 1 ? w[l] / size * longest : (w[l] > 0) - (w[l] < 0);
        }
    }
}

/* Only those that are chosen are closed. */
static int try_part(ncgen_instant *i, int count, const int *sliding, const int *chosen, ncgen_real *pairs)
{
    const ncgen_events *e = i->events;
    for (int k = 0; k < count; ++k)
        i->p[e->holds[e->rubbings[sliding[k]].gap].on] = chosen[k];
    const int status = e->held_conditions(i->moment->t, i->moment->q, i->moment->qd, i->p, pairs);
    for (int k = 0; k < count; ++k)
        i->p[e->holds[e->rubbings[sliding[k]].gap].on] = 1;
    return status == NCGEN_OK && !ncgen_is_determined(e, pairs) ? NCGEN_UNDETERMINED : status;
}

/* The next part; 0 where that was the last one. */
static int take_next(int count, int *chosen)
{
    int k = 0;
    for (; k < count && chosen[k]; ++k)
        chosen[k] = 0;
    if (k < count)
        chosen[k] = 1;
    return k < count;
}

int ncgen_check_parts(ncgen_instant *i, ncgen_real *pairs)
{
    const ncgen_events *e = i->events;
    int *sliding = i->taking, *chosen = i->sticks, count = 0, status = NCGEN_OK;
    for (int k = 0; k < e->n_rubbings; ++k) {
        chosen[count] = 0;
        if (ncgen_slides(e, i->p, e->rubbings + k))
            sliding[count++] = k;
    }
    if (count + e->follows_loads < 2)
        return NCGEN_OK; /* there is one part */
    if (e->follows_loads)
        status = try_part(i, count, sliding, chosen, pairs);
    while (status == NCGEN_OK && count <= MOST_PARTS && take_next(count, chosen))
        status = try_part(i, count, sliding, chosen, pairs);
    for (int a = 0; count > MOST_PARTS && a < count; ++a)
        for (int b = 0; b <= a && status == NCGEN_OK; ++b) {
            chosen[a] = chosen[b] = 1;
            status = try_part(i, count, sliding, chosen, pairs);
            chosen[a] = chosen[b] = 0;
        }
    return status;
}

int ncgen_skip_prevented(ncgen_instant *i)
{
    const ncgen_events *e = i->events;
    int sticks = 0, status = NCGEN_OK;
    for (int k = 0; k < e->n_rubbings; ++k)
        sticks |= e->rubbings[k].stick >= 0 && i->p[e->holds[e->rubbings[k].stick].on] > 0;
    for (int k = 0; sticks && k < e->n_rubbings; ++k) {
        const ncgen_rubbing *rubbing = e->rubbings + k;
        int moves = 0;
        if (!ncgen_slides(e, i->p, rubbing))
            continue;
        for (int l = 0; l < rubbing->directions && status == NCGEN_OK; ++l) {
            int can = 1;
            status = ncgen_can_move_along(i, ncgen_sliding_gradient(i, rubbing->first + l), &can);
            moves |= can;
        }
        if (!moves)
            i->passage->directions[rubbing->condition] = NCGEN_UNWATCHED;
        if (!moves && rubbing->turn >= 0)
            i->passage->directions[rubbing->turn] = NCGEN_UNWATCHED;
    }
    return status;
}
