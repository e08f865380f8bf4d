/* ncgen_step_rules.h: errors of explicit steps, and how long the first and the next ones are; of numbers or of lanes. */
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

#endif
