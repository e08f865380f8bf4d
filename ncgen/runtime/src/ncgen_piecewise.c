/* ncgen_piecewise.c: inputs as tables: polynomials from knot to knot. */
#include "ncgen_math.h"
#include "ncgen_runtime.h"

int ncgen_piecewise_inputs(void *context, ncgen_scalar from, ncgen_scalar t, ncgen_real *values)
{
    const ncgen_piecewise *w = (const ncgen_piecewise *)context;
    const int status = w->others ? w->others(w->context, from, t, values) : NCGEN_OK;
    for (int i = 0; i < w->count; ++i) {
        const int first = w->start[i], end = w->start[i + 1];
        if (first == end)
            continue;
        const int passed = ncgen_knots_passed(w->knots + first, end - first, from), k = first + (passed > 0 ? passed - 1 : 0);
        const ncgen_scalar *c = w->coefficients + 4 * (size_t)k;
        const ncgen_scalar s = from < w->knots[k] && t < w->knots[k] ? 0 : t - w->knots[k]; /* before the table its first value holds */
        values[i] = ((c[3] * s + c[2]) * s + c[1]) * s + c[0];
    }
    return status;
}
