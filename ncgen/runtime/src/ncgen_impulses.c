/* ncgen_impulses.c: impacts of several contacts at one instant, together or in turn. */
#include "ncgen_impulses.h"
#include "ncgen_contact_laws.h"

/* Relative to what is added up: a velocity that counts as zero; energy that an impact may give. */
static const ncgen_scalar nothing = R(1.0e-12), gain = R(1.0e-9);

static ncgen_contact contact_of(const ncgen_impact *i, int number)
{
    return ncgen_contact_of(i->places, i->coefficients, number);
}

static const ncgen_real *row_of(const ncgen_impact *i, int row)
{
    return i->G + row * i->rows;
}

int ncgen_are_coupled(const ncgen_impact *i)
{
    for (int a = 0; a < i->count; ++a)
        for (int b = 0; b < i->count; ++b)
            for (int k = contact_of(i, a).gap; a != b && k <= contact_of(i, a).gap + contact_of(i, a).directions; ++k)
                for (int j = contact_of(i, b).gap; j <= contact_of(i, b).gap + contact_of(i, b).directions; ++j)
                    if (NCGEN_ABS(row_of(i, k)[j]) > nothing * NCGEN_SQRT(row_of(i, k)[k] * row_of(i, j)[j]))
                        return 1;
    return 0;
}

static int closes(const ncgen_impact *i, int gap)
{
    return i->velocities[gap] < -nothing * i->terms[gap];
}

/* The contact that closes fastest, or -1. */
static int fastest(const ncgen_impact *i)
{
    int best = -1;
    for (int b = 0; b < i->count; ++b) {
        const int gap = contact_of(i, b).gap;
        if (closes(i, gap) && (best < 0 || i->velocities[gap] < i->velocities[contact_of(i, best).gap]))
            best = b;
    }
    return best;
}

/* Velocities after impulses of some contacts, and what these take. */
static void push(const ncgen_impact *i, int first, int count, const ncgen_real *impulses)
{
    for (int b = first; b < first + count; ++b)
        for (int k = contact_of(i, b).gap; k <= contact_of(i, b).gap + contact_of(i, b).directions; ++k)
            i->lost[b] -= impulses[k] * (i->velocities[k] + ncgen_dot(i->rows, row_of(i, k), impulses) / 2);
    for (int k = 0; k < i->rows; ++k) {
        i->velocities[k] += ncgen_dot(i->rows, row_of(i, k), impulses);
        i->impulses[k] += impulses[k];
    }
}

static int hit_in_turn(ncgen_impact *i, ncgen_laws *l, ncgen_real *first, ncgen_real *impulses)
{
    for (int turn = 0; turn < NCGEN_MOST_TURNS; ++turn) {
        const int b = fastest(i);
        if (b < 0)
            return NCGEN_OK;
        const ncgen_contact c = contact_of(i, b);
        const int gap = c.gap;
        l->from = b;
        l->to = b + 1;
        for (int k = 0; k < i->rows; ++k)
            impulses[k] = 0;
        if (!c.directions)
            impulses[gap] = -(1 + c.restitution) * i->velocities[gap] / row_of(i, gap)[gap];
        else if (!ncgen_push_with_friction(l, i->velocities, first, impulses)) {
            i->which = b;
            return NCGEN_NO_IMPULSES;
        }
        push(i, b, 1, impulses);
        for (int k = 0; i->turns && k < 3; ++k)
            i->pushes[3 * turn + k] = k <= c.directions ? impulses[gap + k] : 0;
        if (i->turns)
            i->turns[turn] = b;
        i->n_turns = turn + 1;
    }
    if (fastest(i) < 0)
        return NCGEN_OK;
    return NCGEN_ENDLESS;
}

static int hit_together(ncgen_impact *i, ncgen_laws *l, ncgen_real *first, ncgen_real *impulses)
{
    int rubs = 0;
    for (int b = 0; b < i->count; ++b)
        rubs |= contact_of(i, b).directions > 0;
    if (rubs && !ncgen_push_with_friction(l, i->velocities, first, impulses))
        return NCGEN_NO_IMPULSES;
    if (!rubs) {
        for (int b = 0; b < i->count; ++b)
            l->bias[contact_of(i, b).gap] = (1 + contact_of(i, b).restitution) * i->velocities[contact_of(i, b).gap];
        ncgen_push_only(l, impulses);
    }
    push(i, 0, i->count, impulses);
    return NCGEN_OK;
}

/* Whether friction holds each, and whether they gave energy. */
static int finish(ncgen_impact *i)
{
    ncgen_real lost = 0, sizes = 0;
    for (int b = 0; b < i->count; ++b) {
        const ncgen_contact c = contact_of(i, b);
        const int gap = c.gap, n = c.directions;
        ncgen_real most = 0;
        for (int k = gap; k <= gap + n; ++k) {
            ncgen_real sum = 0;
            for (int j = 0; j < i->rows; ++j)
                sum += NCGEN_ABS(row_of(i, k)[j] * i->impulses[j]);
            most = sum > most ? sum : most;
        }
        i->sticks[b] = n && i->impulses[gap] > 0 && ncgen_norm(n, i->impulses + gap + 1) < c.friction * i->impulses[gap] &&
                       ncgen_norm(n, i->velocities + gap + 1) <= nothing * most;
        lost += i->lost[b];
        sizes += NCGEN_ABS(i->lost[b]);
    }
    if (lost < -gain * (sizes + i->energy))
        return NCGEN_GAIN;
    return NCGEN_OK;
}

size_t ncgen_impact_workspace(int rows)
{
    return NCGEN_IMPACT_WORKSPACE((size_t)rows);
}

int ncgen_impact_of_gaps(ncgen_impact *i)
{
    const int rows = i->rows;
    ncgen_space space = {i->workspace, 0};
    ncgen_laws l;
    ncgen_lay_out_laws(i->count, rows, i->places, i->coefficients, i->G, &space, &l);
    ncgen_real *first = ncgen_take(&space, rows), *impulses = ncgen_take(&space, rows);
    for (int k = 0; k < rows; ++k)
        i->impulses[k] = impulses[k] = 0;
    for (int b = 0; b < i->count; ++b) {
        i->lost[b] = 0;
        i->sticks[b] = 0;
        const ncgen_contact c = contact_of(i, b);
        if (!(row_of(i, c.gap)[c.gap] > 0) && (closes(i, c.gap) || c.directions)) {
            i->which = b;
            return NCGEN_SINGULAR;
        }
    }
    i->n_turns = 0;
    i->which = -1;
    i->closes = fastest(i) >= 0;
    if (!i->closes)
        return NCGEN_OK;
    if (i->law == NCGEN_NO_LAW && ncgen_are_coupled(i))
        return NCGEN_NO_ORDER;
    const int status = i->law == NCGEN_IN_TURN ? hit_in_turn(i, &l, first, impulses) : hit_together(i, &l, first, impulses);
    return status == NCGEN_OK ? finish(i) : status;
}
