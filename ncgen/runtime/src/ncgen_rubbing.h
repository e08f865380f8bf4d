/* ncgen_rubbing.h: contacts with friction in the mechanism with switches: in which direction they slide, and whether their loads are
 * determined. */
#ifndef NCGEN_RUBBING_H
#define NCGEN_RUBBING_H

#include "ncgen_active.h"
#include "ncgen_held.h"
#include "ncgen_impacts.h"

/* The contact that sticks where this is held. */
const ncgen_rubbing *ncgen_rubbing_of(const ncgen_events *events, int hold);

/* Does a contact not slide, but for rounding, at most this velocity in natural sizes being the greatest? */
int ncgen_contact_is_still(const ncgen_instant *i, const ncgen_rubbing *rubbing, ncgen_real speed);

/* Is this the velocity of a contact in space along its direction? It has to become faster than where the contact comes to rest first. */
int ncgen_slides_in_space(const ncgen_events *events, int condition);

/* Did a contact come to rest whose velocity passed zero along its direction? In space it may have turned by 90 degrees. */
int ncgen_comes_to_rest(const ncgen_instant *i, const ncgen_rubbing *rubbing);

/* The directions in which contacts of `which` (n_holds) would begin to slide: those of their forces among the held_conditions. */
void ncgen_keep_ways(const ncgen_instant *i, const int *which, const ncgen_real *pairs);

/* Write to p in which direction each contact slides, as what is wanted and released says. */
void ncgen_write_ways(const ncgen_instant *i, const ncgen_active *active);

/* NCGEN_UNDETERMINED unless the loads of any part of the contacts that slide are determined; pairs: room for the held_conditions. That of all
 * together is left to the caller. */
int ncgen_check_parts(ncgen_instant *i, ncgen_real *pairs);

/* Do not watch contacts that cannot slide while others stick. */
int ncgen_skip_prevented(ncgen_instant *i);

#endif
