/* ncgen_trapezoidal.c: the trapezoidal rule with a fixed step and the exact Jacobian. */
#include "ncgen_implicit.h"

enum { LIMIT = 10 };

static int interpolate_fixed(ncgen_run *r, ncgen_stepping *w, ncgen_scalar t, ncgen_scalar h, ncgen_scalar s)
{
    (void)t;
    ncgen_interpolate_cubic(r, w, w->stage_derivatives[0], w->stage_derivatives[1], h, s);
    return NCGEN_OK;
}

/* The largest number of a state or of a change of one, in natural sizes; a velocity counts what it moves in a step. The work follows from
 * the others. */
static ncgen_real natural_size(const ncgen_run *r, const ncgen_real *x, ncgen_scalar h)
{
    const int velocities = r->partitioning ? r->nz : r->n;
    const ncgen_scalar *sizes = r->options->sizes;
    ncgen_real largest = 0;
    for (int i = 0; i < r->error_size - 1; ++i) {
        const ncgen_real size = NCGEN_ABS(x[i]) * (i < velocities ? h : 1) / (sizes ? sizes[i] : 1);
        largest = size > largest ? size : largest;
    }
    return largest;
}

/* new_y by Newton's method: (2/h - J) dy = 2/h (y - new_y) + f + f_new. */
static int correct_fixed(ncgen_run *r, ncgen_stepping *w, ncgen_implicit *m, ncgen_scalar t, ncgen_scalar h)
{
    const ncgen_scalar enough = 500 * r->rounding;
    ncgen_real before = R(1.0e30), least = 0;
    for (int i = 0; i < r->ny; ++i)
        w->new_y[i] = r->y[i] + h * w->stage_derivatives[0][i];
    for (int pass = 0; pass < LIMIT; ++pass) {
        int status = ncgen_report_attempt(r, t + h);
        if (status == NCGEN_OK)
            status = r->derivative(r, t + h, w->new_y, m->derivatives);
        if (status != NCGEN_OK)
            return status;
        for (int i = 0; i < r->error_size; ++i)
            m->right[i] = 2 / h * (r->y[i] - w->new_y[i]) + w->stage_derivatives[0][i] + m->derivatives[i];
        ncgen_shifted_solve(r, m, &m->real, m->right, m->change);
        if (!ncgen_is_finite(r->error_size, m->change))
            return NCGEN_DOMAIN;
        for (int i = 0; i < r->error_size; ++i)
            w->new_y[i] += m->change[i];
        const ncgen_real size = natural_size(r, m->change, h), whole = natural_size(r, w->new_y, h);
        least = whole > 1 ? whole : 1;
        if (size <= enough * least)
            return NCGEN_OK;
        if (!(size < before)) /* rounding ends the fall of the steps before they reach the bound */
            return before < 100 * enough * least ? NCGEN_OK : NCGEN_NOT_CONVERGED;
        before = size;
    }
    return before < 100 * enough * least ? NCGEN_OK : NCGEN_NOT_CONVERGED;
}

static int trapezoidal_step(ncgen_run *r, ncgen_stepping *w, ncgen_implicit *m, ncgen_scalar t, ncgen_scalar h)
{
    int status = NCGEN_NOT_CONVERGED;
    const ncgen_scalar other = h - m->last_step, rounded = R(1.0e-9) * h; /* equal steps between times that are rounded */
    if (m->factored && other <= rounded && -other <= rounded)
        status = correct_fixed(r, w, m, t, h);
    if (status != NCGEN_OK && status != NCGEN_INTERRUPTED) {
        for (int i = 0; i < r->ny; ++i)
            w->new_y[i] = r->y[i] + h * w->stage_derivatives[0][i];
        status = ncgen_implicit_jacobian(r, m, t + h, w->new_y);
        if (status == NCGEN_OK)
            status = ncgen_shifted_factor(m, &m->real, 1, 2 / h, 0);
        m->factored = status == NCGEN_OK;
        m->last_step = h;
        if (status == NCGEN_OK)
            status = correct_fixed(r, w, m, t, h);
    }
    if (status == NCGEN_OK)
        status = ncgen_end_derivative(r, t + h, w->new_y, 0, w->stage_derivatives[1]);
    if (status == NCGEN_OK && !(ncgen_is_finite(r->ny, w->new_y) && ncgen_is_finite(r->ny, w->stage_derivatives[1])))
        status = NCGEN_DOMAIN;
    return status;
}

int ncgen_trapezoidal(ncgen_run *r, ncgen_stepping *w, ncgen_implicit *m)
{
    const ncgen_scalar end = r->times[r->n_times - 1];
    ncgen_scalar t = r->times[0];
    int begun = ncgen_implicit_begin(r, w, m);
    if (begun != NCGEN_OK)
        return begun;
    w->interpolate = interpolate_fixed;
    m->last_step = 0;
    if (!(ncgen_step_count(r, end - t) > 0))
        return NCGEN_ARGUMENT;
    if (ncgen_cross_break(r, &t, end) && (begun = r->derivative(r, t, r->y, w->stage_derivatives[0])) != NCGEN_OK)
        return begun;
    while (t < end) {
        const ncgen_scalar goal = ncgen_next_goal(r, t, end);
        const int last = r->options->max_step < 0 || t + r->options->max_step >= goal;
        const ncgen_scalar t_new = last ? goal : t + r->options->max_step;
        if (!(t_new > t))
            return NCGEN_ARGUMENT;
        int status = trapezoidal_step(r, w, m, t, last ? goal - t : r->options->max_step);
        if (status != NCGEN_OK)
            return status;
        status = ncgen_grid_step(r, w, t, t_new);
        if (status != NCGEN_OK || r->statistics->stopped)
            return status;
        ncgen_begin_at_stage(w, 1);
        t = t_new;
        if (last)
            (void)ncgen_cross_break(r, &t, end);
        if (last && t < end && (status = r->derivative(r, t, r->y, w->stage_derivatives[0])) != NCGEN_OK)
            return status;
    }
    return NCGEN_OK;
}
