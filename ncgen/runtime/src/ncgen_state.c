/* ncgen_state.c: what every integrator does with a run. */
#include "ncgen_state.h"

#include <limits.h>

int ncgen_nonzeros(const ncgen_pattern *pattern)
{
    return pattern->indptr ? pattern->indptr[pattern->rows] : 0;
}

int ncgen_degrees_of_freedom(const ncgen_run *r)
{
    return r->n - (r->dynamics->n_dependent > 0 ? r->dynamics->n_dependent : r->m);
}

void ncgen_times_mass(const ncgen_run *r, const ncgen_real *mass, const ncgen_real *x, ncgen_real *product)
{
    for (int i = 0; i < r->n; ++i)
        product[i] = ncgen_row_times(&r->model->mass_pattern, mass, x, i);
}

/* Phi_q qd. */
void ncgen_row_velocities(const ncgen_run *r, const ncgen_real *phi_q, const ncgen_real *qd, ncgen_real *rates)
{
    for (int i = 0; i < r->m; ++i)
        rates[i] = ncgen_row_times(&r->model->phi_q_pattern, phi_q, qd, i);
}

int ncgen_phi(const ncgen_run *r, ncgen_real t, const ncgen_real *q, ncgen_real *phi)
{
    return r->model->phi ? r->model->phi(t, q, r->p, phi) : NCGEN_OK;
}

int ncgen_phi_q(const ncgen_run *r, ncgen_real t, const ncgen_real *q, ncgen_real *values)
{
    return r->model->phi_q ? r->model->phi_q(t, q, r->p, values) : NCGEN_OK;
}

int ncgen_gamma(const ncgen_run *r, ncgen_real t, const ncgen_real *q, const ncgen_real *qd, ncgen_real *gamma)
{
    return r->model->gamma ? r->model->gamma(t, q, qd, r->p, gamma) : NCGEN_OK;
}

int ncgen_external_forces(ncgen_run *r, ncgen_real t, const ncgen_real *q, const ncgen_real *qd)
{
    if (!ncgen_is_finite(r->n, q) || !ncgen_is_finite(r->n, qd))
        return NCGEN_DOMAIN;
    const int status = r->dynamics->external(t, q, qd, r->p, r->external);
    return status == NCGEN_OK && !ncgen_is_finite(r->n, r->external) ? NCGEN_DOMAIN : status;
}

int ncgen_forces(ncgen_run *r, ncgen_real t, const ncgen_real *q, const ncgen_real *qd, ncgen_real *forces)
{
    for (int i = 0; i < (r->model->force ? 0 : r->n); ++i)
        forces[i] = 0;
    int status = r->model->force ? r->model->force(t, q, qd, r->p, forces) : NCGEN_OK;
    if (!r->external || status != NCGEN_OK)
        return status;
    status = ncgen_external_forces(r, t, q, qd);
    for (int i = 0; i < r->n; ++i)
        forces[i] += r->external[i];
    return status;
}

int ncgen_energies(const ncgen_run *r, ncgen_real t, const ncgen_real *q, const ncgen_real *qd, ncgen_real energies[3])
{
    energies[0] = energies[1] = energies[2] = 0;
    const int status = r->model->energy ? r->model->energy(t, q, qd, r->p, energies) : NCGEN_OK;
    if (r->external)
        energies[2] += ncgen_dot(r->n, r->external, qd);
    return status;
}

int ncgen_power(const ncgen_run *r, ncgen_real t, const ncgen_real *q, const ncgen_real *qd, ncgen_real *power)
{
    ncgen_real energies[3];
    int status = NCGEN_OK;
    *power = 0;
    if (r->dynamics->conservative)
        return NCGEN_OK;
    if (!r->model->power) {
        status = ncgen_energies(r, t, q, qd, energies);
        *power = energies[2];
        return status;
    }
    status = r->model->power(t, q, qd, r->p, power);
    if (r->external)
        *power += ncgen_dot(r->n, r->external, qd);
    return status;
}

void ncgen_write_row(ncgen_run *r, ncgen_real work)
{
    if (r->out_q) {
        ncgen_copy(r->n, r->q, r->out_q + (size_t)r->rows * (size_t)r->n);
        ncgen_copy(r->n, r->qd, r->out_qd + (size_t)r->rows * (size_t)r->n);
        r->out_work[r->rows] = work;
    }
    r->rows += 1;
}

/* A state whose arrays stay becomes the last accepted one. */
static void accept_state(ncgen_run *r, ncgen_scalar t, const ncgen_real *q, const ncgen_real *qd, ncgen_real work)
{
    r->start_q = q;
    r->start_qd = qd;
    r->start_work = work;
    r->start_t = t;
    r->statistics->t = t;
}

/* What was evaluated last becomes the last accepted state. */
void ncgen_save_state(ncgen_run *r, ncgen_scalar t, ncgen_real work)
{
    ncgen_copy(r->n, r->q, r->start);
    ncgen_copy(r->n, r->qd, r->start + r->n);
    accept_state(r, t, r->start, r->start + r->n, work);
}

void ncgen_describe(ncgen_run *r, const ncgen_model *model, const ncgen_dynamics *dynamics, const ncgen_options *options)
{
    r->model = model;
    r->dynamics = dynamics;
    r->options = options;
    r->n = model->n_coordinates;
    r->m = model->n_rows;
    r->nz = dynamics->n_independent;
    r->space.base = NULL;
    r->space.used = 0;
    r->integers = NULL;
    r->partitioning = NULL;
    r->constrained = NULL;
    r->linearisation = NULL;
    r->jacobian = NULL;
    r->project_state = NULL;
    r->accept = NULL;
    r->projects_stages = 1;
    r->projecting = r->uses_exchanges = r->rows = 0;
    r->attempts_left = !options->progress ? LONG_MAX : options->attempts_left > 1 ? options->attempts_left : 1;
}

void ncgen_state_layout(ncgen_run *r)
{
    r->start = ncgen_take(&r->space, 2 * r->n);
    r->start_q = r->start;
    r->start_qd = r->start ? r->start + r->n : NULL;
    r->external = r->dynamics->external ? ncgen_take(&r->space, r->n) : NULL;
    r->is_driven = r->options->signals && r->options->signals->inputs && r->model->n_inputs > 0;
    const int prepared = r->dynamics->motion ? r->dynamics->motion->n_prepared : 0;
    r->p_copy = r->is_driven || prepared || r->options->parameter_rule ? ncgen_take(&r->space, r->model->n_parameters + prepared) : NULL;
}

/* What depends on parameters alone. */
static void prepare(ncgen_run *r)
{
    if (r->p_copy && r->dynamics->motion && r->dynamics->motion->prepare)
        r->dynamics->motion->prepare(r->p, r->p_copy + r->model->n_parameters);
}

ncgen_scalar ncgen_rounding(void)
{
    ncgen_scalar rounding = 1;
    for (;;) {
        const volatile ncgen_scalar more = 1 + rounding / 2;
        if (!(more > 1))
            return rounding;
        rounding /= 2;
    }
}

ncgen_options ncgen_options_of_calls(ncgen_scalar step, ncgen_scalar rtol, ncgen_scalar atol)
{
    ncgen_options options = NCGEN_ALL_ZERO;
    options.method = step > 0 ? NCGEN_RK4 : NCGEN_DOP853;
    options.formalism = NCGEN_LAGRANGE;
    options.project = 1;
    options.rtol = rtol;
    options.atol = atol;
    options.max_step = step;
    options.tolerance = 5000 * ncgen_rounding();
    return options;
}

void ncgen_begin(ncgen_run *r)
{
    ncgen_statistics *s = r->statistics;
    s->steps = s->rejected = s->repeated = s->evaluations = s->newton_steps = 0;
    s->factorisations = s->perturbed = s->refinements = s->jacobians = s->fallbacks = s->stiff = 0;
    s->stopped = 0;
    s->largest_projection = s->next_step = 0;
    s->t = s->tried = r->start_t = r->step_start = r->times[0];
    r->rounding = ncgen_rounding();
    if (r->p_copy) {
        ncgen_copy(r->model->n_parameters, r->p, r->p_copy);
        r->p = r->p_copy;
    }
    prepare(r);
}

int ncgen_choose(ncgen_run *r)
{
    const int status = r->options->parameter_rule ? r->options->parameter_rule(r->start_q, r->p_copy) : NCGEN_OK;
    if (r->options->parameter_rule && status == NCGEN_OK)
        prepare(r);
    return status;
}

int ncgen_ask_for_inputs(ncgen_run *r, ncgen_scalar t)
{
    const ncgen_signals *signals = r->options->signals;
    return signals->inputs(signals->context, r->step_start, t, r->p_copy + r->model->n_parameters - r->model->n_inputs);
}

int ncgen_accept(ncgen_run *r, ncgen_scalar t, const ncgen_real *y)
{
    const ncgen_real work = y[r->error_size - 1];
    r->uses_exchanges = 0;
    if (r->constrained)
        accept_state(r, t, y + r->n, y, work);
    else
        ncgen_save_state(r, t, work);
    return r->accept ? r->accept(r, t) : NCGEN_OK;
}

int ncgen_end_derivative(ncgen_run *r, ncgen_scalar t, ncgen_real *y, int precise, ncgen_real *yd)
{
    return r->project_state ? r->project_state(r, t, y, precise, yd) : r->derivative(r, t, y, yd);
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

int ncgen_report_progress(ncgen_run *r, ncgen_scalar reached)
{
    if (!r->options->progress)
        return NCGEN_OK;
    if (r->attempts_left == 0)
        r->attempts_left = r->options->progress(r->options->context, reached);
    if (r->attempts_left <= 0) {
        r->attempts_left = -1; /* who asks again gets the same answer */
        return NCGEN_INTERRUPTED;
    }
    r->attempts_left -= 1;
    return NCGEN_OK;
}
