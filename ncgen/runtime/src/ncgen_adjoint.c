/* ncgen_adjoint.c: one reverse sweep through a run that was taped: the transposed derivative of every step, the last one first.
 *
 * A step is Y_j = x + h sum a_ji f(Y_i), then x' = x + h sum b_j f(Y_j), closed to c, moved along the constraints to where it is nearest
 * to x', closed again, and at last velocities. Where Newton's method has arrived, one step of it has the derivative of all of them.
 */
#include "ncgen_differentiated.h"
#include "ncgen_vectors.h"
#include "ncgen_tableaus.h"

typedef struct sweep {
    const ncgen_taped *run;
    const ncgen_seeded_motion *transposed;
    int n, n_p, n_w;    /* coordinates; parameters with what is prepared; inputs that are driven */
    ncgen_real *state;  /* 2 n: how the number changes with [q, qd] */
    ncgen_real *p;      /* n_p: with p */
    ncgen_real *stages; /* 2 n each: with f of the stages */
    ncgen_real *moved;  /* n: with how far the position was moved along the constraints */
    ncgen_real *offset;  /* n: how far it had been from where it was closed */
    ncgen_real *output;  /* 2 n + n_p: what a program writes */
    ncgen_real *p_now;  /* n_p: p with the inputs of a stage */
} sweep;

static void lay_out(sweep *s, const ncgen_taped *run, ncgen_space *space)
{
    s->run = run;
    s->n = run->n_coordinates;
    s->n_p = run->n_parameters + run->n_prepared;
    s->p = ncgen_take(space, s->n_p);
    s->stages = ncgen_take(space, tableaus[run->method].stages * 2 * s->n);
    s->moved = ncgen_take(space, s->n);
    s->offset = ncgen_take(space, s->n);
    s->output = ncgen_take(space, 2 * s->n + s->n_p);
    s->n_w = run->n_inputs;
    s->p_now = ncgen_take(space, s->n_p);
}

size_t ncgen_adjoint_workspace(const ncgen_taped *run)
{
    sweep s;
    ncgen_space space = {NULL, 0};
    lay_out(&s, run, &space);
    return space.used;
}

static void add(int count, const ncgen_real *more, ncgen_real *sum)
{
    for (int i = 0; i < count; ++i)
        sum[i] += more[i];
}

/* Reverse sweep through q + dq, with the weights in s->state */
static void close_back(sweep *s, ncgen_scalar t, const ncgen_real *q)
{
    s->transposed->closing(NCGEN_SPLAT(t), q, s->run->p, s->state, s->output);
    add(s->n, s->output, s->state);
    add(s->n_p, s->output + s->n, s->p);
}

/* Reverse sweep through velocities: gradients by q and p are added, that by the given velocities stays in s->output + n. */
static void velocities_back(sweep *s, ncgen_scalar t, const ncgen_real *q, const ncgen_real *qd, const ncgen_real *weights)
{
    s->transposed->velocities(NCGEN_SPLAT(t), q, qd, s->run->p, weights, s->output);
    add(s->n, s->output, s->state);
    add(s->n_p, s->output + 2 * s->n, s->p);
}

/* Reverse sweep through what brings the end of a step onto the constraints: left [q, qd], closed and end are positions. */
static void project_back(sweep *s, ncgen_scalar t, const ncgen_real *left, const ncgen_real *closed, const ncgen_real *end)
{
    const int n = s->n;
    velocities_back(s, t, end, left + n, s->state + n);
    ncgen_copy(n, s->output + n, s->state + n);
    close_back(s, t, end);
    ncgen_copy(n, s->state, s->moved);
    if (s->run->is_driven) {
        for (int i = 0; i < n; ++i) {
            s->offset[i] = NCGEN_SPLAT(R(0.0));
            s->moved[i] = -s->moved[i];
        }
        velocities_back(s, t, closed, s->offset, s->moved);
        for (int i = 0; i < n; ++i)
            s->moved[i] = -s->moved[i];
    }
    for (int i = 0; i < n; ++i)
        s->offset[i] = left[i] - closed[i];
    velocities_back(s, t, closed, s->offset, s->moved);
    ncgen_copy(n, s->output + n, s->moved); /* with what it was apart */
    for (int i = 0; i < n; ++i)
        s->state[i] -= s->moved[i];
    close_back(s, t, closed);
    add(n, s->moved, s->state);
}

/* Reverse sweep through h times the sum of a row, with these weights: those of the stages are added. */
static void row_back(sweep *s, ncgen_scalar h, const tableau_row *row, const ncgen_real *weights)
{
    const int size = 2 * s->n;
    for (int k = 0; k < row->count; ++k)
        for (int i = 0; i < size; ++i)
            s->stages[row->stages[k] * size + i] += h * row->weights[k] * weights[i];
}

/* Reverse sweep through the stages of a step from t on. inputs, by_inputs: those of its stages */
static void stages_back(sweep *s, ncgen_scalar t, ncgen_scalar h, const ncgen_real *states, const ncgen_real *inputs, ncgen_real *by_inputs)
{
    const tableau *method = &tableaus[s->run->method];
    const int n = s->n, last = method->stages, first = s->run->n_parameters - s->n_w;
    for (int i = 0; i < last * 2 * n; ++i)
        s->stages[i] = NCGEN_SPLAT(R(0.0));
    row_back(s, h, &method->a[last], s->state);
    for (int j = last - 1; j >= 0; --j) {
        const ncgen_real *at = states + j * 2 * n;
        ncgen_copy(s->n_w, inputs + j * s->n_w, s->p_now + first);
        s->transposed->derivative(NCGEN_SPLAT(t + method->c[j] * h), at, at + n, s->p_now, s->stages + j * 2 * n, s->output);
        ncgen_copy(s->n_w, s->output + 2 * n + first, by_inputs + j * s->n_w);
        add(2 * n, s->output, s->state);
        add(s->n_p, s->output + 2 * n, s->p);
        row_back(s, h, &method->a[j], s->output);
    }
}

void ncgen_adjoint(const ncgen_taped *run, const ncgen_seeded_motion *transposed, const ncgen_real *weights, ncgen_real *gradient,
                   ncgen_real *by_inputs, ncgen_real *workspace)
{
    const ncgen_tape *tape = run->tape;
    const int n = run->n_coordinates, last = tableaus[run->method].stages;
    const size_t length = (size_t)(2 * last + 3) * (size_t)n;
    ncgen_space space = {workspace, 0};
    sweep s;
    lay_out(&s, run, &space);
    s.transposed = transposed;
    s.state = gradient;
    for (int i = 0; i < 2 * n; ++i)
        s.state[i] = NCGEN_SPLAT(R(0.0));
    for (int i = 0; i < s.n_p; ++i)
        s.p[i] = NCGEN_SPLAT(R(0.0));
    ncgen_copy(s.n_p, run->p, s.p_now);
    for (long k = tape->steps - 1; k >= 0; --k) {
        const ncgen_scalar t = tape->times[k], t_new = tape->times[k + 1];
        const ncgen_real *states = tape->states + (size_t)k * length, *left = states + 2 * last * n;
        add(2 * n, weights + (size_t)(k + 1) * 2 * (size_t)n, s.state);
        project_back(&s, t_new, left, left + 2 * n, states + length);
        const size_t driven = (size_t)k * (size_t)(last * s.n_w);
        stages_back(&s, t, t_new - t, states, run->inputs + driven, by_inputs + driven);
    }
    add(2 * n, weights, s.state);
    if (transposed->prepare) {
        transposed->prepare(run->p, s.p + run->n_parameters, s.output);
        add(run->n_parameters, s.output, s.p);
    }
    ncgen_copy(run->n_parameters, s.p, gradient + 2 * n);
}

void ncgen_velocities_vjp(const ncgen_seeded_motion *transposed, ncgen_scalar t, const ncgen_real *q, const ncgen_real *qd,
                           const ncgen_real *p, const ncgen_real *weights, ncgen_real *gradient)
{
    transposed->velocities(NCGEN_SPLAT(t), q, qd, p, weights, gradient);
}

void ncgen_closing_vjp(const ncgen_seeded_motion *transposed, ncgen_scalar t, const ncgen_real *q, const ncgen_real *p,
                        const ncgen_real *weights, ncgen_real *gradient)
{
    transposed->closing(NCGEN_SPLAT(t), q, p, weights, gradient);
}

void ncgen_prepare_vjp(const ncgen_seeded_motion *transposed, const ncgen_real *p, const ncgen_real *weights, ncgen_real *gradient)
{
    transposed->prepare(p, weights, gradient);
}
