/* ncgen_run.c: the entry of the runtime: workspace, the first state, and the choice of formalism and integrator. */
#include "ncgen_facts.h"
#include "ncgen_internal.h"

ncgen_real *ncgen_take(ncgen_space *space, int count)
{
    ncgen_real *part = space->base ? space->base + space->used : NULL;
    space->used += (size_t)count;
    return part;
}

void ncgen_copy(int count, const ncgen_real *from, ncgen_real *to)
{
    for (int i = 0; i < count; ++i)
        to[i] = from[i];
}

ncgen_real ncgen_dot(int count, const ncgen_real *a, const ncgen_real *b)
{
    ncgen_real sum = 0;
    for (int i = 0; i < count; ++i)
        sum += a[i] * b[i];
    return sum;
}

int ncgen_solve_positive(int size, ncgen_real *a, ncgen_real *right)
{
    for (int k = 0; k < size; ++k) {
        if (!(a[k * size + k] > 0))
            return NCGEN_SINGULAR;
        for (int i = k + 1; i < size; ++i) {
            const ncgen_real share = a[i * size + k] / a[k * size + k];
            for (int j = k + 1; j <= i; ++j)
                a[i * size + j] -= share * a[j * size + k];
        }
    }
    ncgen_solve_positive_again(size, a, right);
    return NCGEN_OK;
}

void ncgen_solve_positive_again(int size, const ncgen_real *a, ncgen_real *right)
{
    for (int k = 0; k < size; ++k)
        for (int i = k + 1; i < size; ++i)
            right[i] -= a[i * size + k] / a[k * size + k] * right[k];
    for (int k = size - 1; k >= 0; --k) {
        for (int i = k + 1; i < size; ++i)
            right[k] -= a[i * size + k] * right[i];
        right[k] /= a[k * size + k];
    }
}

void ncgen_times_mass(const ncgen_run *r, const ncgen_real *mass, const ncgen_real *x, ncgen_real *product)
{
    const ncgen_pattern *pattern = &r->model->mass_pattern;
    for (int i = 0; i < r->n; ++i) {
        ncgen_real sum = 0;
        if (pattern->indptr)
            for (int k = pattern->indptr[i]; k < pattern->indptr[i + 1]; ++k)
                sum += mass[k] * x[pattern->indices[k]];
        product[i] = sum;
    }
}

/* Phi_q qd. */
void ncgen_row_rates(const ncgen_run *r, const ncgen_real *phi_q, const ncgen_real *qd, ncgen_real *rates)
{
    const ncgen_pattern *pattern = &r->model->phi_q_pattern;
    for (int i = 0; i < r->m; ++i) {
        ncgen_real sum = 0;
        for (int k = pattern->indptr[i]; k < pattern->indptr[i + 1]; ++k)
            sum += phi_q[k] * qd[pattern->indices[k]];
        rates[i] = sum;
    }
}

void ncgen_write_row(ncgen_run *r, ncgen_real work)
{
    ncgen_copy(r->n, r->q, r->out_q + (size_t)r->rows * (size_t)r->n);
    ncgen_copy(r->n, r->qd, r->out_qd + (size_t)r->rows * (size_t)r->n);
    r->out_work[r->rows] = work;
    r->rows += 1;
}

/* What was evaluated last becomes the last accepted state. */
void ncgen_keep_state(ncgen_run *r, ncgen_scalar t, ncgen_real work)
{
    ncgen_copy(r->n, r->q, r->start_q);
    ncgen_copy(r->n, r->qd, r->start_qd);
    r->start_work = work;
    r->start_t = t;
    r->statistics->t = t;
}

int ncgen_accept(ncgen_run *r, ncgen_scalar t, const ncgen_real *y)
{
    r->careful = 0;
    ncgen_keep_state(r, t, y[r->weighed - 1]);
    return r->accept ? r->accept(r, t) : NCGEN_OK;
}

/* How many fixed steps of at most max_step make up a span; 0 if a number cannot count them. */
ncgen_scalar ncgen_step_count(const ncgen_run *r, ncgen_scalar span)
{
    const ncgen_scalar least = r->options->max_step > 0 ? span / r->options->max_step - R(1.0e-6) : 0;
    if (!(least < 1 / r->rounding && least < R(1.0e15)))
        return 0;
    ncgen_scalar count = (ncgen_scalar)(long long)least;
    if (count < least)
        count += 1;
    return count < 1 ? 1 : count;
}

int ncgen_listen(ncgen_run *r, ncgen_scalar t)
{
    r->statistics->tried = t;
    if (!r->options->watch)
        return NCGEN_OK;
    if (r->patience == 0)
        r->patience = r->options->watch(r->options->context, r->start_t);
    if (r->patience <= 0) {
        r->patience = -1; /* whoever asks again gets the same answer */
        return NCGEN_INTERRUPTED;
    }
    r->patience -= 1;
    return NCGEN_OK;
}

/* With an infinite number or none the sum is, too, and to look at the sum alone costs least. */
int ncgen_is_finite(int count, const ncgen_real *x)
{
    ncgen_real sum = 0;
    for (int i = 0; i < count; ++i)
        sum += x[i];
    return sum - sum >= 0;
}

typedef struct parts {
    ncgen_partitioning partitioning;
    ncgen_constrained constrained;
    ncgen_slopes slopes;
    ncgen_stepping stepping;
    ncgen_implicit implicit;
    ncgen_correction correction;
} parts;

int ncgen_is_stepper(const ncgen_options *options)
{
    return facts[options->method].steps_constraints >> options->formalism & 1;
}

/* RATTLE does without where the acceleration at a position is the same before and after it is given its velocity and all rows are
 * equations of position, and energy-momentum where it is not told that it needs them. */
int ncgen_uses_tangents(const ncgen_model *model, const ncgen_dynamics *dynamics, const ncgen_options *options)
{
    const int simple = dynamics->conservative && !dynamics->rolling && (!model->mass || model->mass_is_constant);
    if (facts[options->method].tangents == SOMETIMES)
        return options->method == NCGEN_RATTLE ? !simple : dynamics->tangents != NULL;
    return facts[options->method].tangents == ALWAYS;
}

static int is_implicit(const ncgen_options *options)
{
    return !ncgen_is_stepper(options) && facts[options->method].tangents != NEVER;
}

/* The parts of a run and its workspace; with an empty space this only counts. */
static int lay_out(ncgen_run *r, parts *w)
{
    r->n = r->model->n_coordinates;
    r->m = r->model->n_rows;
    r->nz = r->dynamics->n_independent;
    r->start_q = ncgen_take(&r->space, r->n);
    r->start_qd = ncgen_take(&r->space, r->n);
    if (r->options->formalism == NCGEN_COORDINATE_PARTITIONING)
        ncgen_partitioning_layout(r, &w->partitioning);
    else
        ncgen_constrained_layout(r, &w->constrained);
    r->y = ncgen_take(&r->space, r->ny);
    if (r->dynamics->tangents)
        ncgen_slopes_layout(r, &w->slopes);
    if (is_implicit(r->options))
        ncgen_implicit_layout(r, &w->stepping, &w->implicit);
    else if (ncgen_is_stepper(r->options))
        ncgen_steppers_layout(r, &w->stepping, &w->correction);
    else
        ncgen_explicit_layout(r, &w->stepping);
    return NCGEN_OK;
}

/* A run without workspace. */
static void describe(ncgen_run *r, const ncgen_model *model, const ncgen_dynamics *dynamics, const ncgen_options *options)
{
    r->model = model;
    r->dynamics = dynamics;
    r->options = options;
    r->space.base = NULL;
    r->space.used = 0;
    r->integers = NULL;
    r->partitioning = NULL;
    r->constrained = NULL;
    r->slopes = NULL;
    r->settle = NULL;
    r->accept = NULL;
    r->careful = r->rows = 0;
    r->patience = options->patience > 1 ? options->patience : 1;
}

static void clear_statistics(ncgen_statistics *s, ncgen_scalar t)
{
    s->steps = s->rejected = s->repeated = s->evaluations = s->newton_steps = 0;
    s->factorisations = s->perturbed = s->refinements = s->jacobians = s->fallbacks = 0;
    s->stopped = 0;
    s->stiff = 0;
    s->largest_projection = 0;
    s->t = s->tried = t;
}

size_t ncgen_workspace(const ncgen_model *model, const ncgen_dynamics *dynamics, const ncgen_options *options)
{
    parts w;
    ncgen_run r;
    describe(&r, model, dynamics, options);
    lay_out(&r, &w);
    return r.space.used;
}

/* Is there everything that the formalism and the method need? */
static int possible(const ncgen_model *model, const ncgen_dynamics *dynamics, const ncgen_options *options, int n_times)
{
    const int partitioned = options->formalism == NCGEN_COORDINATE_PARTITIONING;
    if (n_times < 2 || !model->phi || options->method < 0 || options->method >= N_METHODS)
        return 0;
    if (options->formalism < 0 || options->formalism >= N_FORMALISMS)
        return 0;
    if (partitioned ? dynamics->n_dependent > 0 && !dynamics->newton && !dynamics->rows : !dynamics->elimination)
        return 0;
    if (ncgen_uses_tangents(model, dynamics, options) && (!dynamics->tangents || (partitioned && dynamics->newton && !dynamics->rows)))
        return 0;
    if (facts[options->method].has_fixed_step && !(options->max_step > 0))
        return 0;
    return ncgen_is_stepper(options) || (facts[options->method].takes_derivative && options->formalism != NCGEN_ALI3P);
}

/* Is every instant after the one before? They are not where the clock's own number is too large to tell them apart. */
static int is_ascending(int n_times, const ncgen_scalar *times)
{
    for (int i = 1; i < n_times; ++i)
        if (!(times[i] > times[i - 1]))
            return 0;
    return 1;
}

/* Everything ready for a run from the position q. */
static int begin(ncgen_run *r, parts *w, const ncgen_real *q, const ncgen_real *velocities)
{
    lay_out(r, w);
    r->rounding = 1;
    for (volatile ncgen_scalar more = 2; more > 1; more = 1 + r->rounding / 2)
        r->rounding /= 2;
    r->start_t = r->times[0];
    for (int i = 0; i < r->n; ++i) {
        r->start_q[i] = q[i];
        r->start_qd[i] = 0;
    }
    if (!r->partitioning)
        return ncgen_constrained_begin(r, velocities);
    ncgen_partitioning_begin(r, velocities);
    return NCGEN_OK;
}

int ncgen_dynamics_jacobian(const ncgen_model *model, const ncgen_dynamics *dynamics, const ncgen_options *options,
                            ncgen_scalar t, const ncgen_real *p, const ncgen_real *q, const ncgen_real *velocities,
                            ncgen_real *jacobian, ncgen_real *workspace, int *integers)
{
    parts w;
    ncgen_statistics statistics;
    ncgen_run r;
    clear_statistics(&statistics, t);
    describe(&r, model, dynamics, options);
    r.p = p;
    r.statistics = &statistics;
    r.space.base = workspace;
    r.integers = integers;
    r.times = &t;
    r.n_times = 1;
    if (!dynamics->tangents)
        return NCGEN_ARGUMENT;
    const int status = begin(&r, &w, q, velocities);
    return status == NCGEN_OK ? r.jacobian(&r, t, r.y, jacobian) : status;
}

int ncgen_simulate(const ncgen_model *model, const ncgen_dynamics *dynamics, const ncgen_options *options,
                   const ncgen_real *p, const ncgen_real *q, const ncgen_real *velocities, int n_times,
                   const ncgen_scalar *times, ncgen_real *out_q, ncgen_real *out_qd, ncgen_real *out_work, int *rows,
                   ncgen_statistics *statistics, ncgen_real *workspace, int *integers)
{
    *rows = 0;
    if (!possible(model, dynamics, options, n_times) || !is_ascending(n_times, times))
        return NCGEN_ARGUMENT;
    parts w;
    ncgen_run r;
    clear_statistics(statistics, times[0]);
    describe(&r, model, dynamics, options);
    r.p = p;
    r.statistics = statistics;
    r.space.base = workspace;
    r.integers = integers;
    r.n_times = n_times;
    r.times = times;
    r.out_q = out_q;
    r.out_qd = out_qd;
    r.out_work = out_work;
    int status = begin(&r, &w, q, velocities);
    if (status == NCGEN_OK && ncgen_is_stepper(options))
        status = ncgen_steppers(&r, &w.stepping, &w.correction);
    else if (status == NCGEN_OK && is_implicit(options))
        status = ncgen_implicit_run(&r, &w.stepping, &w.implicit);
    else if (status == NCGEN_OK)
        status = ncgen_explicit(&r, &w.stepping);
    *rows = r.rows;
    ncgen_copy(r.n, r.start_q, out_q + (size_t)n_times * (size_t)r.n);
    ncgen_copy(r.n, r.start_qd, out_qd + (size_t)n_times * (size_t)r.n);
    out_work[n_times] = r.start_work;
    return status == NCGEN_PIVOT && r.rows == n_times ? NCGEN_OK : status; /* other coordinates have nothing left to do */
}
