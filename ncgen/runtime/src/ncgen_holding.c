/* ncgen_holding.c: what is held: all that may be, less what a load of the wrong sign, or beyond friction, releases, the worst one first. */
#include "ncgen_holding.h"
#include "ncgen_state.h"

/* A load on the wrong side by less than this share of all loads is held; the same where velocities are those before a projection. */
static const ncgen_scalar slack = R(1.0e-10), slack_before = R(1.0e-6);

/* A gap does not change, and a joint does not move, whose velocity is below this share of what it adds up. */
static const ncgen_scalar standstill = R(1.0e-9);

/* Of velocities that miss the constraints after a lock has closed. */
static const ncgen_scalar locked = R(1.0e-9);

static int *flags(const ncgen_events *events, const ncgen_passage *passage, int which)
{
    return passage->flags + which * events->n_holds;
}

static int *held_before(const ncgen_events *events, const ncgen_passage *passage)
{
    return flags(events, passage, 0);
}

static int *wanted_of(const ncgen_events *events, const ncgen_passage *passage)
{
    return flags(events, passage, 1);
}

static int *released_of(const ncgen_events *events, const ncgen_passage *passage)
{
    return flags(events, passage, 2);
}

static ncgen_real speed_of(const ncgen_instant *i, const ncgen_real *qd)
{
    return ncgen_largest(i->n, qd, i->d->dynamics->column_sizes);
}

/* Does a gap not change, or a joint or ratchet not move, but for rounding? */
static int is_still(const ncgen_instant *i, const ncgen_hold *hold)
{
    const ncgen_scalar *sizes = i->d->dynamics->column_sizes;
    const ncgen_real now = speed_of(i, i->moment->qd), before = speed_of(i, i->arrived), *w = ncgen_gradient(i, hold->condition);
    const int is_gap = hold->kind == NCGEN_HOLDS_GAP;
    const ncgen_real drift = is_gap ? w[2 * i->n] : 0;
    ncgen_real sum = drift, size = 0;
    for (int j = 0; j < i->n; ++j) {
        sum += w[j] * i->moment->qd[j];
        size += NCGEN_ABS(w[j]) * sizes[j];
    }
    const ncgen_real speed = is_gap || now > before ? now : before;
    return NCGEN_ABS(sum) <= standstill * (size * speed + NCGEN_ABS(drift));
}

int ncgen_skip_blocked(ncgen_instant *i, ncgen_entered *in)
{
    const ncgen_events *e = i->events;
    int status = NCGEN_OK;
    if (in->driven.model == i->d->model)
        return NCGEN_OK;
    for (int h = 0; h < e->n_holds && status == NCGEN_OK; ++h) {
        const ncgen_hold *hold = e->holds + h;
        if (ncgen_is_lock(hold) || i->p[hold->on] > 0 || !is_still(i, hold))
            continue;
        if (hold->kind == NCGEN_HOLDS_GAP && !ncgen_is_closed(i, hold->condition))
            continue;
        int can = 1;
        status = ncgen_can_move(i, hold->condition, &can);
        if (!can)
            i->passage->directions[hold->condition] = NCGEN_UNWATCHED;
    }
    return status;
}

/* The hold whose load is on the wrong side by most, if by more than `least` of all loads, and the side to which it begins to move. */
static int worst(const ncgen_instant *i, const int *wanted, const ncgen_real *pairs, ncgen_scalar least, int *side)
{
    const ncgen_events *e = i->events;
    const int *before = held_before(e, i->passage);
    int violated = -1;
    ncgen_real most = least;
    for (int h = 0; h < e->n_holds; ++h)
        for (int l = 0; wanted[h] && l < ncgen_loads_of(e->holds + h); ++l) {
            const ncgen_real *load = pairs + 2 * (e->count + e->holds[h].load + l);
            const ncgen_scalar reserve = e->holds[h].kind == NCGEN_HOLDS_JOINT || before[h] ? 0 : 2 * slack;
            const ncgen_real over = reserve - (load[1] > 0 ? load[0] / load[1] : 0);
            if (over > most) {
                most = over;
                violated = h;
                ncgen_release_to(e->holds + h, l, side);
            }
        }
    return violated;
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

static int find_places(ncgen_instant *i)
{
    return i->events->values ? i->events->values(i->moment->t, i->moment->q, i->moment->qd, i->p, i->numbers) : NCGEN_OK;
}

/* Velocities that miss the constraints of a mechanism, over those of the mechanism in natural sizes. */
static int misses(ncgen_instant *i, const ncgen_driven *d, int *does)
{
    const ncgen_model *model = d->model;
    const ncgen_pattern *pattern = &model->phi_q_pattern;
    ncgen_real *values = d->workspace, *nu = values + ncgen_nonzeros(pattern); /* which no call uses now */
    int status = model->phi_q(i->moment->t, i->moment->q, i->p, values);
    *does = 0;
    if (status == NCGEN_OK && model->nu)
        status = model->nu(i->moment->t, i->moment->q, i->p, nu);
    for (int r = 0; r < model->n_rows && status == NCGEN_OK; ++r) {
        ncgen_real sum = model->nu ? -nu[r] : 0, size = NCGEN_ABS(sum) + d->dynamics->row_sizes[r] * speed_of(i, i->moment->qd);
        for (int k = pattern->indptr[r]; k < pattern->indptr[r + 1]; ++k)
            sum += values[k] * i->moment->qd[pattern->indices[k]];
        *does |= !(NCGEN_ABS(sum) <= locked * size);
    }
    return status;
}

int ncgen_lock(ncgen_instant *i, int h)
{
    const ncgen_hold *hold = i->events->holds + h;
    ncgen_entered in;
    int missed;
    if (i->p[hold->on] > 0)
        return NCGEN_OK;
    int status = find_places(i);
    if (status != NCGEN_OK)
        return status;
    i->p[hold->held] = i->numbers[hold->value];
    i->p[hold->on] = 1;
    ncgen_enter_held(i->d, i->events, i->p, NULL, &in);
    status = ncgen_project_velocities(&in.driven, i->p, i->moment);
    if (status == NCGEN_OK)
        status = misses(i, &in.driven, &missed);
    return status == NCGEN_OK && missed ? NCGEN_MOVED : status;
}

/* The velocity of a joint. */
static int sign_of(const ncgen_instant *i, int condition)
{
    return (i->values[2 * condition] > 0) - (i->values[2 * condition] < 0);
}

void ncgen_begin_slip(ncgen_instant *i)
{
    for (int h = 0; h < i->events->n_holds; ++h) {
        const ncgen_hold *hold = i->events->holds + h;
        if (hold->kind == NCGEN_HOLDS_JOINT)
            i->p[hold->slip] = is_still(i, hold) ? 0 : sign_of(i, hold->condition);
    }
}

/* What is held does not slip, what was released does to its side, and others slip as they move. */
static void set_slip(ncgen_instant *i, const int *wanted, const int *released, const int *happened)
{
    for (int h = 0; h < i->events->n_holds; ++h) {
        const ncgen_hold *hold = i->events->holds + h;
        if (hold->kind != NCGEN_HOLDS_JOINT)
            continue;
        if (wanted[h] || released[h])
            i->p[hold->slip] = wanted[h] ? 0 : released[h];
        else if (!(NCGEN_ABS(i->p[hold->slip]) > 0) || happened[hold->condition] || !is_still(i, hold))
            i->p[hold->slip] = sign_of(i, hold->condition);
    }
}

/* What may be held: gaps that are closed and do not open, joints and ratchets that do not move, and what nothing has hit. */
static int find_wanted(ncgen_instant *i, const int *happened, const int *resting, int was_hit)
{
    const ncgen_events *e = i->events;
    int *wanted = wanted_of(e, i->passage);
    const int *before = held_before(e, i->passage), *released = released_of(e, i->passage);
    int status = find_places(i);
    for (int h = 0; h < e->n_holds && status == NCGEN_OK; ++h) {
        const ncgen_hold *hold = e->holds + h;
        const int k = hold->condition;
        if (ncgen_is_lock(hold)) {
            wanted[h] = 0;
            continue;
        }
        const int is_gap = hold->kind == NCGEN_HOLDS_GAP;
        const int stays = is_gap ? ncgen_is_closed(i, k) && is_still(i, hold) && (before[h] || !happened[k]) : happened[k] || is_still(i, hold);
        wanted[h] = !released[h] && ((is_gap && resting[k]) || (before[h] && !was_hit) || stays);
        if (wanted[h] && !before[h] && hold->held >= 0)
            i->p[hold->held] = i->numbers[hold->value];
    }
    return status;
}

/* What was held and has been released begins to move with no velocity, not with one of rounding; what a joint bore may push a gap closed. */
static int let_go(ncgen_instant *i, int was_hit)
{
    const ncgen_events *e = i->events;
    int *released = released_of(e, i->passage), some = 0, joints = 0;
    for (int h = 0; h < e->n_holds; ++h) {
        some |= released[h];
        joints |= released[h] && e->holds[h].kind == NCGEN_HOLDS_JOINT;
    }
    for (int h = 0; h < e->n_holds; ++h)
        released[h] = joints && e->holds[h].kind != NCGEN_HOLDS_JOINT ? 0 : released[h];
    if (!some || was_hit)
        return NCGEN_OK;
    ncgen_write_held(e, held_before(e, i->passage), 0, i->p);
    const int status = project(i, 0);
    return status == NCGEN_OK ? ncgen_look(i) : status;
}

/* The moment q, qd of the start in the mode that is wanted, and what must be released there, -1 for nothing. */
static int try_mode(ncgen_instant *i, const ncgen_real *q, const ncgen_real *qd, const int *wanted, int *released, int *violated)
{
    const ncgen_events *e = i->events;
    ncgen_real *pairs = i->passage->room + 2 * i->n;
    int some = 0, others = 0, status = NCGEN_OK, side = 0;
    *violated = -1;
    for (int h = 0; h < e->n_holds; ++h) {
        some |= wanted[h];
        others |= wanted[h] && e->holds[h].kind != NCGEN_HOLDS_JOINT;
    }
    ncgen_write_held(e, wanted, 0, i->p);
    if (!some)
        return NCGEN_OK;
    if (!others) { /* joints that stand still: their loads there say it without projecting */
        status = e->held_conditions(i->moment->t, q, qd, i->p, pairs);
        *violated = status == NCGEN_OK ? worst(i, wanted, pairs, slack_before, &side) : -1;
    }
    if (status == NCGEN_OK && *violated < 0) {
        status = project(i, 1);
        if (status == NCGEN_OK)
            status = e->held_conditions(i->moment->t, i->moment->q, i->moment->qd, i->p, pairs);
        *violated = status == NCGEN_OK ? worst(i, wanted, pairs, slack, &side) : -1;
    }
    if (*violated >= 0)
        released[*violated] = side;
    return status;
}

/* How often joints have stuck, slipped or turned, and ratchets caught or released; qd (n): velocities before. */
static void count(const ncgen_instant *i, const int *happened, const ncgen_real *qd)
{
    const ncgen_events *e = i->events;
    for (int h = 0; h < e->n_holds; ++h) {
        const ncgen_hold *hold = e->holds + h;
        const int held = wanted_of(e, i->passage)[h], changes = held != held_before(e, i->passage)[h];
        const int turns = hold->kind == NCGEN_HOLDS_JOINT && happened[hold->condition] && !held && !changes;
        if (turns || (changes && !ncgen_is_lock(hold)))
            ncgen_note(i->passage->log, i->n, i->moment, hold->condition, turns ? NCGEN_TURNS : held ? NCGEN_RESTS : NCGEN_LEAVES, qd, 0, 0);
        if (hold->kind == NCGEN_HOLDS_RATCHET || hold->kind == NCGEN_HOLDS_JOINT)
            i->passage->happened[hold->condition] += changes || (hold->kind == NCGEN_HOLDS_JOINT && happened[hold->condition]);
    }
}

int ncgen_choose_held(ncgen_instant *i, const int *happened, const int *resting, int was_hit)
{
    const ncgen_events *e = i->events;
    ncgen_real *q = i->passage->room, *qd = q + i->n;
    int *wanted = wanted_of(e, i->passage), *released = released_of(e, i->passage);
    int status = let_go(i, was_hit), violated = 0;
    if (status == NCGEN_OK)
        status = find_wanted(i, happened, resting, was_hit);
    ncgen_copy(i->n, i->moment->q, q);
    ncgen_copy(i->n, i->moment->qd, qd);
    for (int round = 0; status == NCGEN_OK && violated >= 0; ++round) {
        if (round > e->n_holds)
            return NCGEN_NO_MODE;
        ncgen_copy(i->n, q, i->moment->q);
        ncgen_copy(i->n, qd, i->moment->qd);
        set_slip(i, wanted, released, happened);
        status = try_mode(i, q, qd, wanted, released, &violated);
        if (violated >= 0)
            wanted[violated] = 0;
    }
    if (status != NCGEN_OK)
        return status;
    count(i, happened, qd);
    for (int h = 0; h < e->n_holds; ++h)
        if (e->holds[h].kind == NCGEN_HOLDS_GAP && (released[h] || wanted[h]))
            i->passage->signs[e->holds[h].condition] = 1;
    return NCGEN_OK;
}
