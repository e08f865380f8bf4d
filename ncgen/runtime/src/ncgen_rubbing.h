/* ncgen_rubbing.h: contacts with friction in the mechanism with switches: in which direction they slide, and whether their loads are
 * determined. */
#ifndef NCGEN_RUBBING_H
#define NCGEN_RUBBING_H

#include "ncgen_active.h"
#include "ncgen_held.h"
#include "ncgen_impacts.h"
#include "ncgen_sliding.h"

/* The contact that sticks where this is held. */
const ncgen_rubbing *ncgen_rubbing_of(const ncgen_events *events, int hold);

/* A contact at the moment that was looked at. */
ncgen_slide ncgen_slide_at(const ncgen_instant *i, const ncgen_rubbing *rubbing);

/* Note in which directions contacts slide, and which velocities steps do not tell from none, before it is chosen what is held. */
void ncgen_keep_slip(const ncgen_instant *i);

/* The forces of contacts of `which` (n_holds), along which they would begin to slide, from the held_conditions. */
void ncgen_keep_ways(const ncgen_instant *i, const int *which, const ncgen_real *pairs);

/* Would a contact that has not moved begin to slide against others that have been released? As a rigid body moves, it will not. */
int ncgen_is_opposed(ncgen_instant *i, const ncgen_rubbing *rubbing, const int *released, int *opposed);

/* Write to p in which direction each contact slides, as what is wanted and released says; those that others hold still keep theirs. */
int ncgen_write_ways(ncgen_instant *i, const ncgen_active *active);

/* A contact in space that has just begun to slide is not yet faster than where it would come to rest: no side is known of its condition. */
int ncgen_forget_sides(ncgen_instant *i);

/* NCGEN_UNDETERMINED unless the loads of any part of the contacts that slide are determined; pairs: room for the held_conditions. That of all
 * together is left to the caller. */
int ncgen_check_parts(ncgen_instant *i, ncgen_real *pairs);

/* Do not watch contacts that cannot slide while others stick. */
int ncgen_skip_prevented(ncgen_instant *i);

#endif
