/* ncgen_tree_positions.h: positions of an open tree of bodies in closed form. */
#ifndef NCGEN_TREE_POSITIONS_H
#define NCGEN_TREE_POSITIONS_H

#include "ncgen_tree_work.h"

/* Let q be the first position; 0 where a joint is not measured, or turns about several axes, so that no other follows from it. */
int ncgen_tree_keep_first(const ncgen_run *r, ncgen_tree_work *w, const ncgen_real *q);

/* The position whose measured coordinates are those of q, in w->placed. Whether it satisfies the constraints is to be looked at, since the
 * axes of a joint that turns and moves may stand in either of its links. */
void ncgen_tree_place_all(const ncgen_run *r, ncgen_tree_work *w, const ncgen_real *q);

#endif
