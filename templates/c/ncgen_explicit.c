/* ncgen_explicit.c: Runge-Kutta methods: Dormand-Prince 5(4) and 8(5,3) with error control and dense output, and the
 * classical one with a fixed step.
 */
#include "ncgen_internal.h"
#include "ncgen_tableaus.h"

enum {
    REPEAT_LIMIT = 8
};

void ncgen_explicit_layout(ncgen_run *r, ncgen_stepping *w)
{
    w->new_y = ncgen_take(&r->space, r->ny);
    w->at = ncgen_take(&r->space, r->ny);
    w->slopes = ncgen_take(&r->space, (r->options->method == NCGEN_DOP853 ? 16 : 7) * r->ny);
    w->interpolant = ncgen_take(&r->space, r->options->method == NCGEN_DOP853 ? 7 * r->ny : 0);
    w->interpolated = 0;
}

static ncgen_real *slope(const ncgen_run *r, const ncgen_stepping *w, int stage)
{
    return w->slopes + (size_t)stage * (size_t)r->ny;
}

/* sum = sum over the stages of weight times slope. */
static void combine(const ncgen_run *r, const ncgen_stepping *w, int stages, const ncgen_scalar *weights,
                    ncgen_real *NCGEN_RESTRICT sum)
{
    for (int i = 0; i < r->ny; ++i)
        sum[i] = 0;
    for (int j = 0; j < stages; ++j) {
        const ncgen_scalar weight = weights[j];
        const ncgen_real *NCGEN_RESTRICT k = slope(r, w, j);
        if (!(NCGEN_ABS(weight) > 0))
            continue;
        for (int i = 0; i < r->ny; ++i)
            sum[i] += weight * k[i];
    }
}

static void advance(const ncgen_run *r, const ncgen_stepping *w, ncgen_scalar h, int stages, const ncgen_scalar *weights,
                    ncgen_real *y_new)
{
    combine(r, w, stages, weights, y_new);
    for (int i = 0; i < r->ny; ++i)
        y_new[i] = r->y[i] + h * y_new[i];
}

/* One trial step: new_y, and the slope there. */
static int trial_step(ncgen_run *r, ncgen_stepping *w, const tableau *method, ncgen_scalar t, ncgen_scalar h)
{
    const int last = method->stages;
    for (int s = 1; s <= last; ++s) {
        advance(r, w, h, s, method->a[s], w->new_y);
        int status = s == last && r->settle ? r->settle(r, t + h, w->new_y) : NCGEN_OK;
        if (status == NCGEN_OK)
            status = r->derivative(r, t + method->c[s] * h, w->new_y, slope(r, w, s));
        if (status != NCGEN_OK)
            return status;
    }
    w->interpolated = 0;
    return NCGEN_OK;
}

static ncgen_real tolerated(const ncgen_run *r, ncgen_real a, ncgen_real b)
{
    const ncgen_real u = NCGEN_ABS(a), v = NCGEN_ABS(b);
    return r->options->atol + r->options->rtol * (u > v ? u : v);
}

ncgen_real ncgen_weighted_square(const ncgen_run *r, const ncgen_real *x, const ncgen_real *a, const ncgen_real *b)
{
    ncgen_real sum = 0;
    for (int i = 0; i < r->weighed; ++i) {
        const ncgen_real scaled = x[i] / tolerated(r, a[i], b[i]);
        sum += scaled * scaled;
    }
    return sum / (ncgen_scalar)r->weighed;
}

static ncgen_real error_of(ncgen_run *r, ncgen_stepping *w, ncgen_scalar h)
{
    if (r->options->method == NCGEN_DOPRI5) {
        combine(r, w, 7, dopri_error, w->at);
        return h * NCGEN_SQRT(ncgen_weighted_square(r, w->at, r->y, w->new_y));
    }
    combine(r, w, 12, dop853_e5, w->at);
    const ncgen_real fifth = ncgen_weighted_square(r, w->at, r->y, w->new_y);
    ncgen_scalar third_weights[12];
    for (int j = 0; j < 12; ++j)
        third_weights[j] = dop853_a[12][j] - dop853_e3[j];
    combine(r, w, 12, third_weights, w->at);
    const ncgen_real third = ncgen_weighted_square(r, w->at, r->y, w->new_y);
    const ncgen_real both = fifth + R(0.01) * third;
    return both > 0 ? h * fifth / NCGEN_SQRT(both) : both;
}

/* A first step from the sizes of y, yd and an estimate of ydd (Hairer, Norsett & Wanner, II.4). */
ncgen_scalar ncgen_first_step(ncgen_run *r, ncgen_stepping *w, int order, ncgen_scalar t, ncgen_scalar span)
{
    const ncgen_real d0 = NCGEN_SQRT(ncgen_weighted_square(r, r->y, r->y, r->y));
    const ncgen_real d1 = NCGEN_SQRT(ncgen_weighted_square(r, slope(r, w, 0), r->y, r->y));
    ncgen_real guess = d0 < R(1.0e-5) || d1 < R(1.0e-5) ? R(1.0e-6) : R(0.01) * d0 / d1;
    if (guess > span)
        guess = span;
    for (int i = 0; i < r->ny; ++i)
        w->new_y[i] = r->y[i] + guess * slope(r, w, 0)[i];
    if (r->derivative(r, t + guess, w->new_y, slope(r, w, 1)) != NCGEN_OK)
        return guess * R(0.01);
    for (int i = 0; i < r->ny; ++i)
        w->at[i] = slope(r, w, 1)[i] - slope(r, w, 0)[i];
    const ncgen_real d2 = NCGEN_SQRT(ncgen_weighted_square(r, w->at, r->y, r->y)) / guess;
    const ncgen_real largest = d1 > d2 ? d1 : d2;
    const ncgen_scalar root = 1 / (ncgen_scalar)(order + 1);
    ncgen_real better = largest <= R(1.0e-15) ? guess * R(1.0e-3) : NCGEN_POW(R(0.01) / largest, root);
    if (better > R(100.0) * guess)
        better = R(100.0) * guess;
    return better < span ? better : span;
}

/* DOP853's interpolant needs three stages more and seven coefficients; made once a step, when first asked for. */
static int prepare_interpolant(ncgen_run *r, ncgen_stepping *w, ncgen_scalar t, ncgen_scalar h)
{
    for (int s = 13; s < 16; ++s) {
        advance(r, w, h, s, dop853_a[s], w->at);
        const int status = r->derivative(r, t + dop853_c[s] * h, w->at, slope(r, w, s));
        if (status != NCGEN_OK)
            return status;
    }
    ncgen_real *f = w->interpolant;
    const ncgen_real *first = slope(r, w, 0), *last = slope(r, w, 12);
    const int ny = r->ny;
    for (int i = 0; i < ny; ++i) {
        const ncgen_real change = w->new_y[i] - r->y[i];
        f[i] = change;
        f[ny + i] = h * first[i] - change;
        f[2 * ny + i] = 2 * change - h * (first[i] + last[i]);
    }
    for (int k = 0; k < 4; ++k) {
        combine(r, w, 16, dop853_d[k], f + (size_t)(3 + k) * (size_t)ny);
        for (int i = 0; i < ny; ++i)
            f[(size_t)(3 + k) * (size_t)ny + (size_t)i] *= h;
    }
    return NCGEN_OK;
}

/* w->at: the state at t + s h, inside a step whose end is new_y. */
static int interpolate(ncgen_run *r, ncgen_stepping *w, ncgen_scalar t, ncgen_scalar h, ncgen_scalar s)
{
    if (r->options->method == NCGEN_DOPRI5) {
        ncgen_scalar weights[7];
        for (int j = 0; j < 7; ++j) {
            const ncgen_scalar *c = dopri_dense[j];
            weights[j] = s * (c[0] + s * (c[1] + s * (c[2] + s * c[3])));
        }
        advance(r, w, h, 7, weights, w->at);
    } else if (r->options->method == NCGEN_DOP853) {
        if (!w->interpolated) {
            const int status = prepare_interpolant(r, w, t, h);
            if (status != NCGEN_OK)
                return status;
            w->interpolated = 1;
        }
        for (int i = 0; i < r->ny; ++i) {
            ncgen_real sum = 0;
            for (int k = 6; k >= 0; --k)
                sum = (sum + w->interpolant[(size_t)k * (size_t)r->ny + (size_t)i]) * (k % 2 ? 1 - s : s);
            w->at[i] = r->y[i] + sum;
        }
    } else {
        ncgen_interpolate_cubic(r, w, slope(r, w, 0), slope(r, w, 4), h, s);
    }
    return NCGEN_OK;
}

static int finish_step(ncgen_run *r, ncgen_stepping *w, const tableau *method, ncgen_scalar t, ncgen_scalar t_new)
{
    const int status = ncgen_grid_step(r, w, t, t_new);
    ncgen_copy(r->ny, slope(r, w, method->stages), slope(r, w, 0));
    return status;
}

static int run_adaptive(ncgen_run *r, ncgen_stepping *w, const tableau *method)
{
    const ncgen_scalar end = r->times[r->n_times - 1];
    const ncgen_scalar power = -1 / (ncgen_scalar)(method->order + 1);
    ncgen_scalar t = r->times[0];
    ncgen_scalar h = ncgen_first_step(r, w, method->order, t, end - t);
    int repeats = 0, rejected = 0;
    while (t < end) {
        if (r->options->max_steps && r->statistics->steps >= r->options->max_steps)
            return NCGEN_NOT_CONVERGED;
        if (r->options->max_step > 0 && h > r->options->max_step)
            h = r->options->max_step;
        const int last = t + h >= end;
        if (last)
            h = end - t;
        if (!(t + h > t))
            return NCGEN_NOT_CONVERGED;
        int status = trial_step(r, w, method, t, h);
        const ncgen_real error = status == NCGEN_OK ? error_of(r, w, h) : 0;
        if (status != NCGEN_OK || !(error < R(1.0e30))) {
            if (++repeats > REPEAT_LIMIT)
                return status != NCGEN_OK ? status : NCGEN_NOT_CONVERGED;
            r->statistics->repeated += 1;
            r->careful = repeats > 1; /* again: it may be rounding */
            h *= R(0.25);
            continue;
        }
        ncgen_real factor = error > 0 ? R(0.9) * NCGEN_POW(error, power) : R(10.0);
        if (!(error < R(1.0))) {
            r->statistics->rejected += 1;
            r->careful = rejected; /* again: it may be rounding */
            rejected = 1;
            h *= factor > R(0.2) ? factor : R(0.2);
            continue;
        }
        if (factor > R(10.0))
            factor = R(10.0);
        if (rejected && factor > R(1.0))
            factor = R(1.0);
        repeats = rejected = 0;
        const ncgen_scalar t_new = last ? end : t + h;
        status = finish_step(r, w, method, t, t_new);
        if (r->statistics->stopped || (status != NCGEN_OK && t_new < end))
            return status;
        t = t_new;
        h *= factor;
    }
    return NCGEN_OK;
}

static int run_fixed(ncgen_run *r, ncgen_stepping *w, const tableau *method)
{
    for (int row = 1; row < r->n_times; ++row) {
        const ncgen_scalar span = r->times[row] - r->times[row - 1];
        const ncgen_scalar count = ncgen_step_count(r, span);
        for (ncgen_scalar i = 0; i < count; i += 1) {
            const ncgen_scalar t = r->times[row - 1] + i * (span / count);
            const int last = i + 1 >= count;
            const ncgen_scalar t_new = last ? r->times[row] : r->times[row - 1] + (i + 1) * (span / count);
            int status = trial_step(r, w, method, t, t_new - t);
            if (status != NCGEN_OK)
                return status;
            status = finish_step(r, w, method, t, t_new);
            if (r->statistics->stopped)
                return status;
            if (status != NCGEN_OK && !(last && row + 1 == r->n_times))
                return status;
        }
    }
    return NCGEN_OK;
}

int ncgen_explicit(ncgen_run *r, ncgen_stepping *w)
{
    const tableau *method = &tableaus[r->options->method];
    int status = r->derivative(r, r->times[0], r->y, slope(r, w, 0));
    if (status == NCGEN_OK)
        (void)ncgen_accept(r, r->times[0], r->y);
    w->interpolate = interpolate;
    if (status == NCGEN_OK)
        status = ncgen_grid_begin(r, w);
    if (status != NCGEN_OK)
        return status;
    return r->options->method == NCGEN_RK4 ? run_fixed(r, w, method) : run_adaptive(r, w, method);
}
