/* ncgen_tree_closing.h: the positions of an open tree of bodies, in loops over tables. */
#ifndef NCGEN_TREE_CLOSING_H
#define NCGEN_TREE_CLOSING_H

#include "ncgen_tree.h"

/* The function `closing` of an ncgen_motion. */
void ncgen_tree_closing(ncgen_run *r, ncgen_tree_work *w, ncgen_scalar t, const ncgen_real *q, ncgen_real *out);

#endif
