/* ncgen_tree_loops.h: rows that close loops of a tree of bodies, or couple motions of its joints. */
#ifndef NCGEN_TREE_LOOPS_H
#define NCGEN_TREE_LOOPS_H

#include "ncgen_tree_work.h"

/* Change velocities or accelerations x (n), which the open tree's joints allow, by the least in the sense of kinetic energy so that Phi_q x is
 * `wanted` (n_rows; NULL: zero) in the closing rows. Momenta and pivots are those of the position in w->values. 0 where rows depend
 * on each other that do not elsewhere, or so nearly that a step of refinement does not bring back all digits. w->bias is overwritten. */
int ncgen_tree_close_loops(ncgen_run *r, ncgen_tree_work *w, ncgen_scalar t, const ncgen_real *wanted, ncgen_real *x);

/* Do rows nearly depend on each other at the position of the last call? */
int ncgen_tree_is_near_singular(const ncgen_tree_work *w);

/* x (n) += accelerations of the coordinates of the open tree under the forces in w->force, where nothing else acts or moves. */
void ncgen_tree_respond(const ncgen_run *r, ncgen_tree_work *w, ncgen_real *x);

#endif
