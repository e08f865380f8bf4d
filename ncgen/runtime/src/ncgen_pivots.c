/* ncgen_pivots.c: natural sizes of the pivots of [M Phi_q'; Phi_q -E], its diagonal E, and what replaces pivots that are too small. */
#include "ncgen_pivots.h"

/* The natural size of every diagonal entry: masses, and for rows what they have after elimination of the masses. A row that moves
 * coordinates without mass, too, counts as if it moved these as hard as its others: where it moves the others by nearly nothing, it has a
 * size all the same. */
void ncgen_find_pivot_sizes(ncgen_run *r, ncgen_constrained *w)
{
    const ncgen_pattern *mass = &r->model->mass_pattern, *phi_q = &r->model->phi_q_pattern;
    const ncgen_scalar *sizes = r->dynamics->column_sizes;
    const ncgen_real *values = w->kkt.values + w->n_mass;
    ncgen_real least = 0;
    w->mass_size = 0;
    for (int i = 0; i < r->n; ++i) {
        w->natural[i] = 0;
        for (int k = mass->indptr ? mass->indptr[i] : 0; k < (mass->indptr ? mass->indptr[i + 1] : 0); ++k)
            if (mass->indices[k] == i)
                w->natural[i] = w->kkt.values[k];
        const ncgen_real scaled = w->natural[i] * sizes[i] * sizes[i];
        if (scaled > 0 && (!(least > 0) || scaled < least))
            least = scaled;
        if (scaled > w->mass_size)
            w->mass_size = scaled;
    }
    if (!(least > 0))
        least = w->mass_size = 1;
    for (int i = 0; i < r->m; ++i) {
        ncgen_real own = 0, massive = 0, square = 0;
        for (int k = phi_q->indptr[i]; k < phi_q->indptr[i + 1]; ++k) {
            const int j = phi_q->indices[k];
            const ncgen_real part = values[k] * sizes[j] * values[k] * sizes[j];
            own += w->natural[j] > 0 ? values[k] * values[k] / w->natural[j] : 0;
            massive += w->natural[j] > 0 ? part : 0;
            square += part;
        }
        const ncgen_real size = r->dynamics->row_sizes[i];
        square = square > 0 ? square : size * size;
        w->reduced[i] = own > 0 && massive > 0 ? own / massive * square : square / least;
    }
    for (int i = 0; i < r->n; ++i)
        if (!(w->natural[i] > 0))
            w->natural[i] = least / (sizes[i] * sizes[i]);
}

/* Of all rows, where combinations of them are looked for: those that do not vanish are to be multiplied by nearly nothing. */
ncgen_scalar ncgen_row_compliance(const ncgen_run *r)
{
    return 100 * r->rounding;
}

/* Where M is singular: refinement takes it out at once, also where masses differ by many digits, and pivots are above rounding. Where two
 * vectors of a body are 0.6 degrees apart, less of it costs a digit, and 3,000 roundings cost all. */
static ncgen_scalar compliance_of_singular(const ncgen_run *r)
{
    return R(1.0e5) * r->rounding;
}

/* E of a row. Penalties are what a user gives; where M is singular it only keeps pivots from being zero, so it is small compared with the
 * row's own pivot, whatever the sizes of masses and of rows elsewhere. */
static ncgen_real row_diagonal(ncgen_run *r, const ncgen_constrained *w, int row, int all)
{
    const ncgen_options *o = r->options;
    const ncgen_scalar penalty = o->penalty > 0 ? o->penalty : R(1.0) / NCGEN_SQRT(r->rounding);
    const ncgen_real size = r->dynamics->row_sizes[row];
    if (!all && (o->formalism == NCGEN_PENALTY || o->formalism == NCGEN_AUGMENTED_LAGRANGIAN))
        return size * size / (penalty * w->mass_size);
    return w->reduced[row] * (all ? ncgen_row_compliance(r) : w->iterated ? compliance_of_singular(r) : 0);
}

/* The diagonal -E, the smallest pivots and what replaces them, in the order of elimination.
 *
 * Without a penalty E is zero: near a singular position the constraint forces that are needed there would be lost
 * otherwise. Only a row whose pivot is at rounding is let go, and one that others imply: off the constraints, where the
 * stages of a method are, it contradicts them. */
void ncgen_set_diagonal(ncgen_run *r, ncgen_constrained *w, int all)
{
    const ncgen_scalar precise = NCGEN_SQRT(r->rounding);
    const ncgen_scalar implied = precise * NCGEN_SQRT(precise); /* 2e-12 in double */
    for (int i = 0; i < r->m; ++i)
        w->diagonal[i] = row_diagonal(r, w, i, all);
    w->left_out = 0;
    for (int k = 0; k < w->kkt.plan->size; ++k) {
        const int unknown = w->kkt.plan->order[k];
        const int row = unknown - r->n;
        w->kkt.row[k] = 0;
        w->left_out += row >= 0 && w->is_left_out[row];
        w->kkt.diagonal[k] = row < 0 ? 0 : -w->diagonal[row];
        w->kkt.replacement[k] = row < 0 ? precise * w->natural[unknown]
                                        : all ? -w->diagonal[row] : -w->reduced[row] / (r->rounding * r->rounding);
        if (row < 0 || w->is_left_out[row])
            w->kkt.min_pivot[k] = w->kkt.replacement[k];
        else
            w->kkt.min_pivot[k] = w->diagonal[row] > 0 ? w->kkt.diagonal[k] / 2 : -implied * w->reduced[row];
    }
}
