/* ncgen_method.h: what a method that was asked for is, and what it needs. */
#ifndef NCGEN_METHOD_H
#define NCGEN_METHOD_H

#include "ncgen_runtime.h"

int ncgen_is_stepper(const ncgen_options *options); /* does the method discretise the constrained equations themselves? */
int ncgen_is_implicit(const ncgen_options *options); /* does it integrate the state derivative with its Jacobian? */
int ncgen_is_fixed_explicit(const ncgen_options *options); /* is it explicit, with steps of a given length, its own or without tolerances? */
int ncgen_is_reduced(const ncgen_dynamics *dynamics, const ncgen_options *options); /* does it solve for degrees of freedom alone? */
int ncgen_uses_tangents(const ncgen_model *model, const ncgen_dynamics *dynamics, const ncgen_options *options);

/* Is there everything that the formalism and the method need? */
int ncgen_is_possible(const ncgen_model *model, const ncgen_dynamics *dynamics, const ncgen_options *options);

#endif
