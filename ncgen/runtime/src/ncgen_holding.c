/* ncgen_holding.c: what is held from an instant on, in the mechanism with switches. */
#include "ncgen_holding.h"
#include "ncgen_active.h"
#include "ncgen_rubbing.h"
#include "ncgen_state.h"

/* Does a gap not change, or a joint, contact or ratchet not move, but for rounding? */
static int is_still(const ncgen_instant *i, const ncgen_hold *hold)
{
    if (hold->kind == NCGEN_HOLDS_CONTACT) {
        const ncgen_slide slide = ncgen_slide_at(i, ncgen_rubbing_of(i->events, (int)(hold - i->events->holds)));
        return ncgen_slide_is_still(&slide, ncgen_greatest_speed(i));
    }
    return ncgen_is_still_along(i, hold->condition, ncgen_is_gap(hold));
}

int ncgen_skip_blocked(ncgen_instant *i, ncgen_entered *in)
{
    const ncgen_events *e = i->events;
    int status = NCGEN_OK;
    if (in->driven.model == i->d->model)
        return NCGEN_OK;
    for (int h = 0; h < e->n_holds && status == NCGEN_OK; ++h) {
        const ncgen_hold *hold = e->holds + h;
        const int is_driven = in->driven.model->nu || ncgen_is_gap(hold); /* else what cannot move is still but for rounding */
        if (ncgen_is_lock(hold) || hold->kind == NCGEN_HOLDS_CONTACT || i->p[hold->on] > 0 || (is_driven && !is_still(i, hold)))
            continue;
        if (ncgen_is_gap(hold) && !ncgen_is_closed(i, hold->condition))
            continue;
        int can = 1;
        status = ncgen_can_move(i, hold->condition, &can);
        if (!can)
            i->passage->directions[hold->condition] = NCGEN_UNWATCHED;
    }
    return status == NCGEN_OK ? ncgen_skip_prevented(i) : status;
}

int ncgen_begin_instant(ncgen_instant *i)
{
    const ncgen_events *e = i->events;
    const int *released = ncgen_flags(e, i->passage, NCGEN_RELEASED);
    int some = 0, status = NCGEN_OK;
    ncgen_read_held(e, i->p, i->passage->flags);
    for (int h = 0; h < e->n_holds; ++h) {
        ncgen_flags(e, i->passage, NCGEN_STUCK)[h] = 0;
        some |= released[h] && e->holds[h].kind == NCGEN_HOLDS_CONTACT;
    }
    if (some) {
        status = e->held_conditions(i->moment->t, i->moment->q, i->moment->qd, i->p, i->passage->room);
        ncgen_keep_ways(i, released, i->passage->room);
    }
    ncgen_write_held(e, NULL, 0, i->p);
    return status;
}

/* Modes ---------------------------------------------------------------------------------------------------------- */

/* The moment onto the constraints of what p says is held: velocities alone, or positions first. */
static int project(ncgen_instant *i, int positions)
{
    ncgen_entered in;
    ncgen_enter_held(i->d, i->events, i->p, NULL, &in);
    const int status = positions ? ncgen_project_moment(&in.driven, i->p, i->moment) : NCGEN_OK;
    return status == NCGEN_OK ? ncgen_project_velocities(&in.driven, i->p, i->moment) : status;
}

/* Do velocities miss the constraints of a mechanism, compared with a speed in natural sizes? */
static int misses(ncgen_instant *i, const ncgen_driven *d, ncgen_real speed, int *does)
{
    const ncgen_model *model = d->model;
    const ncgen_pattern *pattern = &model->phi_q_pattern;
    ncgen_space space = {d->workspace, 0}; /* which no call uses now */
    ncgen_real *values = ncgen_take(&space, ncgen_nonzeros(pattern)), *nu = ncgen_take(&space, model->n_rows);
    int status = model->phi_q(i->moment->t, i->moment->q, i->p, values);
    if (status == NCGEN_OK && model->nu)
        status = model->nu(i->moment->t, i->moment->q, i->p, nu);
    *does = status == NCGEN_OK && ncgen_is_missed(pattern, values, model->nu ? nu : NULL, d->dynamics->column_sizes, speed, i->moment->qd);
    return status;
}

int ncgen_lock(ncgen_instant *i, int h)
{
    const ncgen_hold *hold = i->events->holds + h;
    const ncgen_real before = ncgen_speed(i, i->moment->qd);
    ncgen_entered in;
    int missed;
    if (i->p[hold->on] > 0)
        return NCGEN_OK;
    int status = ncgen_find_numbers(i);
    if (status != NCGEN_OK)
        return status;
    i->p[hold->held] = i->numbers[hold->value];
    i->p[hold->on] = 1;
    ncgen_enter_held(i->d, i->events, i->p, NULL, &in);
    status = ncgen_project_velocities(&in.driven, i->p, i->moment);
    if (status == NCGEN_OK)
        status = misses(i, &in.driven, before, &missed);
    return status == NCGEN_OK && missed ? NCGEN_MOVED : status;
}

void ncgen_begin_slip(ncgen_instant *i)
{
    for (int h = 0; h < i->events->n_holds; ++h) {
        const ncgen_hold *hold = i->events->holds + h;
        if (hold->kind == NCGEN_HOLDS_JOINT)
            i->p[hold->slip] = is_still(i, hold) ? 0 : (ncgen_real)ncgen_side(i, hold->condition);
    }
    for (int k = 0; k < i->events->n_rubbings; ++k)
        for (int l = 0; l < i->events->rubbings[k].directions; ++l)
            i->p[i->events->rubbings[k].slip[l]] = 0;
}

/* What was held and has been released begins to move with no velocity, not with one of rounding. */
static int let_go(ncgen_instant *i, int was_hit)
{
    const ncgen_events *e = i->events;
    const int *released = ncgen_flags(e, i->passage, NCGEN_RELEASED);
    int some = 0;
    for (int h = 0; h < e->n_holds; ++h)
        some |= released[h];
    if (!some || was_hit)
        return NCGEN_OK;
    ncgen_write_held(e, ncgen_flags(e, i->passage, NCGEN_BEFORE), 0, i->p);
    const int status = project(i, 0);
    return status == NCGEN_OK ? ncgen_look(i) : status;
}

/* A choice of what is held on its way. */
typedef struct choice {
    ncgen_instant *i;
    ncgen_active active;
} choice;

/* p says what is wanted, where that is held, and how joints slip. */
static int write_wanted(const choice *c)
{
    ncgen_instant *i = c->i;
    for (int h = 0; h < i->events->n_holds; ++h) {
        const ncgen_hold *hold = i->events->holds + h;
        if (c->active.wanted[h] && !c->active.before[h] && hold->held >= 0)
            i->p[hold->held] = i->numbers[hold->value];
        if (hold->kind == NCGEN_HOLDS_JOINT)
            i->p[hold->slip] = (ncgen_real)ncgen_slip_of(&c->active, h, (int)i->p[hold->slip], ncgen_side(i, hold->condition));
    }
    ncgen_write_held(i->events, c->active.wanted, 0, i->p);
    return ncgen_write_ways(i, &c->active);
}

/* Loads of what is wanted, from the state that the choice began with. */
static int find_loads(void *context, int projected)
{
    const choice *c = (const choice *)context;
    ncgen_instant *i = c->i;
    const ncgen_events *e = i->events;
    const ncgen_real *q = i->passage->room;
    ncgen_real *pairs = i->passage->room + 2 * i->n, *next = c->active.loads;
    int some = 0;
    ncgen_copy(i->n, q, i->moment->q);
    ncgen_copy(i->n, q + i->n, i->moment->qd);
    int status = write_wanted(c);
    for (int h = 0; h < e->n_holds; ++h)
        some |= c->active.wanted[h];
    if (!some && !e->follows_loads)
        return status;
    if (status == NCGEN_OK && some && projected)
        status = project(i, 1);
    if (status == NCGEN_OK && projected)
        status = ncgen_check_parts(i, pairs);
    if (status == NCGEN_OK)
        status = e->held_conditions(i->moment->t, i->moment->q, i->moment->qd, i->p, pairs);
    if (status == NCGEN_OK && projected && !ncgen_is_determined(e, pairs))
        status = NCGEN_UNDETERMINED;
    if (status == NCGEN_OK)
        ncgen_keep_ways(i, c->active.wanted, pairs);
    for (int h = 0; h < e->n_holds; ++h)
        for (int l = 0; c->active.wanted[h] && l < ncgen_loads_of(e->holds[h].kind); ++l) { /* loads begins where pairs do */
            const ncgen_real *load = pairs + 2 * (e->count + e->holds[h].load + l);
            *next++ = load[0];
            *next++ = load[1];
        }
    return status;
}

/* Gaps that have bounced are held no more, nor do contacts stick in which they are. */
static void open_gaps(ncgen_instant *i, const int *bounced)
{
    const ncgen_events *e = i->events;
    for (int h = 0; h < e->n_holds; ++h) {
        const ncgen_rubbing *rubbing = ncgen_rubbing_of(e, h);
        const int gap = rubbing ? rubbing->gap : h;
        if (ncgen_is_gap(e->holds + gap) && bounced[e->holds[gap].condition])
            i->p[e->holds[h].on] = 0;
    }
}

int ncgen_accelerate(ncgen_instant *i)
{
    ncgen_entered in;
    if (i->events->n_holds) {
        ncgen_enter_held(i->d, i->events, i->p, NULL, &in);
        return ncgen_evaluate_moment(&in.driven, i->p, i->moment);
    }
    if (!i->events->n_modes)
        return ncgen_evaluate_moment(i->d, i->p, i->moment);
    ncgen_enter(i->d, i->events, i->passage, &in);
    return ncgen_evaluate_moment(&in.driven, i->p, i->moment);
}

int ncgen_accelerate_open(ncgen_instant *i, const int *happened, int *bounced)
{
    const int has_modes = i->events->n_modes > 0, mode = has_modes ? *i->passage->mode : 0, hit = ncgen_was_hit(i);
    int opens = 0;
    for (int k = 0; k < i->count; ++k) {
        const int is_gap = k < ncgen_n_events(i) && ncgen_impact_of(i->events, k);
        bounced[k] = is_gap && (happened[k] || (hit && ncgen_is_closed(i, k)));
        opens |= bounced[k] && has_modes && ncgen_holds(i->events, i->passage, k);
    }
    ncgen_write_held(i->events, i->passage->flags, 0, i->p);
    open_gaps(i, bounced);
    if (opens)
        *i->passage->mode = 0;
    const int status = ncgen_accelerate(i);
    if (opens)
        *i->passage->mode = mode;
    return status;
}

/* What is known of what may be held. */
static int describe(ncgen_instant *i, const int *happened, const int *resting, int was_hit, int *marks)
{
    const ncgen_events *e = i->events;
    const int n = e->n_holds, *before = ncgen_flags(e, i->passage, NCGEN_BEFORE);
    int *kinds = marks, *needs = kinds + n, *has_happened = needs + n, *rests = has_happened + n, *closed = rests + n, *still = closed + n;
    int status = NCGEN_OK;
    for (int h = 0; h < n && status == NCGEN_OK; ++h) {
        const ncgen_hold *hold = e->holds + h;
        const int k = hold->condition, is_lock = ncgen_is_lock(hold), is_gap = ncgen_is_gap(hold);
        const ncgen_rubbing *rubbing = ncgen_rubbing_of(e, h);
        kinds[h] = hold->kind;
        needs[h] = rubbing ? rubbing->gap : -1;
        has_happened[h] = !is_lock && happened[k] && !(rubbing && rubbing->directions > 1);
        rests[h] = !is_lock && ((is_gap && resting[k]) || (before[h] && !was_hit) || ncgen_flags(e, i->passage, NCGEN_STUCK)[h]);
        closed[h] = is_gap && ncgen_is_closed(i, k);
        still[h] = !is_lock && is_still(i, hold);
        if (rubbing && rubbing->turn >= 0 && happened[rubbing->turn] && !still[h]) {
            const ncgen_slide slide = ncgen_slide_at(i, rubbing);
            still[h] = ncgen_slide_is_unseen(&slide);
        }
        int opposed = 0;
        if (rubbing && still[h] && !before[h])
            status = ncgen_is_opposed(i, rubbing, ncgen_flags(e, i->passage, NCGEN_RELEASED), &opposed);
        if (opposed)
            still[h] = NCGEN_OPPOSED;
    }
    return status;
}

/* How often joints and contacts have stuck, slipped or turned, and ratchets caught or released; qd (n): velocities before. */
static void count(const ncgen_instant *i, const ncgen_active *active, const ncgen_real *qd)
{
    for (int h = 0; h < active->count; ++h) {
        const ncgen_hold *hold = i->events->holds + h;
        const int change = ncgen_change_of(active, h);
        if (!change)
            continue;
        ncgen_note(i->passage->log, i->n, i->moment, hold->condition, change, qd, 0, 0);
        i->passage->happened[hold->condition] += !ncgen_is_gap(hold);
    }
}

int ncgen_choose_held(ncgen_instant *i, const int *happened, const int *resting, int was_hit)
{
    const ncgen_events *e = i->events;
    const int n = e->n_holds;
    int *before = ncgen_flags(e, i->passage, NCGEN_BEFORE), *wanted = ncgen_flags(e, i->passage, NCGEN_WANTED);
    int *released = ncgen_flags(e, i->passage, NCGEN_RELEASED), *marks = ncgen_flags(e, i->passage, NCGEN_ROOM);
    choice c = {i, {n, marks, marks + n, before, marks + 2 * n, marks + 3 * n, marks + 4 * n, marks + 5 * n, wanted, released,
                    i->passage->room + 2 * i->n, &c, find_loads}};
    int status = let_go(i, was_hit);
    if (status == NCGEN_OK)
        status = ncgen_find_numbers(i);
    if (status != NCGEN_OK)
        return status;
    ncgen_keep_slip(i);
    status = describe(i, happened, resting, was_hit, marks);
    if (status != NCGEN_OK)
        return status;
    ncgen_copy(i->n, i->moment->q, i->passage->room);
    ncgen_copy(i->n, i->moment->qd, i->passage->room + i->n);
    status = ncgen_find_active(&c.active);
    if (status != NCGEN_OK)
        return status;
    count(i, &c.active, i->passage->room + i->n);
    return NCGEN_OK;
}

/* Does a gap close if it falls from here on: was it let go, or is it closed and does not change? */
static int is_above(const ncgen_instant *i, int k)
{
    const ncgen_events *e = i->events;
    int released = e->n_modes && i->passage->wanted[i->count + k];
    for (int h = 0; h < e->n_holds; ++h)
        released |= ncgen_is_gap(e->holds + h) && e->holds[h].condition == k && ncgen_flags(e, i->passage, NCGEN_RELEASED)[h];
    return ncgen_impact_of(e, k) && (released || (ncgen_is_closed(i, k) && ncgen_is_still_along(i, k, 1)));
}

int ncgen_find_sides(ncgen_instant *i, const ncgen_chain *chain)
{
    const int status = ncgen_look(i);
    for (int k = 0; k < ncgen_n_events(i); ++k)
        i->taking[k] = is_above(i, k);
    ncgen_set_sides(chain, i->taking, i->passage->signs);
    for (int k = 0; k < i->count && i->events->n_modes; ++k)
        i->passage->wanted[i->count + k] = 0;
    return status;
}
