/* ncgen_closing_tangent.c: Newton's steps, each with its derivative; the last one moves by next to nothing. */
#include "ncgen_closing_tangent.h"

enum { CLOSING_LIMIT = 40 }; /* steps where time does not matter */

int ncgen_close_along(int n, ncgen_closing *closing, ncgen_closing_change *closing_change, ncgen_real t, const ncgen_real *p, const ncgen_real *e,
    ncgen_real *q, ncgen_real *seed, ncgen_real *step, ncgen_real *change)
{
    ncgen_real largest = 1;
    int status = NCGEN_OK;
    for (int k = 0; status == NCGEN_OK && k < CLOSING_LIMIT && largest > e[0]; ++k) {
        status = closing_change(t, q, p, e, seed, change);
        if (status == NCGEN_OK)
            status = closing(t, q, p, e, step);
        largest = 0;
        for (int i = 0; status == NCGEN_OK && i < n; ++i) {
            const ncgen_real size = NCGEN_ABS(step[i]) / (1 + NCGEN_ABS(q[i]));
            if (!(size <= largest))
                largest = size;
            seed[1 + i] += change[i];
            q[i] += step[i];
        }
    }
    return status;
}
