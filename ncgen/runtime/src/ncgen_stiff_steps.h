/* ncgen_stiff_steps.h: which steps of explicit methods speak for a stiff mechanism, and when they are enough; of numbers or of lanes. */
#ifndef NCGEN_STIFF_STEPS_H
#define NCGEN_STIFF_STEPS_H

#include "ncgen_step_rules.h"

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
