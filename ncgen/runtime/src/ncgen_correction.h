/* ncgen_correction.h: the equations of a step and their Newton steps, which methods for constrained equations share. */
#ifndef NCGEN_CORRECTION_H
#define NCGEN_CORRECTION_H

#include "ncgen_grid.h"

typedef struct ncgen_correction {
    int size;                     /* n, or n + m where multipliers are unknowns */
    ncgen_real *matrix;           /* size x size */
    ncgen_real *right, *x;        /* size; both without units */
    ncgen_real *residual;         /* n + m: what is missing in forces, and Phi */
    ncgen_real *change;           /* n + m: of q or qdd, and of lam */
    ncgen_real *auxiliary;        /* n: the auxiliary acceleration of generalized-alpha */
    ncgen_real *base;             /* 2 n: qd and q without the accelerations at the end of the step */
    ncgen_real *left;             /* nonzeros of Phi_q that the multipliers act by */
    ncgen_real *halfway, *rolled; /* nonzeros of Phi_q in the middle of the step, n + m: for rolling conditions */
    ncgen_real *gap, *along;      /* m, n: what energy-momentum adds to Phi_q in the middle, gap along' */
    int is_corrected;             /* does it? */
    ncgen_real *steps;            /* NCGEN_ALONG_LIMIT x n: of a projection along a direction */
    int *order;
    ncgen_real unit;             /* the largest inertia so far; without inertia it is not that of rounded multipliers */
    ncgen_real power;            /* at the end of the last step */
} ncgen_correction;

int ncgen_is_rounding(const ncgen_run *r, ncgen_real size, ncgen_real last);
ncgen_real *ncgen_phi_q_values(const ncgen_run *r);
void ncgen_subtract_multipliers(const ncgen_run *r, const ncgen_real *values, ncgen_real *forces);
int ncgen_begin_correction(ncgen_run *r, ncgen_scalar t); /* counts a Newton step on the equations of a step, and listens */
int ncgen_find_forces(ncgen_run *r, ncgen_correction *c, ncgen_scalar t);
int ncgen_find_residual(ncgen_run *r, ncgen_correction *c, ncgen_scalar t, ncgen_scalar h);
int ncgen_find_position_residual(ncgen_run *r, ncgen_correction *c, ncgen_scalar t, ncgen_scalar h, const ncgen_real *end);
void ncgen_fill_weight(const ncgen_run *r, ncgen_correction *c, ncgen_real by_qd, ncgen_real by_q);
int ncgen_solve_with_multipliers(ncgen_run *r, ncgen_correction *c, ncgen_real by_qd, ncgen_real by_q, const ncgen_real *left,
                                 ncgen_real step);
int ncgen_end_step(ncgen_run *r, ncgen_stepping *w, ncgen_correction *c, ncgen_scalar t, ncgen_scalar h);

#endif
