/* ncgen_partitioning.h: coordinate partitioning as a state derivative. */
#ifndef NCGEN_PARTITIONING_H
#define NCGEN_PARTITIONING_H

#include "ncgen_dependent.h"

/* Coordinate partitioning. */
typedef struct ncgen_partitioning {
    ncgen_real *out;                          /* of the last evaluation: qd, zdd, power, amplification */
    ncgen_real *step, *phi;                   /* one behind the other: an emitted Newton step writes both */
    ncgen_choice choices[2];
    ncgen_choice *velocities, *positions;     /* the same one unless there are rolling conditions */
    ncgen_dependent dependent;
    ncgen_scalar turned_at;                   /* where a stage was beyond a singular position the last time; before the run: not yet */
    ncgen_scalar accepted, longest;           /* the end of the last step, and the longest one so far */
    /* Where nothing is emitted, or rows are given, with d dependent and z independent coordinates: */
    ncgen_real *mass;                         /* nonzeros */
    ncgen_real *R, *MR;                       /* z rows of n */
    ncgen_real *place;                        /* R of the positions: a row of n for each independent one */
    ncgen_real *reduced;                      /* z x z */
    ncgen_real *bias, *force, *missing;       /* n */
    ncgen_real *nu, *gamma, *lam;             /* m */
    ncgen_real *column;                       /* d */
} ncgen_partitioning;

/* layout deals out workspace, begin makes the first y. */
void ncgen_partitioning_layout(ncgen_run *r, ncgen_partitioning *w);
void ncgen_partitioning_begin(ncgen_run *r, const ncgen_real *velocities);
int ncgen_partitioning_position(ncgen_run *r, ncgen_scalar t, ncgen_real *y);             /* q of the independent ones in y */
int ncgen_partitioning_accelerate(ncgen_run *r, ncgen_scalar t, const ncgen_real *zd);    /* leaves factors behind */
int ncgen_partitioning_place(ncgen_run *r, ncgen_scalar t, ncgen_real *amplification);     /* R of the positions at r->q */

#endif
