/* ncgen_stiffness.h: whether a mechanism is stiff, before the first step of an explicit method and from its steps. */
#ifndef NCGEN_STIFFNESS_H
#define NCGEN_STIFFNESS_H

#include "ncgen_step_error.h"

/* Is the mechanism stiff where the run begins? To be called with the derivative there as that of the first stage; the other stages are room. */
int ncgen_begins_stiff(ncgen_run *r, ncgen_stepping *w, const tableau *method);

/* Is the mechanism stiff? To be called after every accepted step of length h that was not cut short. */
int ncgen_is_stiff(const ncgen_run *r, ncgen_stepping *w, const tableau *method, ncgen_scalar h);

#endif
