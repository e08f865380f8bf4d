/* ncgen_impacts.h: what impulses change at an instant of events. */
#ifndef NCGEN_IMPACTS_H
#define NCGEN_IMPACTS_H

#include "ncgen_instant.h"

/* Can a condition, or a velocity with these derivatives by qd, change with what is held? */
int ncgen_can_move(ncgen_instant *i, int condition, int *can);
int ncgen_can_move_along(ncgen_instant *i, const ncgen_real *direction, int *can);

const ncgen_action *ncgen_impact_of(const ncgen_events *events, int event); /* NULL: it has none */

/* The impacts of events that are due, with the gaps that are closed already; *hit: whether a gap closes. Numbers that actions set are those
 * of the state before. */
int ncgen_hit(ncgen_instant *i, int *hit);

/* Have velocities changed at this instant? */
int ncgen_was_hit(const ncgen_instant *i);

/* The impulses that stop ratchets which run backward, but for those that only just turn, as `happened` (count) says, and those that were held
 * where nothing was hit. */
int ncgen_catch(ncgen_instant *i, const int *happened);

/* The velocities that an event sets, with those of all other coordinates. */
int ncgen_set_velocities(ncgen_instant *i, int event);

#endif
