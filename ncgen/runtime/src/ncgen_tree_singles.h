/* ncgen_tree_singles.h: mass of an open tree's bodies that is not the same along all axes, entry by entry. */
#ifndef NCGEN_TREE_SINGLES_H
#define NCGEN_TREE_SINGLES_H

#include "ncgen_tree_work.h"

/* What mass that is not the same along all axes adds to the inertias of the links. */
void ncgen_tree_add_singles(ncgen_tree_work *w);

/* What it takes to move that mass without accelerations of the joints, from the wrenches. */
void ncgen_tree_push_singles(ncgen_tree_work *w);

#endif
