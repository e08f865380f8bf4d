/* ncgen_explicit.h: a run over the grid with explicit Runge-Kutta methods. */
#ifndef NCGEN_EXPLICIT_H
#define NCGEN_EXPLICIT_H

#include "ncgen_grid.h"

void ncgen_explicit_layout(ncgen_run *r, ncgen_stepping *w);
int ncgen_explicit(ncgen_run *r, ncgen_stepping *w);

/* What implicit methods share. */
ncgen_real ncgen_weighted_square(const ncgen_run *r, const ncgen_real *x, const ncgen_real *a, const ncgen_real *b);
ncgen_scalar ncgen_first_step(ncgen_run *r, ncgen_stepping *w, int order, ncgen_scalar t, ncgen_scalar span);

#endif
