/* ncgen_step_rules.h: errors of explicit steps, how long the first and the next ones are, and which of them speak for a stiff mechanism; of
 * numbers or of lanes. */
#ifndef NCGEN_STEP_RULES_H
#define NCGEN_STEP_RULES_H

#include "ncgen_runtime.h"

#ifndef NCGEN_LANES_H
typedef int ncgen_mask;

static inline ncgen_real ncgen_select(ncgen_mask is_first, ncgen_real a, ncgen_real b)
{
    return is_first ? a : b;
}
#endif

static inline ncgen_real ncgen_at_most(ncgen_real x, ncgen_real limit)
{
    return ncgen_select(x > limit, limit, x);
}

/* The error that a component may have whose size is that of a or b. */
static inline ncgen_real ncgen_tolerance_of(const ncgen_options *options, int i, ncgen_real a, ncgen_real b)
{
    const ncgen_real u = NCGEN_ABS(a), v = NCGEN_ABS(b);
    return options->atol * (options->sizes ? options->sizes[i] : 1) + options->rtol * ncgen_select(u > v, u, v);
}

/* The square of the first components of x in units of what is tolerated at a and b, a mean over as many as have errors. */
static inline ncgen_real ncgen_mean_square(const ncgen_options *options, int error_size, int count, const ncgen_real *x, const ncgen_real *a,
                                           const ncgen_real *b)
{
    ncgen_real sum = NCGEN_SPLAT((ncgen_scalar)0);
    for (int i = 0; i < count; ++i) {
        const ncgen_real scaled = x[i] / ncgen_tolerance_of(options, i, a[i], b[i]);
        sum += scaled * scaled;
    }
    return sum / (ncgen_scalar)error_size;
}

/* The error of a step of length h, of two estimates over h, squared: the second one, of low order, damps the first. */
static inline ncgen_real ncgen_damped_error(ncgen_real h, ncgen_real first, ncgen_real second)
{
    const ncgen_real both = first + (ncgen_scalar)0.01L * second;
    return ncgen_select(both > 0, h * first / NCGEN_SQRT(both), both);
}

/* By how much the next step may be longer than one with this error over its tolerance, at most. */
static inline ncgen_real ncgen_length_factor(ncgen_real error, int order)
{
    const ncgen_scalar power = -1 / (ncgen_scalar)(order + 1);
    return ncgen_select(error > 0, (ncgen_scalar)0.9L * NCGEN_POW(error, NCGEN_SPLAT(power)), NCGEN_SPLAT((ncgen_scalar)10));
}

/* A first step from the sizes of y and yd (Hairer, Norsett & Wanner, II.4), with which that of ydd is estimated. */
static inline ncgen_real ncgen_first_guess(ncgen_real size, ncgen_real rate, ncgen_real span)
{
    const ncgen_scalar tiny = (ncgen_scalar)1.0e-5L;
    const ncgen_real guess = (ncgen_scalar)0.01L * size / rate;
    return ncgen_at_most(ncgen_select((size < tiny) | (rate < tiny), NCGEN_SPLAT((ncgen_scalar)1.0e-6L), guess), span);
}

/* The first step from these; a hundredth of the guess where it led to no numbers. */
static inline ncgen_real ncgen_better_guess(ncgen_real guess, ncgen_real rate, ncgen_real second, int order, ncgen_real span)
{
    const ncgen_real largest = ncgen_select(rate > second, rate, second), root = NCGEN_SPLAT(1 / (ncgen_scalar)(order + 1));
    const ncgen_real power = NCGEN_POW((ncgen_scalar)0.01L / largest, root);
    const ncgen_real better = ncgen_select(largest <= (ncgen_scalar)1.0e-15L, guess * (ncgen_scalar)1.0e-3L, power);
    return ncgen_select(second - second >= 0, ncgen_at_most(ncgen_at_most(better, 100 * guess), span), guess * (ncgen_scalar)0.01L);
}

/* Stiffness ---------------------------------------------------------------------------------------------------- */

enum {
    NCGEN_STIFF_EVERY = 16, /* accepted steps between two looks, as long as nothing speaks for it and there is far to go */
    NCGEN_STIFF_LIMIT = 15, /* steps in a row that speak for it before it counts */
    NCGEN_STIFF_DOUBT = 6   /* steps that speak against it and make these count anew */
};

/* A step with its length, its last two stages, which are both at its end, and the derivatives there. */
typedef struct ncgen_stage_pair {
    ncgen_real h;
    const ncgen_real *y, *new_y, *at; /* where it begins and ends; the last stage but one */
    const ncgen_real *first, *second; /* derivatives at that, and at the end */
} ncgen_stage_pair;

/* Does an accepted step speak for a stiff mechanism? It does where the motion itself, whose rate its derivatives show, would allow
 * far longer ones at this tolerance, and what holds it down is the stability of the method: the last two stages are both at
 * the end of the step, and the difference of their derivatives over that of their states is about the largest eigenvalue (Hairer
 * and Wanner, Solving Ordinary Differential Equations II, IV.2). The first `count` components are looked at, without work, since nothing
 * depends on it; needed: how far accuracy lets a step move, in its own length; *moved: how far it has, as a share of that. */
static inline ncgen_mask ncgen_is_held_by_stability(const ncgen_options *options, int count, const ncgen_stage_pair *s,
                                                    ncgen_scalar needed, ncgen_scalar stability, ncgen_real *moved)
{
    /* From this share of the interval on the real axis stability begins to hold steps down: along the imaginary axis, where springs without
     * damping are, it may end at 0.4 of that. */
    const ncgen_scalar bound = (ncgen_scalar)0.3L * stability;
    ncgen_real changes = NCGEN_SPLAT((ncgen_scalar)0), states = changes, rates = changes, sizes = changes;
    for (int i = 0; i < count; ++i) {
        const ncgen_real size = ncgen_tolerance_of(options, i, s->y[i], s->new_y[i]);
        const ncgen_real state = s->new_y[i] / size, rate = s->second[i] / size;
        const ncgen_real by_derivative = rate - s->first[i] / size, by_state = state - s->at[i] / size;
        changes += by_derivative * by_derivative;
        states += by_state * by_state;
        rates += rate * rate;
        sizes += state * state;
    }
    *moved = s->h * NCGEN_SQRT(rates / sizes) / needed;
    return (*moved < (ncgen_scalar)0.1L) & (s->h * s->h * changes > bound * bound * states);
}

/* Steps of an explicit method that Radau, with its Jacobians and first steps, costs no more than; its linear systems of so many unknowns cost
 * a share of their square. */
static inline ncgen_scalar ncgen_implicit_cost(int unknowns)
{
    return 200 + (ncgen_scalar)unknowns * (ncgen_scalar)unknowns / 30;
}

/* Steps in a row that spoke for a stiff mechanism, and against it since then. */
typedef struct ncgen_stiff_steps {
    int speaking, against;
} ncgen_stiff_steps;

/* One more step, which speaks for it or not: does it count now? */
static inline int ncgen_counts_as_stiff(ncgen_stiff_steps *steps, int speaks)
{
    if (speaks) {
        steps->against = 0;
        steps->speaking = steps->speaking + 1 < NCGEN_STIFF_LIMIT ? steps->speaking + 1 : 0;
        return steps->speaking == 0;
    }
    steps->against += 1;
    if (steps->against >= NCGEN_STIFF_DOUBT)
        steps->speaking = 0;
    return 0;
}

#endif
