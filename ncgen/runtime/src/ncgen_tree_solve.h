/* ncgen_tree_solve.h: (T'M T) x = right side over the rates of an open tree, by articulated inertias. */
#ifndef NCGEN_TREE_SOLVE_H
#define NCGEN_TREE_SOLVE_H

#include "ncgen_tree_work.h"

/* Momenta, pivots and pushes of all screws and groups, from inertias and wrenches of the bodies, forces along coordinates and pushes;
 * 0 where a screw or a group moves nothing. */
int ncgen_tree_reduce(ncgen_tree_work *w);

/* Pushes of the screws before anything else: forces along the coordinates that measure them. */
void ncgen_tree_begin_pushes(ncgen_tree_work *w);

/* The pushes alone, momenta and pivots being those of the position already. */
void ncgen_tree_push(ncgen_tree_work *w);

/* Of one link, into arrays of all screws and groups, with the forces along its coordinates; its wrench is then what its parent gets. */
void ncgen_tree_push_link(ncgen_tree_work *w, int link, ncgen_real *pushes, ncgen_real *group_pushes);

/* x grows by what the wrenches, and forces along the coordinates that measure screws, change of the velocities of all coordinates. */
void ncgen_tree_respond_to_wrenches(const ncgen_run *r, ncgen_tree_work *w, ncgen_real *x);

/* What the joints' rates change by, in pushes, and the links by that, in wrenches. */
void ncgen_tree_release(ncgen_tree_work *w);

#endif
