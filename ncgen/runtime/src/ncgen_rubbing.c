/* ncgen_rubbing.c: contacts with friction in the mechanism with switches.
 *
 * The loads of contacts that slide are determined, whatever acts on them, where the determinants of all parts of them are positive: of the
 * mechanism in which only these are closed. */
#include "ncgen_rubbing.h"
#include "ncgen_sliding.h"

const ncgen_rubbing *ncgen_rubbing_of(const ncgen_events *events, int hold)
{
    for (int k = 0; k < events->n_rubbings; ++k)
        if (events->rubbings[k].stick == hold)
            return events->rubbings + k;
    return NULL;
}

/* The largest change of a velocity at which a contact slides where coordinates change by so much (n). */
static ncgen_real largest_change(const ncgen_instant *i, const ncgen_rubbing *rubbing, ncgen_real (*change)(const ncgen_instant *, int))
{
    ncgen_real most = 0;
    for (int k = rubbing->first; k < rubbing->first + rubbing->directions; ++k) {
        ncgen_real sum = 0;
        for (int j = 0; j < i->n; ++j)
            sum += NCGEN_ABS(ncgen_sliding_gradient(i, k)[j]) * change(i, j);
        most = sum > most ? sum : most;
    }
    return most;
}

static ncgen_real natural_size(const ncgen_instant *i, int j)
{
    return i->d->dynamics->column_sizes[j];
}

static ncgen_real unseen_velocity(const ncgen_instant *i, int j)
{
    const ncgen_options *o = i->d->options;
    return ncgen_unseen_velocity(o->rtol, o->atol, o->max_step, natural_size(i, j), i->moment->qd[j], i->moment->qdd[j]);
}

static const ncgen_real *slip_before(const ncgen_instant *i, const ncgen_rubbing *rubbing)
{
    return i->passage->ways + 2 * (i->events->n_holds + rubbing->stick);
}

/* The largest velocity of the present slide of a contact in space that is known; 0 in the plane. */
static ncgen_real largest_so_far(const ncgen_instant *i, const ncgen_rubbing *rubbing)
{
    return rubbing->directions > 1 ? ncgen_norm(2, slip_before(i, rubbing)) : 0;
}

int ncgen_contact_is_still(const ncgen_instant *i, const ncgen_rubbing *rubbing, ncgen_real speed)
{
    ncgen_real velocity = 0;
    for (int k = rubbing->first; k < rubbing->first + rubbing->directions; ++k)
        velocity = NCGEN_ABS(i->sliding[k]) > velocity ? NCGEN_ABS(i->sliding[k]) : velocity;
    return ncgen_is_still(velocity, largest_change(i, rubbing, natural_size) * speed + largest_so_far(i, rubbing), 0);
}

int ncgen_is_unseen(const ncgen_instant *i, const ncgen_rubbing *rubbing)
{
    return ncgen_norm(rubbing->directions, i->sliding + rubbing->first) <= ncgen_missed_speed(largest_change(i, rubbing, unseen_velocity), 0);
}

void ncgen_keep_slip(const ncgen_instant *i)
{
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

/* How long the direction is in which a contact in space begins to slide whose force has this size. */
static int find_beginning(ncgen_instant *i, const ncgen_rubbing *rubbing, ncgen_real force, ncgen_real *length)
{
    ncgen_real deceleration = 0;
    for (int k = rubbing->first; k < rubbing->first + rubbing->directions; ++k) {
        const int status = ncgen_respond(i->d, i->p, i->moment, ncgen_sliding_gradient(i, k), i->kept);
        const ncgen_real own = ncgen_dot(i->n, ncgen_sliding_gradient(i, k), i->kept) * force;
        if (status != NCGEN_OK)
            return status;
        deceleration = own > deceleration ? own : deceleration;
    }
    const ncgen_real missed = ncgen_missed_speed(largest_change(i, rubbing, unseen_velocity), !(i->d->options->span > 0));
    *length = ncgen_first_length(deceleration, largest_change(i, rubbing, natural_size), missed);
    return NCGEN_OK;
}

/* The largest velocity of the slide of a contact in space that moves at this speed. */
static ncgen_real largest_of(const ncgen_instant *i, const ncgen_rubbing *rubbing, ncgen_real speed)
{
    const ncgen_real most = ncgen_speed(i, i->moment->qd);
    return ncgen_largest_slide(largest_so_far(i, rubbing), speed, largest_change(i, rubbing, natural_size) * most);
}

/* p says in which direction a contact slides: that of a velocity or force of this size, as long as it is to be. */
static void write_slip(const ncgen_instant *i, const ncgen_rubbing *rubbing, const ncgen_real *along, ncgen_real length)
{
    const ncgen_real size = ncgen_norm(rubbing->directions, along);
    for (int l = 0; l < rubbing->directions; ++l)
        i->p[rubbing->slip[l]] = rubbing->directions > 1 ? along[l] / size * length : (along[l] > 0) - (along[l] < 0);
}

int ncgen_is_opposed(ncgen_instant *i, const ncgen_rubbing *rubbing, const int *released, int *opposed)
{
    const ncgen_events *e = i->events;
    const ncgen_real *slip = slip_before(i, rubbing);
    ncgen_real product = 0;
    *opposed = 0;
    for (int l = 0; ncgen_norm(rubbing->directions, slip) > 0 && l < rubbing->directions; ++l) {
        const int status = ncgen_respond(i->d, i->p, i->moment, ncgen_sliding_gradient(i, rubbing->first + l), i->kept);
        if (status != NCGEN_OK)
            return status;
        for (int k = 0; k < e->n_rubbings; ++k) {
            const ncgen_rubbing *other = e->rubbings + k;
            for (int j = 0; other->stick >= 0 && released[other->stick] && j < other->directions; ++j)
                product += slip[l] * i->passage->ways[2 * other->stick + j] *
                           ncgen_dot(i->n, ncgen_sliding_gradient(i, other->first + j), i->kept);
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
        const ncgen_real *w = i->sliding + rubbing->first, *way = i->passage->ways + 2 * h, speed = ncgen_norm(n, w), force = ncgen_norm(n, way);
        const int slide = ncgen_slide_of(active, h, force > 0, speed > 0);
        ncgen_real length = 1;
        if (slide == NCGEN_BEGINS && n > 1)
            status = find_beginning(i, rubbing, force, &length);
        for (int l = 0; slide == NCGEN_SLIDES_NOT && l < n; ++l)
            i->p[rubbing->slip[l]] = 0;
        if (slide == NCGEN_BEGINS)
            write_slip(i, rubbing, way, length);
        else if (slide == NCGEN_SLIDES_ON)
            write_slip(i, rubbing, w, largest_of(i, rubbing, speed));
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
        i->p[e->holds[e->rubbings[sliding[k]].gap].on] = chosen[k];
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
