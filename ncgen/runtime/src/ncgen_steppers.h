/* ncgen_steppers.h: methods for constrained equations, one a file, and a run over the grid with them. A library that is compiled with
 * NCGEN_WITHOUT_STEPPERS defined goes without them, and refuses such methods. */
#ifndef NCGEN_STEPPERS_H
#define NCGEN_STEPPERS_H

#include "ncgen_grid.h"
#ifndef NCGEN_WITHOUT_STEPPERS
#include "ncgen_correction.h"
#include "ncgen_methods.h"

/* A step from t to t + h, whose end is left in r->q, r->qd and the work in w->new_y. */
typedef int ncgen_stepper(ncgen_run *r, ncgen_stepping *w, ncgen_correction *c, ncgen_scalar t, ncgen_scalar h);
#define DECLARED(method, step, with_tangents) ncgen_stepper step, with_tangents;
NCGEN_STEPPERS(DECLARED)
#undef DECLARED
ncgen_stepper ncgen_ali3p;

void ncgen_steppers_layout(ncgen_run *r, ncgen_stepping *w, ncgen_correction *c);
int ncgen_steppers(ncgen_run *r, ncgen_stepping *w, ncgen_correction *c);
#else
typedef int ncgen_correction;
#define ncgen_steppers_layout(r, w, c) ((void)(c))
#define ncgen_steppers(r, w, c) ((void)(c), NCGEN_ARGUMENT)
#endif

#endif
