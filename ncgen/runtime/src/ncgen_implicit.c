/* ncgen_implicit.c: linear systems of implicit methods, and which steps they allow.
 *
 * Newton's method solves (s - J) x = f for numbers s of the method, one of them complex. Since positions change with the
 * velocities, x' = v, half of the unknowns go: (s - J_v - J_x / s) v = f_v + J_x f_x / s. A complex system is solved as a
 * real one of twice the size. Nothing depends on the work, which follows its own sum. With rolling conditions positions are more
 * than velocities, and all unknowns are solved for. Over all coordinates of a tree of bodies J changes along its degrees of freedom
 * alone (ncgen_reduced.c): the system is that of as many velocities, and the others follow from its rows.
 */
#include "ncgen_implicit.h"
#include "ncgen_method.h"
#include "ncgen_lu.h"

void ncgen_implicit_layout(ncgen_run *r, ncgen_stepping *w, ncgen_implicit *m)
{
    const int ny = r->ny;
    int *integers = r->integers ? r->integers + r->n + 2 * r->m : NULL;
    m->is_reduced = ncgen_is_reduced(r->dynamics, r->options);
    m->is_second_order = !(r->partitioning && r->dynamics->positions);
    m->rows = m->is_second_order ? (r->error_size - 1) / 2 : r->error_size - 1;
    m->count = m->is_reduced ? ncgen_reduced_count(r) : m->rows;
    m->width = m->is_second_order ? 2 * m->count : m->count;
    w->new_y = ncgen_take(&r->space, ny);
    w->at = ncgen_take(&r->space, ny);
    ncgen_take_stages(r, w, 2);
    w->interpolant = ncgen_take(&r->space, 3 * ny);
    m->jacobian = ncgen_take(&r->space, (m->is_reduced ? m->count : m->rows) * m->width);
    m->real.matrix = ncgen_take(&r->space, m->count * m->count);
    m->complex.matrix = ncgen_take(&r->space, 4 * m->count * m->count);
    m->real.order = integers;
    m->complex.order = integers ? integers + m->count : NULL;
    m->stages = ncgen_take(&r->space, NCGEN_STAGES * ny);
    m->derivatives = ncgen_take(&r->space, NCGEN_STAGES * ny);
    m->unknowns = ncgen_take(&r->space, NCGEN_STAGES * r->error_size);
    m->right = ncgen_take(&r->space, NCGEN_STAGES * r->error_size);
    m->change = ncgen_take(&r->space, NCGEN_STAGES * r->error_size);
    m->reduced = ncgen_take(&r->space, 6 * m->count);
    if (m->is_reduced)
        ncgen_reduced_layout(r, &m->along, integers ? integers + 3 * m->count : NULL);
}

/* The row of an unknown in the Jacobian. */
static const ncgen_real *row_of(const ncgen_implicit *m, int unknown)
{
    return m->jacobian + (size_t)unknown * (size_t)m->width;
}

/* Factor s - J_v - J_x / s for s = a + ib, or s - J where positions do not follow; parts: 1 where s is real, 2 else. */
int ncgen_shifted_factor(const ncgen_implicit *m, ncgen_shifted *shifted, int parts, ncgen_scalar a, ncgen_scalar b)
{
    const int count = m->count, size = parts * count;
    shifted->parts = parts;
    shifted->inverse[0] = a / (a * a + b * b);
    shifted->inverse[1] = -b / (a * a + b * b);
    for (int i = 0; i < count; ++i) {
        const ncgen_real *row = row_of(m, i);
        for (int j = 0; j < count; ++j) {
            const ncgen_real by_v = row[j], by_x = m->is_second_order ? row[count + j] : 0;
            const ncgen_real real = (i == j ? a : 0) - by_v - shifted->inverse[0] * by_x;
            const ncgen_real imaginary = (i == j ? b : 0) - shifted->inverse[1] * by_x;
            for (int k = 0; k < parts; ++k) {
                ncgen_real *own = shifted->matrix + (size_t)(k * count + i) * (size_t)size;
                own[k * count + j] = real;
                if (parts == 2)
                    own[(1 - k) * count + j] = k == 0 ? -imaginary : imaginary;
            }
        }
    }
    int orientation;
    return ncgen_lu_factor(size, shifted->matrix, shifted->order, &orientation);
}

/* Part k of x / s, where the parts of x are `stride` numbers from each other. */
static ncgen_real over(const ncgen_shifted *s, const ncgen_real *x, int stride, int k)
{
    const ncgen_real own = s->inverse[0] * x[k * stride];
    return s->parts == 1 ? own : own + (k == 0 ? -s->inverse[1] : s->inverse[1]) * x[(1 - k) * stride];
}

/* x of (s - J) x = f over all coordinates, where J sees along the constraints alone: with the measured part u of the velocities and the
 * chosen positions p, s u = f_u + J_v u + J_x p, s p = u + f_p. The others change along the basis by as much as these; what its turning adds,
 * nothing stiff, is left to the next iteration. */
static void solve_reduced(ncgen_run *r, const ncgen_implicit *m, const ncgen_shifted *shifted, const ncgen_real *f, ncgen_real *x)
{
    const int count = m->count, n = m->rows, ny = r->error_size, parts = shifted->parts;
    ncgen_real *right = m->reduced, *u = m->reduced + 2 * count, *p = m->reduced + 4 * count;
    for (int k = 0; k < parts; ++k) {
        ncgen_reduced_measure(r, &m->along, f + k * ny, right + k * count);
        ncgen_reduced_measure_positions(r, &m->along, f + k * ny + n, u + k * count);
    }
    for (int k = 0; k < parts; ++k)
        for (int i = 0; i < count; ++i)
            p[k * count + i] = over(shifted, u + i, count, k);
    for (int k = 0; k < parts; ++k)
        for (int i = 0; i < count; ++i)
            right[k * count + i] += ncgen_dot(count, row_of(m, i) + count, p + k * count);
    ncgen_lu_solve(parts * count, shifted->matrix, shifted->order, right, u);
    for (int k = 0; k < parts; ++k)
        for (int i = 0; i < count; ++i)
            p[k * count + i] += over(shifted, u + i, count, k);
    for (int k = 0; k < parts; ++k) {
        for (int i = 0; i < count; ++i)
            right[i] = ncgen_dot(count, row_of(m, i), u + k * count) + ncgen_dot(count, row_of(m, i) + count, p + k * count);
        ncgen_copy(2 * n, f + k * ny, x + k * ny);
        ncgen_reduced_add(r, &m->along, right, x + k * ny);
        ncgen_reduced_add(r, &m->along, u + k * count, x + k * ny + n);
    }
    for (int i = 0; i < 2 * n; ++i) {
        const ncgen_real sum[2] = {x[i], parts == 2 ? x[ny + i] : 0};
        for (int k = 0; k < parts; ++k)
            x[k * ny + i] = over(shifted, sum, 1, k);
    }
    for (int k = 0; k < parts; ++k)
        x[k * ny + 2 * n] = over(shifted, f + 2 * n, ny, k);
}

/* x of (s - J) x = f; real parts of f and x come first, then their imaginary parts. */
void ncgen_shifted_solve(ncgen_run *r, const ncgen_implicit *m, const ncgen_shifted *shifted, const ncgen_real *f, ncgen_real *x)
{
    const int count = m->count, ny = r->error_size, parts = shifted->parts;
    ncgen_real *right = m->reduced, *v = m->reduced + 2 * count;
    if (m->is_reduced) {
        solve_reduced(r, m, shifted, f, x);
        return;
    }
    for (int k = 0; k < parts; ++k) /* x = f / s for now */
        for (int i = count; i < ny; ++i)
            x[k * ny + i] = over(shifted, f + i, ny, k);
    for (int k = 0; k < parts; ++k)
        for (int i = 0; i < count; ++i)
            right[k * count + i] = f[k * ny + i] + ncgen_dot(m->width - count, m->jacobian + i * m->width + count, x + k * ny + count);
    ncgen_lu_solve(parts * count, shifted->matrix, shifted->order, right, v);
    for (int k = 0; k < parts; ++k)
        for (int i = 0; i < count; ++i) {
            x[k * ny + i] = v[k * count + i];
            if (m->is_second_order)
                x[k * ny + count + i] += over(shifted, v + i, count, k);
        }
}

int ncgen_implicit_jacobian(ncgen_run *r, ncgen_implicit *m, ncgen_scalar t, ncgen_real *y)
{
    r->statistics->jacobians += 1;
    m->factored = 0;
    if (!m->is_reduced)
        return r->jacobian(r, t, y, m->jacobian);
    const int status = ncgen_reduced_jacobian(r, &m->along, t, y, m->jacobian);
    m->count = m->along.count;
    m->width = 2 * m->count;
    return status;
}

int ncgen_implicit_begin(ncgen_run *r, ncgen_stepping *w, ncgen_implicit *m)
{
    int status = r->derivative(r, r->times[0], r->y, w->stage_derivatives[0]);
    if (status == NCGEN_OK && !ncgen_is_finite(r->ny, w->stage_derivatives[0]))
        status = NCGEN_DOMAIN;
    m->factored = 0;
    m->iterations = 0;
    if (status == NCGEN_OK)
        (void)ncgen_accept(r, r->times[0], r->y);
    return status == NCGEN_OK ? ncgen_grid_begin(r, w) : status;
}

ncgen_scalar ncgen_halved_step(ncgen_implicit *m, ncgen_scalar h)
{
    m->factored = 0;
    m->failed_step = h;
    m->relief = 1;
    return R(0.5) * h;
}

ncgen_scalar ncgen_most_growth(ncgen_implicit *m, ncgen_scalar h)
{
    const ncgen_scalar usual = R(10.0), most = R(0.75) * m->failed_step / h;
    if (!(m->failed_step > 0) || most > usual) {
        m->failed_step = 0;
        return usual;
    }
    m->relief = R(1.01) + R(1.3) * (m->relief - 1);
    m->failed_step *= m->relief;
    return most > 1 ? most : 1;
}
