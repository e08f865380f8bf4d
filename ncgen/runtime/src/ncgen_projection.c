/* ncgen_projection.c: back onto the constraints with the matrix that gives accelerations: the smallest change in the sense of
 * kinetic energy. */
#include "ncgen_projection.h"
#include "ncgen_method.h"
#include "ncgen_solution.h"

enum { VELOCITY_LIMIT = 5 };

/* Phi_q and the factors at r->q. */
static int refresh(ncgen_run *r, ncgen_scalar t)
{
    const int status = ncgen_constrained_matrices(r, t);
    return status == NCGEN_OK ? ncgen_constrained_factor(r) : status;
}

/* Change x by the smallest amount that changes the rows by -w->residual[n..]; smallest in the sense of kinetic energy. */
static void correct(ncgen_run *r, ncgen_constrained *w, ncgen_real *x)
{
    for (int i = 0; i < r->n; ++i)
        w->residual[i] = 0;
    for (int i = 0; i < r->m; ++i)
        w->residual[r->n + i] = -w->residual[r->n + i];
    ncgen_kkt_solve(&w->kkt, w->residual, w->residual);
    for (int i = 0; i < r->n; ++i)
        x[i] += w->residual[i];
}

/* The same without what the factors have besides M and Phi_q'; overwrites w->solution. */
static int correct_exactly(ncgen_run *r, ncgen_constrained *w, ncgen_real *x)
{
    for (int i = 0; i < r->n; ++i)
        w->right[i] = 0;
    for (int i = 0; i < r->m; ++i)
        w->right[r->n + i] = -w->residual[r->n + i];
    const int status = ncgen_constrained_solve(r);
    for (int i = 0; i < r->n && status == NCGEN_OK; ++i)
        x[i] += w->solution[i];
    return status;
}

/* r->q onto the constraints with the factors that are there; fresh: they are those of this position.
 * Near singular positions the rest of a violation is multiplied by much, so it is brought down to rounding if it can be. */
static int project_position(ncgen_run *r, ncgen_scalar t, int fresh)
{
    ncgen_constrained *w = r->constrained;
    const ncgen_scalar wanted = NCGEN_ROUNDINGS * r->rounding;
    ncgen_real before = 0;
    for (int k = 0; k < NCGEN_POSITION_LIMIT; ++k) {
        int status = ncgen_phi(r, t, r->q, w->residual + r->n);
        const ncgen_real size = ncgen_constrained_violation(r, w->residual + r->n);
        if (status != NCGEN_OK)
            return status;
        if (size <= wanted)
            return NCGEN_OK;
        if (!(size < R(1.0e30)))
            return ncgen_is_finite(1, &size) ? NCGEN_NOT_CONVERGED : NCGEN_DOMAIN;
        if (k > 0 && size > R(0.1) * before) {
            if (size <= r->options->tolerance || (fresh && size <= 1000 * r->options->tolerance))
                return NCGEN_OK; /* at rounding; more of it near a singular position */
            if ((status = refresh(r, t)) != NCGEN_OK)
                return status;
            fresh = 1;
        }
        before = size;
        r->statistics->newton_steps += 1;
        correct(r, w, r->q);
    }
    return NCGEN_NOT_CONVERGED;
}

/* The part of b along a, in natural sizes. */
static ncgen_real share_along(const ncgen_run *r, const ncgen_real *a, const ncgen_real *b)
{
    const ncgen_scalar *sizes = r->dynamics->column_sizes;
    ncgen_real square = 0, sum = 0;
    for (int i = 0; i < r->n; ++i) {
        square += a[i] / sizes[i] * (a[i] / sizes[i]);
        sum += a[i] / sizes[i] * (b[i] / sizes[i]);
    }
    return square > 0 ? sum / square : 0;
}

/* The next step of Broyden's method: that of the factors, `step`, with what the steps before it have shown of Phi_q on the way. All are
 * sums of columns of M^-1 Phi_q' at the place of the factors (Kelley 1995, section 7.3). */
static void learn(const ncgen_run *r, const ncgen_real *steps, int count, ncgen_real *step)
{
    const int n = r->n;
    for (int j = 0; j < count; ++j) {
        const ncgen_real *before = steps + (size_t)j * (size_t)n, *after = before + n;
        const ncgen_real share = share_along(r, before, step);
        for (int i = 0; i < n; ++i)
            step[i] = j + 1 < count ? step[i] + share * after[i] : step[i] / (1 - share);
    }
}

int ncgen_project_along(ncgen_run *r, ncgen_scalar t, ncgen_real *steps)
{
    const int n = r->n;
    ncgen_constrained *w = r->constrained;
    ncgen_real before = R(1.0e30);
    for (int k = 0; k < NCGEN_ALONG_LIMIT; ++k) {
        ncgen_real *step = steps + (size_t)k * (size_t)n;
        int status = ncgen_phi(r, t, r->q, w->residual + n);
        const ncgen_real size = ncgen_constrained_violation(r, w->residual + n);
        if (status != NCGEN_OK)
            return status;
        if (size <= NCGEN_ROUNDINGS * r->rounding || (size <= r->options->tolerance && size > R(0.1) * before))
            return NCGEN_OK;
        if (!(size < R(1.0e30)))
            return NCGEN_NOT_CONVERGED;
        before = size;
        r->statistics->newton_steps += 1;
        for (int i = 0; i < n; ++i)
            step[i] = 0;
        status = correct_exactly(r, w, step);
        if (status != NCGEN_OK)
            return status;
        learn(r, steps, k, step);
        for (int i = 0; i < n; ++i)
            r->q[i] += step[i];
    }
    return NCGEN_NOT_CONVERGED;
}

/* exactly: in the direction of M and Phi_q' alone; overwrites w->solution. */
static int project_velocity(ncgen_run *r, ncgen_scalar t, int exactly)
{
    ncgen_constrained *w = r->constrained;
    int status = ncgen_constrained_phi_q(r, t);
    if (status == NCGEN_OK && r->model->nu)
        status = r->model->nu(t, r->q, r->p, w->nu);
    if (status != NCGEN_OK)
        return status;
    const ncgen_real size = 1 + ncgen_constrained_size(r, r->qd), enough = NCGEN_ROUNDINGS * r->rounding * size;
    for (int k = 0;; ++k) {
        ncgen_row_velocities(r, w->kkt.values + w->n_mass, r->qd, w->residual + r->n);
        for (int i = 0; i < r->m; ++i)
            w->residual[r->n + i] -= w->nu[i];
        const ncgen_real violation = ncgen_rest_of_rows(r, w); /* others follow, or contradict these, which the run reports */
        if (violation <= enough)
            return NCGEN_OK;
        if (k == VELOCITY_LIMIT) /* at rounding; more of it near a singular position */
            return violation <= NCGEN_SQRT(r->rounding) * size ? NCGEN_OK : NCGEN_NOT_CONVERGED;
        if (!exactly)
            correct(r, w, r->qd);
        else if ((status = correct_exactly(r, w, r->qd)) != NCGEN_OK)
            return status;
    }
}

int ncgen_project_velocity(ncgen_run *r, ncgen_scalar t)
{
    return project_velocity(r, t, 0);
}

int ncgen_project_velocity_along(ncgen_run *r, ncgen_scalar t, ncgen_real *kept)
{
    ncgen_copy(r->n, r->constrained->solution, kept);
    const int status = project_velocity(r, t, 1);
    ncgen_copy(r->n, kept, r->constrained->solution);
    return status;
}

/* What closing a position came to: it does not close; it is closed; it is closed where it may stay, since it followed from what its joints
 * measure, or was moved by about the shortest way. */
enum { STAYS_OPEN, IS_CLOSED, IS_IN_PLACE };

/* May a position stay where a step has moved it that far, its rows being violated that much? With error control it may not: few steps
 * end, with many stages each, and the tolerance is for their errors. */
static int is_near(const ncgen_run *r, const ncgen_constrained *w, ncgen_real moved, ncgen_real violation)
{
    return !(violation > 0) || (w->motion && ncgen_is_fixed_explicit(r->options) && moved <= 2 * violation);
}

/* r->q from q by Newton steps of the emitted motion, which leave the independent coordinates as they are; STAYS_OPEN, too, where they move the
 * others by much more than the rows are violated, in natural sizes: where these coordinates hardly determine where the mechanism is. Link by link no
 * coordinate stays as it is, and links pass on what moves the one before. */
static int close_position(ncgen_run *r, ncgen_constrained *w, ncgen_scalar t, const ncgen_real *q)
{
    const ncgen_scalar quadratic_limit = NCGEN_SQRT(r->rounding) * NCGEN_QUADRATIC, nothing = NCGEN_ROUNDINGS * r->rounding;
    for (int k = 0; k < NCGEN_POSITION_LIMIT; ++k, q = r->q) {
        ncgen_recursive_closing(r, t, q, w->emitted);
        r->statistics->newton_steps += 1;
        const ncgen_real moved = ncgen_constrained_size(r, w->emitted);
        const ncgen_real violation = ncgen_largest(ncgen_recursive_rows(r), w->emitted + r->n, r->dynamics->row_sizes);
        if (!(moved < NCGEN_TOO_FAR) ||
            (w->motion && violation > 0 && moved > ncgen_pivot_growth_limit(r, NCGEN_BAD_GROWTH) * violation + nothing))
            return STAYS_OPEN;
        NCGEN_UNROLLED
        for (int i = 0; i < r->n; ++i)
            r->q[i] = q[i] + w->emitted[i];
        w->moved_at_once = k == 0 ? moved : -1;
        if (violation < quadratic_limit)
            return ncgen_follows_from_measured(r) || (k == 0 && is_near(r, w, moved, violation)) ? IS_IN_PLACE : IS_CLOSED;
    }
    return STAYS_OPEN;
}

/* r->q moved along the constraints to where it is nearest to q: by the part of the difference that the joints allow. A difference up to
 * `enough`, in natural sizes, stays. */
static int approach(ncgen_run *r, ncgen_constrained *w, ncgen_scalar t, const ncgen_real *q, ncgen_scalar enough)
{
    const int n = r->n;
    const ncgen_real *moved = w->emitted + n;
    for (int i = 0; i < n; ++i)
        w->offset[i] = q[i] - r->q[i];
    const ncgen_real length = ncgen_constrained_size(r, w->offset);
    if (length <= enough)
        return 1;
    ncgen_recursive_velocities(r, t, r->q, w->offset, w->emitted);
    const int is_bad = ncgen_has_pivot_growth(r, *ncgen_growth_in(r, w->emitted));
    if (r->model->nu) { /* without what drivers add */
        ncgen_copy(n, moved, w->solution);
        for (int i = 0; i < n; ++i)
            w->offset[i] = 0;
        ncgen_recursive_velocities(r, t, r->q, w->offset, w->emitted);
    }
    for (int i = 0; i < n; ++i)
        r->q[i] += r->model->nu ? w->solution[i] - moved[i] : moved[i];
    /* what is straight leaves the constraints, always to the same side, by about the square of its length */
    return !is_bad && (length * length < NCGEN_STRAIGHT * r->rounding || close_position(r, w, t, r->q) != STAYS_OPEN);
}

/* Position and velocity of the state y by the emitted motion, in r->q and r->qd; 0 where its order of elimination is a bad one. As below,
 * both are changed as little as can be in the sense of kinetic energy, a position up to `enough`. Where it follows from measured coordinates,
 * these stay as they were integrated, each to the same order as all others; an emitted one with a tape is moved all the same, as the sweep
 * back over the tape has it. The derivative comes along, in yd, if that is not NULL and there is a function for both. */
static int close_by_recursion(ncgen_run *r, ncgen_constrained *w, ncgen_scalar t, const ncgen_real *y, ncgen_scalar enough, ncgen_real *yd)
{
    const ncgen_real *qd = y, *q = y + r->n;
    const int closing = close_position(r, w, t, q);
    if (closing == STAYS_OPEN)
        return 0;
    if (w->closed_position)
        ncgen_copy(r->n, r->q, w->closed_position);
    const int stays = closing == IS_IN_PLACE && !(w->motion && w->closed_position);
    if (!stays && !approach(r, w, t, q, enough))
        return 0;
    w->moved_at_once = stays ? w->moved_at_once : -1;
    ncgen_real *out = yd ? yd : w->emitted;
    const int came_along = yd && ncgen_recursive_projected(r, t, r->q, qd, out);
    if (!yd)
        ncgen_recursive_velocities(r, t, r->q, qd, out);
    ncgen_copy(r->n, out + r->n, r->qd);
    w->came_along = came_along && *ncgen_growth_in(r, out) < R(1.0e30);
    return w->came_along || ncgen_is_finite(r->n, r->qd); /* who wants the derivative looks at it */
}

/* Is a step whose end the recursion does not close better repeated than closed by the matrix? In loops over tables the matrix, which is large,
 * costs as much as hundreds of evaluations, and a step of a quarter of the length closes mostly. */
static int is_repeated_first(const ncgen_run *r, int precise)
{
    const ncgen_constrained *w = r->constrained;
    return !precise && w->is_recursive && !w->motion && !w->uses_matrix && r->dynamics->tree && r->dynamics->tree->n_closing;
}

/* The same with the matrix. */
static int close_by_matrix(ncgen_run *r, ncgen_scalar t, const ncgen_real *y, int factors_are_near, int precise)
{
    ncgen_constrained *w = r->constrained;
    ncgen_copy(2 * r->n, y, r->qd);
    const long steps = r->statistics->newton_steps;
    w->moved_at_once = -1;
    int status = factors_are_near ? NCGEN_OK : refresh(r, t);
    if (status == NCGEN_OK)
        status = project_position(r, t, !factors_are_near);
    const int has_moved = r->statistics->newton_steps > steps + 1; /* so that the factors are those of another place */
    if (status == NCGEN_OK && !factors_are_near && has_moved)
        status = refresh(r, t);
    return status == NCGEN_OK ? project_velocity(r, t, precise > 1) : status;
}

/* Position and velocity of the state y onto the constraints, in r->q and r->qd, with the factors of a nearby state unless there are none;
 * enough, yd: as above; precise: 1 where nothing is tried before the matrix but the recursion, 2 where velocities take the least kinetic
 * energy to all digits, too. */
static int project(ncgen_run *r, ncgen_scalar t, const ncgen_real *y, int factors_are_near, ncgen_scalar enough, int precise,
                   ncgen_real *yd)
{
    ncgen_constrained *w = r->constrained;
    w->came_along = 0;
    if (w->is_recursive && !w->uses_matrix && close_by_recursion(r, w, t, y, enough, yd))
        return NCGEN_OK;
    return is_repeated_first(r, precise) ? NCGEN_NOT_CONVERGED : close_by_matrix(r, t, y, factors_are_near, precise);
}

/* precise: with the factors of this state */
int ncgen_project_state(ncgen_run *r, ncgen_scalar t, ncgen_real *y, int precise, ncgen_real *yd)
{
    ncgen_constrained *w = r->constrained;
    const int n = r->n, has_factors = w->is_factored && !ncgen_constrained_is_dense(r) && !precise;
    const int status = project(r, t, y, has_factors, 0, precise, yd);
    w->has_phi_q = status == NCGEN_OK && w->is_factored;
    if (status != NCGEN_OK)
        return status;
    ncgen_real moved = w->moved_at_once;
    if (moved < 0) {
        for (int i = 0; i < n; ++i)
            w->solution[i] = r->q[i] - y[n + i];
        moved = ncgen_constrained_size(r, w->solution);
    }
    if (moved > r->statistics->largest_projection)
        r->statistics->largest_projection = moved;
    ncgen_copy(2 * n, r->qd, y);
    if (w->is_factored)
        ncgen_constrained_rows(r, 1);
    return !yd || ncgen_recursive_taken(r, yd) ? NCGEN_OK : r->derivative(r, t, y, yd);
}

int ncgen_projected_state(ncgen_run *r, ncgen_scalar t, ncgen_real *y)
{
    r->constrained->is_reusable = 0;
    if (!r->options->project && !ncgen_is_stepper(r->options)) {
        ncgen_copy(2 * r->n, y, r->qd);
        return NCGEN_OK;
    }
    const int status = project(r, t, y, 0, r->options->rtol, 1, NULL); /* what is looked at is not gone on from */
    if (status == NCGEN_OK)
        ncgen_copy(2 * r->n, r->qd, y);
    return status;
}
