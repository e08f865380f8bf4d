/* ncgen_tree_closing.c: how far the coordinates of an open tree are from satisfying its rows, link by link outward. */
#include "ncgen_closing_rules.h"
#include "ncgen_tree_closing.h"
#include "ncgen_tree_loops.h"
#include "ncgen_tree_positions.h"

/* The right sides of the rows that close a link: the step is zero for its own coordinates. */
NCGEN_SHORT_LOOPS static void find_right(const ncgen_run *r, ncgen_tree_work *w, int link, const ncgen_real *phi)
{
    const ncgen_tree *tree = w->tree;
    const ncgen_pattern *phi_q = &r->model->phi_q_pattern;
    const int first = tree->row_start[link], count = tree->row_start[link + 1] - first;
    for (int i = 0; i < count; ++i) {
        const int row = tree->rows[first + i];
        const int shift = tree->slot_start[first + i] - phi_q->indptr[row];
        ncgen_real rest = -phi[row];
        for (int s = phi_q->indptr[row]; s < phi_q->indptr[row + 1]; ++s)
            rest -= w->jacobian[s] * w->step[tree->slots[shift + s]];
        w->right[i] = rest;
    }
}

/* A row that changes less than this, in natural sizes, with all coordinates of its link says nothing of them. */
static const ncgen_scalar least_entry = R(1.0e-9);

/* The products of the rows of a link, below the diagonal and on it, in w->gram. */
NCGEN_SHORT_LOOPS static void multiply_rows(const ncgen_run *r, ncgen_tree_work *w, int link, int count)
{
    const ncgen_tree *tree = w->tree;
    int entry = tree->entry_start[link];
    for (int i = 0; i < count; ++i) {
        const ncgen_scalar least = least_entry * r->dynamics->row_sizes[tree->rows[tree->row_start[link] + i]];
        for (int j = 0; j <= i; ++j, ++entry) {
            ncgen_real sum = 0;
            for (int s = tree->product_start[entry]; s < tree->product_start[entry + 1]; ++s)
                sum += w->scaled[tree->products[2 * s]] * w->scaled[tree->products[2 * s + 1]];
            w->gram[i * count + j] = sum;
        }
        if (!(w->gram[i * count + i] > least * least))
            w->gram[i * count + i] = 0;
    }
}

/* L D L' x = right, row by row: of a row above only what is eliminated already is read. A row that those before it imply is left out. */
NCGEN_SHORT_LOOPS static void solve(int count, ncgen_scalar rounding, ncgen_real *a, ncgen_real *right, ncgen_real *pivot)
{
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
        const int is_implied = !(rest > 1000 * rounding * size);
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
}

/* The smallest change, in natural sizes, of a link's coordinates that closes its rows, the others' changes being known. */
NCGEN_SHORT_LOOPS static void close_link(const ncgen_run *r, ncgen_tree_work *w, int link, const ncgen_real *phi)
{
    const ncgen_tree *tree = w->tree;
    const ncgen_pattern *phi_q = &r->model->phi_q_pattern;
    const int first = tree->row_start[link], count = tree->row_start[link + 1] - first;
    find_right(r, w, link, phi);
    multiply_rows(r, w, link, count);
    solve(count, r->rounding, w->gram, w->right, w->right + tree->most_rows);
    for (int i = 0; i < count; ++i) {
        const int shift = tree->slot_start[first + i] - phi_q->indptr[tree->rows[first + i]];
        for (int k = tree->own_start[first + i]; k < tree->own_start[first + i + 1]; ++k) {
            const int s = tree->own[k];
            w->step[tree->slots[shift + s]] += w->scaled[s] * r->dynamics->column_sizes[phi_q->indices[s]] * w->right[i];
        }
    }
}

/* A Newton step from a position whose rows are known. */
static void step_by_links(ncgen_run *r, ncgen_tree_work *w, ncgen_scalar t, const ncgen_real *q, ncgen_real *out)
{
    const int n_values = ncgen_nonzeros(&r->model->phi_q_pattern);
    const int *indices = r->model->phi_q_pattern.indices;
    const ncgen_real *phi = out + r->n;
    ncgen_phi_q(r, t, q, w->jacobian);
    for (int s = 0; s < n_values; ++s)
        w->scaled[s] = w->jacobian[s] * r->dynamics->column_sizes[indices[s]];
    for (int i = 0; i < r->n + w->tree->n_copies; ++i)
        w->step[i] = 0;
    for (int link = 0; link < w->tree->n_links; ++link)
        close_link(r, w, link, phi);
    ncgen_copy(r->n, w->step, out);
}

/* The largest residual, in natural sizes, of the rows that close links alone. */
static ncgen_real violation_of_links(const ncgen_run *r, const ncgen_tree_work *w, const ncgen_real *phi)
{
    ncgen_copy(r->m, phi, w->gamma);
    for (int i = 0; i < w->tree->n_opposed; ++i)
        w->gamma[w->tree->closing[i]] = 0;
    return ncgen_largest(r->m, w->gamma, r->dynamics->row_sizes);
}

/* The start, closed to rounding, is the position that others follow from. */
static int begin_closed_form(ncgen_run *r, ncgen_tree_work *w, ncgen_scalar t, ncgen_real *out)
{
    enum { MOST_STEPS = 12 };
    ncgen_tree_mass_at(r, w, t, r->start_q);
    ncgen_copy(r->n, r->start_q, w->placed);
    for (int k = 0; k < MOST_STEPS; ++k) {
        ncgen_phi(r, t, w->placed, out + r->n);
        if (violation_of_links(r, w, out + r->n) <= NCGEN_ROUNDINGS * r->rounding)
            break;
        step_by_links(r, w, t, w->placed, out);
        for (int i = 0; i < r->n; ++i)
            w->placed[i] += out[i];
    }
    return ncgen_tree_keep_first(r, w, w->placed);
}

/* The step to the position of the same measured coordinates, and its rows; 0 where there is none that satisfies them. */
static int close_at_once(ncgen_run *r, ncgen_tree_work *w, ncgen_scalar t, const ncgen_real *q, ncgen_real *out)
{
    if (w->closed_form == NCGEN_UNKNOWN)
        w->closed_form = !r->model->nu && begin_closed_form(r, w, t, out);
    if (!w->closed_form)
        return 0;
    ncgen_tree_place_all(r, w, q);
    ncgen_phi(r, t, w->placed, out + r->n);
    w->closed_form = violation_of_links(r, w, out + r->n) <= r->options->tolerance;
    for (int i = 0; i < r->n; ++i)
        out[i] = w->placed[i] - q[i];
    return w->closed_form;
}

/* ... and to where loops are closed, too, by a Newton step over the joints. */
static void close_loops(ncgen_run *r, ncgen_tree_work *w, ncgen_scalar t, const ncgen_real *q, ncgen_real *out)
{
    const int n = r->n;
    ncgen_real *phi = out + n;
    for (int i = 0; i < n; ++i) {
        w->placed[i] = q[i] + out[i];
        w->still[i] = 0;
    }
    ncgen_tree_velocities(r, w, t, w->placed, w->still, w->room);
    ncgen_phi(r, t, w->placed, w->gamma);
    for (int i = 0; i < n; ++i)
        w->room[i] = 0;
    for (int i = 0; i < w->tree->n_opposed; ++i) {
        const int row = w->tree->closing[i];
        phi[row] = w->gamma[row];
        w->gamma[row] = -w->gamma[row];
    }
    ncgen_tree_close_loops(r, w, t, w->gamma, w->room);
    for (int i = 0; i < n; ++i)
        out[i] += w->room[i];
}

int ncgen_tree_is_in_closed_form(const ncgen_tree_work *w)
{
    return w->closed_form == 1;
}

void ncgen_tree_closing(ncgen_run *r, ncgen_tree_work *w, ncgen_scalar t, const ncgen_real *q, ncgen_real *out)
{
    if (!close_at_once(r, w, t, q, out)) {
        ncgen_phi(r, t, q, out + r->n);
        step_by_links(r, w, t, q, out);
    }
    if (w->tree->n_closing)
        close_loops(r, w, t, q, out);
}
