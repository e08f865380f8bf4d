/* ncgen_explicit.c: explicit Runge-Kutta methods: with error control and dense output, or with a fixed step. */
#include "ncgen_explicit.h"
#include "ncgen_constrained.h"
#include "ncgen_tableaus.h"

enum {
    REPEAT_LIMIT = 8,
    STIFF_EVERY = 1000, /* accepted steps between two looks at stiffness, as long as nothing speaks for it */
    STIFF_EVERY_WITH_IMPLICIT = 16,    /* the same where an implicit method could go on and `implicit_cost` steps are left */
    STIFF_LIMIT = 15,   /* steps in a row that speak for it before it counts */
    STIFF_DOUBT = 6,    /* steps that speak against it and make these count anew */
    TINY_LIMIT = 10     /* looks in a row at steps that are a thousand times too short */
};

void ncgen_explicit_layout(ncgen_run *r, ncgen_stepping *w)
{
    w->new_y = ncgen_take(&r->space, r->ny);
    w->at = ncgen_take(&r->space, r->ny);
    w->stage_derivatives = ncgen_take(&r->space, tableaus[r->options->method].width * r->ny);
    w->interpolated = 0;
    w->repeated = w->stiff = w->not_stiff = w->tiny = 0;
}

/* From this share of the stability interval on the real axis stability begins to hold the step down: along the imaginary axis,
 * where springs without damping are, it may end at 0.4 of that. */
static const ncgen_scalar stability_fraction = R(0.3);

/* Steps of this method that an implicit one, with its Jacobian and first steps, costs no more than. */
static const ncgen_scalar implicit_cost = R(200.0);

static ncgen_real *stage_derivative(const ncgen_run *r, const ncgen_stepping *w, int stage)
{
    return w->stage_derivatives + (size_t)stage * (size_t)r->ny;
}

/* Terms of a sum of weight times derivative, as many as are added in a pass: over few numbers a pass costs more than what it adds. */
typedef struct {
    const ncgen_real *stage_derivatives[4];
    ncgen_scalar weights[4];
} terms;

/* The next terms that have a weight, from stage *j on, which becomes the one behind them: how many. Others have a weight of 0. */
static inline int next_terms(const ncgen_run *r, const ncgen_stepping *w, int *j, int stages, const ncgen_scalar *weights, terms *s)
{
    int count = 0;
    for (int k = 0; k < 4; ++k) {
        s->stage_derivatives[k] = w->stage_derivatives;
        s->weights[k] = 0;
    }
    for (; *j < stages && count < 4; ++*j)
        if (NCGEN_ABS(weights[*j]) > 0) {
            s->weights[count] = weights[*j];
            s->stage_derivatives[count++] = stage_derivative(r, w, *j);
        }
    return count;
}

/* sum = sum over the stages of weight times derivative, in their order. */
static void combine(const ncgen_run *r, const ncgen_stepping *w, int stages, const ncgen_scalar *weights,
                    ncgen_real *NCGEN_RESTRICT sum)
{
    const int ny = r->ny;
    terms s;
    int j = 0, count = next_terms(r, w, &j, stages, weights, &s);
    for (int is_first = 1; is_first || count > 0; is_first = 0) {
        const ncgen_real *NCGEN_RESTRICT a = s.stage_derivatives[0], *NCGEN_RESTRICT b = s.stage_derivatives[1];
        const ncgen_real *NCGEN_RESTRICT c = s.stage_derivatives[2], *NCGEN_RESTRICT d = s.stage_derivatives[3];
        const ncgen_scalar u = s.weights[0], v = s.weights[1], x = s.weights[2], y = s.weights[3];
        if (is_first && count > 2)
            for (int i = 0; i < ny; ++i)
                sum[i] = u * a[i] + v * b[i] + x * c[i] + y * d[i];
        else if (is_first)
            for (int i = 0; i < ny; ++i)
                sum[i] = u * a[i] + v * b[i];
        else if (count > 2)
            for (int i = 0; i < ny; ++i)
                sum[i] = sum[i] + u * a[i] + v * b[i] + x * c[i] + y * d[i];
        else
            for (int i = 0; i < ny; ++i)
                sum[i] = sum[i] + u * a[i] + v * b[i];
        count = next_terms(r, w, &j, stages, weights, &s);
    }
}

static void advance(const ncgen_run *r, const ncgen_stepping *w, ncgen_scalar h, int stages, const ncgen_scalar *weights,
                    ncgen_real *NCGEN_RESTRICT y_new)
{
    const ncgen_real *NCGEN_RESTRICT y = r->y;
    const int ny = r->ny;
    combine(r, w, stages, weights, y_new);
    for (int i = 0; i < ny; ++i)
        y_new[i] = y[i] + h * y_new[i];
}

/* new_y onto the constraints; at the end of a step the statistics get how far it was moved. */
static int project_state(ncgen_run *r, ncgen_stepping *w, ncgen_scalar t, int is_end)
{
    const ncgen_real largest = r->statistics->largest_projection;
    const int status = r->project_state(r, t, w->new_y, w->repeated);
    if (!is_end)
        r->statistics->largest_projection = largest;
    return status;
}

/* Where the tape has a stage of the step under way. */
static ncgen_real *taped_stage(const ncgen_run *r, const tableau *method, int stage)
{
    const ncgen_tape *tape = r->options->tape;
    return tape->states + ((size_t)tape->steps * (size_t)(2 * method->stages + 3) + 2 * (size_t)stage) * (size_t)r->n;
}

static void tape_stage(const ncgen_run *r, const tableau *method, int stage, const ncgen_real *y)
{
    ncgen_real *state = taped_stage(r, method, stage);
    ncgen_copy(r->n, y + r->n, state);
    ncgen_copy(r->n, y, state + r->n);
}

/* The step under way has come to its end. */
static void tape_step(const ncgen_run *r, const tableau *method, ncgen_scalar t, ncgen_scalar t_new, const ncgen_real *y_new)
{
    ncgen_tape *tape = r->options->tape;
    ncgen_copy(r->n, r->constrained->closed_position, taped_stage(r, method, method->stages + 1));
    if (r->statistics->factorisations > 0 && !tape->first_other)
        tape->first_other = tape->steps + 1;
    tape->times[tape->steps] = t;
    tape->times[tape->steps += 1] = t_new;
    tape_stage(r, method, 0, y_new);
}

/* One trial step: new_y, and the derivative there. NCGEN_DOMAIN if these are no numbers.
 *
 * Once it is repeated its stages are projected as well as its end: near a singular position the accelerations of a state that is
 * off the constraints by a truncation error are wrong by that error over the distance, and no step is short enough to pass. */
static int trial_step(ncgen_run *r, ncgen_stepping *w, const tableau *method, ncgen_scalar t, ncgen_scalar h)
{
    const int last = method->stages, projects = r->projecting = w->repeated && r->projects_stages;
    ncgen_tape *tape = r->options->tape;
    if (tape && !(r->constrained && r->constrained->closed_position))
        return NCGEN_ARGUMENT;
    if (tape && tape->steps == tape->capacity)
        return NCGEN_TAPE_FULL;
    if (tape) {
        if (projects && !tape->first_other)
            tape->first_other = tape->steps + 1;
        tape_stage(r, method, 0, r->y);
    }
    for (int s = 1; s <= last; ++s) {
        advance(r, w, h, s, method->a[s], w->new_y);
        if (tape)
            tape_stage(r, method, s, w->new_y);
        int status = ncgen_report_attempt(r, t + method->c[s] * h);
        if (status == NCGEN_OK && (s == last || projects) && r->project_state)
            status = project_state(r, w, t + method->c[s] * h, s == last);
        if (status == NCGEN_OK)
            status = r->derivative(r, t + method->c[s] * h, w->new_y, stage_derivative(r, w, s));
        if (status != NCGEN_OK)
            return status;
    }
    w->interpolated = 0;
    return ncgen_is_finite(r->ny, w->new_y) && ncgen_is_finite(r->ny, stage_derivative(r, w, last)) ? NCGEN_OK : NCGEN_DOMAIN;
}

/* The error that a component may have. */
static ncgen_real tolerance_of(const ncgen_run *r, int i, ncgen_real a, ncgen_real b)
{
    const ncgen_real u = NCGEN_ABS(a), v = NCGEN_ABS(b);
    return r->options->atol * (r->options->sizes ? r->options->sizes[i] : 1) + r->options->rtol * (u > v ? u : v);
}

/* The square of the first components in units of what is tolerated at a and b, a mean over all of them. */
static ncgen_real mean_square(const ncgen_run *r, int count, const ncgen_real *x, const ncgen_real *a, const ncgen_real *b)
{
    ncgen_real sum = 0;
    for (int i = 0; i < count; ++i) {
        const ncgen_real scaled = x[i] / tolerance_of(r, i, a[i], b[i]);
        sum += scaled * scaled;
    }
    return sum / (ncgen_scalar)r->error_size;
}

ncgen_real ncgen_weighted_square(const ncgen_run *r, const ncgen_real *x, const ncgen_real *a, const ncgen_real *b)
{
    return mean_square(r, r->error_size, x, a, b);
}

/* Estimate k of the error over h, squared. */
static ncgen_real estimate(ncgen_run *r, ncgen_stepping *w, const tableau *method, int k)
{
    combine(r, w, method->stages + 1, method->errors[k], w->at);
    return ncgen_weighted_square(r, w->at, r->y, w->new_y);
}

/* The part of the tolerance that a step of a length may take, because all steps share it. Steps that are shorter than the mean
 * count as that: near a singular position rounding is all that is left of the error, and no step could be short enough for it. So do
 * first steps that are far shorter than the run, by a share that becomes less and less, so that all of it together is small. */
static ncgen_scalar tolerance_fraction(const ncgen_run *r, ncgen_scalar h)
{
    const ncgen_scalar count = (ncgen_scalar)r->statistics->steps + 1, mean = (r->start_t - r->times[0]) / count;
    const ncgen_scalar least = R(1.0e-4) * r->options->span / (count * count);
    if (h < mean)
        h = mean;
    if (h < least)
        h = least;
    return r->options->span > h ? h / r->options->span : 1;
}

/* The error of a step over the tolerance. */
static ncgen_real error_of(ncgen_run *r, ncgen_stepping *w, const tableau *method, ncgen_scalar h)
{
    const ncgen_real error = estimate(r, w, method, 0);
    if (method->n_errors == 1)
        return h * NCGEN_SQRT(error);
    const ncgen_real both = error + R(0.01) * estimate(r, w, method, 1);
    return both > 0 ? h * error / NCGEN_SQRT(both) : both;
}

/* A first step from the sizes of y, yd and an estimate of ydd (Hairer, Norsett & Wanner, II.4). Work is left out: it begins with 0, so that
 * any power would be infinitely fast next to it. */
ncgen_scalar ncgen_first_step(ncgen_run *r, ncgen_stepping *w, int order, ncgen_scalar t, ncgen_scalar span)
{
    const int count = r->error_size - 1;
    const ncgen_real d0 = NCGEN_SQRT(mean_square(r, count, r->y, r->y, r->y));
    const ncgen_real d1 = NCGEN_SQRT(mean_square(r, count, stage_derivative(r, w, 0), r->y, r->y));
    ncgen_real guess = d0 < R(1.0e-5) || d1 < R(1.0e-5) ? R(1.0e-6) : R(0.01) * d0 / d1;
    if (guess > span)
        guess = span;
    for (int i = 0; i < r->ny; ++i)
        w->new_y[i] = r->y[i] + guess * stage_derivative(r, w, 0)[i];
    if (r->derivative(r, t + guess, w->new_y, stage_derivative(r, w, 1)) != NCGEN_OK)
        return guess * R(0.01);
    for (int i = 0; i < r->ny; ++i)
        w->at[i] = stage_derivative(r, w, 1)[i] - stage_derivative(r, w, 0)[i];
    const ncgen_real d2 = NCGEN_SQRT(mean_square(r, count, w->at, r->y, r->y)) / guess;
    if (!ncgen_is_finite(1, &d2))
        return guess * R(0.01);
    const ncgen_real largest = d1 > d2 ? d1 : d2;
    const ncgen_scalar root = 1 / (ncgen_scalar)(order + 1);
    ncgen_real better = largest <= R(1.0e-15) ? guess * R(1.0e-3) : NCGEN_POW(R(0.01) / largest, root);
    if (better > R(100.0) * guess)
        better = R(100.0) * guess;
    return better < span ? better : span;
}

/* The stages that only the interpolant needs; taken once a step, when first asked for. */
static int prepare_interpolant(ncgen_run *r, ncgen_stepping *w, const tableau *method, ncgen_scalar t, ncgen_scalar h)
{
    for (int s = method->stages + 1; s < method->width && !w->interpolated; ++s) {
        advance(r, w, h, s, method->a[s], w->at);
        const int status = r->derivative(r, t + method->c[s] * h, w->at, stage_derivative(r, w, s));
        if (status != NCGEN_OK)
            return status;
    }
    w->interpolated = 1;
    return NCGEN_OK;
}

/* w->at: the state at t + s h, inside a step whose end is new_y. */
static int interpolate(ncgen_run *r, ncgen_stepping *w, ncgen_scalar t, ncgen_scalar h, ncgen_scalar s)
{
    const tableau *method = &tableaus[r->options->method];
    const int status = prepare_interpolant(r, w, method, t, h);
    if (status != NCGEN_OK)
        return status;
    ncgen_scalar weights[WIDTH];
    for (int j = 0; j < method->width; ++j) {
        weights[j] = 0;
        for (int k = method->n_dense - 1; k >= 0; --k)
            weights[j] = (weights[j] + method->dense[k][j]) * (k % 2 ? 1 - s : s);
    }
    advance(r, w, h, method->width, weights, w->at);
    return NCGEN_OK;
}

static int finish_step(ncgen_run *r, ncgen_stepping *w, const tableau *method, ncgen_scalar t, ncgen_scalar t_new)
{
    if (r->options->tape)
        tape_step(r, method, t, t_new, w->new_y);
    const int status = ncgen_grid_step(r, w, t, t_new);
    ncgen_copy(r->ny, stage_derivative(r, w, method->stages), stage_derivative(r, w, 0));
    return status;
}

/* Does an accepted step speak for a stiff mechanism? It does where the motion itself, whose rate its derivatives show, would allow
 * far longer ones at this tolerance, and what holds it down is the stability of the method: the last two stages are both at
 * the end of the step, and the difference of their derivatives over that of their states is about the largest eigenvalue (Hairer
 * and Wanner, Solving Ordinary Differential Equations II, IV.2). Work is left out, since nothing depends on it.
 *
 * A spring may be so stiff that the rounding of its length is a force; then no eigenvalue is to be seen, but steps are tiny:
 * for good, while near a singular position they are so for a moment. */
static int is_limited_by_stability(const ncgen_run *r, const ncgen_stepping *w, const tableau *method, ncgen_scalar h, int *tiny)
{
    const int last = method->stages;
    const ncgen_real *first = stage_derivative(r, w, last - 1), *second = stage_derivative(r, w, last);
    const ncgen_scalar needed = NCGEN_POW(r->options->rtol, 1 / (ncgen_scalar)(method->order + 1));
    ncgen_real stage_derivatives = 0, states = 0, rates = 0, sizes = 0;
    *tiny = 0;
    if (r->options->max_step > 0 && !(h < r->options->max_step))
        return 0; /* the user holds it down */
    advance(r, w, h, last - 1, method->a[last - 1], w->at);
    for (int i = 0; i < r->error_size - 1; ++i) {
        const ncgen_real size = tolerance_of(r, i, r->y[i], w->new_y[i]), state = w->new_y[i] / size, rate = second[i] / size;
        const ncgen_real by_derivative = rate - first[i] / size, by_state = state - w->at[i] / size;
        stage_derivatives += by_derivative * by_derivative;
        states += by_state * by_state;
        rates += rate * rate;
        sizes += state * state;
    }
    const ncgen_real moved = h * NCGEN_SQRT(rates / sizes);
    const ncgen_scalar bound = stability_fraction * method->stability;
    *tiny = moved < R(1.0e-3) * needed;
    return moved < R(0.1) * needed && h * h * stage_derivatives > bound * bound * states;
}

/* Would an implicit method from here on solve for the degrees of freedom alone, and is there far to go? */
static int can_switch_to_implicit(const ncgen_run *r, ncgen_scalar h)
{
    const int is_cheap = r->options->stop_when_stiff && r->constrained && r->constrained->is_recursive && !r->dynamics->rolling;
    return is_cheap && r->times[r->n_times - 1] - r->start_t > implicit_cost * h;
}

/* Is the mechanism stiff? Looked at now and then, and at every step once one speaks for it. */
static int is_stiff(const ncgen_run *r, ncgen_stepping *w, const tableau *method, ncgen_scalar h)
{
    const long step = r->statistics->steps + 1;
    const int due = step % STIFF_EVERY == 0;
    int tiny;
    if (w->stiff == 0 && !due && !(step % STIFF_EVERY_WITH_IMPLICIT == 0 && can_switch_to_implicit(r, h)))
        return 0;
    const int speaks = is_limited_by_stability(r, w, method, h, &tiny);
    if (due)
        w->tiny = tiny ? w->tiny + 1 : 0;
    if (w->tiny == TINY_LIMIT) {
        w->tiny = 0;
        return 1;
    }
    if (speaks) {
        w->not_stiff = 0;
        w->stiff = w->stiff + 1 < STIFF_LIMIT ? w->stiff + 1 : 0;
        return w->stiff == 0;
    }
    w->not_stiff += 1;
    if (w->not_stiff >= STIFF_DOUBT)
        w->stiff = 0;
    return 0;
}

/* The derivative at the start of a step whose inputs are not those of the last step's end. */
static int begin_anew(ncgen_run *r, ncgen_stepping *w, ncgen_scalar t)
{
    return r->is_driven ? r->derivative(r, t, r->y, stage_derivative(r, w, 0)) : NCGEN_OK;
}

static int run_adaptive(ncgen_run *r, ncgen_stepping *w, const tableau *method)
{
    const ncgen_scalar end = r->times[r->n_times - 1];
    const ncgen_scalar power = -1 / (ncgen_scalar)(method->order + 1);
    ncgen_scalar t = r->times[0], goal = end;
    ncgen_scalar h = r->options->first_step > 0 ? r->options->first_step : ncgen_first_step(r, w, method->order, t, end - t);
    int repeats = 0, rejected = 0, near = 0, stiff = 0, trouble = NCGEN_STEP_TOO_SHORT;
    while (t < end) {
        if (r->options->max_step > 0 && h > r->options->max_step)
            h = r->options->max_step;
        goal = ncgen_next_break(r, t, end);
        const ncgen_scalar wanted = h;
        const int last = t + h >= goal;
        if (last)
            h = goal - t;
        if (!ncgen_is_step(r, t, h))
            return trouble;
        w->repeated = repeats || rejected || near;
        int status = trial_step(r, w, method, t, h);
        if (status == NCGEN_INTERRUPTED || status == NCGEN_TAPE_FULL)
            return status;
        const ncgen_real error = status == NCGEN_OK ? error_of(r, w, method, h) / tolerance_fraction(r, h) : 0;
        if (status != NCGEN_OK || !(error < R(1.0e30))) {
            trouble = status != NCGEN_OK ? status : NCGEN_NOT_CONVERGED;
            if (++repeats > REPEAT_LIMIT)
                return trouble;
            r->statistics->repeated += 1;
            r->uses_exchanges = repeats > 1; /* again: it may be rounding */
            h *= R(0.25);
            continue;
        }
        ncgen_real factor = error > 0 ? R(0.9) * NCGEN_POW(error, power) : R(10.0);
        if (!(error < R(1.0))) {
            r->statistics->rejected += 1;
            r->uses_exchanges = rejected; /* again: it may be rounding */
            rejected = 1;
            h *= factor > R(0.2) ? factor : R(0.2);
            continue;
        }
        /* A repeated step that is far better than its length explains is better since its stages were projected: without that the next one,
         * which is no farther from the singular position, would be refused as well, and steps creep up to it. */
        near = (repeats || rejected) && r->projecting && factor > R(1.5);
        if (factor > R(10.0))
            factor = R(10.0);
        if (rejected && factor > R(1.0))
            factor = R(1.0);
        if (repeats == 0 && rejected == 0)
            trouble = NCGEN_STEP_TOO_SHORT; /* what was wrong is behind */
        repeats = rejected = 0;
        const ncgen_scalar t_new = last ? goal : t + h;
        stiff = !(h < wanted) && is_stiff(r, w, method, h); /* one that is cut short does not count */
        r->statistics->stiff += stiff;
        status = finish_step(r, w, method, t, t_new);
        if (status != NCGEN_OK || r->statistics->stopped)
            return status;
        t = t_new;
        h = last && factor >= 1 && h * factor < wanted ? wanted : h * factor; /* what cut it short is behind */
        r->statistics->next_step = h;
        if (t < end && last && (status = begin_anew(r, w, t)) != NCGEN_OK)
            return status;
        if (t < end && ncgen_makes_no_progress(r, w, t))
            return NCGEN_STEP_TOO_SHORT;
        if (stiff && t < end && r->options->stop_when_stiff)
            return NCGEN_STIFF;
    }
    return NCGEN_OK;
}

static int run_fixed(ncgen_run *r, ncgen_stepping *w, const tableau *method)
{
    const ncgen_scalar end = r->times[r->n_times - 1];
    ncgen_scalar from = r->times[0];
    while (from < end) { /* from one row or break to the next */
        int row = r->rows;
        while (row < r->n_times && !(r->times[row] > from))
            ++row;
        const ncgen_scalar to = ncgen_next_break(r, from, row < r->n_times ? r->times[row] : end), span = to - from;
        const ncgen_scalar count = ncgen_step_count(r, span);
        if (!(count > 0))
            return NCGEN_ARGUMENT;
        for (ncgen_scalar i = 0; i < count; i += 1) {
            const ncgen_scalar t = from + i * (span / count);
            const int last = i + 1 >= count;
            const ncgen_scalar t_new = last ? to : from + (i + 1) * (span / count);
            if (!(t_new > t))
                return NCGEN_ARGUMENT;
            int status = trial_step(r, w, method, t, t_new - t);
            if (status == NCGEN_OK)
                status = finish_step(r, w, method, t, t_new);
            if (status == NCGEN_OK && t_new < end)
                status = begin_anew(r, w, t_new);
            if (status != NCGEN_OK || r->statistics->stopped)
                return status;
        }
        from = to;
    }
    return NCGEN_OK;
}

int ncgen_explicit(ncgen_run *r, ncgen_stepping *w)
{
    const tableau *method = &tableaus[r->options->method];
    int status = r->derivative(r, r->times[0], r->y, stage_derivative(r, w, 0));
    if (status == NCGEN_OK && !ncgen_is_finite(r->ny, stage_derivative(r, w, 0)))
        status = NCGEN_DOMAIN;
    if (status == NCGEN_OK)
        (void)ncgen_accept(r, r->times[0], r->y);
    w->interpolate = interpolate;
    if (status == NCGEN_OK)
        status = ncgen_grid_begin(r, w);
    if (status != NCGEN_OK)
        return status;
    const int is_fixed = method->n_errors == 0 || !(r->options->rtol > 0 || r->options->atol > 0);
    return is_fixed ? run_fixed(r, w, method) : run_adaptive(r, w, method);
}
