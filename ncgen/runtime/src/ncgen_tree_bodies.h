/* ncgen_tree_bodies.h: inertias of the bodies of an open tree, and what moves with links, block by block.
 *
 * Most mass is the same along all axes, M I between two elements, so that an inertia is P = sum of m x y' and h = sum of m x over the
 * members of a body: I = tr(P) 1 - P, B = h x. The reference point, where it is a member, is at x = 0 and counts in h alone.
 */
#ifndef NCGEN_TREE_BODIES_H
#define NCGEN_TREE_BODIES_H

#include "ncgen_tree_work.h"

/* Coordinates, velocities or forces into a place of the slots, ... */
void ncgen_tree_put(const ncgen_run *r, const ncgen_tree_work *w, int place, const ncgen_real *x);

/* ... and velocities or accelerations out of them. */
void ncgen_tree_take(const ncgen_run *r, const ncgen_tree_work *w, ncgen_real *x);

/* Velocities of measured coordinates from the rates of the joints, and accelerations from their pushes, for `take`. */
void ncgen_tree_measure_rates(ncgen_tree_work *w);
void ncgen_tree_measure_pushes(ncgen_tree_work *w);

/* Levers, and P and h of the bodies, at the position in w->values, where reference points are known. */
void ncgen_tree_place_bodies(const ncgen_run *r, ncgen_tree_work *w);

/* Velocities of elements from the links' twists; wrenches are zero. */
void ncgen_tree_spread_twists(ncgen_tree_work *w);

/* ... and wrenches of the bodies' own mass, where the joints are not accelerated. */
void ncgen_tree_set_wrenches(ncgen_tree_work *w);

/* Forces along coordinates, in the slots, added to the wrenches, or as the wrenches. */
void ncgen_tree_add_forces(ncgen_tree_work *w, int to_wrenches);

/* As the wrenches, the momenta of the bodies' own mass where coordinates have velocities that their links do not have: w->bias. */
void ncgen_tree_set_momenta(const ncgen_run *r, ncgen_tree_work *w);

/* Accelerations of elements from those of the links without the joints' and what these add. */
void ncgen_tree_spread_changes(ncgen_tree_work *w);

/* Places of elements, where velocities are else, from w->turns and levers of the first position. */
void ncgen_tree_turn_elements(ncgen_tree_work *w);

/* Velocities of elements by what is in the wrenches. */
void ncgen_tree_spread_added(ncgen_tree_work *w);

#endif
