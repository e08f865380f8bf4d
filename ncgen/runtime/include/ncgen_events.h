/* ncgen_events.h: a motion that continues from call to call through the events of a mechanism.
 *
 * Conditions are watched by ncgen_advance, whose options name them; what happens at an instant is a table of actions.
 */
#ifndef NCGEN_EVENTS_H
#define NCGEN_EVENTS_H

#include "ncgen_event_table.h"

#ifdef __cplusplus
extern "C" {
#endif

struct ncgen_breaks;

/* Events at the start: conditions that are zero there and move on in their direction, p (n_parameters) and the moment being changed as
 * they say. All statuses of these functions leave the caller to go back to what was. */
int ncgen_begin_events(const ncgen_driven *d, const ncgen_events *events, ncgen_real *p, ncgen_moment *moment, ncgen_passage *passage);

/* What is due, and what that brings about at the same instant. */
int ncgen_apply_events(const ncgen_driven *d, const ncgen_events *events, ncgen_real *p, ncgen_moment *moment, ncgen_passage *passage);

/* Mark as due what has come to the other side of zero in its direction, as where p or, for integrators outside, the state was changed.
 * nearly: whether what is not clear of zero counts, too. A gap that is held and no longer pushes is due as well. Returns how many are
 * due, or a negative status. */
int ncgen_mark_events(const ncgen_driven *d, const ncgen_events *events, const ncgen_real *p, const ncgen_moment *moment, int nearly,
    ncgen_passage *passage);

/* For integrators outside: add to the values of conditions (count) how much more of gaps they are to see, so that one that is closed where a
 * motion begins changes its sign when it falls. */
int ncgen_add_margins(const ncgen_driven *d, const ncgen_events *events, const ncgen_real *p, const ncgen_moment *moment,
    ncgen_passage *passage, ncgen_real *out);

/* ncgen_advance through events, whose conditions options->event watches with the passage's signs, to t_end, past the first instant of events
 * before it where `one` is set, or to the event that ends the motion. breaks: NULL, or where laws of time change their formula. */
int ncgen_advance_through_events(const ncgen_driven *d, const struct ncgen_breaks *breaks, const ncgen_events *events, ncgen_real *p,
    ncgen_moment *moment, ncgen_scalar t_end, int one, ncgen_passage *passage, ncgen_statistics *statistics);

#ifdef __cplusplus
}
#endif

#endif
