/* ncgen_jacobian.h: how accelerations change with positions and velocities. */
#ifndef NCGEN_JACOBIAN_H
#define NCGEN_JACOBIAN_H

#include "ncgen_state.h"

/* The tangent kernels' values, and changes of the equations of motion. */
typedef struct ncgen_linearisation {
    ncgen_real *stiffness, *damping, *phidd_q, *phidd_qd; /* nonzeros */
    ncgen_real *rolled;                                   /* nonzeros of phidd_q: what qdd = qd adds to it; for rolling conditions */
    ncgen_real *qdd, *lam;                                /* n, m: where they are taken */
    ncgen_real *dq, *dqd;                                 /* n */
    ncgen_real *change;                                   /* n + m: of forces and rows */
} ncgen_linearisation;

void ncgen_linearisation_layout(ncgen_run *r, ncgen_linearisation *w);
int ncgen_constrained_jacobian(ncgen_run *r, ncgen_scalar t, ncgen_real *y, ncgen_real *jacobian);
#ifndef NCGEN_WITHOUT_PARTITIONING
int ncgen_partitioning_jacobian(ncgen_run *r, ncgen_scalar t, ncgen_real *y, ncgen_real *jacobian);
#else
#define ncgen_partitioning_jacobian ncgen_constrained_jacobian
#endif
int ncgen_find_tangents(ncgen_run *r, ncgen_scalar t); /* stiffness and damping at r->q, r->qd and qdd, lam of r->linearisation */

#endif
