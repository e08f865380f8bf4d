/* ncgen_breaks.c: the times at which laws of time change their formula, and a motion that ends its parts there. */
#include "ncgen_breaks.h"
#include "ncgen_state.h"

/* Where a law of time changes its formula, and how far from there it may have that of the other side: no stage is computed so near. */
typedef struct break_time {
    ncgen_scalar t, gap;
} break_time;

static break_time break_at(ncgen_scalar t, ncgen_scalar size, ncgen_scalar rounding)
{
    const ncgen_scalar largest = NCGEN_ABS(t) > size ? NCGEN_ABS(t) : size;
    const break_time next = {t, R(1e-30) + 4 * rounding * largest}; /* at 0, too */
    return next;
}

static break_time earlier(break_time a, break_time b)
{
    return a.t - a.gap < b.t - b.gap ? a : b;
}

/* The first of the straight switches that does not lie behind t, or `first`. */
static break_time first_of_lines(const ncgen_breaks *b, const ncgen_real *p, ncgen_scalar t, break_time first, ncgen_scalar rounding)
{
    b->switches(t, p, b->workspace);
    for (int k = 0; k < b->lines; ++k) {
        const ncgen_real *of = b->workspace + 4 * k;
        for (int side = 0; side < 2 && NCGEN_ABS(of[2]) > 0; ++side) {
            const break_time next = break_at(of[side] / of[2], NCGEN_ABS(of[3] / of[2]), rounding);
            if (next.t + next.gap / 2 > t)
                first = earlier(next, first);
        }
    }
    return first;
}

/* Is one of the curves in another piece at this time than the first half of the workspace has? */
static int has_switched(const ncgen_breaks *b, const ncgen_real *p, ncgen_scalar t)
{
    const int size = 4 * b->lines + b->curves;
    b->switches(t, p, b->workspace + size);
    for (int k = 4 * b->lines; k < size; ++k)
        if (NCGEN_ABS(b->workspace[size + k] - b->workspace[k]) > 0)
            return 1;
    return 0;
}

/* The same of the curves, by looking at intervals and halving the one in which something has changed. */
static break_time first_of_curves(const ncgen_breaks *b, const ncgen_real *p, ncgen_scalar t, break_time first, ncgen_scalar rounding)
{
    ncgen_scalar low = t - break_at(t, 0, rounding).gap / 2, high;
    b->switches(low, p, b->workspace);
    for (; low < first.t; low = high) {
        high = low + b->interval + 64 * rounding * NCGEN_ABS(low);
        if (high > first.t)
            high = first.t;
        if (!has_switched(b, p, high))
            continue;
        for (ncgen_scalar middle; middle = low + (high - low) / 2, middle > low && middle < high;)
            if (has_switched(b, p, middle))
                high = middle;
            else
                low = middle;
        return earlier(break_at(high, 0, rounding), first);
    }
    return first;
}

/* The first break that does not lie behind t, or one at `end` where there is none before. */
static break_time next_change(const ncgen_breaks *b, const ncgen_real *p, ncgen_scalar t, ncgen_scalar end, ncgen_scalar rounding)
{
    break_time first = {end, 0};
    if (b->lines > 0)
        first = first_of_lines(b, p, t, first, rounding);
    return b->curves > 0 ? first_of_curves(b, p, t, first, rounding) : first;
}

ncgen_scalar ncgen_break_after(const ncgen_breaks *b, const ncgen_real *p, ncgen_scalar t, ncgen_scalar t_end)
{
    const ncgen_scalar rounding = ncgen_rounding();
    break_time next = next_change(b, p, t, t_end, rounding);
    while (next.t < t_end && !(next.t - next.gap > t)) {
        t = next.t + next.gap;
        next = next_change(b, p, t, t_end, rounding);
    }
    return next.t;
}

ncgen_scalar ncgen_time_next_to_break(const ncgen_breaks *b, const ncgen_real *p, ncgen_scalar t, int behind)
{
    const ncgen_scalar rounding = ncgen_rounding();
    const break_time here = break_at(t, 0, rounding);
    const break_time next = next_change(b, p, t - here.gap / 2, t + 4 * here.gap, rounding);
    if (next.t < t + 4 * here.gap && next.t - next.gap <= t && t < next.t + next.gap)
        return behind ? next.t + next.gap : next.t - next.gap;
    return t;
}

static ncgen_real kinetic_energy(const ncgen_driven *d, const ncgen_real *p, const ncgen_moment *moment)
{
    ncgen_real energies[3] = {0, 0, 0};
    if (d->model->energy)
        d->model->energy(moment->t, moment->q, moment->qd, p, energies);
    return energies[0];
}

/* Past a break, where the velocities of drivers may jump: that changes kinetic energy by the work of their impulses. */
static int cross(const ncgen_driven *d, const ncgen_breaks *b, const ncgen_real *p, ncgen_moment *moment, ncgen_scalar t)
{
    const ncgen_real before = b->jumps ? kinetic_energy(d, p, moment) : 0;
    moment->t = t;
    const int status = ncgen_project_moment(d, p, moment);
    if (b->jumps)
        moment->work += kinetic_energy(d, p, moment) - before;
    return status;
}

int ncgen_advance_over_breaks(const ncgen_driven *d, const ncgen_breaks *b, const ncgen_real *p, ncgen_moment *moment, ncgen_scalar t_end,
                         ncgen_statistics *statistics)
{
    const ncgen_scalar rounding = ncgen_rounding(), beyond = t_end + 2 * break_at(t_end, NCGEN_ABS(moment->t), rounding).gap;
    int status = NCGEN_OK;
    statistics->stopped = 0;
    while (status == NCGEN_OK && moment->t < t_end && !statistics->stopped) {
        const ncgen_scalar t = moment->t;
        const break_time next = next_change(b, p, t, beyond, rounding);
        const ncgen_scalar before = next.t - next.gap, behind = next.t + next.gap, goal = before < t_end ? before : t_end;
        if (before > t && goal > t + break_at(t, 0, rounding).gap)
            status = ncgen_advance(d, p, moment, goal, statistics);
        else if (before > t)
            moment->t = goal;
        else if (behind < t_end)
            status = cross(d, b, p, moment, behind);
        else
            moment->t = t_end;
    }
    return status;
}
