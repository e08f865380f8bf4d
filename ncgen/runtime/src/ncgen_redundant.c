/* ncgen_redundant.c: which of redundant rows are left out.
 *
 * Combinations y of rows that vanish, Phi_q' y = 0, are found by inverse iteration: the factors of [M Phi_q'; Phi_q -E] with all rows
 * multiply them by 1 / E, and others by less. As many rows are left out as there are combinations, those in which these are largest, so
 * that the rows that count imply them with small shares. It takes the sparse factors and vectors, no array of n x m numbers. The choice
 * stays as long as no share has become much larger.
 */
#include "ncgen_redundant.h"
#include "ncgen_pivots.h"

/* Combinations that are found besides, since at singular positions more of them vanish than elsewhere; iterations of each. */
enum { BESIDES = 3, ITERATIONS = 2 };

/* Nothing is left of a combination that is less than this many roundings once those before it are taken out. */
static const ncgen_scalar nothing_left = R(1.0e4);

/* Shares that have grown this much ask for another choice; by how much the first row is preferred to the last one. */
static const ncgen_scalar much_larger = R(2.0), preference = R(1.0e-6);

int ncgen_combination_count(int m, int rank)
{
    return rank < 0 || rank < BESIDES ? m : m - rank + BESIDES;
}

/* Combination k, in the rows' sizes, and what is left of it in the coordinates'. */
static ncgen_real *combination(const ncgen_run *r, const ncgen_constrained *w, int k)
{
    return w->combinations + (size_t)k * (size_t)(r->n + r->m);
}

static ncgen_real *remainder_of(const ncgen_run *r, const ncgen_constrained *w, int k)
{
    return combination(r, w, k) + r->m;
}

static void add_times(int count, ncgen_real factor, const ncgen_real *x, ncgen_real *sum)
{
    for (int i = 0; i < count; ++i)
        sum[i] += factor * x[i];
}

/* Make a combination orthogonal to those before it, and 1 long; returns how long it was. */
static ncgen_real normalise(const ncgen_run *r, const ncgen_constrained *w, int k)
{
    ncgen_real *y = combination(r, w, k);
    for (int pass = 0; pass < 2; ++pass)
        for (int i = 0; i < k; ++i)
            add_times(r->m, -ncgen_dot(r->m, combination(r, w, i), y), combination(r, w, i), y);
    const ncgen_real size = ncgen_norm(r->m, y);
    for (int i = 0; i < r->m && size > 0; ++i)
        y[i] /= size;
    return size;
}

/* One inverse iteration with the factors of all rows. */
static void iterate(ncgen_run *r, ncgen_constrained *w, ncgen_real *y)
{
    for (int i = 0; i < r->n; ++i)
        w->probe[i] = 0;
    for (int i = 0; i < r->m; ++i)
        w->probe[r->n + i] = NCGEN_SQRT(w->reduced[i]) * y[i];
    ncgen_kkt_solve(&w->kkt, w->probe, w->probe);
    for (int i = 0; i < r->m; ++i)
        y[i] = NCGEN_SQRT(w->reduced[i]) * w->probe[r->n + i];
}

static void find_remainder(const ncgen_run *r, const ncgen_constrained *w, int k)
{
    const ncgen_pattern *phi_q = &r->model->phi_q_pattern;
    const ncgen_real *values = w->kkt.values + w->n_mass, *y = combination(r, w, k);
    ncgen_real *rest = remainder_of(r, w, k);
    for (int j = 0; j < r->n; ++j)
        rest[j] = 0;
    for (int i = 0; i < r->m; ++i)
        for (int e = phi_q->indptr[i]; e < phi_q->indptr[i + 1]; ++e)
            rest[phi_q->indices[e]] += values[e] * y[i] / NCGEN_SQRT(w->reduced[i] * w->natural[phi_q->indices[e]]);
}

/* The combinations that are nearest to vanishing: all that are looked at, or where it is not known how many vanish until some do not. */
static int find_combinations(ncgen_run *r, ncgen_constrained *w)
{
    const int most = ncgen_combination_count(r->m, r->dynamics->n_dependent);
    unsigned seed = 1;
    int count = 0;
    for (int tries = 0, others = 0; tries < most && others < BESIDES; ++tries) {
        ncgen_real *y = combination(r, w, count), size = 0;
        for (int i = 0; i < r->m; ++i)
            y[i] = ncgen_next_random(&seed);
        normalise(r, w, count);
        for (int k = 0; k < ITERATIONS && (k == 0 || size > 0); ++k) {
            iterate(r, w, y);
            const ncgen_real whole = ncgen_norm(r->m, y);
            size = normalise(r, w, count);
            if (!(size > nothing_left * r->rounding * whole))
                size = 0; /* rounding of those before it, which would count as one more that vanishes */
        }
        if (size > 0) /* rows that move coordinates without mass alone may leave nothing */
            find_remainder(r, w, count++);
        others += r->dynamics->n_dependent < 0 && !(size * ncgen_row_compliance(r) > R(0.01));
    }
    return count;
}

/* Take out what does not vanish, the largest first; returns how many combinations are left. */
static int drop_others(ncgen_run *r, ncgen_constrained *w, int count)
{
    const int wanted = r->dynamics->n_dependent < 0 ? 0 : r->m - r->dynamics->n_dependent, length = r->n + r->m;
    for (; count > wanted; --count) {
        int worst = 0;
        ncgen_real largest = -1;
        for (int k = 0; k < count; ++k) {
            const ncgen_real size = ncgen_norm(r->n, remainder_of(r, w, k));
            if (size > largest) {
                largest = size;
                worst = k;
            }
        }
        if (r->dynamics->n_dependent < 0 && !(largest > R(1.0e-9)))
            break;
        ncgen_real *last = combination(r, w, count - 1), *large = combination(r, w, worst);
        for (int i = 0; i < length && worst != count - 1; ++i) {
            const ncgen_real other = last[i];
            last[i] = large[i];
            large[i] = other;
        }
        for (int k = 0; k < count - 1 && largest > 0; ++k)
            add_times(length, -ncgen_dot(r->n, last + r->m, remainder_of(r, w, k)) / (largest * largest), last, combination(r, w, k));
    }
    return count;
}

/* The rows in which orthonormal combinations are largest, one a combination: a QR factorisation with exchange of columns. Of equal ones the
 * first is taken, whatever the rounding. */
static void pick_rows(ncgen_run *r, ncgen_constrained *w, int count)
{
    ncgen_real *size = w->probe, *along = w->probe;
    for (int k = 0; k < count; ++k) {
        for (int i = 0; i < r->m; ++i)
            combination(r, w, k)[i] *= r->dynamics->row_sizes[i] / NCGEN_SQRT(w->reduced[i]);
        normalise(r, w, k);
    }
    for (int done = 0; done < count; ++done) {
        int row = -1;
        for (int i = 0; i < r->m; ++i)
            size[i] = 0;
        for (int k = 0; k < count; ++k)
            for (int i = 0; i < r->m; ++i)
                size[i] += combination(r, w, k)[i] * combination(r, w, k)[i];
        for (int i = 0; i < r->m; ++i) {
            size[i] = w->is_left_out[i] ? -1 : size[i] * (1 - 2 * preference * (ncgen_real)i / (ncgen_real)r->m);
            row = row < 0 || size[i] > size[row] ? i : row;
        }
        w->is_left_out[row] = 1;
        ncgen_real square = 0;
        for (int i = 0; i < r->m; ++i)
            along[i] = 0;
        for (int k = 0; k < count; ++k) {
            const ncgen_real share = combination(r, w, k)[row];
            square += share * share;
            add_times(r->m, share, combination(r, w, k), along);
        }
        for (int k = 0; k < count && square > 0; ++k)
            add_times(r->m, -combination(r, w, k)[row] / square, along, combination(r, w, k));
    }
}

int ncgen_choose_rows(ncgen_run *r, ncgen_constrained *w)
{
    for (int i = 0; i < r->m; ++i)
        w->is_left_out[i] = 0;
    ncgen_set_diagonal(r, w, 1);
    const int status = ncgen_constrained_factor(r);
    if (status == NCGEN_OK)
        pick_rows(r, w, drop_others(r, w, find_combinations(r, w)));
    ncgen_set_diagonal(r, w, 0);
    w->largest_share = 0;
    return status;
}

/* All rows that are left out are added up, with factors of size 1 to 2 that do not cancel, and found as a sum of those that count. */
int ncgen_rows_are_good(ncgen_run *r, ncgen_constrained *w)
{
    const ncgen_pattern *phi_q = &r->model->phi_q_pattern;
    const ncgen_real *values = w->kkt.values + w->n_mass;
    ncgen_real largest = 0;
    unsigned seed = 1;
    for (int i = 0; i < r->n + r->m; ++i)
        w->probe[i] = 0;
    for (int i = 0; i < r->m; ++i) {
        const ncgen_scalar x = ncgen_next_random(&seed), part = (x < 0 ? x - 1 : x + 1) / r->dynamics->row_sizes[i];
        for (int k = phi_q->indptr[i]; k < (w->is_left_out[i] ? phi_q->indptr[i + 1] : phi_q->indptr[i]); ++k)
            w->probe[phi_q->indices[k]] += part * values[k];
    }
    ncgen_kkt_solve(&w->kkt, w->probe, w->probe);
    for (int i = 0; i < r->m; ++i) {
        const ncgen_real share = NCGEN_ABS(w->probe[r->n + i]) * r->dynamics->row_sizes[i];
        largest = share > largest ? share : largest;
    }
    if (!(w->largest_share > 0))
        w->largest_share = largest > 1 ? largest : 1;
    return largest < much_larger * w->largest_share;
}
