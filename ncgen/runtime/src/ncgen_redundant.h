/* ncgen_redundant.h: which of redundant rows are left out, in w->is_left_out. */
#ifndef NCGEN_REDUNDANT_H
#define NCGEN_REDUNDANT_H

#include "ncgen_constrained.h"

/* How many combinations of rows are looked at where this many rows are independent; rank: as n_dependent of ncgen_dynamics. */
int ncgen_combination_count(int m, int rank);
int ncgen_choose_rows(ncgen_run *r, ncgen_constrained *w); /* from M, Phi_q and the sizes of pivots; leaves the diagonal of this choice */
int ncgen_rows_are_good(ncgen_run *r, ncgen_constrained *w); /* with the factors of the rows that count, at this state or near it */

#endif
