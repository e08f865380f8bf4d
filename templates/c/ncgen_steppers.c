/* ncgen_steppers.c: methods with a fixed step that discretise the constrained equations themselves.
 *
 * Both are written with what the formalisms on all coordinates have: accelerations at a state, which leave the factors
 * of [M Phi_q'; Phi_q -E] there behind, and projections along M^-1 Phi_q' with those factors. What an acceleration has
 * along that direction does not matter: the projection that follows puts it right.
 */
#include "ncgen_internal.h"

enum { ITERATION_LIMIT = 30 };

/* The largest |a - b| in natural sizes. */
static ncgen_real distance(const ncgen_run *r, const ncgen_real *a, const ncgen_real *b)
{
    ncgen_real largest = 0;
    for (int i = 0; i < r->n; ++i) {
        const ncgen_real size = NCGEN_ABS(a[i] - b[i]) / r->dynamics->column_sizes[i];
        if (!(size <= largest))
            largest = size;
    }
    return largest;
}

/* Half a kick, a drift onto the constraints, half a kick onto their velocities (Andersen 1983). Forces depend on position
 * only, so the acceleration and the factors at the end of a step are those at the start of the next. */
static int rattle(ncgen_run *r, ncgen_stepping *w, ncgen_scalar t, ncgen_scalar h)
{
    const int n = r->n;
    ncgen_real *velocity = r->y, *position = r->y + n;
    const ncgen_real *acceleration = r->constrained->solution;
    int status = NCGEN_OK;
    if (!w->interpolated) { /* the first step: there is no acceleration yet */
        ncgen_copy(n, position, r->q);
        ncgen_copy(n, velocity, r->qd);
        status = ncgen_constrained_accelerations(r, t);
        w->interpolated = 1;
    }
    for (int i = 0; i < n; ++i)
        r->q[i] = position[i] + h * (velocity[i] + h / 2 * acceleration[i]);
    if (status == NCGEN_OK)
        status = ncgen_constrained_position(r, t + h);
    for (int i = 0; i < n; ++i)
        r->qd[i] = (r->q[i] - position[i]) / h;
    ncgen_copy(n, r->q, position);
    ncgen_constrained_rows(r);
    if (status == NCGEN_OK)
        status = ncgen_constrained_accelerations(r, t + h);
    for (int i = 0; i < n; ++i)
        r->qd[i] += h / 2 * acceleration[i];
    if (status == NCGEN_OK)
        status = ncgen_constrained_velocity(r, t + h);
    ncgen_copy(n, r->qd, velocity);
    return status;
}

/* The midpoint rule with Phi = 0 at the end: M (v1 - v0) / h = Q - Phi_q' lam in the middle, q1 - q0 = h (v0 + v1) / 2.
 * With a constant mass matrix, quadratic constraints and a linear potential it keeps the energy. */
static int energy_momentum(ncgen_run *r, ncgen_stepping *w, ncgen_scalar t, ncgen_scalar h)
{
    const int n = r->n;
    ncgen_real *velocity = r->y, *position = r->y + n, *end = w->new_y, *before = w->at;
    const ncgen_real *acceleration = r->constrained->solution;
    ncgen_real last = 0;
    ncgen_copy(n, position, end);
    for (int i = 0; i < n; ++i)
        end[i] += h * velocity[i];
    for (int pass = 0; pass < ITERATION_LIMIT; ++pass) {
        ncgen_copy(n, end, before);
        for (int i = 0; i < n; ++i) {
            r->q[i] = (position[i] + end[i]) / 2;
            r->qd[i] = (end[i] - position[i]) / h;
        }
        int status = ncgen_constrained_accelerations(r, t + h / 2);
        for (int i = 0; i < n; ++i)
            r->q[i] = position[i] + h * (velocity[i] + h / 2 * acceleration[i]);
        if (status == NCGEN_OK)
            status = ncgen_constrained_position(r, t + h);
        if (status != NCGEN_OK)
            return status;
        ncgen_copy(n, r->q, end);
        const ncgen_real change = distance(r, end, before);
        if (change <= 4 * r->rounding || (pass > 1 && change < R(1.0e4) * r->rounding && change > last / 4)) {
            for (int i = 0; i < n; ++i)
                velocity[i] = 2 * (end[i] - position[i]) / h - velocity[i];
            ncgen_copy(n, end, position);
            ncgen_copy(n, velocity, r->qd);
            ncgen_constrained_rows(r);
            return NCGEN_OK;
        }
        last = change;
    }
    return NCGEN_NOT_CONVERGED;
}

int ncgen_steppers(ncgen_run *r, ncgen_stepping *w)
{
    int (*step)(ncgen_run *, ncgen_stepping *, ncgen_scalar, ncgen_scalar) =
        r->options->method == NCGEN_RATTLE ? rattle : energy_momentum;
    ncgen_copy(r->n, r->y, r->qd);
    ncgen_keep_state(r, r->times[0], 0);
    ncgen_write_row(r, 0);
    w->interpolated = 0;
    for (int row = 1; row < r->n_times; ++row) {
        const ncgen_scalar start = r->times[row - 1], span = r->times[row] - start;
        const ncgen_scalar count = ncgen_step_count(r, span);
        for (ncgen_scalar i = 0; i < count; i += 1) {
            const ncgen_scalar t = start + i * (span / count);
            const int status = step(r, w, t, span / count);
            if (status != NCGEN_OK)
                return status;
            r->statistics->steps += 1;
            ncgen_keep_state(r, t + span / count, 0);
        }
        ncgen_write_row(r, 0);
    }
    return NCGEN_OK;
}
