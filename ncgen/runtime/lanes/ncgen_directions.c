/* ncgen_directions.c: a run that was taped, differentiated along directions, a direction a lane; steps as in ncgen_adjoint.c. */
#include "ncgen_directions.h"
#include "ncgen_space.h"
#include "ncgen_vectors.h"
#include "ncgen_stage_sums.h"

typedef struct sweep {
    const ncgen_seeded_motion *motion;
    int n, n_p, is_driven; /* n_p: parameters with what is prepared */
    const tableau *method;
    ncgen_real *p;      /* n_p, the same in all lanes */
    ncgen_real *at;     /* 2 n: a state, the same in all lanes */
    ncgen_real *seed;   /* 2 n + n_p: changes of a state and of p; p stays at its end */
    ncgen_real *brief;  /* n + n_p: the same where a program takes no qd */
    ncgen_real *state;  /* 2 n: changes where the step begins, then where it ends */
    ncgen_real *stage_derivatives[WIDTH]; /* 2 n for every stage */
    ncgen_real *output;  /* 2 n: what a program writes */
    int n_w;            /* inputs that are driven */
    ncgen_real *w;      /* where p has them */
    long count, first;  /* directions, and which one is in the first lane */
    double *taped;      /* NULL, or where changes of the step's states go, as the tape has these */
} sweep;

static void lay_out(sweep *s, int n, int n_p, int method, ncgen_space *space)
{
    s->n = n;
    s->n_p = n_p;
    s->method = &tableaus[method];
    s->p = ncgen_take(space, n_p);
    s->at = ncgen_take(space, 2 * n);
    s->seed = ncgen_take(space, 2 * n + n_p);
    s->brief = ncgen_take(space, n + n_p);
    s->state = ncgen_take(space, 2 * n);
    for (int j = 0; j < s->method->stages; ++j)
        s->stage_derivatives[j] = ncgen_take(space, 2 * n);
    s->output = ncgen_take(space, 2 * n);
}

int ncgen_directions_lanes(void)
{
    return NCGEN_LANES;
}

size_t ncgen_directions_workspace(int n_coordinates, int n_parameters, int n_prepared, int method)
{
    sweep s;
    ncgen_space space = {NULL, 0};
    lay_out(&s, n_coordinates, n_parameters + n_prepared, method, &space);
    return space.used * sizeof(ncgen_real) / sizeof(double);
}

static void spread(int count, const double *x, ncgen_real *lanes)
{
    const ncgen_real zero = {0};
    for (int i = 0; i < count; ++i)
        lanes[i] = zero + x[i];
}

/* Rows of `count` directions from the first one on into lanes, and back; lanes beyond the last direction are 0. */
static void read_rows(int rows, long count, long first, const double *from, ncgen_real *lanes)
{
    for (int i = 0; i < rows; ++i) {
        lanes[i] = (ncgen_real){0};
        for (long lane = 0; lane < NCGEN_LANES && first + lane < count; ++lane)
            lanes[i][lane] = from[i * count + first + lane];
    }
}

static void write_rows(int rows, long count, long first, const ncgen_real *lanes, double *to)
{
    for (int i = 0; i < rows; ++i)
        for (long lane = 0; lane < NCGEN_LANES && first + lane < count; ++lane)
            to[i * count + first + lane] = lanes[i][lane];
}

/* What changes of a tape's rows: `rows` of them from `row` of the step on. */
static void note(const sweep *s, int row, int rows, const ncgen_real *changes)
{
    if (s->taped)
        write_rows(rows, s->count, s->first, changes, s->taped + (long)row * s->count);
}

/* found = the change of velocities; s->seed holds those of q and qd. */
static void velocities(const sweep *s, double t)
{
    const ncgen_real zero = {0};
    s->motion->velocities(zero + t, s->at, s->at + s->n, s->p, s->seed, s->output);
}

/* The change of q in s->seed, and of q + dq. */
static void close(const sweep *s, double t)
{
    const ncgen_real zero = {0};
    for (int i = 0; i < s->n; ++i)
        s->brief[i] = s->seed[i];
    s->motion->closing(zero + t, s->at, s->p, s->brief, s->output);
    for (int i = 0; i < s->n; ++i)
        s->seed[i] += s->output[i];
}

/* From changes in s->state where a step left off, at left [q, qd], to those where it ended: closed and end are positions. */
static void project_state(const sweep *s, double t, const double *left, const double *closed, const double *end)
{
    const int n = s->n;
    ncgen_real *moved = s->stage_derivatives[0]; /* n: the stages are behind */
    note(s, 2 * n * s->method->stages, 2 * n, s->state);
    spread(n, closed, s->at);
    for (int i = 0; i < n; ++i)
        s->seed[i] = s->state[i];
    close(s, t);
    note(s, 2 * n * (s->method->stages + 1), n, s->seed);
    for (int i = 0; i < n; ++i) {
        moved[i] = s->seed[i];
        s->seed[n + i] = s->state[i] - s->seed[i];
        s->at[n + i] = (ncgen_real){0} + (left[i] - closed[i]);
    }
    velocities(s, t);
    for (int i = 0; i < n; ++i)
        moved[i] += s->output[i];
    if (s->is_driven) {
        for (int i = 0; i < n; ++i)
            s->seed[n + i] = s->at[n + i] = (ncgen_real){0};
        velocities(s, t);
        for (int i = 0; i < n; ++i)
            moved[i] -= s->output[i];
    }
    spread(n, end, s->at);
    spread(n, left + n, s->at + n);
    for (int i = 0; i < n; ++i)
        s->seed[i] = moved[i];
    close(s, t);
    for (int i = 0; i < n; ++i) {
        s->seed[n + i] = s->state[n + i];
        s->state[i] = s->seed[i];
    }
    velocities(s, t);
    for (int i = 0; i < n; ++i)
        s->state[n + i] = s->output[i];
}

/* From changes in s->state where a step begins to those where it leaves off; inputs: of its stages. */
static void stages(const sweep *s, double t, double h, const double *states, const double *inputs)
{
    const int size = 2 * s->n, last = s->method->stages;
    const ncgen_real zero = {0};
    for (int j = 0; j <= last; ++j) {
        ncgen_sum_stages(size, &s->method->a[j], s->stage_derivatives, s->state, zero + h, s->seed);
        if (j == last)
            break;
        note(s, j * size, size, s->seed);
        spread(size, states + j * size, s->at);
        spread(s->n_w, inputs + j * s->n_w, s->w);
        s->motion->derivative(zero + (t + s->method->c[j] * h), s->at, s->at + s->n, s->p, s->seed, s->stage_derivatives[j]);
    }
    for (int i = 0; i < size; ++i)
        s->state[i] = s->seed[i];
}

/* The directions from the first one on: their changes of a state into s->state, those of p, with what is prepared, to where they stay. */
static void turn_to(sweep *s, int n_parameters, long first, const double *seeds)
{
    const int size = 2 * s->n;
    s->first = first;
    read_rows(size, s->count, first, seeds, s->state);
    read_rows(n_parameters, s->count, first, seeds + size * s->count, s->seed + size);
    if (s->motion->prepare)
        s->motion->prepare(s->p, s->seed + size, s->seed + size + n_parameters);
    for (int i = 0; i < s->n_p; ++i)
        s->brief[s->n + i] = s->seed[size + i];
}

/* A sweep over `count` directions of a motion with parameters p, in memory of ncgen_directions_workspace. */
static sweep begun(const void *motion, int n_coordinates, int n_parameters, int n_prepared, int method, const double *p, long count,
                   double *workspace)
{
    sweep s = {0};
    ncgen_space space = {(ncgen_real *)workspace, 0};
    lay_out(&s, n_coordinates, n_parameters + n_prepared, method, &space);
    s.motion = motion;
    s.count = count;
    spread(s.n_p, p, s.p);
    return s;
}

void ncgen_starts_jvp(const void *motion, int n_coordinates, int n_parameters, int n_prepared, int method, const double *p,
                        int of_velocities, double t, const double *state, long count, const double *seeds, double *changes,
                        double *workspace)
{
    const int size = 2 * n_coordinates;
    sweep s = begun(motion, n_coordinates, n_parameters, n_prepared, method, p, count, workspace);
    spread(size, state, s.at);
    for (long first = 0; first < count; first += NCGEN_LANES) {
        turn_to(&s, n_parameters, first, seeds);
        for (int i = 0; i < size; ++i)
            s.seed[i] = s.state[i];
        if (of_velocities)
            velocities(&s, t);
        else
            close(&s, t);
        write_rows(s.n, count, first, s.output, changes);
    }
}

void ncgen_directions(const void *motion, int n_coordinates, int n_parameters, int n_prepared, int is_driven, int method,
                      int n_inputs, const double *p, const double *inputs, long steps, const double *times, const double *states, long count, const double *seeds,
                      double *changes, double *taped, double *workspace)
{
    const int size = 2 * n_coordinates;
    sweep s = begun(motion, n_coordinates, n_parameters, n_prepared, method, p, count, workspace);
    s.is_driven = is_driven;
    s.n_w = n_inputs;
    s.w = s.p + n_parameters - n_inputs;
    for (long first = 0; first < count; first += NCGEN_LANES) {
        turn_to(&s, n_parameters, first, seeds);
        write_rows(size, count, first, s.state, changes);
        for (long k = 0; k < steps; ++k) {
            const size_t begins = (size_t)k * (size_t)(2 * s.method->stages + 3) * (size_t)s.n;
            const double *step = states + begins;
            s.taped = taped ? taped + begins * (size_t)count : NULL;
            const double *left = step + size * s.method->stages, *closed = left + size, *next = closed + s.n;
            stages(&s, times[k], times[k + 1] - times[k], step, inputs + (size_t)k * (size_t)(s.method->stages * n_inputs));
            project_state(&s, times[k + 1], left, closed, next);
            write_rows(size, count, first, s.state, changes + (size_t)(k + 1) * (size_t)size * (size_t)count);
        }
        if (taped) {
            s.taped = taped + (size_t)steps * (size_t)(2 * s.method->stages + 3) * (size_t)s.n * (size_t)count;
            note(&s, 0, size, s.state);
            note(&s, size, n_prepared, s.seed + size + n_parameters);
        }
    }
}
