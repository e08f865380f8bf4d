/* ncgen_stiffness.h: whether a mechanism is stiff, from the steps of an explicit method. */
#ifndef NCGEN_STIFFNESS_H
#define NCGEN_STIFFNESS_H

#include "ncgen_step_error.h"

/* Is the mechanism stiff? To be called after every accepted step of length h that was not cut short. */
int ncgen_is_stiff(const ncgen_run *r, ncgen_stepping *w, const tableau *method, ncgen_scalar h);

#endif
