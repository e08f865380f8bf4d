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
    struct dense *dense; /* NULL where the dynamics are emitted */
} run;

/* What the dense path works in: sizes are n coordinates, d dependent, z independent, m rows. */
typedef struct dense {
    ncgen_real *jacobian, *mass;              /* nonzeros */
    ncgen_real *lu;                           /* d x d, row by row */
    ncgen_real *R, *MR;                       /* n x z */
    ncgen_real *reduced;                      /* z x z */
    ncgen_real *bias, *force, *missing;       /* n */
    ncgen_real *nu, *gamma, *lam;             /* m */
    ncgen_real *column;                       /* d */
    ncgen_real energy[3];
    int *order;                               /* row exchanges */
} dense;

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
    const size_t d = (size_t)dynamics->n_dependent;
    const size_t m = (size_t)model->n_rows;
    const size_t integration = 6 * n + nz + 2 + m + d + (3 + STAGES) * ny;
    const size_t nonzeros = (size_t)(model->phi_q_pattern.indptr ? model->phi_q_pattern.indptr[model->n_rows] : 0) +
                            (size_t)(model->mass_pattern.indptr ? model->mass_pattern.indptr[model->n_coordinates] : 0);
    const size_t linear = nonzeros + d * d + 2 * n * nz + nz * nz + 3 * n + 3 * m + d;
    return integration + (dynamics->newton ? 0 : linear);
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

/* Dense linear algebra, where nothing is emitted ------------------------------------------------------------- */

/* Phi_q at (t, q), and the factors of its dependent columns over the kept rows. */
static int factor_jacobian(run *r, ncgen_scalar t)
{
    const ncgen_dynamics *d = r->dynamics;
    const ncgen_pattern *pattern = &r->model->phi_q_pattern;
    dense *w = r->dense;
    const int size = d->n_dependent;
    const int status = r->model->phi_q(t, r->q, r->p, w->jacobian);
    if (status != NCGEN_OK)
        return status;
    for (int i = 0; i < size; ++i) {
        ncgen_real *row = w->lu + (size_t)i * (size_t)size;
        ncgen_real *full = w->bias; /* n numbers that are free here */
        for (int c = 0; c < r->n; ++c)
            full[c] = 0;
        for (int k = pattern->indptr[d->rows[i]]; k < pattern->indptr[d->rows[i] + 1]; ++k)
            full[pattern->indices[k]] = w->jacobian[k];
        for (int c = 0; c < size; ++c)
            row[c] = full[d->dependent[c]];
        w->order[i] = i;
    }
    for (int k = 0; k < size; ++k) {
        int best = k;
        for (int i = k + 1; i < size; ++i)
            if (NCGEN_ABS(w->lu[(size_t)i * (size_t)size + (size_t)k]) > NCGEN_ABS(w->lu[(size_t)best * (size_t)size + (size_t)k]))
                best = i;
        if (best != k) {
            for (int c = 0; c < size; ++c) {
                const ncgen_real other = w->lu[(size_t)k * (size_t)size + (size_t)c];
                w->lu[(size_t)k * (size_t)size + (size_t)c] = w->lu[(size_t)best * (size_t)size + (size_t)c];
                w->lu[(size_t)best * (size_t)size + (size_t)c] = other;
            }
            const int other = w->order[k];
            w->order[k] = w->order[best];
            w->order[best] = other;
        }
        const ncgen_real *pivot_row = w->lu + (size_t)k * (size_t)size;
        if (!(NCGEN_ABS(pivot_row[k]) > 0))
            return NCGEN_SINGULAR;
        for (int i = k + 1; i < size; ++i) {
            ncgen_real *row = w->lu + (size_t)i * (size_t)size;
            if (!(NCGEN_ABS(row[k]) > 0))
                continue;
            const ncgen_real share = row[k] /= pivot_row[k];
            for (int c = k + 1; c < size; ++c)
                row[c] -= share * pivot_row[c];
        }
    }
    return NCGEN_OK;
}

/* x of A x = right over kept rows; right is indexed like the model's rows. */
static void solve_factored(const run *r, const ncgen_real *right, ncgen_real *x)
{
    const int size = r->dynamics->n_dependent;
    const dense *w = r->dense;
    for (int i = 0; i < size; ++i) {
        const ncgen_real *row = w->lu + (size_t)i * (size_t)size;
        ncgen_real sum = right[r->dynamics->rows[w->order[i]]];
        for (int c = 0; c < i; ++c)
            sum -= row[c] * x[c];
        x[i] = sum;
    }
    for (int i = size - 1; i >= 0; --i) {
        const ncgen_real *row = w->lu + (size_t)i * (size_t)size;
        for (int c = i + 1; c < size; ++c)
            x[i] -= row[c] * x[c];
        x[i] /= row[i];
    }
}

/* lam of A' lam = right over the dependent coordinates, written to the model's rows; rows that are not kept get zero. */
static void solve_transposed(const run *r, const ncgen_real *right, ncgen_real *lam)
{
    const int size = r->dynamics->n_dependent;
    const dense *w = r->dense;
    ncgen_real *x = w->column;
    for (int i = 0; i < size; ++i) {
        ncgen_real sum = right[r->dynamics->dependent[i]];
        for (int c = 0; c < i; ++c)
            sum -= w->lu[(size_t)c * (size_t)size + (size_t)i] * x[c];
        x[i] = sum / w->lu[(size_t)i * (size_t)size + (size_t)i];
    }
    for (int i = size - 1; i >= 0; --i)
        for (int c = i + 1; c < size; ++c)
            x[i] -= w->lu[(size_t)c * (size_t)size + (size_t)i] * x[c];
    for (int i = 0; i < r->model->n_rows; ++i)
        lam[i] = 0;
    for (int i = 0; i < size; ++i)
        lam[r->dynamics->rows[w->order[i]]] = x[i];
}

/* The correction of the dependent coordinates for the phi there is. */
static int dense_step(run *r, ncgen_scalar t)
{
    const int status = factor_jacobian(r, t);
    if (status != NCGEN_OK)
        return status;
    solve_factored(r, r->phi, r->step);
    for (int i = 0; i < r->dynamics->n_dependent; ++i)
        r->step[i] = -r->step[i];
    return NCGEN_OK;
}

/* The basis R of the motions: column z of an n x nz matrix is qd for a unit speed of one independent coordinate. */
static void form_basis(const run *r)
{
    const ncgen_dynamics *d = r->dynamics;
    const ncgen_pattern *pattern = &r->model->phi_q_pattern;
    dense *w = r->dense;
    for (int z = 0; z < r->nz; ++z) {
        for (int i = 0; i < r->model->n_rows; ++i) {
            w->lam[i] = 0;
            for (int k = pattern->indptr[i]; k < pattern->indptr[i + 1]; ++k)
                if (pattern->indices[k] == d->independent[z])
                    w->lam[i] = w->jacobian[k];
        }
        solve_factored(r, w->lam, w->column);
        ncgen_real *column = w->R + (size_t)z * (size_t)r->n;
        for (int i = 0; i < r->n; ++i)
            column[i] = 0;
        column[d->independent[z]] = 1;
        for (int i = 0; i < d->n_dependent; ++i)
            column[d->dependent[i]] = -w->column[i];
    }
}

static void times_mass(const run *r, const ncgen_real *x, ncgen_real *product)
{
    const ncgen_pattern *pattern = &r->model->mass_pattern;
    for (int i = 0; i < r->n; ++i) {
        ncgen_real sum = 0;
        if (pattern->indptr)
            for (int k = pattern->indptr[i]; k < pattern->indptr[i + 1]; ++k)
                sum += r->dense->mass[k] * x[pattern->indices[k]];
        product[i] = sum;
    }
}

static ncgen_real dot(int count, const ncgen_real *a, const ncgen_real *b)
{
    ncgen_real sum = 0;
    for (int i = 0; i < count; ++i)
        sum += a[i] * b[i];
    return sum;
}

/* zdd of (R'MR) zdd = right, by LDL'. */
static int solve_reduced(const run *r, ncgen_real *right)
{
    const int nz = r->nz;
    ncgen_real *a = r->dense->reduced;
    for (int k = 0; k < nz; ++k) {
        if (!(a[k * nz + k] > 0))
            return NCGEN_SINGULAR;
        for (int i = k + 1; i < nz; ++i) {
            const ncgen_real share = a[i * nz + k] / a[k * nz + k];
            for (int j = k + 1; j <= i; ++j)
                a[i * nz + j] -= share * a[j * nz + k];
            right[i] -= share * right[k];
        }
    }
    for (int k = nz - 1; k >= 0; --k) {
        for (int i = k + 1; i < nz; ++i)
            right[k] -= a[i * nz + k] * right[i];
        right[k] /= a[k * nz + k];
    }
    return NCGEN_OK;
}

/* qd, zdd, power and amplification at r->q for the speeds zd, as the emitted function writes them. */
static int accelerate(run *r, ncgen_scalar t, const ncgen_real *zd)
{
    if (r->dynamics->acceleration)
        return r->dynamics->acceleration(t, r->q, zd, r->p, r->out);
    const ncgen_model *model = r->model;
    const ncgen_dynamics *d = r->dynamics;
    dense *w = r->dense;
    ncgen_real *qd = r->out, *zdd = r->out + r->n;
    int status = factor_jacobian(r, t);
    if (status != NCGEN_OK)
        return status;
    form_basis(r);
    for (int i = 0; i < model->n_rows; ++i)
        w->nu[i] = 0;
    if (model->nu)
        status |= model->nu(t, r->q, r->p, w->nu);
    solve_factored(r, w->nu, w->column);
    for (int i = 0; i < r->n; ++i) {
        qd[i] = 0;
        w->bias[i] = w->force[i] = 0;
        for (int z = 0; z < r->nz; ++z)
            qd[i] += w->R[z * r->n + i] * zd[z];
    }
    for (int i = 0; i < d->n_dependent; ++i)
        qd[d->dependent[i]] += w->column[i];
    status |= model->gamma(t, r->q, qd, r->p, w->gamma);
    solve_factored(r, w->gamma, w->column);
    for (int i = 0; i < d->n_dependent; ++i)
        w->bias[d->dependent[i]] = w->column[i];
    if (model->mass)
        status |= model->mass(t, r->q, r->p, w->mass);
    if (model->force)
        status |= model->force(t, r->q, qd, r->p, w->force);
    if (status != NCGEN_OK)
        return NCGEN_DOMAIN;
    times_mass(r, w->bias, w->missing);
    for (int i = 0; i < r->n; ++i)
        w->missing[i] = w->force[i] - w->missing[i];
    ncgen_real amplification = 0;
    for (int z = 0; z < r->nz; ++z) {
        const ncgen_real *column = w->R + z * r->n;
        times_mass(r, column, w->MR + z * r->n);
        for (int j = 0; j <= z; ++j)
            w->reduced[z * r->nz + j] = dot(r->n, column, w->MR + j * r->n);
        zdd[z] = dot(r->n, column, w->missing);
        for (int i = 0; i < r->n; ++i) {
            const ncgen_real grown = column[i] * d->column_sizes[d->independent[z]] / d->column_sizes[i];
            amplification += grown * grown;
        }
    }
    status = solve_reduced(r, zdd);
    if (status != NCGEN_OK)
        return status;
    ncgen_real power = 0;
    if (model->energy) {
        if (model->energy(t, r->q, qd, r->p, w->energy) != NCGEN_OK)
            return NCGEN_DOMAIN;
        power = w->energy[2];
    }
    if (model->nu) {
        for (int z = 0; z < r->nz; ++z)
            for (int i = 0; i < r->n; ++i)
                w->missing[i] -= w->MR[z * r->n + i] * zdd[z];
        solve_transposed(r, w->missing, w->lam);
        power -= dot(model->n_rows, w->nu, w->lam);
    }
    r->out[r->n + r->nz] = power;
    r->out[r->n + r->nz + 1] = amplification;
    return NCGEN_OK;
}

/* Positions, the state derivative, and integration ------------------------------------------------------------- */

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
        /* An emitted step has phi in it; most often one is needed, so it is not worth a look at phi beforehand. */
        int status = d->newton ? d->newton(t, r->q, r->p, r->step) : r->model->phi(t, r->q, r->p, r->phi);
        if (status != NCGEN_OK)
            return status;
        const ncgen_real size = residual(r);
        if (size <= r->options->tolerance)
            return NCGEN_OK;
        if (!(size < R(1e30)))
            return NCGEN_NOT_CONVERGED;
        status = d->newton ? NCGEN_OK : dense_step(r, t);
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
    status = accelerate(r, t, y);
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
            status = accelerate(r, times[*rows], at);
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

static void give_dense(const run *r, dense *w, ncgen_real *workspace, int *integers)
{
    const int n = r->n, m = r->model->n_rows, d = r->dynamics->n_dependent;
    w->jacobian = take(&workspace, r->model->phi_q_pattern.indptr ? r->model->phi_q_pattern.indptr[m] : 0);
    w->mass = take(&workspace, r->model->mass_pattern.indptr ? r->model->mass_pattern.indptr[n] : 0);
    w->lu = take(&workspace, d * d);
    w->R = take(&workspace, n * r->nz);
    w->MR = take(&workspace, n * r->nz);
    w->reduced = take(&workspace, r->nz * r->nz);
    w->bias = take(&workspace, n);
    w->force = take(&workspace, n);
    w->missing = take(&workspace, n);
    w->nu = take(&workspace, m);
    w->gamma = take(&workspace, m);
    w->lam = take(&workspace, m);
    w->column = take(&workspace, d);
    w->order = integers;
}

int ncgen_simulate(const ncgen_model *model, const ncgen_dynamics *dynamics, const ncgen_options *options,
                   const ncgen_real *p, const ncgen_real *q, const ncgen_real *zd, int n_times, const ncgen_scalar *times,
                   ncgen_real *out_q, ncgen_real *out_qd, ncgen_real *out_work, int *rows, ncgen_statistics *statistics,
                   ncgen_real *workspace, int *integers)
{
    if (n_times < 2 || !model->phi)
        return NCGEN_ARGUMENT;
    run r = {.model = model, .dynamics = dynamics, .options = options, .p = p, .statistics = statistics};
    r.n = model->n_coordinates;
    r.nz = dynamics->n_independent;
    r.ny = 2 * r.nz + 1;
    r.q = take(&workspace, r.n);
    r.out = take(&workspace, r.n + r.nz + 2);
    r.start_q = take(&workspace, r.n);
    r.start_qd = take(&workspace, r.n);
    r.y = take(&workspace, r.ny);
    r.y_new = take(&workspace, r.ny);
    for (int s = 0; s < STAGES; ++s)
        r.k[s] = take(&workspace, r.ny);
    r.step = take(&workspace, dynamics->n_dependent);
    r.phi = take(&workspace, model->n_rows); /* right behind step: an emitted step writes both */
    r.end_q = take(&workspace, r.n);
    r.end_qd = take(&workspace, r.n);
    r.end_y = take(&workspace, r.ny);

    dense w;
    if (!dynamics->newton) {
        give_dense(&r, &w, workspace, integers);
        r.dense = &w;
    }

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
