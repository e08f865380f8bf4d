/* ncgen_tree_solve.h: (T'M T) x = right side over the rates of an open tree, by articulated inertias. */
#ifndef NCGEN_TREE_SOLVE_H
#define NCGEN_TREE_SOLVE_H

#include "ncgen_tree_work.h"

/* What factors need of a new w->mass. */
void ncgen_tree_weigh(ncgen_tree_work *w);

/* Momenta and pivots of all screws and groups, from w->mass; 0 where one of them moves nothing. */
int ncgen_tree_factor(ncgen_tree_work *w);

/* The wrenches less those of inertia without accelerations of the joints, where all mass is between members; after ncgen_tree_factor. */
void ncgen_tree_take_inertial(ncgen_tree_work *w);

/* What the wrenches and pushes change the joints' rates by, added to `change` of all links; in w->push. */
void ncgen_tree_solve(ncgen_tree_work *w, ncgen_real *change);

#endif
