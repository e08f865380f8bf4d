/* ncgen_implicit.h: implicit methods: linear systems, and a run over the grid with each. */
#ifndef NCGEN_IMPLICIT_H
#define NCGEN_IMPLICIT_H

#include "ncgen_grid.h"
#include "ncgen_reduced.h"

enum { NCGEN_STAGES = 3 }; /* of the method that has most */

/* A factored matrix s - J. */
typedef struct ncgen_shifted {
    int parts;                   /* 2 where s is complex */
    ncgen_scalar inverse[2];     /* of s */
    ncgen_real *matrix;
    int *order;
} ncgen_shifted;

/* What an implicit integrator works in besides. */
typedef struct ncgen_implicit {
    int is_second_order;         /* are positions the integrals of as many velocities? */
    int is_reduced;              /* are the unknowns of the linear systems velocities of some coordinates, which the others follow? */
    ncgen_reduced along;         /* where they are */
    int rows;                    /* of the Jacobian: velocities, and positions where these do not follow */
    int count;                   /* unknowns of the linear systems: as many, or fewer where they are reduced */
    int width;                   /* columns of the Jacobian: velocities and positions of the unknowns */
    ncgen_real *jacobian;        /* rows of width */
    ncgen_shifted real, complex;
    int factored, is_current;              /* for this Jacobian and step? Is the Jacobian that of the present state? */
    ncgen_real *stages, *derivatives;      /* three of ny: changes since the start of the step, and derivatives */
    ncgen_real *unknowns, *right, *change; /* three of weighed */
    ncgen_real *reduced;                   /* 6 count */
    int iterations;                        /* of the last step, and how fast they converged */
    ncgen_real rate;
    ncgen_scalar last_step;      /* accepted, and its error; 0 if there is none */
    ncgen_real last_error;
    ncgen_scalar failed_step, relief; /* the last at which Newton's method did not converge, or 0; by which factor that bound is relaxed */
} ncgen_implicit;

void ncgen_implicit_layout(ncgen_run *r, ncgen_stepping *w, ncgen_implicit *m);
int ncgen_implicit_begin(ncgen_run *r, ncgen_stepping *w, ncgen_implicit *m); /* the first derivative, and the grid's first row */
int ncgen_implicit_jacobian(ncgen_run *r, ncgen_implicit *m, ncgen_scalar t, ncgen_real *y);

/* Factor s - J for s = a + ib; parts: 1 where s is real, 2 else. Then x of (s - J) x = f; real parts of f and x come first. */
int ncgen_shifted_factor(const ncgen_implicit *m, ncgen_shifted *shifted, int parts, ncgen_scalar a, ncgen_scalar b);
void ncgen_shifted_solve(ncgen_run *r, const ncgen_implicit *m, const ncgen_shifted *shifted, const ncgen_real *f, ncgen_real *x);

/* The step after one at which Newton's method did not converge, and by which factor a step may grow: those after a failure stay shorter than
 * it, or each would fail and be halved again. That bound is relaxed, slowly at first. */
ncgen_scalar ncgen_halved_step(ncgen_implicit *m, ncgen_scalar h);
ncgen_scalar ncgen_most_growth(ncgen_implicit *m, ncgen_scalar h);

/* The methods, one a file: a run over the grid. */
int ncgen_radau(ncgen_run *r, ncgen_stepping *w, ncgen_implicit *m);
int ncgen_trapezoidal(ncgen_run *r, ncgen_stepping *w, ncgen_implicit *m);

#endif
