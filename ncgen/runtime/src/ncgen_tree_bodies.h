/* ncgen_tree_bodies.h: masses and inertias of the bodies of an open tree. */
#ifndef NCGEN_TREE_BODIES_H
#define NCGEN_TREE_BODIES_H

#include "ncgen_tree_work.h"

/* What inertias need of a new w->mass. */
void ncgen_tree_weigh(ncgen_tree_work *w);

/* Inertias of all bodies, and no wrenches; or those of inertia without accelerations of the joints, where all mass is the same along all
 * axes. */
void ncgen_tree_find_inertias(ncgen_tree_work *w);
void ncgen_tree_find_inertias_and_wrenches(ncgen_tree_work *w);

#endif
