/* ncgen_active.c: which gaps stay closed and what sticks after an instant. */
#include "ncgen_active.h"
#include "ncgen_vectors.h"

/* A load on the wrong side by less than this share of its size is held; the same where velocities are those before a projection, which
 * moves them by a rounding. */
static const ncgen_scalar slack = R(1.0e-10), slack_before = R(1.0e-6);

/* Where a contact begins to slide, so do others whose friction has no more than this share left, if they would slide the same way. */
static const ncgen_scalar friction_reserve = R(1.0e-8);

/* Something is still whose velocity is below this share of its terms. */
static const ncgen_scalar standstill = R(1.0e-9);

/* A direction is blocked in which less than this share of its mobility is left: rounding. */
static const ncgen_scalar least_mobility = R(1.0e-9);

/* Velocities satisfy constraints that they miss by less than this share of their terms. */
static const ncgen_scalar allowed = R(1.0e-9);

int ncgen_loads_of(int kind)
{
    return kind == NCGEN_HOLDS_JOINT ? 2 : kind != NCGEN_HOLDS_LOCK;
}

int ncgen_side_of(int kind, int l)
{
    return kind == NCGEN_HOLDS_JOINT && !l ? -1 : 1;
}

int ncgen_way_of(int kind, int is_held, int touches, int slip, int direction)
{
    if (is_held || (kind == NCGEN_HOLDS_CONTACT && !touches) || (kind == NCGEN_HOLDS_JOINT && !slip))
        return NCGEN_UNWATCHED;
    return kind == NCGEN_HOLDS_CONTACT ? -1 : kind == NCGEN_HOLDS_JOINT ? -slip : direction;
}

int ncgen_is_still(ncgen_scalar velocity, ncgen_scalar terms, ncgen_scalar drift)
{
    return NCGEN_ABS(velocity) <= standstill * (terms + NCGEN_ABS(drift));
}

int ncgen_is_blocked(ncgen_scalar mobility, ncgen_scalar whole)
{
    return mobility <= least_mobility * whole;
}

int ncgen_is_missed(const ncgen_pattern *phi_q, const ncgen_real *values, const ncgen_real *nu, const ncgen_scalar *sizes, ncgen_scalar speed,
    const ncgen_real *qd)
{
    for (int r = 0; r < phi_q->rows; ++r) {
        ncgen_real sum = nu ? -nu[r] : 0, terms = NCGEN_ABS(sum);
        for (int k = phi_q->indptr[r]; k < phi_q->indptr[r + 1]; ++k) {
            const int j = phi_q->indices[k];
            const ncgen_real now = NCGEN_ABS(qd[j]), before = speed * sizes[j];
            sum += values[k] * qd[j];
            terms += NCGEN_ABS(values[k]) * (now > before ? now : before);
        }
        if (!(NCGEN_ABS(sum) <= allowed * terms))
            return 1;
    }
    return 0;
}

int ncgen_is_used_up(ncgen_scalar value, ncgen_scalar size, int nearly)
{
    return nearly ? value <= slack * size : value < -slack * size;
}

int ncgen_slip_of(const ncgen_active *a, int k, int slip, int side)
{
    if (a->wanted[k] || a->released[k])
        return a->wanted[k] ? 0 : a->released[k];
    return !slip || a->happened[k] || !a->still[k] ? side : slip;
}

int ncgen_slide_of(const ncgen_active *a, int k, int released, int moves)
{
    if (a->wanted[k] || !a->wanted[a->needs[k]])
        return NCGEN_SLIDES_NOT;
    if (a->released[k] && released)
        return NCGEN_BEGINS;
    return moves && !a->still[k] ? NCGEN_SLIDES_ON : NCGEN_SLIDES_AS_BEFORE;
}

int ncgen_change_of(const ncgen_active *a, int k)
{
    const int slips = a->kinds[k] == NCGEN_HOLDS_JOINT || a->kinds[k] == NCGEN_HOLDS_CONTACT, held = a->wanted[k];
    if (a->kinds[k] == NCGEN_HOLDS_LOCK)
        return 0;
    if (held == a->before[k])
        return slips && a->happened[k] && !held ? NCGEN_TURNS : 0;
    if (a->needs[k] >= 0 && !a->wanted[a->needs[k]])
        return 0; /* it leaves */
    return held ? NCGEN_RESTS : NCGEN_LEAVES;
}

/* Whether a gap is closed and does not open, or a joint or a contact does not move. */
static int may_hold(const ncgen_active *a, int k)
{
    if (a->rests[k])
        return 1;
    switch (a->kinds[k]) {
    case NCGEN_HOLDS_LOCK:
        return 0;
    case NCGEN_HOLDS_GAP:
    case NCGEN_HOLDS_RUBBING_GAP:
        return a->closed[k] && a->still[k] && (a->before[k] || !a->happened[k]);
    default:
        return a->still[k] || a->happened[k];
    }
}

/* A contact that is open does not stick. */
static void drop_open(ncgen_active *a)
{
    for (int k = 0; k < a->count; ++k)
        if (a->needs[k] >= 0 && !a->wanted[a->needs[k]])
            a->wanted[k] = 0;
}

/* All that may be held, but for what was released. What a joint bore may push a gap closed; and where a contact is at rest that has slipped,
 * it may take over, so loads are shared anew; not where it is opposed to those that were released. */
static void want(ncgen_active *a)
{
    int joints = 0, takes_over = 0;
    for (int k = 0; k < a->count; ++k) {
        a->wanted[k] = may_hold(a, k);
        joints |= a->released[k] && a->kinds[k] == NCGEN_HOLDS_JOINT;
        takes_over |= a->wanted[k] && !a->before[k] && !a->released[k] && a->kinds[k] == NCGEN_HOLDS_CONTACT && a->still[k] != NCGEN_OPPOSED;
    }
    for (int k = 0; k < a->count; ++k) {
        const int pushes = a->kinds[k] == NCGEN_HOLDS_GAP || a->kinds[k] == NCGEN_HOLDS_RATCHET;
        if ((joints && pushes) || (takes_over && a->kinds[k] == NCGEN_HOLDS_CONTACT))
            a->released[k] = 0;
        a->wanted[k] = a->wanted[k] && !a->released[k];
    }
    drop_open(a);
}

/* What its load violates most, by more than `least` of its size, or -1; *side: to which it is released. reserve: that contacts must have. */
static int worst(const ncgen_active *a, ncgen_scalar least, ncgen_scalar reserve, int *side)
{
    const ncgen_real *load = a->loads;
    ncgen_real most = least;
    int candidate = -1;
    for (int k = 0; k < a->count; ++k)
        for (int l = 0; a->wanted[k] && l < ncgen_loads_of(a->kinds[k]); ++l, load += 2) {
            const int joint = a->kinds[k] == NCGEN_HOLDS_JOINT, old = joint || a->before[k];
            const int joins = a->still[k] != NCGEN_OPPOSED; /* else it stands at its limit and moves away from it, but for as much */
            const ncgen_scalar needed = a->kinds[k] == NCGEN_HOLDS_CONTACT ? (joins ? reserve : -reserve) : old ? 0 : 2 * slack;
            const ncgen_real over = needed - (load[1] > 0 ? load[0] / load[1] : 0);
            if (over > most) {
                most = over;
                candidate = k;
                *side = ncgen_side_of(a->kinds[k], l);
            }
        }
    return candidate;
}

int ncgen_find_active(ncgen_active *a)
{
    ncgen_scalar reserve = 0;
    for (int k = 0; k < a->count; ++k)
        reserve = a->released[k] && a->kinds[k] == NCGEN_HOLDS_CONTACT ? friction_reserve : reserve;
    want(a);
    for (int round = 0; round <= a->count; ++round) {
        int some = 0, others = 0, candidate = -1, side = 0, status = NCGEN_OK;
        for (int k = 0; k < a->count; ++k) {
            some |= a->wanted[k];
            others |= a->wanted[k] && a->kinds[k] != NCGEN_HOLDS_JOINT;
        }
        if (some && !others) { /* joints that stand still: their loads there say it without projecting */
            status = a->find_loads(a->context, 0);
            candidate = status == NCGEN_OK ? worst(a, slack_before, reserve, &side) : -1;
        }
        if (status == NCGEN_OK && candidate < 0) {
            status = a->find_loads(a->context, 1);
            candidate = status == NCGEN_OK ? worst(a, slack, reserve, &side) : -1;
        }
        if (status != NCGEN_OK || candidate < 0)
            return status;
        a->released[candidate] = side;
        a->wanted[candidate] = 0;
        drop_open(a);
    }
    return NCGEN_NO_MODE;
}
