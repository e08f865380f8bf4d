/* ncgen_explicit.h: a run over the grid with explicit Runge-Kutta methods. */
#ifndef NCGEN_EXPLICIT_H
#define NCGEN_EXPLICIT_H

#include "ncgen_grid.h"

void ncgen_explicit_layout(ncgen_run *r, ncgen_stepping *w);
int ncgen_explicit(ncgen_run *r, ncgen_stepping *w);

#endif
