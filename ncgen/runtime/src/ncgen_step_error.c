/* ncgen_step_error.c: errors of steps against their tolerances, and a first step. */
#include "ncgen_step_error.h"
#include "ncgen_step_rules.h"

ncgen_real ncgen_weighted_square(const ncgen_run *r, const ncgen_real *x, const ncgen_real *a, const ncgen_real *b)
{
    return ncgen_mean_square(r->options, r->error_size, r->error_size, x, a, b);
}

/* Estimate k of the error over h, squared. */
static ncgen_real estimate(ncgen_run *r, ncgen_stepping *w, const tableau *method, int k)
{
    ncgen_combine_stages(r, w, &method->errors[k], w->at);
    return ncgen_weighted_square(r, w->at, r->y, w->new_y);
}

/* The part of the tolerance that a step of a length may take, because all steps share it. Steps that are shorter than the mean
 * count as that: near a singular position rounding is all that is left of the error, and no step could be short enough for it. So do
 * first steps that are far shorter than the run, by a share that becomes less and less, so that all of it together is small. No part is
 * smaller than what rounding leaves of the state. */
ncgen_scalar ncgen_tolerance_fraction(const ncgen_run *r, ncgen_scalar h)
{
    const ncgen_scalar count = (ncgen_scalar)r->statistics->steps + 1, mean = (r->start_t - r->times[0]) / count;
    const ncgen_scalar least = R(1.0e-4) * r->options->span / (count * count);
    if (h < mean)
        h = mean;
    if (h < least)
        h = least;
    const ncgen_scalar fraction = r->options->span > h ? h / r->options->span : 1;
    const ncgen_scalar left = r->options->rtol > r->rounding ? r->rounding / r->options->rtol : 0;
    return fraction > left ? fraction : left;
}

/* The error of a step over the tolerance. */
ncgen_real ncgen_step_error(ncgen_run *r, ncgen_stepping *w, const tableau *method, ncgen_scalar h)
{
    const ncgen_real error = estimate(r, w, method, 0);
    if (method->n_errors == 1)
        return h * NCGEN_SQRT(error);
    return ncgen_damped_error(h, error, estimate(r, w, method, 1));
}

/* A first step from the sizes of y, yd and an estimate of ydd. Work is left out: it begins with 0, so that
 * any power would be infinitely fast next to it. */
ncgen_scalar ncgen_first_step(ncgen_run *r, ncgen_stepping *w, int order, ncgen_scalar t, ncgen_scalar span)
{
    const int count = r->error_size - 1;
    const ncgen_real d0 = NCGEN_SQRT(ncgen_mean_square(r->options, r->error_size, count, r->y, r->y, r->y));
    const ncgen_real d1 = NCGEN_SQRT(ncgen_mean_square(r->options, r->error_size, count, w->stage_derivatives[0], r->y, r->y));
    const ncgen_real guess = ncgen_first_guess(d0, d1, span);
    for (int i = 0; i < r->ny; ++i)
        w->new_y[i] = r->y[i] + guess * w->stage_derivatives[0][i];
    if (r->derivative(r, t + guess, w->new_y, w->stage_derivatives[1]) != NCGEN_OK)
        return guess * R(0.01);
    for (int i = 0; i < r->ny; ++i)
        w->at[i] = w->stage_derivatives[1][i] - w->stage_derivatives[0][i];
    const ncgen_real d2 = NCGEN_SQRT(ncgen_mean_square(r->options, r->error_size, count, w->at, r->y, r->y)) / guess;
    return ncgen_better_guess(guess, d1, d2, order, span);
}
