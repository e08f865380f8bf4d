/* ncgen_tree_closing.c: how far the coordinates of an open tree are from satisfying its rows, link by link outward. */
#include "ncgen_tree_closing.h"

/* The right sides of the rows that close a link: `step` is zero for its own coordinates. */
NCGEN_SHORT_LOOPS static void find_right(const ncgen_run *r, ncgen_tree_work *w, int link, const ncgen_real *phi, const ncgen_real *step)
{
    const ncgen_tree *tree = w->tree;
    const ncgen_pattern *phi_q = &r->model->phi_q_pattern;
    const int first = tree->row_start[link], count = tree->row_start[link + 1] - first;
    for (int i = 0; i < count; ++i) {
        const int row = tree->rows[first + i];
        ncgen_real rest = -phi[row];
        for (int s = phi_q->indptr[row]; s < phi_q->indptr[row + 1]; ++s)
            rest -= w->jacobian[s] * step[phi_q->indices[s]];
        w->right[i] = rest;
    }
}

static inline void add_row(const int stride, ncgen_real factor, const ncgen_real *NCGEN_RESTRICT row, ncgen_real *NCGEN_RESTRICT sum)
{
    for (int k = 0; k < stride; ++k)
        sum[k] += factor * row[k];
}

/* The products of the rows of a link, in w->gram; these rows stand in w->dense as columns, of which each takes `stride` numbers. */
static inline void multiply_rows(const int stride, const ncgen_tree_work *w, int link)
{
    const ncgen_tree *tree = w->tree;
    const int first = tree->row_start[link], count = tree->row_start[link + 1] - first, width = tree->widths[link];
    for (int j = 0; j < width * stride; ++j)
        w->dense[j] = 0;
    for (int i = 0; i < count; ++i)
        for (int k = tree->own_start[first + i]; k < tree->own_start[first + i + 1]; ++k)
            w->dense[tree->own_place[k] * stride + i] = w->scaled[tree->own[k]];
    for (int i = 0; i < count; ++i) {
        ncgen_real *products = w->gram + i * stride;
        for (int k = 0; k < stride; ++k)
            products[k] = 0;
        for (int c = 0; c < width; ++c)
            add_row(stride, w->dense[c * stride + i], w->dense + c * stride, products);
    }
}

/* Gaussian elimination of a symmetric matrix, and x in place of the right side. A row that those before it imply is left out. */
static inline void solve(const int stride, int count, ncgen_scalar rounding, ncgen_real *a, ncgen_real *right, ncgen_real *pivot)
{
    for (int i = 0; i < count; ++i)
        pivot[i] = 1000 * rounding * a[i * stride + i];
    for (int i = 0; i < count; ++i) {
        const ncgen_real *own = a + i * stride;
        const int is_implied = !(own[i] > pivot[i]);
        pivot[i] = is_implied ? 0 : 1 / own[i]; /* 0: nothing is taken from others, and it moves nothing */
        right[i] = is_implied ? 0 : right[i];
        for (int j = i + 1; j < count; ++j) {
            const ncgen_real share = pivot[i] * own[j];
            add_row(stride, -share, own, a + j * stride);
            right[j] -= share * right[i];
        }
    }
    for (int i = count - 1; i >= 0; --i) {
        ncgen_real x = right[i];
        for (int k = i + 1; k < count; ++k)
            x -= a[i * stride + k] * right[k];
        right[i] = x * pivot[i];
    }
}

static inline void solve_link(const int stride, const ncgen_run *r, ncgen_tree_work *w, int link)
{
    const ncgen_tree *tree = w->tree;
    multiply_rows(stride, w, link);
    solve(stride, tree->row_start[link + 1] - tree->row_start[link], r->rounding, w->gram, w->right, w->right + tree->most_rows);
}

/* The smallest change, in natural sizes, of a link's coordinates that closes its rows, the others' changes being known. Most links have at
 * most 8 rows, nearly all 16: with as many numbers a row the compiler takes vectors. */
static void close_link(const ncgen_run *r, ncgen_tree_work *w, int link, const ncgen_real *phi, ncgen_real *step)
{
    const ncgen_tree *tree = w->tree;
    const int *indices = r->model->phi_q_pattern.indices;
    const int first = tree->row_start[link], count = tree->row_start[link + 1] - first;
    find_right(r, w, link, phi, step);
    if (count <= 8)
        solve_link(8, r, w, link);
    else if (count <= 16)
        solve_link(16, r, w, link);
    else
        solve_link(count, r, w, link);
    for (int i = 0; i < count; ++i)
        for (int k = tree->own_start[first + i]; k < tree->own_start[first + i + 1]; ++k) {
            const int s = tree->own[k], c = indices[s];
            step[c] += w->scaled[s] * r->dynamics->column_sizes[c] * w->right[i];
        }
}

void ncgen_tree_closing(ncgen_run *r, ncgen_tree_work *w, ncgen_scalar t, const ncgen_real *q, ncgen_real *out)
{
    const int n_values = ncgen_nonzeros(&r->model->phi_q_pattern);
    const int *indices = r->model->phi_q_pattern.indices;
    ncgen_real *phi = out + r->n;
    ncgen_phi(r, t, q, phi);
    ncgen_phi_q(r, t, q, w->jacobian);
    for (int s = 0; s < n_values; ++s)
        w->scaled[s] = w->jacobian[s] * r->dynamics->column_sizes[indices[s]];
    for (int i = 0; i < r->n; ++i)
        out[i] = 0;
    for (int link = 0; link < w->tree->n_links; ++link)
        close_link(r, w, link, phi, out);
}
