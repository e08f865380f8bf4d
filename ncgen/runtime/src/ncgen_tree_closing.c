/* ncgen_tree_closing.c: how far the coordinates of an open tree are from satisfying its rows, link by link outward. */
#include "ncgen_tree_closing.h"

/* The smallest change, in natural sizes, of a link's coordinates that closes its rows, the others' changes being known. A row that
 * those before it imply is left out. */
static void close_link(const ncgen_run *r, ncgen_tree_work *w, int link, const ncgen_real *phi, ncgen_real *step)
{
    const ncgen_tree *tree = w->tree;
    const ncgen_pattern *phi_q = &r->model->phi_q_pattern;
    const ncgen_scalar *sizes = r->dynamics->column_sizes;
    const int first = tree->row_start[link], count = tree->row_start[link + 1] - first;
    const int begin = tree->unknowns[link], width = tree->unknowns[link + 1] - begin;
    ncgen_real *a = w->gram, *right = w->right, *diagonal = w->right + tree->most_rows;
    for (int i = 0; i < count; ++i) {
        const int row = tree->rows[first + i];
        ncgen_real *own = w->dense + i * width;
        for (int j = 0; j < width; ++j)
            own[j] = 0;
        right[i] = -phi[row];
        for (int s = phi_q->indptr[row]; s < phi_q->indptr[row + 1]; ++s) {
            const int c = phi_q->indices[s];
            if (tree->group[c] == link)
                own[tree->place[c]] = w->jacobian[s] * sizes[c];
            else
                right[i] -= w->jacobian[s] * step[c];
        }
        for (int j = 0; j <= i; ++j)
            a[i * count + j] = ncgen_dot(width, own, w->dense + j * width);
        diagonal[i] = a[i * count + i];
    }
    for (int k = 0; k < count; ++k) {
        const int is_implied = !(a[k * count + k] > 1000 * r->rounding * diagonal[k]);
        for (int i = k; is_implied && i < count; ++i)
            a[i * count + k] = 0;
        if (is_implied) {
            a[k * count + k] = 1;
            for (int j = 0; j < k; ++j)
                a[k * count + j] = 0;
            right[k] = 0;
        }
        for (int i = k + 1; i < count; ++i) {
            const ncgen_real share = a[i * count + k] / a[k * count + k];
            for (int j = k + 1; j <= i; ++j)
                a[i * count + j] -= share * a[j * count + k];
        }
    }
    ncgen_solve_positive_again(count, a, right);
    for (int j = 0; j < width; ++j) {
        const int c = tree->order[begin + j];
        step[c] = 0;
        for (int i = 0; i < count; ++i)
            step[c] += w->dense[i * width + j] * right[i];
        step[c] *= sizes[c];
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
