/* ncgen_tree.h: the motion of an open tree of bodies by the articulated recursion, in loops over tables. */
#ifndef NCGEN_TREE_H
#define NCGEN_TREE_H

#include "ncgen_tree_records.h"

/* Functions of an ncgen_motion. growth is 0, more where closing rows are about to depend on each other, huge where they do or a joint moves
 * nothing. */
void ncgen_tree_derivative(ncgen_run *r, ncgen_tree_work *w, ncgen_scalar t, const ncgen_real *q, const ncgen_real *qd, ncgen_real *out);
void ncgen_tree_velocities(ncgen_run *r, ncgen_tree_work *w, ncgen_scalar t, const ncgen_real *q, const ncgen_real *qd, ncgen_real *out);

/* How many joints follow no other, the motions of one counted each. */
int ncgen_tree_joints(const ncgen_tree *tree);

/* At the position that was looked at last, the velocities of these joints that the derivative sees in those of all coordinates, whether loops
 * allow them or not: of a measured one that of its coordinate. */
void ncgen_tree_measure(const ncgen_run *r, ncgen_tree_work *w, const ncgen_real *velocities, ncgen_real *chosen);

/* ... and the velocities of all coordinates at those of these joints. */
const ncgen_real *ncgen_tree_along(const ncgen_run *r, ncgen_tree_work *w, const ncgen_real *chosen);

#endif
