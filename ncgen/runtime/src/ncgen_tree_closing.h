/* ncgen_tree_closing.h: the positions of an open tree of bodies, in loops over tables. */
#ifndef NCGEN_TREE_CLOSING_H
#define NCGEN_TREE_CLOSING_H

#include "ncgen_tree.h"

/* The function `closing` of an ncgen_motion. */
void ncgen_tree_closing(ncgen_run *r, ncgen_tree_work *w, ncgen_scalar t, const ncgen_real *q, ncgen_real *out);

/* Did the last closing give the position in closed form, its measured coordinates as they were? */
int ncgen_tree_is_in_closed_form(const ncgen_tree_work *w);

#endif
