/* ncgen_projection.h: states back onto the constraints, for formalisms on all coordinates. */
#ifndef NCGEN_PROJECTION_H
#define NCGEN_PROJECTION_H

#include "ncgen_constrained.h"

enum { NCGEN_ALONG_LIMIT = 30 };

/* r->q onto the constraints along M^-1 Phi_q' of the place of the factors, whatever Phi_q is on the way: of methods that owe what they
 * keep to that direction. steps: NCGEN_ALONG_LIMIT x n */
int ncgen_project_along(ncgen_run *r, ncgen_scalar t, ncgen_real *steps);
int ncgen_project_velocity(ncgen_run *r, ncgen_scalar t); /* r->qd onto their rates, with the factors that are there */
/* The velocity likewise, in the direction of M and Phi_q' without what stands in for missing inertia; kept: n, for accelerations meanwhile */
int ncgen_project_velocity_along(ncgen_run *r, ncgen_scalar t, ncgen_real *kept);

/* As members of a run: a new state onto the constraints, precise with the factors of its own place; an interpolated state. */
int ncgen_project_state(ncgen_run *r, ncgen_scalar t, ncgen_real *y, int precise, ncgen_real *yd);
int ncgen_projected_state(ncgen_run *r, ncgen_scalar t, ncgen_real *y);

#endif
