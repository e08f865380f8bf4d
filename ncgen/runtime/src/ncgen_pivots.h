/* ncgen_pivots.h: natural sizes of the pivots of [M Phi_q'; Phi_q -E], its diagonal E, and what replaces pivots that are too small. */
#ifndef NCGEN_PIVOTS_H
#define NCGEN_PIVOTS_H

#include "ncgen_constrained.h"

void ncgen_find_pivot_sizes(ncgen_run *r, ncgen_constrained *w); /* from M and Phi_q in kkt.values */
void ncgen_set_diagonal(ncgen_run *r, ncgen_constrained *w);     /* and the smallest pivots, once rows that others imply are known */

#endif
