/* ncgen_piecewise.c: inputs as tables: polynomials from knot to knot. */
#include "ncgen_runtime.h"

/* The last of the knots first .. end - 1 that is not after t; the first one where t is before them all. */
static int piece_of(const ncgen_scalar *knots, int first, int end, ncgen_scalar t)
{
    int low = first, high = end; /* what is looked for is at low .. high - 1 */
    while (high - low > 1) {
        const int middle = low + (high - low) / 2;
        if (knots[middle] > t)
            high = middle;
        else
            low = middle;
    }
    return low;
}

int ncgen_piecewise_inputs(void *context, ncgen_scalar from, ncgen_scalar t, ncgen_real *values)
{
    const ncgen_piecewise *w = (const ncgen_piecewise *)context;
    const int status = w->others ? w->others(w->context, from, t, values) : NCGEN_OK;
    for (int i = 0; i < w->count; ++i) {
        const int first = w->start[i], end = w->start[i + 1];
        if (first == end)
            continue;
        const int k = piece_of(w->knots, first, end, from);
        const ncgen_scalar *c = w->coefficients + 4 * (size_t)k;
        const ncgen_scalar s = from < w->knots[k] && t < w->knots[k] ? 0 : t - w->knots[k]; /* before the table its first value holds */
        values[i] = ((c[3] * s + c[2]) * s + c[1]) * s + c[0];
    }
    return status;
}
