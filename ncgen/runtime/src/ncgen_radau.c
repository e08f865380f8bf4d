/* ncgen_radau.c: Radau IIA of order 5 with error control and dense output.
 *
 * Method, choice of step and of fresh Jacobians: Hairer and Wanner, Solving Ordinary Differential Equations II, IV.8.
 */
#include "ncgen_step_error.h"
#include "ncgen_implicit.h"

enum {
    STAGES = NCGEN_STAGES,
    ITERATION_LIMIT = 6,
    REPEAT_LIMIT = 20,        /* of one step */
    ALL_REPEATS_LIMIT = 1000, /* repeats in all, after which the run must get on better than every other step */
    ORDER = 3 /* of the error estimate */
};

#define ROOT6 R(2.449489742783178098197284074705891392)

static const ncgen_scalar radau_c[STAGES] = {(4 - ROOT6) / 10, (4 + ROOT6) / 10, R(1.0)};

/* The inverse of the method's matrix is T diag(radau_real, radau_complex) T^-1: its real eigenvalue, and the complex one by
 * real and imaginary part, whose eigenvector stands in two columns of T. */
static const ncgen_scalar radau_real = R(3.637834252744495732208418513577775798);
static const ncgen_scalar radau_complex[2] = {R(2.681082873627752133895790743211112101), -R(3.050430199247410569426377624787567904)};

static const ncgen_scalar radau_t[STAGES][STAGES] = {
    {R(0.09443876248897524148749007950641658629), -R(0.1412552950209542084279903838077973094),
     R(0.03002919410514742449186111708905386667)},
    {R(0.2502131229653333113765090675125016844), R(0.2041293522937999319959908102983381741),
     -R(0.3829421127572619377954382335998732104)},
    {R(1.0), R(1.0), R(0.0)},
};

static const ncgen_scalar radau_inverse_t[STAGES][STAGES] = {
    {R(4.17871859155190472734646265851205623), R(0.3276828207610623870825332724296162342),
     R(0.5233764454994495480399309159089875021)},
    {-R(4.17871859155190472734646265851205623), -R(0.3276828207610623870825332724296162342),
     R(0.4766235545005504519600690840910124979)},
    {R(0.5028726349457868759512473431395442929), -R(2.571926949855605429186785353601675055),
     R(0.5960392048282249249688219110993024033)},
};

/* Weights of the error estimate. */
static const ncgen_scalar radau_error[STAGES] = {(-13 - 7 * ROOT6) / 3, (-13 + 7 * ROOT6) / 3, -R(1.0) / 3};

/* The polynomial through the stages: coefficients of s, s^2, s^3 for each stage. */
static const ncgen_scalar radau_dense[STAGES][3] = {
    {(13 + 7 * ROOT6) / 3, (-23 - 22 * ROOT6) / 3, (10 + 15 * ROOT6) / 3},
    {(13 - 7 * ROOT6) / 3, (-23 + 22 * ROOT6) / 3, (10 - 15 * ROOT6) / 3},
    {R(1.0) / 3, -R(8.0) / 3, R(10.0) / 3},
};

static ncgen_real *part(const ncgen_run *r, ncgen_real *stages, int i)
{
    return stages + (size_t)i * (size_t)r->ny;
}

/* sum_j weights[j] x_j over stages of `count` numbers each. */
static void combine(int count, const ncgen_scalar weights[STAGES], const ncgen_real *x, ncgen_real *sum)
{
    for (int i = 0; i < count; ++i)
        sum[i] = weights[0] * x[i] + weights[1] * x[count + i] + weights[2] * x[2 * count + i];
}

/* w->at: the state at t + s h on the polynomial through the stages. */
static int interpolate(ncgen_run *r, ncgen_stepping *w, ncgen_scalar t, ncgen_scalar h, ncgen_scalar s)
{
    (void)t;
    (void)h;
    for (int i = 0; i < r->ny; ++i)
        w->at[i] = r->y[i] + s * (w->interpolant[i] + s * (w->interpolant[r->ny + i] + s * w->interpolant[2 * r->ny + i]));
    return NCGEN_OK;
}

/* Where Newton's method starts: the last step's polynomial, carried on; `ratio` of the steps is 0 if there is none. */
static void predict(ncgen_run *r, const ncgen_stepping *w, ncgen_implicit *m, ncgen_scalar ratio)
{
    const ncgen_real *f = w->interpolant;
    for (int k = 0; k < STAGES; ++k) {
        const ncgen_scalar s = 1 + radau_c[k] * ratio;
        for (int i = 0; i < r->ny; ++i)
            part(r, m->stages, k)[i] = ratio > 0 ? (s - 1) * f[i] + (s * s - 1) * f[r->ny + i] + (s * s * s - 1) * f[2 * r->ny + i] : 0;
    }
}

/* The derivatives at the stages. Where a stage has unknowns that the derivative solves for by itself, they come back. */
static int find_rates(ncgen_run *r, ncgen_stepping *w, ncgen_implicit *m, ncgen_scalar t, ncgen_scalar h)
{
    for (int k = 0; k < STAGES; ++k) {
        ncgen_real *stage = part(r, m->stages, k);
        for (int i = 0; i < r->ny; ++i)
            w->at[i] = r->y[i] + stage[i];
        int status = ncgen_report_attempt(r, t + radau_c[k] * h);
        if (status == NCGEN_OK)
            status = r->derivative(r, t + radau_c[k] * h, w->at, part(r, m->derivatives, k));
        if (status != NCGEN_OK)
            return status;
        for (int i = r->error_size; i < r->ny; ++i)
            stage[i] = w->at[i] - r->y[i];
    }
    return NCGEN_OK;
}

/* The right side of Newton's method in transformed unknowns: T^-1 F - (eigenvalues / h) W. */
static void find_right(const ncgen_run *r, const ncgen_implicit *m, ncgen_scalar h)
{
    const int ny = r->error_size;
    const ncgen_scalar a = radau_complex[0] / h, b = radau_complex[1] / h;
    for (int i = 0; i < ny; ++i) {
        ncgen_real f[STAGES];
        for (int k = 0; k < STAGES; ++k) {
            f[k] = 0;
            for (int j = 0; j < STAGES; ++j)
                f[k] += radau_inverse_t[k][j] * m->derivatives[j * r->ny + i];
        }
        const ncgen_real *x = m->unknowns + i;
        m->right[i] = f[0] - radau_real / h * x[0];
        m->right[ny + i] = f[1] - a * x[ny] + b * x[2 * ny];
        m->right[2 * ny + i] = f[2] - b * x[ny] - a * x[2 * ny];
    }
}

static ncgen_real size_of_change(ncgen_run *r, const ncgen_implicit *m)
{
    ncgen_real sum = 0;
    for (int k = 0; k < STAGES; ++k)
        sum += ncgen_weighted_square(r, m->change + k * r->error_size, r->y, r->y);
    return NCGEN_SQRT(sum / (ncgen_scalar)STAGES);
}

/* The stages by Newton's method. NCGEN_NOT_CONVERGED: with this Jacobian and step it does not converge. */
static int solve_stages(ncgen_run *r, ncgen_stepping *w, ncgen_implicit *m, ncgen_scalar t, ncgen_scalar h)
{
    const int ny = r->error_size;
    const ncgen_scalar least = 10 * r->rounding / r->options->rtol, root = NCGEN_SQRT(r->options->rtol);
    const ncgen_scalar usual = root < R(0.03) ? root : R(0.03), wanted = least > usual ? least : usual;
    ncgen_real before = 0;
    for (int k = 0; k < STAGES; ++k)
        for (int i = 0; i < ny; ++i) {
            m->unknowns[k * ny + i] = 0;
            for (int j = 0; j < STAGES; ++j)
                m->unknowns[k * ny + i] += radau_inverse_t[k][j] * m->stages[j * r->ny + i];
        }
    m->rate = 0;
    for (m->iterations = 1; m->iterations <= ITERATION_LIMIT; ++m->iterations) {
        const int status = find_rates(r, w, m, t, h);
        if (status != NCGEN_OK)
            return status;
        find_right(r, m, h);
        ncgen_shifted_solve(r, m, &m->real, m->right, m->change);
        ncgen_shifted_solve(r, m, &m->complex, m->right + ny, m->change + ny);
        const ncgen_real size = size_of_change(r, m);
        if (!(size < R(1.0e30)))
            return ncgen_is_finite(1, &size) ? NCGEN_NOT_CONVERGED : NCGEN_DOMAIN;
        if (m->iterations > 1) {
            m->rate = size / before;
            ncgen_real left = size / (1 - m->rate);
            for (int k = m->iterations; k <= ITERATION_LIMIT; ++k)
                left *= m->rate;
            if (!(m->rate < 1) || left > wanted)
                return NCGEN_NOT_CONVERGED;
        }
        for (int i = 0; i < STAGES * ny; ++i)
            m->unknowns[i] += m->change[i];
        for (int k = 0; k < STAGES; ++k)
            combine(ny, radau_t[k], m->unknowns, part(r, m->stages, k));
        if (!(size > 0) || (m->iterations > 1 && m->rate / (1 - m->rate) * size < wanted))
            return NCGEN_OK;
        before = size;
    }
    return NCGEN_NOT_CONVERGED;
}

/* The stages for a step h, with a fresh Jacobian if the one there is does not serve. */
static int attempt(ncgen_run *r, ncgen_stepping *w, ncgen_implicit *m, ncgen_scalar t, ncgen_scalar h)
{
    for (;;) {
        int status = NCGEN_OK;
        if (!m->factored)
            status = ncgen_shifted_factor(m, &m->real, 1, radau_real / h, 0);
        if (!m->factored && status == NCGEN_OK)
            status = ncgen_shifted_factor(m, &m->complex, 2, radau_complex[0] / h, radau_complex[1] / h);
        m->factored = status == NCGEN_OK;
        if (status == NCGEN_OK) {
            predict(r, w, m, m->last_step > 0 ? h / m->last_step : 0);
            status = solve_stages(r, w, m, t, h);
        }
        if (status == NCGEN_OK || status == NCGEN_INTERRUPTED || m->is_current)
            return status;
        const int evaluated = ncgen_implicit_jacobian(r, m, t, r->y);
        m->is_current = 1;
        if (evaluated != NCGEN_OK)
            return evaluated;
    }
}

/* The size of the error, where 1 is allowed. After a rejection it is filtered once more. */
static int estimate(ncgen_run *r, ncgen_stepping *w, ncgen_implicit *m, ncgen_scalar t, ncgen_scalar h, int rejected,
                    ncgen_real *error)
{
    int status = NCGEN_OK;
    const ncgen_real *derivative = w->stage_derivatives[0];
    for (int again = 0; again < 2; ++again) {
        for (int i = 0; i < r->error_size; ++i) {
            ncgen_real sum = 0;
            for (int k = 0; k < STAGES; ++k)
                sum += radau_error[k] * part(r, m->stages, k)[i];
            m->right[i] = derivative[i] + sum / h;
        }
        ncgen_shifted_solve(r, m, &m->real, m->right, m->change);
        *error = NCGEN_SQRT(ncgen_weighted_square(r, m->change, r->y, w->new_y));
        if (again || !rejected || !(*error > 1))
            return status;
        ncgen_copy(r->ny, r->y, w->at);
        for (int i = 0; i < r->error_size; ++i)
            w->at[i] += m->change[i];
        status = r->derivative(r, t, w->at, m->derivatives);
        if (status != NCGEN_OK)
            return status;
        derivative = m->derivatives;
    }
    return status;
}

/* By which factor the step should change, from this error and the one before (Gustafsson). */
static ncgen_real step_factor(const ncgen_implicit *m, ncgen_scalar h, ncgen_real error)
{
    const ncgen_scalar power = R(0.25);
    if (!(error > 0))
        return R(10.0);
    const ncgen_real trend = m->last_step > 0 && m->last_error > 0 ? h / m->last_step * NCGEN_POW(m->last_error / error, power) : 1;
    return (trend < 1 ? trend : 1) * NCGEN_POW(error, -power);
}

/* A converged step whose error is small enough becomes the state. */
static int conclude(ncgen_run *r, ncgen_stepping *w, ncgen_implicit *m, ncgen_scalar t, ncgen_scalar h)
{
    const int status = ncgen_end_derivative(r, t + h, w->new_y, 0, w->stage_derivatives[1]);
    if (status != NCGEN_OK)
        return status;
    if (!ncgen_is_finite(r->ny, w->new_y) || !ncgen_is_finite(r->ny, w->stage_derivatives[1]))
        return NCGEN_DOMAIN;
    for (int k = 0; k < 3; ++k)
        for (int i = 0; i < r->ny; ++i) {
            ncgen_real sum = 0;
            for (int j = 0; j < STAGES; ++j)
                sum += radau_dense[j][k] * part(r, m->stages, j)[i];
            w->interpolant[k * r->ny + i] = sum;
        }
    return NCGEN_OK;
}

/* The derivative in w->stage_derivatives[0] is one without steps before it. */
static int begin_anew(ncgen_run *r, ncgen_implicit *m, ncgen_scalar t)
{
    const int status = ncgen_implicit_jacobian(r, m, t, r->y);
    m->is_current = 1;
    m->factored = 0;
    m->last_step = 0;
    m->last_error = 0;
    m->failed_step = 0;
    return status;
}

/* The first derivative, step and Jacobian; past a jump at the start. */
static int begin_run(ncgen_run *r, ncgen_stepping *w, ncgen_implicit *m, ncgen_scalar *t, ncgen_scalar *h)
{
    const ncgen_scalar end = r->times[r->n_times - 1];
    int status = ncgen_implicit_begin(r, w, m);
    if (status == NCGEN_OK && ncgen_cross_break(r, t, end))
        status = r->derivative(r, *t, r->y, w->stage_derivatives[0]);
    if (status != NCGEN_OK)
        return status;
    *h = ncgen_first_step(r, w, ORDER, *t, end - *t);
    return begin_anew(r, m, *t);
}

/* A step with its error over the tolerance, and its end where that is below 1; NCGEN_NOT_CONVERGED for an error beyond all bounds. */
static int try_step(ncgen_run *r, ncgen_stepping *w, ncgen_implicit *m, ncgen_scalar t, ncgen_scalar h, int rejected, ncgen_real *error)
{
    *error = 0;
    int status = attempt(r, w, m, t, h);
    if (status != NCGEN_OK)
        return status;
    for (int i = 0; i < r->ny; ++i)
        w->new_y[i] = r->y[i] + part(r, m->stages, 2)[i];
    status = estimate(r, w, m, t, h, rejected, error);
    if (status == NCGEN_OK && *error < 1)
        status = conclude(r, w, m, t, h);
    return status == NCGEN_OK && !(*error < R(1.0e30)) ? NCGEN_NOT_CONVERGED : status;
}

/* On from a break, past a jump. */
static int step_over_break(ncgen_run *r, ncgen_stepping *w, ncgen_implicit *m, ncgen_scalar *t)
{
    const ncgen_scalar end = r->times[r->n_times - 1];
    (void)ncgen_cross_break(r, t, end);
    if (!(*t < end))
        return NCGEN_OK;
    const int status = r->derivative(r, *t, r->y, w->stage_derivatives[0]);
    return status == NCGEN_OK ? begin_anew(r, m, *t) : status;
}

/* Newton's method gets a new Jacobian where its changes shrink by no more than this from one iteration to the next (Hairer and Wanner 1996,
 * section IV.8): one by differences costs two evaluations a degree of freedom, an iteration three. */
static const ncgen_scalar usual_rate = R(1.0e-3), costly_rate = R(0.1);

/* On from an accepted step: with a new Jacobian where Newton's method took many iterations, and with a new step where it is worth new
 * factors. */
static int renew(ncgen_run *r, ncgen_stepping *w, ncgen_implicit *m, ncgen_scalar t, ncgen_real factor, ncgen_scalar *h)
{
    const int is_new = m->iterations > 2 && m->rate > (m->is_reduced ? costly_rate : usual_rate);
    int status = NCGEN_OK;
    ncgen_begin_at_stage(w, 1);
    if (is_new) {
        status = ncgen_implicit_jacobian(r, m, t, r->y);
        m->is_current = 1;
    }
    if (is_new || !(factor < R(1.2))) { /* else the factors serve again */
        m->factored = 0;
        *h *= factor;
    }
    return status;
}

int ncgen_radau(ncgen_run *r, ncgen_stepping *w, ncgen_implicit *m)
{
    const ncgen_scalar end = r->times[r->n_times - 1];
    ncgen_scalar t = r->times[0], h = 0;
    int repeats = 0, rejected = 0, trouble = NCGEN_STEP_TOO_SHORT;
    int status = begin_run(r, w, m, &t, &h);
    w->interpolate = interpolate;
    while (t < end && status == NCGEN_OK) {
        const ncgen_scalar wanted = h, goal = ncgen_next_break(r, t, end);
        if (r->options->max_step > 0 && h > r->options->max_step)
            h = r->options->max_step;
        const int last = t + h >= goal;
        if (last)
            h = goal - t;
        if (h < wanted || h > wanted)
            m->factored = 0;
        if (!ncgen_is_step(r, t, h))
            return trouble;
        ncgen_real error;
        const int tried = try_step(r, w, m, t, h, rejected, &error);
        if (tried == NCGEN_INTERRUPTED)
            return tried;
        if (tried != NCGEN_OK) {
            const long all = r->statistics->repeated += 1;
            trouble = tried;
            if (++repeats > REPEAT_LIMIT || (all > ALL_REPEATS_LIMIT && all > r->statistics->steps / 2))
                return trouble;
            r->uses_exchanges = repeats > 1; /* again: it may be rounding */
            h = ncgen_halved_step(m, h);
            continue;
        }
        const ncgen_scalar safety = R(0.9) * (2 * ITERATION_LIMIT + 1) / (ncgen_scalar)(2 * ITERATION_LIMIT + m->iterations);
        const ncgen_real factor = safety * step_factor(m, h, error);
        if (!(error < 1)) {
            r->statistics->rejected += 1;
            r->uses_exchanges = rejected; /* again: it may be rounding */
            rejected = 1;
            m->factored = 0;
            h *= factor > R(0.2) ? factor : R(0.2);
            continue;
        }
        if (repeats == 0 && rejected == 0)
            trouble = NCGEN_STEP_TOO_SHORT; /* what was wrong is behind */
        repeats = rejected = m->is_current = 0;
        m->last_step = h;
        m->last_error = error;
        const ncgen_scalar t_new = last ? goal : t + h, most = ncgen_most_growth(m, h), growth = factor > most ? most : factor;
        status = ncgen_grid_step(r, w, t, t_new);
        if (status != NCGEN_OK || r->statistics->stopped)
            return status;
        t = t_new;
        if (t < end && ncgen_makes_no_progress(r, w, t))
            return NCGEN_STEP_TOO_SHORT;
        status = last ? step_over_break(r, w, m, &t) : renew(r, w, m, t, growth, &h);
        if (last)
            h = h * growth < wanted && growth >= 1 ? wanted : h * growth; /* what cut it short is behind */
    }
    return status;
}
