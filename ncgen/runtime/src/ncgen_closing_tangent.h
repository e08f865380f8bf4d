/* ncgen_closing_tangent.h: how a position that Newton's method brings onto the constraints changes along a direction. */
#ifndef NCGEN_CLOSING_TANGENT_H
#define NCGEN_CLOSING_TANGENT_H

#include "ncgen_math.h"

/* A step towards the constraints, behind which more may stand, and how it changes along a direction; e: a regularisation. */
typedef int ncgen_closing(ncgen_real t, const ncgen_real *q, const ncgen_real *p, const ncgen_real *e, ncgen_real *out);
typedef int ncgen_closing_change(ncgen_real t, const ncgen_real *q, const ncgen_real *p, const ncgen_real *e, const ncgen_real *seed, ncgen_real *out);

/* q (n) onto the constraints, and the direction with it, whose change of q stands in seed[1] and behind it. step, change: room for what the
 * functions write */
int ncgen_close_along(int n, ncgen_closing *closing, ncgen_closing_change *closing_change, ncgen_real t, const ncgen_real *p, const ncgen_real *e,
    ncgen_real *q, ncgen_real *seed, ncgen_real *step, ncgen_real *change);

#endif
