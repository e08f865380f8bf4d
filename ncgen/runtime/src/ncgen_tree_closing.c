/* ncgen_tree_closing.c: how far the coordinates of an open tree are from satisfying its rows, link by link outward. */
#include "ncgen_tree_closing.h"

/* The rows that close a link over its own coordinates, in natural sizes, one after the other in w->dense, and their right sides. */
static void find_block(const ncgen_run *r, ncgen_tree_work *w, int link, const ncgen_real *phi, const ncgen_real *step)
{
    const ncgen_tree *tree = w->tree;
    const ncgen_pattern *phi_q = &r->model->phi_q_pattern;
    const ncgen_scalar *sizes = r->dynamics->column_sizes;
    const int first = tree->row_start[link], count = tree->row_start[link + 1] - first;
    const int width = tree->unknowns[link + 1] - tree->unknowns[link];
    for (int j = 0; j < count * width; ++j)
        w->dense[j] = 0;
    for (int i = 0; i < count; ++i) {
        const int row = tree->rows[first + i];
        ncgen_real *own = w->dense + i * width, rest = -phi[row];
        for (int s = phi_q->indptr[row]; s < phi_q->indptr[row + 1]; ++s) {
            const int c = phi_q->indices[s];
            if (tree->group[c] == link)
                own[tree->place[c]] = w->jacobian[s] * sizes[c];
            else
                rest -= w->jacobian[s] * step[c];
        }
        w->right[i] = rest;
    }
}

/* The products of the rows of a block, below the diagonal and on it, in w->gram. */
static void multiply_rows(ncgen_tree_work *w, int count, int width)
{
    for (int i = 0; i < count; ++i) {
        const ncgen_real *own = w->dense + i * width;
        ncgen_real *products = w->gram + i * count;
        for (int j = 0; j <= i; ++j) {
            const ncgen_real *other = w->dense + j * width;
            ncgen_real sum = 0;
            for (int c = 0; c < width; ++c)
                sum += own[c] * other[c];
            products[j] = sum;
        }
    }
}

/* The smallest change, in natural sizes, of a link's coordinates that closes its rows, the others' changes being known. A row that
 * those before it imply is left out. */
static void close_link(const ncgen_run *r, ncgen_tree_work *w, int link, const ncgen_real *phi, ncgen_real *step)
{
    const ncgen_tree *tree = w->tree;
    const int count = tree->row_start[link + 1] - tree->row_start[link];
    const int begin = tree->unknowns[link], width = tree->unknowns[link + 1] - begin;
    ncgen_real *a = w->gram, *right = w->right, *pivot = w->right + tree->most_rows;
    find_block(r, w, link, phi, step);
    multiply_rows(w, count, width);
    /* L D L' row by row: of a row above only what is eliminated already is read. */
    for (int i = 0; i < count; ++i) {
        ncgen_real *own = a + i * count;
        const ncgen_real size = own[i];
        for (int k = 0; k < i; ++k) {
            const ncgen_real *before = a + k * count;
            ncgen_real sum = own[k];
            for (int j = 0; j < k; ++j)
                sum -= own[j] * before[j];
            own[k] = sum;
        }
        ncgen_real rest = size, known = right[i];
        for (int k = 0; k < i; ++k) {
            const ncgen_real share = own[k] * pivot[k];
            rest -= share * own[k];
            known -= share * right[k];
            own[k] = share;
        }
        const int is_implied = !(rest > 1000 * r->rounding * size);
        for (int k = 0; is_implied && k < i; ++k)
            own[k] = 0;
        pivot[i] = is_implied ? 0 : 1 / rest; /* 0: nothing is taken from others, and it moves nothing */
        right[i] = is_implied ? 0 : known;
    }
    for (int i = count - 1; i >= 0; --i) {
        ncgen_real x = right[i] * pivot[i];
        for (int k = i + 1; k < count; ++k)
            x -= a[k * count + i] * right[k];
        right[i] = x;
    }
    for (int j = 0; j < width; ++j)
        w->unknown[j] = 0;
    for (int i = 0; i < count; ++i)
        for (int j = 0; j < width; ++j)
            w->unknown[j] += w->dense[i * width + j] * right[i];
    for (int j = 0; j < width; ++j) {
        const int c = tree->order[begin + j];
        step[c] = w->unknown[j] * r->dynamics->column_sizes[c];
    }
}

void ncgen_tree_closing(ncgen_run *r, ncgen_tree_work *w, ncgen_scalar t, const ncgen_real *q, ncgen_real *out)
{
    ncgen_real *phi = out + r->n;
    ncgen_phi(r, t, q, phi);
    ncgen_phi_q(r, t, q, w->jacobian);
    for (int link = 0; link < w->tree->n_links; ++link)
        close_link(r, w, link, phi, out);
}
