/* ncgen_sparse.c: L D L' of a sparse symmetric quasidefinite matrix, in an order and with a pattern found beforehand.
 *
 * Row after row: row k of L solves L D l = a with the rows above. Its pattern is known, so there are no lists to
 * search, and entry (i, j) of a column stands before entry (k, j) exactly when i < k. A pivot that is too small or has
 * the wrong sign is replaced: without mass a coordinate gets some, which is counted and taken out again by refinement; a row
 * that others imply gets a multiplier of zero.
 */
#include "ncgen_sparse.h"

void ncgen_kkt_layout(ncgen_kkt *k, const ncgen_elimination *plan, int nonzeros, ncgen_space *space)
{
    k->plan = plan;
    k->values = ncgen_take(space, nonzeros);
    k->lower = ncgen_take(space, plan->nonzeros);
    k->pivots = ncgen_take(space, plan->size);
    k->row = ncgen_take(space, plan->size);
    k->diagonal = ncgen_take(space, plan->size);
    k->min_pivot = ncgen_take(space, plan->size);
    k->replacement = ncgen_take(space, plan->size);
    k->permuted = ncgen_take(space, plan->size);
}

/* Pivots that are this near to being replaced have lost about five digits. */
static const ncgen_scalar weak_mass = R(1.0e3), weak_row = R(1.0e7);

/* Factor the matrix of k->values and k->diagonal. */
int ncgen_kkt_factor(ncgen_kkt *k)
{
    const ncgen_elimination *plan = k->plan;
    ncgen_real *NCGEN_RESTRICT lower = k->lower, *NCGEN_RESTRICT row = k->row;
    k->perturbed = k->let_go = k->weak = 0;
    for (int r = 0; r < plan->size; ++r) {
        ncgen_real pivot = k->diagonal[r];
        const int end = plan->entry_start[r + 1];
        for (int e = plan->entry_start[r]; e < end; ++e)
            row[plan->entry_columns[e]] += k->values[plan->entry_values[e]];
        pivot += row[r];
        row[r] = 0;
        for (int s = plan->row_start[r]; s < plan->row_start[r + 1]; ++s) {
            const int column = plan->row_columns[s], place = plan->row_positions[s];
            const ncgen_real value = row[column];
            row[column] = 0;
            for (int i = plan->column_start[column]; i < place; ++i)
                row[plan->column_rows[i]] -= lower[i] * value;
            const ncgen_real share = value * k->pivots[column]; /* inverses are kept */
            lower[place] = share;
            pivot -= share * value;
        }
        if (pivot != pivot)
            return NCGEN_DOMAIN;
        const ncgen_real least = k->min_pivot[r]; /* negative for rows, whose pivots are negative */
        if (least > 0 ? !(pivot > least) : !(pivot < least)) {
            pivot = k->replacement[r];
            k->perturbed += least > 0;
            k->let_go += least < 0;
        } else {
            k->weak += NCGEN_ABS(pivot) < NCGEN_ABS(least) * (least > 0 ? weak_mass : weak_row);
        }
        if (!(NCGEN_ABS(pivot) > 0))
            return NCGEN_SINGULAR;
        k->pivots[r] = 1 / pivot;
    }
    return NCGEN_OK;
}

/* x of the factored matrix; right and x are [coordinates, rows] and may be the same. */
void ncgen_kkt_solve(ncgen_kkt *k, const ncgen_real *right, ncgen_real *x)
{
    const ncgen_elimination *plan = k->plan;
    ncgen_real *NCGEN_RESTRICT b = k->permuted;
    const ncgen_real *NCGEN_RESTRICT lower = k->lower;
    for (int c = 0; c < plan->size; ++c)
        b[c] = right[plan->order[c]];
    for (int c = 0; c < plan->size; ++c) {
        const ncgen_real value = b[c];
        for (int i = plan->column_start[c]; i < plan->column_start[c + 1]; ++i)
            b[plan->column_rows[i]] -= lower[i] * value;
    }
    for (int c = plan->size - 1; c >= 0; --c) {
        ncgen_real sum = b[c] * k->pivots[c];
        for (int i = plan->column_start[c]; i < plan->column_start[c + 1]; ++i)
            sum -= lower[i] * b[plan->column_rows[i]];
        b[c] = sum;
        x[plan->order[c]] = sum;
    }
}
