/* ncgen_grid.h: rows of the time grid, inside steps from y to new_y. */
#ifndef NCGEN_GRID_H
#define NCGEN_GRID_H

#include "ncgen_inside.h"

/* A step's end has been evaluated last. */
int ncgen_grid_begin(ncgen_run *r, ncgen_stepping *w);
int ncgen_grid_step(ncgen_run *r, ncgen_stepping *w, ncgen_scalar t, ncgen_scalar t_new); /* new_y becomes y */
/* Where a step from t has to end at the latest: at a break, or at the end of the run. Every algorithm that advances time asks. */
ncgen_scalar ncgen_next_break(const ncgen_run *r, ncgen_scalar t, ncgen_scalar end);
/* The same for methods with a fixed step: where that is negative, also the next time of the grid. */
ncgen_scalar ncgen_next_goal(const ncgen_run *r, ncgen_scalar t, ncgen_scalar end);
/* Is t just before a jump? Then t becomes the time just after it, with the same state; for methods that take no step of that length. */
int ncgen_cross_break(ncgen_run *r, ncgen_scalar *t, ncgen_scalar end);
int ncgen_makes_no_progress(const ncgen_run *r, ncgen_stepping *w, ncgen_scalar t);
void ncgen_interpolate_cubic(ncgen_run *r, ncgen_stepping *w, const ncgen_real *first, const ncgen_real *last, ncgen_scalar h,
                             ncgen_scalar s);

#endif
