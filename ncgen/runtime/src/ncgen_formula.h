/* ncgen_formula.h: conditions that are no polynomials in time within a step, between bounds on any part of it. */
#ifndef NCGEN_FORMULA_H
#define NCGEN_FORMULA_H

#include "ncgen_crossing.h"
#include "ncgen_enclosure.h"

/* Condition k on the part from `low` to `high` of the step, both shares of it. */
const ncgen_enclosure *ncgen_bounded_formula(const ncgen_formula_step *step, int k, ncgen_scalar low, ncgen_scalar high);

/* Walk through the step for condition k, of a size with which errors are compared. Is there a change of sign, between walk->at and
 * walk->next? Else the walk ends at *reached: 1, or the beginning of a part that has no bounds, whose end is *unbounded, and which the
 * caller is to look at by other means before it continues from there. *parts: how many were bounded in this step. */
int ncgen_walk_formula(const ncgen_formula_step *step, const ncgen_basis *basis, int k, ncgen_scalar size, ncgen_walk *walk,
                       ncgen_scalar *reached, ncgen_scalar *unbounded, int *parts);

#endif
