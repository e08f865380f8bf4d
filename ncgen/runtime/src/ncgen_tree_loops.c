/* ncgen_tree_loops.c: rows that close loops of a tree of bodies, or couple motions of its joints.
 *
 * The multipliers of c rows solve a system of c equations (the Schur complement): G lam = missing with G = Phi_q T (T'M T)^-1 T' Phi_q'.
 * A row needs one pass inward, over the links between its own and the ground alone, with the momenta and pivots that are there; then all
 * multipliers together one pass over the tree. Rows that others imply are left out by pivoting.
 */
#include "ncgen_tree_loops.h"
#include "ncgen_tree_bodies.h"
#include "ncgen_tree_rates.h"
#include "ncgen_tree_solve.h"

/* A pivot below this share of its row's own response is zero: the row is implied by those before it. */
static const ncgen_scalar least_pivot = R(1.0e-9);

/* What is less than this is near to it: digits are lost there, and how many is measured by a step of refinement. */
static const ncgen_scalar near_singular = R(1.0e-6);

/* The share of itself that a step of refinement may change. The next one would change the square of it. */
static const ncgen_scalar most_refined = R(1.0e-6);

/* From here on the rows that others imply elsewhere are looked at, too. */
static const ncgen_scalar small_pivot = R(1.0e-4);

static ncgen_real row_times(const ncgen_run *r, const ncgen_tree_work *w, int row, const ncgen_real *x)
{
    const ncgen_pattern *phi_q = &r->model->phi_q_pattern;
    ncgen_real sum = 0;
    for (int s = phi_q->indptr[row]; s < phi_q->indptr[row + 1]; ++s)
        sum += w->jacobian[s] * x[phi_q->indices[s]];
    return sum;
}

/* A force along a row, in w->force. */
static void add_row(const ncgen_run *r, ncgen_tree_work *w, int row, ncgen_real force)
{
    const ncgen_pattern *phi_q = &r->model->phi_q_pattern;
    for (int s = phi_q->indptr[row]; s < phi_q->indptr[row + 1]; ++s)
        w->force[phi_q->indices[s]] += force * w->jacobian[s];
}

static void clear_row(const ncgen_run *r, ncgen_tree_work *w, int row)
{
    const ncgen_pattern *phi_q = &r->model->phi_q_pattern;
    for (int s = phi_q->indptr[row]; s < phi_q->indptr[row + 1]; ++s)
        w->force[phi_q->indices[s]] = 0;
}

void ncgen_tree_respond(const ncgen_run *r, ncgen_tree_work *w, ncgen_real *x)
{
    ncgen_tree_put(r, w, FORCE, w->force);
    ncgen_tree_add_forces(w, 0);
    ncgen_tree_respond_to_wrenches(r, w, x);
}

/* A row of the matrix with its column, and what belongs to it, changes places with another one. */
static void exchange(ncgen_tree_work *w, int i, int k)
{
    const int c = w->n_rows, row = w->order[i];
    const ncgen_real own = w->own[i];
    w->order[i] = w->order[k];
    w->order[k] = row;
    w->own[i] = w->own[k];
    w->own[k] = own;
    for (int j = 0; j < c; ++j) {
        const ncgen_real entry = w->square[i * c + j];
        w->square[i * c + j] = w->square[k * c + j];
        w->square[k * c + j] = entry;
    }
    for (int j = 0; j < c; ++j) {
        const ncgen_real entry = w->square[j * c + i];
        w->square[j * c + i] = w->square[j * c + k];
        w->square[j * c + k] = entry;
    }
}

/* The row with the largest pivot over its own response, from the k-th on; -1 where there is none. */
static int find_pivot(ncgen_tree_work *w, int k)
{
    const int c = w->n_rows;
    int best = -1;
    ncgen_real largest = least_pivot;
    for (int i = k; i < c; ++i) {
        const ncgen_real share = w->own[i] > 0 ? w->square[i * c + i] / w->own[i] : 0;
        if (share > largest) {
            largest = share;
            best = i;
        }
    }
    w->least_share = best >= 0 && largest < w->least_share ? largest : w->least_share;
    return best;
}

/* G = L D L' with the largest pivot first, row by row above the diagonal: the number of rows that are independent, no more than n_closing, since
 * off the closed loops others imply the rest only nearly. Rows that do not respond to one another, such as those of other limbs, take nothing from
 * one another. */
static int factor(ncgen_tree_work *w)
{
    const int c = w->n_rows, most = w->tree->n_closing;
    ncgen_real *a = w->square;
    w->least_share = 1;
    for (int i = 0; i < c; ++i) {
        w->order[i] = i;
        w->own[i] = a[i * c + i];
    }
    for (int k = 0; k < most; ++k) {
        const int best = find_pivot(w, k);
        if (best < 0)
            return k;
        if (best != k)
            exchange(w, best, k);
        ncgen_real *first = a + k * c;
        const ncgen_real inverse = 1 / first[k];
        for (int i = k + 1; i < c; ++i) {
            const ncgen_real share = first[i] * inverse;
            ncgen_real *other = a + i * c;
            if (share > 0 || share < 0)
                for (int j = k + 1; j < c; ++j)
                    other[j] -= share * first[j];
        }
        for (int i = k + 1; i < c; ++i)
            first[i] *= inverse;
    }
    return most;
}

/* What is left of a force along a closing row for every screw on its links' way to the ground, where the joints beyond take their part. */
static void go_inward(ncgen_tree_work *w, int closing, ncgen_real *left)
{
    const ncgen_tree *tree = w->tree;
    const int begin = tree->way_start[closing], end = tree->way_start[closing + 1];
    for (int i = tree->reach_start[closing]; i < tree->reach_start[closing + 1]; ++i)
        left[tree->reach[i]] = 0;
    for (int i = 0; i < tree->n_measured; ++i)
        left[tree->measured[2 * i + 1]] += tree->ratios[i] * w->force[tree->measured[2 * i]];
    for (int i = begin; i < end; ++i)
        ncgen_put6(ncgen_nothing, w->link[tree->way[i]].lane, WRENCH);
    for (int i = begin; i < end; ++i)
        ncgen_tree_push_link(w, tree->way[i], left, left + tree->n_screws);
}

/* The matrix of the closing rows, factored. With L D L' = T'M T as the recursion has it, G = Y' D^-1 Y, where L Y = T' Phi_q'. */
static void factor_rows(const ncgen_run *r, ncgen_tree_work *w)
{
    const ncgen_tree *tree = w->tree;
    const int c = w->n_rows, width = tree->n_screws + tree->n_groups;
    for (int k = 0; k < r->n; ++k)
        w->force[k] = 0;
    for (int i = 0; i < c; ++i) {
        add_row(r, w, tree->closing[i], 1);
        go_inward(w, i, w->left + (size_t)i * (size_t)width);
        clear_row(r, w, tree->closing[i]);
    }
    for (int k = 0; k < tree->n_screws; ++k)
        w->weights[k] = w->screw[k].pivot;
    for (int link = 0; link < (tree->n_groups ? tree->n_links : 0); ++link)
        for (int k = tree->screw_start[link]; k < tree->screw_start[link + 1]; ++k)
            w->weights[k] = tree->coupling[link] < 0 ? w->weights[k] : 0;
    for (int group = 0; group < tree->n_groups; ++group)
        w->weights[tree->n_screws + group] = w->group[2 * group];
    for (int i = 0; i < c; ++i)
        for (int j = 0; j <= i; ++j) {
            const ncgen_real *a = w->left + (size_t)i * (size_t)width, *b = w->left + (size_t)j * (size_t)width;
            ncgen_real sum = 0;
            for (int s = tree->reach_start[j]; s < tree->reach_start[j + 1]; ++s) {
                const int k = tree->reach[s];
                sum += w->weights[k] * a[k] * b[k];
            }
            w->square[i * c + j] = w->square[j * c + i] = sum;
        }
    w->n_independent = factor(w);
}

/* The same at the position in w->values, from where on with the rows that others imply elsewhere where these nearly depend on each other. */
static void find_matrix(ncgen_run *r, ncgen_tree_work *w, ncgen_scalar t)
{
    ncgen_phi_q(r, t, w->values, w->jacobian);
    factor_rows(r, w);
    if (w->n_rows < w->tree->n_opposed && w->least_share < small_pivot) {
        w->n_rows = w->tree->n_opposed;
        factor_rows(r, w);
    }
    w->most_independent = w->n_independent > w->most_independent ? w->n_independent : w->most_independent;
    w->are_there = 1;
}

/* x changed so that Phi_q x is `wanted`, with the factors that are there: `change`, which may be x, grows by what that takes. */
static void close_once(ncgen_run *r, ncgen_tree_work *w, const ncgen_real *wanted, const ncgen_real *x, ncgen_real *change)
{
    const int count = w->n_independent, c = w->n_rows;
    const ncgen_real *a = w->square;
    for (int i = 0; i < c; ++i)
        w->missing[i] = (wanted ? wanted[w->tree->closing[i]] : 0) - row_times(r, w, w->tree->closing[i], x);
    ncgen_real *lam = w->own;
    for (int k = 0; k < count; ++k)
        lam[k] = w->missing[w->order[k]];
    for (int k = 0; k < count; ++k)
        for (int i = k + 1; i < count; ++i)
            lam[i] -= a[k * c + i] * lam[k];
    for (int k = count - 1; k >= 0; --k) {
        lam[k] /= a[k * c + k];
        for (int i = k + 1; i < count; ++i)
            lam[k] -= a[k * c + i] * lam[i];
    }
    for (int i = 0; i < r->n; ++i)
        w->force[i] = 0;
    for (int k = 0; k < count; ++k)
        add_row(r, w, w->tree->closing[w->order[k]], lam[k]);
    ncgen_tree_respond(r, w, change);
}

/* One step of refinement of x; 0 where it changes x so much that the next one would still change more than its last four digits. */
static int refine(ncgen_run *r, ncgen_tree_work *w, const ncgen_real *wanted, ncgen_real *x)
{
    for (int i = 0; i < r->n; ++i)
        w->bias[i] = 0;
    close_once(r, w, wanted, x, w->bias);
    for (int i = 0; i < r->n; ++i)
        x[i] += w->bias[i];
    const ncgen_scalar *sizes = r->dynamics->column_sizes;
    return ncgen_largest(r->n, w->bias, sizes) <= most_refined * ncgen_largest(r->n, x, sizes) + r->rounding;
}

int ncgen_tree_close_loops(ncgen_run *r, ncgen_tree_work *w, ncgen_scalar t, const ncgen_real *wanted, ncgen_real *x)
{
    if (!w->are_there)
        find_matrix(r, w, t);
    close_once(r, w, wanted, x, x);
    return (!ncgen_tree_is_near_singular(w) || refine(r, w, wanted, x)) && w->n_independent == w->most_independent;
}

int ncgen_tree_is_near_singular(const ncgen_tree_work *w)
{
    return w->least_share < near_singular;
}
