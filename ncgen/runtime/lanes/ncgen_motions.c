/* ncgen_motions.c: explicit Runge-Kutta methods on all coordinates, a state a lane; see ncgen_motions.h. What is a branch in
 * ncgen_projection.c is a mask here, and a state that would go by the matrix is handed back.
 */
#include "ncgen_motions.h"

#include <float.h>

#include "ncgen_closing_rules.h"
#include "ncgen_rows.h"
#include "ncgen_vectors.h"
#include "ncgen_stage_sums.h"

enum { CHAINS = 4 }; /* of additions and comparisons which do not wait for each other */

/* The limits of a run that writes a tape. */
static const double rounding = DBL_EPSILON, max_growth = NCGEN_BAD_GROWTH * NCGEN_TAPED_GROWTH;
static const double max_step_growth = NCGEN_SOON_BAD_GROWTH * NCGEN_TAPED_GROWTH;

typedef struct run {
    const ncgen_motion *motion;
    const ncgen_taped *sizes;
    const tableau *method;
    int n, n_rows;
    ncgen_real *per_column, *per_row; /* one over the sizes: vectors divide slowly */
    ncgen_mask good;                  /* lanes that go on */
    ncgen_real *p;     /* with what is prepared */
    ncgen_real *state; /* 2 n: q and qd */
    ncgen_real *offset; /* n */
    ncgen_real *output; /* what a program writes */
    ncgen_real *more;  /* 2 n + 2 */
    ncgen_real *stage_derivatives[WIDTH]; /* 2 n for every stage and the end */
    double *rows;       /* n of every lane */
} run;

int ncgen_motions_lanes(void)
{
    return NCGEN_LANES;
}

static size_t step_size(const ncgen_taped *sizes)
{
    return (size_t)(2 * tableaus[sizes->method].stages + 3) * (size_t)sizes->n_coordinates;
}

/* Numbers of a block's tape in lanes: the states, then p with what is prepared. */
static size_t tape_size(const ncgen_taped *sizes, long steps)
{
    return (size_t)steps * step_size(sizes) + (size_t)(2 * sizes->n_coordinates + sizes->n_parameters + sizes->n_prepared);
}

size_t ncgen_motions_tape(const ncgen_taped *sizes, long steps)
{
    return tape_size(sizes, steps) * NCGEN_LANES;
}

size_t ncgen_motions_workspace(const ncgen_taped *sizes, int n_rows, long steps)
{
    const size_t n = (size_t)sizes->n_coordinates, stages = (size_t)tableaus[sizes->method].stages;
    const size_t there = NCGEN_GAPS + 9 * n + 4 + 2 * (size_t)n_rows + 2 * n * (stages + 1);
    const size_t back = NCGEN_GAPS + ncgen_adjoint_workspace(sizes) + (size_t)(steps + 2) * 2 * n + 4 * n +
                        2 * (size_t)(sizes->n_parameters + sizes->n_prepared);
    return (there > back ? there : back) * NCGEN_LANES;
}

/* The largest |x| relative to the sizes; not a number if one of them is not. */
static ncgen_real largest_of(int count, const ncgen_real *x, const ncgen_real *per_size)
{
    ncgen_real largest[CHAINS] = {{0}}, sum[CHAINS] = {{0}};
    for (int first = 0; first < count; first += CHAINS)
        for (int k = 0; k < CHAINS && first + k < count; ++k) {
            const ncgen_real size = NCGEN_ABS(x[first + k]) * per_size[first + k];
            largest[k] = ncgen_select(size > largest[k], size, largest[k]);
            sum[k] += size;
        }
    for (int k = 1; k < CHAINS; ++k) {
        largest[0] = ncgen_select(largest[k] > largest[0], largest[k], largest[0]);
        sum[0] += sum[k];
    }
    return ncgen_select(sum[0] == sum[0], largest[0], sum[0]);
}

/* Newton steps for the position of some lanes, in q; those that do not close, or are moved too far, are good no more. */
static void close_position(run *r, double t, ncgen_real *q, ncgen_mask open)
{
    const double quadratic_limit = sqrt(rounding) * NCGEN_QUADRATIC, nothing = NCGEN_ROUNDINGS * rounding;
    for (int k = 0; k < NCGEN_POSITION_LIMIT && ncgen_any(open); ++k) {
        r->motion->closing(ncgen_splat(t), q, r->p, r->output);
        const ncgen_real moved = largest_of(r->n, r->output, r->per_column);
        const ncgen_real violation = largest_of(r->motion->n_closing_rows, r->output + r->n, r->per_row);
        const ncgen_mask lost = ~(moved < NCGEN_TOO_FAR) | ((violation > 0.0) & (moved > max_growth * violation + nothing));
        r->good &= ~(open & lost);
        open &= ~lost;
        for (int i = 0; i < r->n; ++i)
            q[i] += (ncgen_real)((ncgen_mask)r->output[i] & open);
        open &= ~(violation < quadratic_limit);
    }
    r->good &= ~open;
}

/* The end of a step onto the constraints, as close_by_recursion of ncgen_projection.c does it; closed: where its tape has that. */
static void project_state(run *r, double t, ncgen_real *closed)
{
    const int n = r->n;
    ncgen_real *q = r->state, *qd = r->state + n;
    ncgen_copy(n, q, r->offset);
    close_position(r, t, q, r->good);
    ncgen_copy(n, q, closed);
    for (int i = 0; i < n; ++i)
        r->offset[i] -= q[i];
    const ncgen_real length = largest_of(n, r->offset, r->per_column);
    r->motion->velocities(ncgen_splat(t), q, r->offset, r->p, r->output);
    r->good &= (r->output[2 * n + 1] < max_growth) | ~(length > 0.0);
    if (r->sizes->is_driven) {
        for (int i = 0; i < n; ++i)
            r->offset[i] = ncgen_splat(0.0);
        r->motion->velocities(ncgen_splat(t), q, r->offset, r->p, r->more);
        for (int i = 0; i < n; ++i)
            r->output[n + i] -= r->more[n + i];
    }
    for (int i = 0; i < n; ++i)
        q[i] += (ncgen_real)((ncgen_mask)r->output[n + i] & (length > 0.0));
    close_position(r, t, q, r->good & ~(length * length < NCGEN_STRAIGHT * rounding));
    r->motion->velocities(ncgen_splat(t), q, qd, r->p, r->output);
    ncgen_copy(n, r->output + n, qd);
}

/* Lanes in which small pivots multiply errors of a step are good no more. */
static void check_errors(run *r, const ncgen_real *qd, const ncgen_real *allowed, ncgen_real growth)
{
    const ncgen_mask digit_lost = growth >= NCGEN_GROWTH_OF_A_DIGIT;
    if (!ncgen_any(digit_lost))
        return;
    for (int i = 0; i < r->n; ++i)
        r->offset[i] = allowed[i] - qd[i];
    r->good &= ~(digit_lost & (largest_of(r->n, r->offset, r->per_column) > NCGEN_HARMLESS_SHARE * largest_of(r->n, qd, r->per_column)));
}

/* [qd, qdd] of a state into stage_derivatives; lanes with pivot growth, or a NaN, are good no more. */
static ncgen_real derivative(run *r, double t, const ncgen_real *state, ncgen_real *stage_derivatives)
{
    const int n = r->n;
    ncgen_real sums[CHAINS] = {{0}}; /* which are numbers where all are */
    r->motion->derivative(ncgen_splat(t), state, state + n, r->p, r->output);
    ncgen_copy(n, r->output + n, stage_derivatives);
    ncgen_copy(n, r->output, stage_derivatives + n);
    for (int i = 0; i < 2 * n; ++i)
        sums[i % CHAINS] += stage_derivatives[i];
    for (int k = 0; k < CHAINS; ++k)
        r->good &= sums[k] - sums[k] == 0.0;
    r->good &= r->output[2 * n + 1] < max_growth;
    check_errors(r, state + n, r->output + n, r->output[2 * n + 1]);
    return r->output[2 * n + 1];
}

/* A step of h from t on, which leaves its states on the tape. */
static void step(run *r, double t, double h, ncgen_real *tape)
{
    const int size = 2 * r->n, last = r->method->stages;
    ncgen_copy(size, r->state, tape);
    for (int s = 1; s <= last; ++s) {
        ncgen_real *stage = tape + s * size;
        ncgen_sum_stages(size, &r->method->a[s], r->stage_derivatives, r->state, ncgen_splat(h), stage);
        if (s < last)
            derivative(r, t + r->method->c[s] * h, stage, r->stage_derivatives[s]);
    }
    ncgen_copy(size, tape + last * size, r->state);
    project_state(r, t + h, tape + (last + 1) * size);
    r->good &= derivative(r, t + h, r->state, r->stage_derivatives[0]) < max_step_growth;
}

/* n numbers of each lane into rows that lie `stride` numbers from one another. */
static void write_rows(const run *r, int count, const ncgen_real *lanes, long stride, double *to)
{
    ncgen_collect(r->n, count, lanes, r->rows);
    for (int lane = 0; lane < count; ++lane)
        memcpy(to + (long)lane * stride, r->rows + (long)lane * r->n, (size_t)r->n * sizeof(double));
}

static void write_state(const run *r, int count, long rows, long row, double *out_q, double *out_qd)
{
    write_rows(r, count, r->state, rows * r->n, out_q + row * r->n);
    write_rows(r, count, r->state + r->n, rows * r->n, out_qd + row * r->n);
}

/* A block; its first derivatives are those of the first stage, which each step finds at its end for the next. */
static void run_block(run *r, long steps, const double *times, int count, double *out_q, double *out_qd, int *other, ncgen_real *tape,
                      long taped)
{
    const size_t length = step_size(r->sizes);
    r->p = tape + tape_size(r->sizes, taped) - (size_t)(r->sizes->n_parameters + r->sizes->n_prepared);
    if (r->motion->prepare)
        r->motion->prepare(r->p, r->p + r->sizes->n_parameters);
    for (int lane = 0; lane < NCGEN_LANES; ++lane)
        r->good[lane] = -1;
    derivative(r, times[0], r->state, r->stage_derivatives[0]);
    write_state(r, count, steps + 1, 0, out_q, out_qd);
    for (long k = 0; k < steps && ncgen_any(r->good); ++k) {
        step(r, times[k], times[k + 1] - times[k], tape + (size_t)(k % taped) * length);
        write_state(r, count, steps + 1, k + 1, out_q, out_qd);
    }
    ncgen_copy(2 * r->n, r->state, tape + (size_t)taped * length);
    for (int lane = 0; lane < count; ++lane)
        other[lane] = !r->good[lane];
}

void ncgen_motions(const void *motion, const ncgen_taped *sizes, int n_rows, const double *column_sizes, const double *row_sizes,
                   long steps, const double *times, long count, const double *q, const double *qd, const double *p, double *out_q,
                   double *out_qd, int *other, long taped, double *tapes, double *workspace)
{
    const int n = sizes->n_coordinates, n_p = sizes->n_parameters;
    ncgen_space space = {(ncgen_real *)workspace, 0};
    run r = {.motion = motion, .sizes = sizes, .method = &tableaus[sizes->method], .n = n, .n_rows = n_rows};
    r.state = ncgen_take(&space, 2 * n);
    r.offset = ncgen_take(&space, n);
    r.output = ncgen_take(&space, 2 * n + 2 + n_rows);
    r.more = ncgen_take(&space, 2 * n + 2);
    for (int s = 0; s <= r.method->stages; ++s)
        r.stage_derivatives[s] = ncgen_take(&space, 2 * n);
    r.rows = (double *)ncgen_take(&space, n);
    r.per_column = ncgen_take(&space, n);
    r.per_row = ncgen_take(&space, n_rows);
    for (int i = 0; i < n; ++i)
        r.per_column[i] = ncgen_splat(1.0 / column_sizes[i]);
    for (int i = 0; i < n_rows; ++i)
        r.per_row[i] = ncgen_splat(1.0 / row_sizes[i]);
    for (long first = 0; first < count; first += NCGEN_LANES) {
        const int block = count - first < NCGEN_LANES ? (int)(count - first) : NCGEN_LANES;
        ncgen_real *tape = (ncgen_real *)tapes + (taped == steps ? (size_t)(first / NCGEN_LANES) * tape_size(sizes, steps) : 0);
        ncgen_spread(n, block, n, q + first * n, r.state);
        ncgen_spread(n, block, n, qd + first * n, r.state + n);
        ncgen_spread(n_p, block, n_p, p + first * n_p, tape + tape_size(sizes, taped) - (size_t)(n_p + sizes->n_prepared));
        run_block(&r, steps, times, block, out_q + first * (steps + 1) * n, out_qd + first * (steps + 1) * n, other + first, tape,
                  taped);
    }
}

/* weights (steps + 1) x 2 n in lanes, from rows of states that lie `steps + 1` rows apart. */
static void spread_weights(int n, int count, long rows, const double *by_q, const double *by_qd, ncgen_real *weights)
{
    for (long row = 0; row < rows; ++row) {
        ncgen_spread(n, count, rows * n, by_q + row * n, weights + row * 2 * n);
        ncgen_spread(n, count, rows * n, by_qd + row * n, weights + row * 2 * n + n);
    }
}

void ncgen_motions_adjoint(const void *transposed, const ncgen_taped *sizes, long steps, const double *times, long count,
                        const double *by_q, const double *by_qd, const double *tapes, double *stage_derivatives, double *workspace)
{
    const int n = sizes->n_coordinates, width = 2 * n + sizes->n_parameters;
    ncgen_space space = {(ncgen_real *)workspace, 0};
    ncgen_real *weights = ncgen_take(&space, (int)(steps + 1) * 2 * n);
    ncgen_real *output = ncgen_take(&space, width);
    ncgen_real *work = space.base + space.used;
    for (long first = 0; first < count; first += NCGEN_LANES) {
        const int block = count - first < NCGEN_LANES ? (int)(count - first) : NCGEN_LANES;
        const ncgen_real *states = (const ncgen_real *)tapes + (size_t)(first / NCGEN_LANES) * tape_size(sizes, steps);
        const ncgen_tape tape = {.steps = steps, .times = (double *)times, .states = (ncgen_real *)states};
        ncgen_taped here = *sizes;
        here.tape = &tape;
        here.p = states + tape_size(sizes, steps) - (size_t)(sizes->n_parameters + sizes->n_prepared);
        spread_weights(n, block, steps + 1, by_q + first * (steps + 1) * n, by_qd + first * (steps + 1) * n, weights);
        ncgen_adjoint(&here, transposed, weights, output, NULL, work);
        ncgen_collect(width, block, output, stage_derivatives + first * width);
    }
}

void ncgen_starts_vjp(const void *transposed, const ncgen_taped *sizes, int of_velocities, long steps, double t, long count,
                       const double *weights, const double *tapes, double *stage_derivatives, double *workspace)
{
    const ncgen_seeded_motion *parts = transposed;
    const int n = sizes->n_coordinates, n_p = sizes->n_parameters, before = of_velocities ? 2 * n : n;
    ncgen_space space = {(ncgen_real *)workspace, 0};
    ncgen_real *seed = ncgen_take(&space, n), *output = ncgen_take(&space, before + n_p + sizes->n_prepared);
    ncgen_real *more = ncgen_take(&space, n_p);
    for (long first = 0; first < count; first += NCGEN_LANES) {
        const int block = count - first < NCGEN_LANES ? (int)(count - first) : NCGEN_LANES;
        const ncgen_real *q = (const ncgen_real *)tapes + (size_t)(first / NCGEN_LANES) * tape_size(sizes, steps);
        const ncgen_real *p = q + tape_size(sizes, steps) - (size_t)(n_p + sizes->n_prepared);
        ncgen_spread(n, block, n, weights + first * n, seed);
        if (of_velocities)
            parts->velocities(ncgen_splat(t), q, q + n, p, seed, output);
        else
            parts->closing(ncgen_splat(t), q, p, seed, output);
        if (parts->prepare) {
            parts->prepare(p, output + before + n_p, more);
            for (int i = 0; i < n_p; ++i)
                output[before + i] += more[i];
        }
        ncgen_collect(before + n_p, block, output, stage_derivatives + first * (before + n_p));
    }
}
