/* ncgen_runtime.c: coordinate partitioning with Dormand-Prince 5(4) and classical Runge-Kutta.
 *
 * The state is y = [zd, z, W]: velocities and positions of the independent coordinates, and the work of drivers and
 * forces without a potential. Newton's method for the dependent coordinates starts from the last accepted state,
 * extrapolated with its velocities, so a rejected step leaves no trace.
 */
#include "ncgen_runtime.h"

#include "ncgen_math.h"

#define R(x) ((ncgen_scalar)(x))

/* An amplification that leaves no digit of the solution. */
static const ncgen_scalar broken_down = R(1e30);

enum {
    STAGES = 7,
    NEWTON_LIMIT = 40,
    REPEAT_LIMIT = 8
};

/* After a Newton step from a residual below this, the next one is at rounding: it need not be looked at. */
static const ncgen_scalar nearly_converged = R(1e-8);

typedef struct run {
    const ncgen_model *model;
    const ncgen_dynamics *dynamics;
    const ncgen_options *options;
    const ncgen_real *p;
    ncgen_statistics *statistics;
    int n, nz, ny;
    ncgen_real *q, *out, *phi, *step; /* of the last evaluation; out = qd, zdd, power, amplification */
    ncgen_real *start_q, *start_qd;   /* the last accepted state */
    ncgen_real start_work;
    ncgen_real *end_q, *end_qd, *end_y; /* the state at the end of a step, while rows inside it are written */
    ncgen_scalar start_t;
    ncgen_real amplification; /* at the start of the run */
    ncgen_real *y, *y_new, *k[STAGES];
} run;

static const ncgen_scalar dopri_c[STAGES] = {R(0.0), R(1.0 / 5), R(3.0 / 10), R(4.0 / 5), R(8.0 / 9), R(1.0), R(1.0)};

static const ncgen_scalar dopri_a[STAGES][6] = {
    {R(0.0)},
    {R(1.0 / 5)},
    {R(3.0 / 40), R(9.0 / 40)},
    {R(44.0 / 45), R(-56.0 / 15), R(32.0 / 9)},
    {R(19372.0 / 6561), R(-25360.0 / 2187), R(64448.0 / 6561), R(-212.0 / 729)},
    {R(9017.0 / 3168), R(-355.0 / 33), R(46732.0 / 5247), R(49.0 / 176), R(-5103.0 / 18656)},
    {R(35.0 / 384), R(0.0), R(500.0 / 1113), R(125.0 / 192), R(-2187.0 / 6784), R(11.0 / 84)},
};

/* Difference of the fifth- and fourth-order weights. */
static const ncgen_scalar dopri_error[STAGES] = {
    R(-71.0 / 57600), R(0.0), R(71.0 / 16695), R(-71.0 / 1920), R(17253.0 / 339200), R(-22.0 / 525), R(1.0 / 40)};

/* Weights of the interpolant: b_i(s) = s (c0 + s (c1 + s (c2 + s c3))) (Shampine 1986). */
static const ncgen_scalar dopri_dense[STAGES][4] = {
    {R(1.0), R(-8048581381.0 / 2820520608.0), R(8663915743.0 / 2820520608.0), R(-12715105075.0 / 11282082432.0)},
    {R(0.0), R(0.0), R(0.0), R(0.0)},
    {R(0.0), R(131558114200.0 / 32700410799.0), R(-68118460800.0 / 10900136933.0), R(87487479700.0 / 32700410799.0)},
    {R(0.0), R(-1754552775.0 / 470086768.0), R(14199869525.0 / 1410260304.0), R(-10690763975.0 / 1880347072.0)},
    {R(0.0), R(127303824393.0 / 49829197408.0), R(-318862633887.0 / 49829197408.0), R(701980252875.0 / 199316789632.0)},
    {R(0.0), R(-282668133.0 / 205662961.0), R(2019193451.0 / 616988883.0), R(-1453857185.0 / 822651844.0)},
    {R(0.0), R(40617522.0 / 29380423.0), R(-110615467.0 / 29380423.0), R(69997945.0 / 29380423.0)},
};

size_t ncgen_workspace(const ncgen_model *model, const ncgen_dynamics *dynamics)
{
    const size_t n = (size_t)model->n_coordinates;
    const size_t nz = (size_t)dynamics->n_independent;
    const size_t ny = 2 * nz + 1;
    return 6 * n + nz + 2 + (size_t)model->n_rows + (size_t)dynamics->n_dependent + (3 + STAGES) * ny;
}

static ncgen_real *take(ncgen_real **workspace, int count)
{
    ncgen_real *part = *workspace;
    *workspace += count;
    return part;
}

static void copy(int count, const ncgen_real *from, ncgen_real *to)
{
    for (int i = 0; i < count; ++i)
        to[i] = from[i];
}

/* The largest |phi| relative to the rows' sizes; not a number if one of them is not. */
static ncgen_real residual(const run *r)
{
    ncgen_real largest = 0;
    for (int i = 0; i < r->model->n_rows; ++i) {
        const ncgen_real size = NCGEN_ABS(r->phi[i]) / r->dynamics->row_sizes[i];
        if (!(size <= largest))
            largest = size;
    }
    return largest;
}

/* The dependent coordinates at time t for the independent ones z. */
static int solve_position(run *r, ncgen_scalar t, const ncgen_real *z)
{
    const ncgen_dynamics *d = r->dynamics;
    const ncgen_scalar ahead = t - r->start_t;
    for (int i = 0; i < r->n; ++i)
        r->q[i] = r->start_q[i] + ahead * r->start_qd[i];
    for (int i = 0; i < r->nz; ++i)
        r->q[d->independent[i]] = z[i];
    for (int iteration = 0; iteration <= NEWTON_LIMIT; ++iteration) {
        int status = r->model->phi(t, r->q, r->p, r->phi);
        if (status != NCGEN_OK)
            return status;
        const ncgen_real size = residual(r);
        if (size <= r->options->tolerance)
            return NCGEN_OK;
        if (!(size < R(1e30)))
            return NCGEN_NOT_CONVERGED;
        status = d->newton(t, r->q, r->p, r->step);
        if (status != NCGEN_OK)
            return status;
        for (int i = 0; i < d->n_dependent; ++i)
            r->q[d->dependent[i]] += r->step[i];
        r->statistics->newton_steps += 1;
        if (size <= nearly_converged)
            return NCGEN_OK;
    }
    return NCGEN_NOT_CONVERGED;
}

/* yd at (t, y); q, qd and the accelerations stay in r->q and r->out. */
static int derivative(run *r, ncgen_scalar t, const ncgen_real *y, ncgen_real *yd)
{
    r->statistics->evaluations += 1;
    int status = solve_position(r, t, y + r->nz);
    if (status != NCGEN_OK)
        return status;
    status = r->dynamics->acceleration(t, r->q, y, r->p, r->out);
    if (status != NCGEN_OK)
        return status;
    if (!(r->out[r->n + r->nz + 1] < broken_down))
        return NCGEN_PIVOT;
    for (int i = 0; i < r->nz; ++i) {
        yd[i] = r->out[r->n + i];
        yd[r->nz + i] = r->out[r->dynamics->independent[i]];
    }
    yd[2 * r->nz] = r->out[r->n + r->nz];
    return NCGEN_OK;
}

/* The last evaluation becomes the state from which Newton's method starts. NCGEN_PIVOT means that other independent
 * coordinates may serve better from here on: the amplification has grown since the start. */
static int accept(run *r, ncgen_scalar t)
{
    const ncgen_real amplification = r->out[r->n + r->nz + 1];
    r->statistics->t = t;
    r->start_work = r->y[2 * r->nz];
    copy(r->n, r->q, r->start_q);
    copy(r->n, r->out, r->start_qd);
    r->start_t = t;
    if (r->amplification == 0)
        r->amplification = amplification;
    return amplification > r->options->growth * r->amplification ? NCGEN_PIVOT : NCGEN_OK;
}

static void write_row(const run *r, const ncgen_real *y, int row, ncgen_real *out_q, ncgen_real *out_qd, ncgen_real *out_work)
{
    for (int i = 0; i < r->n; ++i) {
        out_q[(size_t)row * (size_t)r->n + (size_t)i] = r->q[i];
        out_qd[(size_t)row * (size_t)r->n + (size_t)i] = r->out[i];
    }
    out_work[row] = y[2 * r->nz];
}

static ncgen_real weighted_norm(const run *r, const ncgen_real *x, const ncgen_real *a, const ncgen_real *b)
{
    ncgen_real sum = 0;
    for (int i = 0; i < r->ny; ++i) {
        const ncgen_real u = NCGEN_ABS(a[i]), v = NCGEN_ABS(b[i]);
        const ncgen_real scaled = x[i] / (r->options->atol + r->options->rtol * (u > v ? u : v));
        sum += scaled * scaled;
    }
    return NCGEN_SQRT(sum / (ncgen_scalar)r->ny);
}

/* A first step from the sizes of y, yd and an estimate of ydd (Hairer, Norsett & Wanner, II.4). */
static int first_step(run *r, ncgen_scalar t, ncgen_scalar span, ncgen_scalar *h)
{
    const ncgen_real d0 = weighted_norm(r, r->y, r->y, r->y);
    const ncgen_real d1 = weighted_norm(r, r->k[0], r->y, r->y);
    ncgen_real guess = d0 < R(1e-5) || d1 < R(1e-5) ? R(1e-6) : R(0.01) * d0 / d1;
    if (guess > span)
        guess = span;
    for (int i = 0; i < r->ny; ++i)
        r->y_new[i] = r->y[i] + guess * r->k[0][i];
    const int status = derivative(r, t + guess, r->y_new, r->k[1]);
    if (status != NCGEN_OK) {
        *h = guess * R(0.01);
        return NCGEN_OK;
    }
    for (int i = 0; i < r->ny; ++i)
        r->k[2][i] = r->k[1][i] - r->k[0][i];
    const ncgen_real d2 = weighted_norm(r, r->k[2], r->y, r->y) / guess;
    const ncgen_real largest = d1 > d2 ? d1 : d2;
    ncgen_real better = largest <= R(1e-15) ? guess * R(1e-3) : NCGEN_POW(R(0.01) / largest, R(0.2));
    if (better > R(100.0) * guess)
        better = R(100.0) * guess;
    *h = better < span ? better : span;
    return NCGEN_OK;
}

/* One trial step of Dormand-Prince; on success y_new and *error are set and the last stage is evaluated at y_new. */
static int dopri_step(run *r, ncgen_scalar t, ncgen_scalar h, ncgen_real *error)
{
    for (int s = 1; s < STAGES; ++s) {
        for (int i = 0; i < r->ny; ++i) {
            ncgen_real sum = 0;
            for (int j = 0; j < s; ++j)
                sum += dopri_a[s][j] * r->k[j][i];
            r->y_new[i] = r->y[i] + h * sum;
        }
        const int status = derivative(r, t + dopri_c[s] * h, r->y_new, r->k[s]);
        if (status != NCGEN_OK)
            return status;
    }
    ncgen_real sum_of_squares = 0;
    for (int i = 0; i < r->ny; ++i) {
        ncgen_real sum = 0;
        for (int s = 0; s < STAGES; ++s)
            sum += dopri_error[s] * r->k[s][i];
        const ncgen_real u = NCGEN_ABS(r->y[i]), v = NCGEN_ABS(r->y_new[i]);
        const ncgen_real scaled = h * sum / (r->options->atol + r->options->rtol * (u > v ? u : v));
        sum_of_squares += scaled * scaled;
    }
    *error = NCGEN_SQRT(sum_of_squares / (ncgen_scalar)r->ny);
    return NCGEN_OK;
}

/* Rows of the grid inside the step from t to t + h, by interpolation of the state; positions are solved anew. */
static int write_inside(run *r, ncgen_scalar t, ncgen_scalar h, int n_times, const ncgen_scalar *times, ncgen_real *out_q,
                        ncgen_real *out_qd, ncgen_real *out_work, int *rows)
{
    ncgen_real *at = r->y_new; /* the new state has been moved to y by now */
    while (*rows < n_times && times[*rows] < t + h) {
        const ncgen_scalar s = (times[*rows] - t) / h;
        for (int i = 0; i < r->ny; ++i) {
            ncgen_real sum = 0;
            for (int j = 0; j < STAGES; ++j) {
                const ncgen_scalar *c = dopri_dense[j];
                sum += s * (c[0] + s * (c[1] + s * (c[2] + s * c[3]))) * r->k[j][i];
            }
            at[i] = r->y[i] + h * sum;
        }
        int status = solve_position(r, times[*rows], at + r->nz);
        if (status == NCGEN_OK)
            status = r->dynamics->acceleration(times[*rows], r->q, at, r->p, r->out);
        if (status != NCGEN_OK)
            return status;
        write_row(r, at, *rows, out_q, out_qd, out_work);
        *rows += 1;
    }
    return NCGEN_OK;
}

static int run_dopri5(run *r, int n_times, const ncgen_scalar *times, ncgen_real *out_q, ncgen_real *out_qd,
                      ncgen_real *out_work, int *rows)
{
    const ncgen_scalar end = times[n_times - 1];
    ncgen_scalar t = times[0], h = 0;
    int status = first_step(r, t, end - t, &h);
    int repeats = 0, rejected = 0;
    while (status == NCGEN_OK && t < end) {
        if (r->options->max_steps && r->statistics->steps >= r->options->max_steps)
            return NCGEN_NOT_CONVERGED;
        if (r->options->max_step > 0 && h > r->options->max_step)
            h = r->options->max_step;
        const int last = t + h >= end;
        if (last)
            h = end - t;
        if (!(t + h > t))
            return NCGEN_NOT_CONVERGED;
        ncgen_real error = 0;
        status = dopri_step(r, t, h, &error);
        if (status != NCGEN_OK || !(error < R(1e30))) {
            if (++repeats > REPEAT_LIMIT)
                return status != NCGEN_OK ? status : NCGEN_NOT_CONVERGED;
            r->statistics->repeated += 1;
            h *= R(0.25);
            status = NCGEN_OK;
            continue;
        }
        ncgen_real factor = error > 0 ? R(0.9) * NCGEN_POW(error, R(-0.2)) : R(10.0);
        if (!(error < R(1.0))) {
            r->statistics->rejected += 1;
            rejected = 1;
            h *= factor > R(0.2) ? factor : R(0.2);
            continue;
        }
        if (factor > R(10.0))
            factor = R(10.0);
        if (rejected && factor > R(1.0))
            factor = R(1.0);
        repeats = rejected = 0;

        /* Keep the new state (its q and qd are those of the last stage) while rows inside the step are written. */
        const ncgen_scalar t_new = last ? end : t + h;
        copy(r->n, r->q, r->end_q);
        copy(r->n, r->out, r->end_qd);
        copy(r->ny, r->y_new, r->end_y);
        status = write_inside(r, t, t_new - t, n_times, times, out_q, out_qd, out_work, rows);
        copy(r->n, r->end_q, r->q);
        copy(r->n, r->end_qd, r->out);
        copy(r->ny, r->end_y, r->y);
        copy(r->ny, r->k[STAGES - 1], r->k[0]);
        r->statistics->steps += 1;
        const int accepted = accept(r, t_new);
        if (status == NCGEN_OK && t_new < end)
            status = accepted;
        t = t_new;
        h *= factor;
    }
    if (status == NCGEN_OK && *rows < n_times) {
        write_row(r, r->y, *rows, out_q, out_qd, out_work);
        *rows += 1;
    }
    return status;
}

static int rk4_step(run *r, ncgen_scalar t, ncgen_scalar h)
{
    static const ncgen_scalar weight[4] = {R(1.0 / 6), R(1.0 / 3), R(1.0 / 3), R(1.0 / 6)};
    static const ncgen_scalar node[4] = {R(0.0), R(0.5), R(0.5), R(1.0)};
    for (int s = 1; s < 4; ++s) {
        for (int i = 0; i < r->ny; ++i)
            r->y_new[i] = r->y[i] + node[s] * h * r->k[s - 1][i];
        const int status = derivative(r, t + node[s] * h, r->y_new, r->k[s]);
        if (status != NCGEN_OK)
            return status;
    }
    for (int i = 0; i < r->ny; ++i) {
        ncgen_real sum = 0;
        for (int s = 0; s < 4; ++s)
            sum += weight[s] * r->k[s][i];
        r->y[i] += h * sum;
    }
    return derivative(r, t + h, r->y, r->k[0]);
}

static int run_rk4(run *r, int n_times, const ncgen_scalar *times, ncgen_real *out_q, ncgen_real *out_qd, ncgen_real *out_work,
                   int *rows)
{
    for (int row = 1; row < n_times; ++row) {
        const ncgen_scalar span = times[row] - times[row - 1];
        long count = r->options->max_step > 0 ? (long)(span / r->options->max_step + R(0.999999)) : 1;
        if (count < 1)
            count = 1;
        for (long i = 0; i < count; ++i) {
            const ncgen_scalar h = span / (ncgen_scalar)count;
            const ncgen_scalar t = times[row - 1] + (ncgen_scalar)i * h;
            const int status = rk4_step(r, t, h);
            if (status != NCGEN_OK)
                return status;
            r->statistics->steps += 1;
            const int accepted = accept(r, i + 1 == count ? times[row] : t + h);
            if (i + 1 == count) {
                write_row(r, r->y, row, out_q, out_qd, out_work);
                *rows += 1;
            }
            if (accepted != NCGEN_OK && !(i + 1 == count && row + 1 == n_times))
                return accepted;
        }
    }
    return NCGEN_OK;
}

int ncgen_simulate(const ncgen_model *model, const ncgen_dynamics *dynamics, const ncgen_options *options,
                   const ncgen_real *p, const ncgen_real *q, const ncgen_real *zd, int n_times, const ncgen_scalar *times,
                   ncgen_real *out_q, ncgen_real *out_qd, ncgen_real *out_work, int *rows, ncgen_statistics *statistics,
                   ncgen_real *workspace)
{
    if (n_times < 2 || !model->phi)
        return NCGEN_ARGUMENT;
    run r = {.model = model, .dynamics = dynamics, .options = options, .p = p, .statistics = statistics};
    r.n = model->n_coordinates;
    r.nz = dynamics->n_independent;
    r.ny = 2 * r.nz + 1;
    r.q = take(&workspace, r.n);
    r.out = take(&workspace, r.n + r.nz + 2);
    r.phi = take(&workspace, model->n_rows);
    r.start_q = take(&workspace, r.n);
    r.start_qd = take(&workspace, r.n);
    r.y = take(&workspace, r.ny);
    r.y_new = take(&workspace, r.ny);
    for (int s = 0; s < STAGES; ++s)
        r.k[s] = take(&workspace, r.ny);
    r.step = take(&workspace, dynamics->n_dependent);
    r.end_q = take(&workspace, r.n);
    r.end_qd = take(&workspace, r.n);
    r.end_y = take(&workspace, r.ny);

    *statistics = (ncgen_statistics){.t = times[0]};
    *rows = 0;
    r.start_t = times[0];
    for (int i = 0; i < r.n; ++i) {
        r.start_q[i] = q[i];
        r.start_qd[i] = 0;
    }
    for (int i = 0; i < r.nz; ++i) {
        r.y[i] = zd[i];
        r.y[r.nz + i] = q[dynamics->independent[i]];
    }
    r.y[2 * r.nz] = 0;
    const int status = derivative(&r, times[0], r.y, r.k[0]);
    if (status != NCGEN_OK)
        return status;
    (void)accept(&r, times[0]);
    write_row(&r, r.y, 0, out_q, out_qd, out_work);
    *rows = 1;
    const int ended = options->method == NCGEN_RK4 ? run_rk4(&r, n_times, times, out_q, out_qd, out_work, rows)
                                                   : run_dopri5(&r, n_times, times, out_q, out_qd, out_work, rows);
    copy(r.n, r.start_q, out_q + (size_t)n_times * (size_t)r.n);
    copy(r.n, r.start_qd, out_qd + (size_t)n_times * (size_t)r.n);
    out_work[n_times] = r.start_work;
    return ended;
}
