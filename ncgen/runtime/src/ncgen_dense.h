/* ncgen_dense.h: accelerations by QR; and which of redundant rows are farthest from dependent, in w->is_left_out. */
#ifndef NCGEN_DENSE_H
#define NCGEN_DENSE_H

#include "ncgen_constrained.h"

void ncgen_choose_rows(ncgen_run *r, ncgen_constrained *w);
int ncgen_dense_accelerations(ncgen_run *r, ncgen_constrained *w);

#endif
