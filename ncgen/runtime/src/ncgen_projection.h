/* ncgen_projection.h: states back onto the constraints, for formalisms on all coordinates. */
#ifndef NCGEN_PROJECTION_H
#define NCGEN_PROJECTION_H

#include "ncgen_constrained.h"

/* r->q and r->qd onto the constraints, with the factors that are there; fresh: they are those of this position. */
int ncgen_project_position(ncgen_run *r, ncgen_scalar t, int fresh);
int ncgen_project_velocity(ncgen_run *r, ncgen_scalar t);

/* As members of a run: a new state onto the constraints, precise with the factors of its own place; an interpolated state. */
int ncgen_settle(ncgen_run *r, ncgen_scalar t, ncgen_real *y, int precise);
int ncgen_projected_state(ncgen_run *r, ncgen_scalar t, ncgen_real *y);

#endif
