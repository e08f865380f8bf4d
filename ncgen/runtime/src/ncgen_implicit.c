/* ncgen_implicit.c: linear systems of implicit methods.
 *
 * Newton's method solves (s - J) x = f for numbers s of the method, one of them complex. Since positions change with the
 * velocities, x' = v, half of the unknowns go: (s - J_v - J_x / s) v = f_v + J_x f_x / s. A complex system is solved as a
 * real one of twice the size. Nothing depends on the work, which follows its own sum. With rolling conditions positions are more
 * than velocities, and all unknowns are solved for.
 */
#include "ncgen_implicit.h"
#include "ncgen_lu.h"

void ncgen_implicit_layout(ncgen_run *r, ncgen_stepping *w, ncgen_implicit *m)
{
    const int follows = !(r->partitioning && r->dynamics->positions), width = r->weighed - 1, ny = r->ny;
    const int count = follows ? width / 2 : width;
    int *integers = r->integers ? r->integers + r->n + 2 * r->m : NULL;
    w->new_y = ncgen_take(&r->space, ny);
    w->at = ncgen_take(&r->space, ny);
    w->slopes = ncgen_take(&r->space, 2 * ny);
    w->interpolant = ncgen_take(&r->space, 3 * ny);
    m->follows = follows;
    m->count = count;
    m->width = width;
    m->jacobian = ncgen_take(&r->space, count * width);
    m->real.matrix = ncgen_take(&r->space, count * count);
    m->complex.matrix = ncgen_take(&r->space, 4 * count * count);
    m->real.order = integers;
    m->complex.order = integers ? integers + count : NULL;
    m->stages = ncgen_take(&r->space, NCGEN_STAGES * ny);
    m->rates = ncgen_take(&r->space, NCGEN_STAGES * ny);
    m->unknowns = ncgen_take(&r->space, NCGEN_STAGES * r->weighed);
    m->right = ncgen_take(&r->space, NCGEN_STAGES * r->weighed);
    m->change = ncgen_take(&r->space, NCGEN_STAGES * r->weighed);
    m->reduced = ncgen_take(&r->space, 4 * count);
}

/* Factor s - J_v - J_x / s for s = a + ib, or s - J where positions do not follow; parts: 1 where s is real, 2 else. */
int ncgen_shifted_factor(const ncgen_implicit *m, ncgen_shifted *shifted, int parts, ncgen_scalar a, ncgen_scalar b)
{
    const int count = m->count, size = parts * count;
    shifted->parts = parts;
    shifted->inverse[0] = a / (a * a + b * b);
    shifted->inverse[1] = -b / (a * a + b * b);
    for (int i = 0; i < count; ++i)
        for (int j = 0; j < count; ++j) {
            const ncgen_real by_v = m->jacobian[i * m->width + j], by_x = m->follows ? m->jacobian[i * m->width + count + j] : 0;
            const ncgen_real real = (i == j ? a : 0) - by_v - shifted->inverse[0] * by_x;
            const ncgen_real imaginary = (i == j ? b : 0) - shifted->inverse[1] * by_x;
            for (int k = 0; k < parts; ++k) {
                ncgen_real *row = shifted->matrix + (size_t)(k * count + i) * (size_t)size;
                row[k * count + j] = real;
                if (parts == 2)
                    row[(1 - k) * count + j] = k == 0 ? -imaginary : imaginary;
            }
        }
    int orientation;
    return ncgen_lu_factor(size, shifted->matrix, shifted->order, &orientation);
}

/* x of (s - J) x = f; real parts of f and x come first, then their imaginary parts. */
void ncgen_shifted_solve(const ncgen_run *r, const ncgen_implicit *m, const ncgen_shifted *shifted, const ncgen_real *f,
                          ncgen_real *x)
{
    const int count = m->count, ny = r->weighed, parts = shifted->parts;
    const ncgen_real c = shifted->inverse[0], d = shifted->inverse[1];
    ncgen_real *right = m->reduced, *v = m->reduced + 2 * count;
    for (int k = 0; k < parts; ++k) /* x = f / s for now */
        for (int i = count; i < ny; ++i)
            x[k * ny + i] = c * f[k * ny + i] + (parts == 2 ? (k == 0 ? -d : d) * f[(1 - k) * ny + i] : 0);
    for (int k = 0; k < parts; ++k)
        for (int i = 0; i < count; ++i)
            right[k * count + i] = f[k * ny + i] + ncgen_dot(m->width - count, m->jacobian + i * m->width + count, x + k * ny + count);
    ncgen_lu_solve(parts * count, shifted->matrix, shifted->order, right, v);
    for (int k = 0; k < parts; ++k)
        for (int i = 0; i < count; ++i) {
            x[k * ny + i] = v[k * count + i];
            if (m->follows)
                x[k * ny + count + i] += c * v[k * count + i] + (parts == 2 ? (k == 0 ? -d : d) * v[(1 - k) * count + i] : 0);
        }
}

int ncgen_implicit_jacobian(ncgen_run *r, ncgen_implicit *m, ncgen_scalar t, ncgen_real *y)
{
    r->statistics->jacobians += 1;
    m->factored = 0;
    return r->jacobian(r, t, y, m->jacobian);
}

int ncgen_implicit_begin(ncgen_run *r, ncgen_stepping *w, ncgen_implicit *m)
{
    int status = r->derivative(r, r->times[0], r->y, w->slopes);
    if (status == NCGEN_OK && !ncgen_is_finite(r->ny, w->slopes))
        status = NCGEN_DOMAIN;
    m->factored = 0;
    m->iterations = 0;
    if (status == NCGEN_OK)
        (void)ncgen_accept(r, r->times[0], r->y);
    return status == NCGEN_OK ? ncgen_grid_begin(r, w) : status;
}
