/* ncgen_step_error.h: errors of steps against their tolerances, and a first step. */
#ifndef NCGEN_STEP_ERROR_H
#define NCGEN_STEP_ERROR_H

#include "ncgen_stages.h"

/* The square of all components that count in units of what is tolerated at a and b, a mean. */
ncgen_real ncgen_weighted_square(const ncgen_run *r, const ncgen_real *x, const ncgen_real *a, const ncgen_real *b);
/* The error of a step over the tolerance; the fraction of the tolerance that a step of a length may have. */
ncgen_real ncgen_step_error(ncgen_run *r, ncgen_stepping *w, const tableau *method, ncgen_scalar h);
ncgen_scalar ncgen_tolerance_fraction(const ncgen_run *r, ncgen_scalar h);
ncgen_scalar ncgen_first_step(ncgen_run *r, ncgen_stepping *w, int order, ncgen_scalar t, ncgen_scalar span);

#endif
