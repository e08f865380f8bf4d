/* ncgen_pivots.h: natural sizes of the pivots of [M Phi_q'; Phi_q -E], its diagonal E, and what replaces pivots that are too small. */
#ifndef NCGEN_PIVOTS_H
#define NCGEN_PIVOTS_H

#include "ncgen_constrained.h"

void ncgen_find_pivot_sizes(ncgen_run *r, ncgen_constrained *w); /* from M and Phi_q in kkt.values */
/* And the smallest pivots, once rows that others imply are known; all: with a diagonal for every row, so that all of them have pivots. */
void ncgen_set_diagonal(ncgen_run *r, ncgen_constrained *w, int all);
ncgen_scalar ncgen_row_compliance(const ncgen_run *r); /* that diagonal, over the size that a row's pivot has without it */

#endif
