/* ncgen_tree.h: the motion of an open tree of bodies by the articulated recursion, in loops over tables. */
#ifndef NCGEN_TREE_H
#define NCGEN_TREE_H

#include "ncgen_tree_records.h"

/* Functions of an ncgen_motion. growth is 0, or huge where a joint moves nothing. */
void ncgen_tree_derivative(ncgen_run *r, ncgen_tree_work *w, ncgen_scalar t, const ncgen_real *q, const ncgen_real *qd, ncgen_real *out);
void ncgen_tree_velocities(ncgen_run *r, ncgen_tree_work *w, ncgen_scalar t, const ncgen_real *q, const ncgen_real *qd, ncgen_real *out);

/* Where all joints are measured: of every one that follows no other its coordinate, and the velocities of all coordinates at rate 1 of
 * this one, a column of n; how many they are. 0 where a joint is not measured. */
int ncgen_tree_basis(const ncgen_run *r, ncgen_tree_work *w, ncgen_scalar t, const ncgen_real *q, ncgen_real *basis, int *chosen);

/* ... the velocities of all coordinates at those of these ones, at the position that was looked at last. */
const ncgen_real *ncgen_tree_along(ncgen_tree_work *w, const ncgen_real *chosen);

#endif
