/* ncgen_rubbing.c: contacts with friction in the mechanism with switches.
 *
 * The loads of contacts that slide are determined, whatever acts on them, where the determinants of all parts of them are positive: of the
 * mechanism in which only these are closed. */
#include "ncgen_rubbing.h"

const ncgen_rubbing *ncgen_rubbing_of(const ncgen_events *events, int hold)
{
    for (int k = 0; k < events->n_rubbings; ++k)
        if (events->rubbings[k].stick == hold)
            return events->rubbings + k;
    return NULL;
}

ncgen_slide ncgen_slide_at(const ncgen_instant *i, const ncgen_rubbing *rubbing)
{
    const ncgen_real *slip = i->passage->ways + 2 * (i->events->n_holds + rubbing->stick);
    const ncgen_slide slide = {i->n, rubbing->directions, i->sliding + rubbing->first, ncgen_sliding_gradient(i, rubbing->first), slip,
        i->d->dynamics->column_sizes, i->unseen};
    return slide;
}

void ncgen_keep_slip(const ncgen_instant *i)
{
    const ncgen_options *o = i->d->options;
    const ncgen_moment *m = i->moment;
    for (int j = 0; j < i->n; ++j)
        i->unseen[j] = ncgen_unseen_velocity(o->rtol, o->atol, o->max_step, i->d->dynamics->column_sizes[j], m->qd[j], m->qdd[j]);
    for (int k = 0; k < i->events->n_rubbings; ++k) {
        const ncgen_rubbing *rubbing = i->events->rubbings + k;
        ncgen_real *before = i->passage->ways + 2 * (i->events->n_holds + rubbing->stick);
        for (int l = 0; rubbing->stick >= 0 && l < rubbing->directions; ++l)
            before[l] = i->p[rubbing->slip[l]];
    }
}

void ncgen_keep_ways(const ncgen_instant *i, const int *which, const ncgen_real *pairs)
{
    const ncgen_events *e = i->events;
    for (int k = 0; k < e->n_rubbings; ++k) {
        const int h = e->rubbings[k].stick;
        for (int l = 0; h >= 0 && which[h] && l < e->rubbings[k].directions; ++l)
            i->passage->ways[2 * h + l] = pairs[2 * (e->count + e->holds[h].load + 1 + l)];
    }
}

/* The greatest change of a contact's velocities by an impulse of 1 N s along them. */
static int find_mobility(ncgen_instant *i, const ncgen_slide *slide, ncgen_real *mobility)
{
    *mobility = 0;
    for (int k = 0; k < slide->directions; ++k) {
        const ncgen_real *gradient = slide->gradients + k * slide->n;
        const int status = ncgen_respond(i->d, i->p, i->moment, gradient, i->kept);
        const ncgen_real own = ncgen_dot(i->n, gradient, i->kept);
        if (status != NCGEN_OK)
            return status;
        *mobility = own > *mobility ? own : *mobility;
    }
    return NCGEN_OK;
}

int ncgen_is_opposed(ncgen_instant *i, const ncgen_rubbing *rubbing, const int *released, int *opposed)
{
    const ncgen_events *e = i->events;
    const ncgen_slide slide = ncgen_slide_at(i, rubbing);
    ncgen_real product = 0;
    *opposed = 0;
    for (int l = 0; ncgen_norm(slide.directions, slide.slip) > 0 && l < slide.directions; ++l) {
        const int status = ncgen_respond(i->d, i->p, i->moment, slide.gradients + l * i->n, i->kept);
        if (status != NCGEN_OK)
            return status;
        for (int k = 0; k < e->n_rubbings; ++k)
            if (e->rubbings[k].stick >= 0 && released[e->rubbings[k].stick]) {
                const ncgen_slide other = ncgen_slide_at(i, e->rubbings + k);
                product += slide.slip[l] * ncgen_along_slide(&other, i->passage->ways + 2 * e->rubbings[k].stick, i->kept);
            }
    }
    *opposed = product < 0;
    return NCGEN_OK;
}

int ncgen_write_ways(ncgen_instant *i, const ncgen_active *active)
{
    const ncgen_events *e = i->events;
    int status = NCGEN_OK;
    for (int k = 0; k < e->n_rubbings && status == NCGEN_OK; ++k) {
        const ncgen_rubbing *rubbing = e->rubbings + k;
        const int h = rubbing->stick, n = rubbing->directions;
        if (h < 0)
            continue;
        const ncgen_slide slide = ncgen_slide_at(i, rubbing);
        const ncgen_real *way = i->passage->ways + 2 * h;
        ncgen_real mobility = 0, slip[2] = {i->p[rubbing->slip[0]], n > 1 ? i->p[rubbing->slip[1]] : 0};
        if (n > 1 && ncgen_norm(n, way) > 0)
            status = find_mobility(i, &slide, &mobility);
        ncgen_write_slip(&slide, active, h, way, mobility, ncgen_speed(i, i->moment->qd), !(i->d->options->span > 0), slip);
        for (int l = 0; l < n; ++l)
            i->p[rubbing->slip[l]] = slip[l];
    }
    return status;
}

int ncgen_forget_sides(ncgen_instant *i)
{
    const ncgen_events *e = i->events;
    int some = 0, status = NCGEN_OK;
    for (int k = 0; k < e->n_rubbings; ++k)
        some |= e->rubbings[k].turn >= 0;
    if (some)
        status = e->conditions(i->moment->t, i->moment->q, i->moment->qd, i->p, i->values);
    for (int k = 0; some && status == NCGEN_OK && k < e->n_rubbings; ++k)
        if (e->rubbings[k].turn >= 0 && i->values[2 * e->rubbings[k].condition] < 0)
            i->passage->signs[e->rubbings[k].condition] = 0;
    return status;
}

/* Only those that are chosen are closed. */
static int try_part(ncgen_instant *i, int count, const int *sliding, const int *chosen, ncgen_real *pairs)
{
    const ncgen_events *e = i->events;
    for (int k = 0; k < count; ++k)
        i->p[e->holds[e->rubbings[sliding[k]].gap].on] = (ncgen_real)chosen[k];
    const int status = e->held_conditions(i->moment->t, i->moment->q, i->moment->qd, i->p, pairs);
    for (int k = 0; k < count; ++k)
        i->p[e->holds[e->rubbings[sliding[k]].gap].on] = 1;
    return status == NCGEN_OK && !ncgen_is_determined(e, pairs) ? NCGEN_UNDETERMINED : status;
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
    while (status == NCGEN_OK && ncgen_next_part(count, chosen))
        status = try_part(i, count, sliding, chosen, pairs);
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
