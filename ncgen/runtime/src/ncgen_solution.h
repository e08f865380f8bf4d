/* ncgen_solution.h: solutions of [M Phi_q'; Phi_q -E] by its factors. */
#ifndef NCGEN_SOLUTION_H
#define NCGEN_SOLUTION_H

#include "ncgen_constrained.h"

int ncgen_constrained_solve(ncgen_run *r); /* solution for what is in right; NCGEN_SINGULAR where the equations do not determine it */
ncgen_real ncgen_rest_of_rows(const ncgen_run *r, const ncgen_constrained *w); /* residual of the rows that count, in their sizes */

#endif
