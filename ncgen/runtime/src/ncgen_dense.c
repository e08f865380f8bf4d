/* ncgen_dense.c: accelerations through Householder's QR factorisation with exchange of columns.
 *
 * Phi_q' = Q [R11 R12; 0 0] P' gives the rank, a particular acceleration and an orthonormal basis N of the motions:
 *   null space:         N'M N w = N'(Q - M qdd_p), qdd = qdd_p + N w
 *   Udwadia-Phohomsiri: [N'M; Phi_q] qdd = [N'Q; gamma] by least squares, which is their (I - Phi_q+ Phi_q) M as
 *                       far as the solution goes, since N has orthonormal columns and N N' = I - Phi_q+ Phi_q
 * Coordinates and rows are measured in their natural sizes throughout.
 */
#include "ncgen_dense.h"
#include "ncgen_positive.h"

/* A matrix by columns, with its reflections below the diagonal. */
typedef struct orthogonal {
    int rows, columns, rank;
    ncgen_real *a;
    ncgen_real *heads; /* of the reflections I - 2 v v' / v'v */
    int *order;
} orthogonal;

static ncgen_real *column_of(const orthogonal *f, int column)
{
    return f->a + (size_t)column * (size_t)f->rows;
}

/* Apply reflection k to x: v is column k from the diagonal on, its head apart. */
static void reflect(const orthogonal *f, int k, ncgen_real *x)
{
    const ncgen_real *v = column_of(f, k);
    ncgen_real square = f->heads[k] * f->heads[k], along = f->heads[k] * x[k];
    for (int i = k + 1; i < f->rows; ++i) {
        square += v[i] * v[i];
        along += v[i] * x[i];
    }
    if (!(square > 0))
        return;
    along *= 2 / square;
    x[k] -= along * f->heads[k];
    for (int i = k + 1; i < f->rows; ++i)
        x[i] -= along * v[i];
}

static ncgen_real square_below(const orthogonal *f, int column, int from)
{
    const ncgen_real *a = column_of(f, column);
    return ncgen_dot(f->rows - from, a + from, a + from);
}

/* Down to columns of this share of the largest, and to a rank of `most`. */
static void decompose(orthogonal *f, ncgen_real least_share, int most)
{
    int steps = f->rows < f->columns ? f->rows : f->columns;
    steps = most < steps ? most : steps;
    ncgen_real first = 0;
    for (int c = 0; c < f->columns; ++c)
        f->order[c] = c;
    for (f->rank = 0; f->rank < steps; ++f->rank) {
        const int k = f->rank;
        int best = k;
        ncgen_real largest = -1;
        for (int c = k; c < f->columns; ++c) {
            const ncgen_real size = square_below(f, c, k);
            if (!(size <= largest)) {
                largest = size;
                best = c;
            }
        }
        const ncgen_real size = NCGEN_SQRT(largest);
        if (k == 0)
            first = size;
        if (!(size > least_share * first))
            return;
        for (int i = 0; i < f->rows && best != k; ++i) {
            const ncgen_real other = column_of(f, k)[i];
            column_of(f, k)[i] = column_of(f, best)[i];
            column_of(f, best)[i] = other;
        }
        const int other = f->order[k];
        f->order[k] = f->order[best];
        f->order[best] = other;
        ncgen_real *v = column_of(f, k);
        const ncgen_real diagonal = v[k] > 0 ? -size : size;
        f->heads[k] = v[k] - diagonal;
        for (int c = k + 1; c < f->columns; ++c)
            reflect(f, k, column_of(f, c));
        v[k] = diagonal;
    }
}

/* x = Q' x over the rank, or Q x. */
static void rotate(const orthogonal *f, ncgen_real *x)
{
    for (int k = 0; k < f->rank; ++k)
        reflect(f, k, x);
}

static void rotate_back(const orthogonal *f, ncgen_real *x)
{
    for (int k = f->rank - 1; k >= 0; --k)
        reflect(f, k, x);
}

/* Least squares: x of a x = right (which is overwritten), zero beyond the rank. */
static void least_squares(const orthogonal *f, ncgen_real *right, ncgen_real *x)
{
    rotate(f, right);
    for (int k = f->rank - 1; k >= 0; --k) {
        for (int c = k + 1; c < f->rank; ++c)
            right[k] -= column_of(f, c)[k] * right[c];
        right[k] /= column_of(f, k)[k];
    }
    for (int c = 0; c < f->columns; ++c)
        x[f->order[c]] = c < f->rank ? right[c] : 0;
}

/* The shortest x of a' x = right. */
static void shortest(const orthogonal *f, const ncgen_real *right, ncgen_real *x)
{
    for (int k = 0; k < f->rows; ++k)
        x[k] = 0;
    for (int k = 0; k < f->rank; ++k) {
        ncgen_real sum = right[f->order[k]];
        for (int c = 0; c < k; ++c)
            sum -= column_of(f, k)[c] * x[c];
        x[k] = sum / column_of(f, k)[k];
    }
    rotate_back(f, x);
}

/* Phi_q' in natural sizes, by columns; zero where a row is let go. */
static void fill_jacobian(ncgen_run *r, ncgen_constrained *w)
{
    const ncgen_pattern *pattern = &r->model->phi_q_pattern;
    const ncgen_real *values = w->kkt.values + w->n_mass;
    for (int i = 0; i < r->n * r->m; ++i)
        w->jacobian[i] = 0;
    for (int i = 0; i < r->m; ++i)
        for (int k = pattern->indptr[i]; k < (w->is_left_out[i] ? pattern->indptr[i] : pattern->indptr[i + 1]); ++k)
            w->jacobian[(size_t)i * (size_t)r->n + (size_t)pattern->indices[k]] =
                values[k] * r->dynamics->column_sizes[pattern->indices[k]] / r->dynamics->row_sizes[i];
}

/* out = C M C x for coordinates in natural sizes; all of length n, between is overwritten. */
static void times_scaled_mass(ncgen_run *r, ncgen_constrained *w, const ncgen_real *x, ncgen_real *between, ncgen_real *out)
{
    const ncgen_scalar *sizes = r->dynamics->column_sizes;
    for (int i = 0; i < r->n; ++i)
        between[i] = x[i] * sizes[i];
    ncgen_times_mass(r, w->kkt.values, between, out);
    for (int i = 0; i < r->n; ++i)
        out[i] *= sizes[i];
}

/* qdd_p + N w. */
static int by_null_space(ncgen_run *r, ncgen_constrained *w, const orthogonal *f, ncgen_real *x, ncgen_real *missing,
                         ncgen_real *between)
{
    const int n = r->n, free = n - f->rank;
    times_scaled_mass(r, w, x, between, missing);
    for (int i = 0; i < n; ++i)
        missing[i] = w->right[i] * r->dynamics->column_sizes[i] - missing[i];
    ncgen_real *motion = missing + n + r->m; /* free numbers behind */
    for (int a = 0; a < free; ++a) {
        ncgen_real *product = w->square + (size_t)n * (size_t)n; /* m n numbers that are free here, or the one below */
        product = r->m > 0 ? product : between;
        times_scaled_mass(r, w, w->basis + (size_t)a * (size_t)n, between, product);
        for (int b = 0; b <= a; ++b)
            w->square[(size_t)a * (size_t)free + (size_t)b] = ncgen_dot(n, w->basis + (size_t)b * (size_t)n, product);
        motion[a] = ncgen_dot(n, w->basis + (size_t)a * (size_t)n, missing);
    }
    const int status = ncgen_solve_positive(free, w->square, motion);
    for (int a = 0; a < free && status == NCGEN_OK; ++a)
        for (int i = 0; i < n; ++i)
            x[i] += motion[a] * w->basis[(size_t)a * (size_t)n + (size_t)i];
    return status;
}

static int by_least_squares(ncgen_run *r, ncgen_constrained *w, const orthogonal *f, ncgen_real *x, ncgen_real *right,
                            ncgen_real *between)
{
    const int n = r->n, free = n - f->rank;
    orthogonal all = {free + r->m, n, 0, w->square, right + n + r->m, w->columns};
    fill_jacobian(r, w);
    for (int a = 0; a < free; ++a) {
        const ncgen_real *motion = w->basis + (size_t)a * (size_t)n;
        times_scaled_mass(r, w, motion, between, x);
        right[a] = 0;
        for (int i = 0; i < n; ++i) {
            column_of(&all, i)[a] = x[i] / w->mass_size;
            right[a] += motion[i] * w->right[i] * r->dynamics->column_sizes[i] / w->mass_size;
        }
    }
    for (int i = 0; i < r->m; ++i) {
        right[free + i] = w->is_left_out[i] ? 0 : w->right[n + i] / r->dynamics->row_sizes[i];
        for (int j = 0; j < n; ++j)
            column_of(&all, j)[free + i] = w->jacobian[(size_t)i * (size_t)n + (size_t)j];
    }
    decompose(&all, 16 * r->rounding, n);
    if (all.rank < n)
        return NCGEN_SINGULAR;
    least_squares(&all, right, x);
    return NCGEN_OK;
}

/* w->solution of the equations in w->right, with M and Phi_q in w->kkt.values. */
int ncgen_dense_accelerations(ncgen_run *r, ncgen_constrained *w)
{
    const int n = r->n, m = r->m;
    const ncgen_scalar *sizes = r->dynamics->column_sizes;
    ncgen_real *x = w->scaled, *first = x + n + m, *second = first; /* parts of n + m numbers */
    orthogonal f = {n, m, 0, w->jacobian, w->scaled + 3 * (n + m), w->columns};
    fill_jacobian(r, w);
    decompose(&f, R(100.0) * (ncgen_scalar)n * r->rounding, n);
    for (int a = f.rank; a < n; ++a) {
        ncgen_real *motion = w->basis + (size_t)(a - f.rank) * (size_t)n;
        for (int i = 0; i < n; ++i)
            motion[i] = i == a;
        rotate_back(&f, motion);
    }
    for (int i = 0; i < m; ++i)
        w->residual[i] = w->is_left_out[i] ? 0 : w->right[n + i] / r->dynamics->row_sizes[i];
    shortest(&f, w->residual, x);
    int status;
    if (r->options->formalism == NCGEN_NULL_SPACE) {
        status = by_null_space(r, w, &f, x, first, w->residual);
    } else {
        status = by_least_squares(r, w, &f, x, second, w->residual);
        fill_jacobian(r, w);
        f.rank = 0;
        decompose(&f, R(100.0) * (ncgen_scalar)n * r->rounding, n);
    }
    if (status != NCGEN_OK)
        return status;
    for (int i = 0; i < n; ++i)
        w->solution[i] = x[i] * sizes[i];
    ncgen_times_mass(r, w->kkt.values, w->solution, w->residual);
    for (int i = 0; i < n; ++i)
        first[i] = (w->right[i] - w->residual[i]) * sizes[i];
    least_squares(&f, first, w->solution + n);
    for (int i = 0; i < m; ++i)
        w->solution[n + i] /= r->dynamics->row_sizes[i];
    return NCGEN_OK;
}
