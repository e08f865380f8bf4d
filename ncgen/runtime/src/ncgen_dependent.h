/* ncgen_dependent.h: Phi_q^d, the columns of the dependent coordinates of a choice over its kept rows: its factors, and whether a step has
 * passed a position where it is singular. */
#ifndef NCGEN_DEPENDENT_H
#define NCGEN_DEPENDENT_H

#include "ncgen_state.h"

/* A choice of independent coordinates in a run. */
typedef struct ncgen_choice {
    ncgen_partition of;
    int orientation, first_orientation;       /* sign of the determinant of Phi_q^d, now and at the start of the run; 0: not known */
    int has_start, *start_order;              /* row exchanges at the start of the step */
    ncgen_real *start_lu;                     /* factors then */
    int has_turned;                           /* the last orientation is not the first one */
    ncgen_real amplification;                 /* at the start of the run */
} ncgen_choice;

/* Where nothing is emitted, or rows are given, for d dependent coordinates. */
typedef struct ncgen_dependent {
    const ncgen_partition *factored;          /* whose columns have been factored */
    ncgen_real *jacobian;                     /* nonzeros of Phi_q */
    ncgen_real *lu, *columns;                 /* d x d, row by row: factors, and room for what was factored; lu: NULL where there are none */
    ncgen_real *full, *solution;              /* n, and d */
    int *order;                               /* row exchanges */
} ncgen_dependent;

void ncgen_dependent_layout(ncgen_run *r, ncgen_dependent *w, int d);
void ncgen_dependent_start_layout(ncgen_run *r, ncgen_choice *choice, int number, int d);
void ncgen_dependent_begin(ncgen_choice *choice);
int ncgen_dependent_factor(ncgen_run *r, ncgen_dependent *w, ncgen_scalar t, ncgen_choice *choice); /* at r->q */
void ncgen_dependent_note_start(const ncgen_dependent *w, ncgen_choice *choice);                   /* of the step that begins here */
int ncgen_dependent_has_passed(const ncgen_run *r, const ncgen_dependent *w, const ncgen_choice *choice);
void ncgen_dependent_solve(const ncgen_dependent *w, const ncgen_real *right, ncgen_real *x);
void ncgen_dependent_multipliers(const ncgen_run *r, const ncgen_dependent *w, const ncgen_real *right, ncgen_real *lam);

#endif
