/* ncgen_impacts.h: what impulses change at an instant of events. */
#ifndef NCGEN_IMPACTS_H
#define NCGEN_IMPACTS_H

#include "ncgen_instant.h"

/* Can a condition, or a velocity with these derivatives by qd, change with what is held? */
int ncgen_can_move(ncgen_instant *i, int condition, int *can);
int ncgen_can_move_along(ncgen_instant *i, const ncgen_real *direction, int *can);

const ncgen_action *ncgen_impact_of(const ncgen_events *events, int event); /* NULL: it has none */

/* Impacts of closed gaps and of those that are due, in two steps. What closes is hit, with restitution, together with what is closed and does not
 * open, and with ratchets that do not run forward. What opened or ran forward before, and would not after that, is then stopped without
 * restitution, together with all that touches; impulses only push, so none is left. due: of each condition, or NULL; *hit: whether a gap
 * closes. Numbers that actions set are those of the state before. */
int ncgen_hit(ncgen_instant *i, const int *due, int *hit);

/* What integrators outside see of a gap is above it by this much: they find no change of the sign of what begins at zero. */
ncgen_real ncgen_margin(const ncgen_instant *i, int k);

/* Have velocities changed at this instant? */
int ncgen_was_hit(const ncgen_instant *i);

/* The same of what actions have left closing or running backward. */
int ncgen_hit_remaining(ncgen_instant *i);

/* The velocities that an event sets, with those of all other coordinates. */
int ncgen_set_velocities(ncgen_instant *i, int event);

#endif
