/* ncgen_grid.h: rows of the time grid and the event, inside steps from y to new_y. */
#ifndef NCGEN_GRID_H
#define NCGEN_GRID_H

#include "ncgen_state.h"

/* What an integrator works in. */
typedef struct ncgen_stepping {
    ncgen_real *new_y, *at;      /* ny: the end of a step, and a state in between */
    ncgen_real *slopes;          /* stages of ny each */
    ncgen_real *interpolant;     /* coefficients of ny each */
    int interpolated;            /* are they those of this step? */
    ncgen_real event;            /* value of the event's function at the last accepted state */
    /* at: the state at t + s h, inside a step from y to new_y */
    int (*interpolate)(ncgen_run *r, struct ncgen_stepping *w, ncgen_scalar t, ncgen_scalar h, ncgen_scalar s);
    int repeated;                /* is the step taken again, since its error was too large or a stage had no derivative, or near such a one? */
    int stiff, not_stiff;        /* steps in a row that spoke for a stiff mechanism, and against it since then */
    int tiny;                    /* looks in a row at steps far too short */
    ncgen_scalar mark;           /* the time at the last look at how far the steps come */
} ncgen_stepping;

/* A step's end has been evaluated last. */
int ncgen_grid_begin(ncgen_run *r, ncgen_stepping *w);
int ncgen_grid_step(ncgen_run *r, ncgen_stepping *w, ncgen_scalar t, ncgen_scalar t_new); /* new_y becomes y */
/* Where a step from t has to end at the latest: at a break, or at the end of the run. Every algorithm that advances time asks. */
ncgen_scalar ncgen_next_break(const ncgen_run *r, ncgen_scalar t, ncgen_scalar end);
/* The same for methods with a fixed step: where that is negative, also the next time of the grid. */
ncgen_scalar ncgen_next_goal(const ncgen_run *r, ncgen_scalar t, ncgen_scalar end);
/* Is t just before a jump? Then t becomes the time just after it, with the same state; for methods that take no step of that length. */
int ncgen_cross_break(ncgen_run *r, ncgen_scalar *t, ncgen_scalar end);
int ncgen_creeps(const ncgen_run *r, ncgen_stepping *w, ncgen_scalar t);
void ncgen_interpolate_cubic(ncgen_run *r, ncgen_stepping *w, const ncgen_real *first, const ncgen_real *last, ncgen_scalar h,
                             ncgen_scalar s);

#endif
