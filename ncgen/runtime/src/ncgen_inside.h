/* ncgen_inside.h: the first of several conditions that is fulfilled inside a step. */
#ifndef NCGEN_INSIDE_H
#define NCGEN_INSIDE_H

#include "ncgen_location.h"

/* Conditions of options->event at the first state, and after a step that was accepted: *happens and the share *s of the step at which the
 * first of them is fulfilled, whose state then is the one that was evaluated last. */
int ncgen_conditions_begin(ncgen_run *r, ncgen_scalar t);
int ncgen_conditions_step(ncgen_run *r, ncgen_stepping *w, ncgen_scalar t, ncgen_scalar h, int *happens, ncgen_scalar *s);

#endif
