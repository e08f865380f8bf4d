/* ncgen_holding.h: what is held from an instant on. */
#ifndef NCGEN_HOLDING_H
#define NCGEN_HOLDING_H

#include "ncgen_held.h"
#include "ncgen_impacts.h"

/* What is held when an instant begins is noted in passage->flags, with directions of contacts that are released, and let go: impulses act on
 * the mechanism with its locks alone. */
int ncgen_begin_instant(ncgen_instant *i);

/* Do not watch gaps that are closed, and joints at rest, that cannot move while others are held. i: with the values there */
int ncgen_skip_blocked(ncgen_instant *i, ncgen_entered *in);

/* Close a lock where it is, with the impulses of its constraint. */
int ncgen_lock(ncgen_instant *i, int hold);

/* The accelerations with what is held at present. */
int ncgen_accelerate(ncgen_instant *i);

/* Those without gaps that have bounced: they were due, or are closed where impulses acted. happened (count): which conditions have;
 * bounced (count): which gaps */
int ncgen_accelerate_open(ncgen_instant *i, const int *happened, int *bounced);

/* The directions of slip at the start. */
void ncgen_begin_slip(ncgen_instant *i);

/* The largest part of what may be held whose loads all hold: held from here on, with the moment on its constraints. happened (count): what
 * has; resting (count): which gaps are at rest; was_hit: whether velocities have changed at this instant. */
int ncgen_choose_held(ncgen_instant *i, const int *happened, const int *resting, int was_hit);

/* The sides on which the conditions of events go on behind an instant; what it released is forgotten. */
int ncgen_find_sides(ncgen_instant *i, const ncgen_chain *chain);

#endif
