/* ncgen_steppers.c: a run with equal steps of a method that discretises the constrained equations themselves. */
#include "ncgen_constrained.h"
#include "ncgen_jacobian.h"
#include "ncgen_method.h"
#include "ncgen_projection.h"
#include "ncgen_steppers.h"
#ifndef NCGEN_WITHOUT_STEPPERS

void ncgen_steppers_layout(ncgen_run *r, ncgen_stepping *w, ncgen_correction *c)
{
    const int n = r->n;
    w->new_y = ncgen_take(&r->space, r->ny);
    w->at = ncgen_take(&r->space, r->ny);
    if (!ncgen_uses_tangents(r->model, r->dynamics, r->options)) {
        c->steps = ncgen_take(&r->space, NCGEN_ALONG_LIMIT * n);
        return;
    }
    c->size = r->options->formalism == NCGEN_ALI3P ? n : n + r->m;
    c->matrix = ncgen_take(&r->space, c->size * c->size);
    c->right = ncgen_take(&r->space, c->size);
    c->x = ncgen_take(&r->space, c->size);
    c->residual = ncgen_take(&r->space, n + r->m);
    c->change = ncgen_take(&r->space, n + r->m);
    c->auxiliary = ncgen_take(&r->space, n);
    c->base = ncgen_take(&r->space, 2 * n);
    c->left = ncgen_take(&r->space, r->constrained->n_phi_q);
    c->halfway = ncgen_take(&r->space, r->dynamics->rolling ? r->constrained->n_phi_q : 0);
    c->rolled = ncgen_take(&r->space, r->dynamics->rolling ? n + r->m : 0);
    c->gap = ncgen_take(&r->space, r->m);
    c->along = ncgen_take(&r->space, n);
    c->order = r->integers ? r->integers + n + 2 * r->m : NULL;
    c->unit = 0;
}

/* The cubic through both ends of a step and its derivative; the work in proportion. */
static int interpolate(ncgen_run *r, ncgen_stepping *w, ncgen_scalar t, ncgen_scalar h, ncgen_scalar s)
{
    const int n = r->n;
    const ncgen_real *v0 = r->y, *q0 = r->y + n, *v1 = w->new_y, *q1 = w->new_y + n;
    (void)t;
    for (int i = 0; i < n; ++i) {
        const ncgen_real change = q1[i] - q0[i], first = h * v0[i] - change, last = h * v1[i] - change;
        w->at[n + i] = q0[i] + s * (change + (1 - s) * ((1 - s) * first - s * last));
        w->at[i] = (change + (1 - s) * (1 - 3 * s) * first - s * (2 - 3 * s) * last) / h;
    }
    w->at[2 * n] = r->y[2 * n] + s * (w->new_y[2 * n] - r->y[2 * n]);
    return NCGEN_OK;
}

/* A row that does not count has no multiplier: that of a step in which it did would push against the others. */
static void let_rows_go(ncgen_run *r)
{
    for (int i = 0; i < r->m; ++i)
        if (r->constrained->is_left_out[i])
            r->linearisation->lam[i] = 0;
}

/* Accelerations, multipliers and power where steps begin: at the start, and where something that depends on time changes its formula. */
static int begin(ncgen_run *r, ncgen_correction *c, ncgen_scalar t)
{
    r->constrained->is_reusable = 0;
    c->is_corrected = 0;
    ncgen_copy(r->n, r->y, r->qd);
    if (!ncgen_uses_tangents(r->model, r->dynamics, r->options))
        return r->statistics->steps ? NCGEN_OK : ncgen_constrained_matrices(r, t); /* which redundant rows count is a matter of the start */
    const int status = ncgen_constrained_accelerations(r, t);
    ncgen_copy(r->n, r->constrained->solution, r->linearisation->qdd);
    ncgen_copy(r->n, r->constrained->solution, c->auxiliary);
    ncgen_copy(r->m, r->constrained->solution + r->n, r->linearisation->lam);
    return status == NCGEN_OK ? ncgen_constrained_power(r, t, &c->power) : status;
}

static ncgen_stepper *stepper_of(const ncgen_run *r)
{
    const int tangents = ncgen_uses_tangents(r->model, r->dynamics, r->options);
#define CASE(constant, step, with_tangents) \
    if (r->options->method == constant) \
        return tangents ? with_tangents : step;
    NCGEN_STEPPERS(CASE)
#undef CASE
    return ncgen_ali3p;
}

/* Equal steps from one break, or the start, to the next, or the end. */
static int step_through(ncgen_run *r, ncgen_stepping *w, ncgen_correction *c, ncgen_scalar start, ncgen_scalar end)
{
    const ncgen_scalar count = ncgen_step_count(r, end - start), h = (end - start) / count;
    int status = count > 0 && start + h > start && end - h < end ? NCGEN_OK : NCGEN_ARGUMENT;
    for (ncgen_scalar i = 0; i < count && status == NCGEN_OK && !r->statistics->stopped; i += 1) {
        w->new_y[2 * r->n] = w->new_y[2 * r->n + 1] = 0;
        status = stepper_of(r)(r, w, c, start + i * h, h);
        ncgen_copy(r->n, r->qd, w->new_y);
        ncgen_copy(r->n, r->q, w->new_y + r->n);
        if (status == NCGEN_OK && !ncgen_is_finite(2 * r->n + 1, w->new_y))
            status = NCGEN_DOMAIN;
        if (status == NCGEN_OK && !(ncgen_constrained_size(r, r->q) < R(1.0e30) && ncgen_constrained_size(r, r->qd) < R(1.0e30)))
            status = NCGEN_NOT_CONVERGED;
        if (ncgen_uses_tangents(r->model, r->dynamics, r->options) && r->options->formalism != NCGEN_ALI3P)
            let_rows_go(r);
        if (status == NCGEN_OK)
            status = ncgen_grid_step(r, w, start + i * h, i + 1 < count ? start + (i + 1) * h : end);
    }
    return status;
}

int ncgen_steppers(ncgen_run *r, ncgen_stepping *w, ncgen_correction *c)
{
    const ncgen_scalar end = r->times[r->n_times - 1];
    ncgen_scalar t = r->times[0];
    w->interpolate = interpolate;
    ncgen_copy(r->n, r->y, r->qd);
    ncgen_save_state(r, r->times[0], 0);
    int status = ncgen_grid_begin(r, w); /* the first row is there before a jump at the start is crossed */
    if (status == NCGEN_OK) {
        (void)ncgen_cross_break(r, &t, end);
        status = begin(r, c, t);
    }
    while (t < end && status == NCGEN_OK && !r->statistics->stopped) {
        const ncgen_scalar goal = ncgen_next_goal(r, t, end);
        const int is_broken = !(goal < ncgen_next_break(r, t, end));
        status = step_through(r, w, c, t, goal);
        t = goal;
        if (status == NCGEN_OK && !r->statistics->stopped)
            (void)ncgen_cross_break(r, &t, end);
        if (status == NCGEN_OK && is_broken && t < end && !r->statistics->stopped)
            status = begin(r, c, t);
    }
    return status;
}

#endif
