/* ncgen_tree_loops.c: rows that close loops of a tree of bodies, or couple motions of its joints.
 *
 * What a force along a row, Phi_q', changes in the accelerations of the open tree is one pass inward and one outward with the momenta and
 * pivots that are there. So the multipliers of c rows solve a system of c equations (the Schur complement): G lam = missing with
 * G = Phi_q T (T'M T)^-1 T' Phi_q'. Rows that others imply are left out by pivoting.
 */
#include "ncgen_tree_loops.h"
#include "ncgen_tree_rates.h"
#include "ncgen_tree_solve.h"

/* A pivot below this share of its row's own response is zero: the row is implied by those before it. */
static const ncgen_scalar least_pivot = R(1.0e-9);

/* What is less than this times that share is near to it: a position where rows are about to depend on each other. */
static const ncgen_scalar margin = R(1.0e3);

static ncgen_real row_times(const ncgen_run *r, const ncgen_tree_work *w, int row, const ncgen_real *x)
{
    const ncgen_pattern *phi_q = &r->model->phi_q_pattern;
    ncgen_real sum = 0;
    for (int s = phi_q->indptr[row]; s < phi_q->indptr[row + 1]; ++s)
        sum += w->jacobian[s] * x[phi_q->indices[s]];
    return sum;
}

/* Accelerations of the coordinates of a tree at rest under the forces in w->force. */
static void respond(const ncgen_run *r, ncgen_tree_work *w, ncgen_real *response)
{
    const ncgen_tree *tree = w->tree;
    for (int k = 0; k < tree->n_screws; ++k)
        w->screw[k].push = 0;
    for (int i = 0; i < tree->n_measured; ++i)
        w->screw[tree->measured[2 * i + 1]].push += tree->ratios[i] * w->force[tree->measured[2 * i]];
    for (ncgen_tree_link *own = w->link, *end = own + tree->n_links; own < end; ++own)
        ncgen_set6(ncgen_nothing, own->wrench);
    ncgen_tree_push(w);
    ncgen_tree_release(w);
    const ncgen_tree_element *e = w->element;
    for (const ncgen_tree_link *own = w->link, *end = own + tree->n_links; own < end; ++own)
        for (const ncgen_tree_element *last = e + own->n_elements; e < last; ++e) {
            ncgen_real moved[3];
            ncgen_carried(e, own->wrench, moved);
            for (int i = 0; i < 3; ++i)
                if (e->c[i] < r->n)
                    response[e->c[i]] = moved[i];
        }
    for (int i = 0; i < tree->n_measured; ++i)
        response[tree->measured[2 * i]] = tree->ratios[i] * w->screw[tree->measured[2 * i + 1]].push;
}

/* G = L D L' with the largest pivot first, in w->square by w->order: the number of rows that are independent. */
static int factor(ncgen_tree_work *w)
{
    const int c = w->tree->n_closing;
    ncgen_real *a = w->square;
    w->is_near_singular = 0;
    for (int i = 0; i < c; ++i) {
        w->order[i] = i;
        w->own[i] = a[i * c + i];
    }
    for (int k = 0; k < c; ++k) {
        int best = k;
        ncgen_real largest = 0;
        for (int i = k; i < c; ++i) {
            const int row = w->order[i];
            const ncgen_real share = w->own[row] > 0 ? a[row * c + row] / w->own[row] : 0;
            if (share > largest) {
                largest = share;
                best = i;
            }
        }
        if (!(largest > least_pivot))
            return k;
        w->is_near_singular |= largest < margin * least_pivot;
        const int row = w->order[best];
        w->order[best] = w->order[k];
        w->order[k] = row;
        for (int i = k + 1; i < c; ++i) {
            const int other = w->order[i];
            const ncgen_real share = a[other * c + row] / a[row * c + row];
            for (int j = k + 1; j < c; ++j)
                a[other * c + w->order[j]] -= share * a[w->order[j] * c + row];
            a[row * c + other] = share; /* of L: nothing else is read there any more */
        }
    }
    return c;
}

/* Responses of the tree to all closing rows, and their factored matrix. */
static void find_responses(ncgen_run *r, ncgen_tree_work *w, ncgen_scalar t)
{
    const ncgen_tree *tree = w->tree;
    const ncgen_pattern *phi_q = &r->model->phi_q_pattern;
    const int n = r->n, c = tree->n_closing;
    ncgen_phi_q(r, t, w->values, w->jacobian);
    for (int i = 0; i < c; ++i) {
        const int row = tree->closing[i];
        for (int k = 0; k < n; ++k)
            w->force[k] = 0;
        for (int s = phi_q->indptr[row]; s < phi_q->indptr[row + 1]; ++s)
            w->force[phi_q->indices[s]] = w->jacobian[s];
        respond(r, w, w->responses + (size_t)i * (size_t)n);
        for (int j = 0; j < c; ++j)
            w->square[j * c + i] = row_times(r, w, tree->closing[j], w->responses + (size_t)i * (size_t)n);
    }
    w->n_independent = factor(w);
    w->most_independent = w->n_independent > w->most_independent ? w->n_independent : w->most_independent;
    w->are_there = 1;
}

int ncgen_tree_close_loops(ncgen_run *r, ncgen_tree_work *w, ncgen_scalar t, const ncgen_real *wanted, ncgen_real *x)
{
    const int n = r->n, c = w->tree->n_closing;
    if (!w->are_there)
        find_responses(r, w, t);
    const int count = w->n_independent;
    const ncgen_real *a = w->square;
    for (int i = 0; i < c; ++i)
        w->missing[i] = (wanted ? wanted[w->tree->closing[i]] : 0) - row_times(r, w, w->tree->closing[i], x);
    for (int k = 0; k < count; ++k)
        for (int i = k + 1; i < count; ++i)
            w->missing[w->order[i]] -= a[w->order[k] * c + w->order[i]] * w->missing[w->order[k]];
    for (int k = count - 1; k >= 0; --k) {
        const int row = w->order[k];
        ncgen_real lam = w->missing[row] / a[row * c + row];
        for (int i = k + 1; i < count; ++i)
            lam -= a[row * c + w->order[i]] * w->missing[w->order[i]];
        w->missing[row] = lam;
        const ncgen_real *response = w->responses + (size_t)row * (size_t)n;
        for (int i = 0; i < n; ++i)
            x[i] += lam * response[i];
    }
    return !w->is_near_singular && count == w->most_independent;
}
