/* ncgen_modes.h: which gaps are held closed, and the mechanism that they make. */
#ifndef NCGEN_MODES_H
#define NCGEN_MODES_H

#include "ncgen_event_table.h"

/* The mechanism of the present mode, with what is watched in it. */
typedef struct ncgen_entered {
    ncgen_driven driven;
    ncgen_dynamics dynamics; /* with holds: that of what is held */
    ncgen_options options;
    ncgen_event watched;
} ncgen_entered;

void ncgen_enter(const ncgen_driven *d, const ncgen_events *events, const ncgen_passage *passage, ncgen_entered *in);

/* The same, or with holds the mechanism with what p says is held. */
int ncgen_enter_present(const ncgen_driven *d, const ncgen_events *events, ncgen_real *p, ncgen_moment *moment, ncgen_passage *passage,
    ncgen_entered *in);

/* Gaps that are released, of what crossed at the end of a run in the present mode, `count` conditions. */
void ncgen_mark_crossed_gaps(const ncgen_events *events, int count, const int *crossed, const ncgen_passage *passage);

/* Does the present mode hold the gap of an event? */
int ncgen_holds(const ncgen_events *events, const ncgen_passage *passage, int event);

/* Mark gaps that no longer push as released, in the second half of passage->wanted; how many, or a negative status. nearly: also where
 * the load cannot be told from zero. */
int ncgen_release(const ncgen_events *events, const ncgen_real *p, const ncgen_moment *moment, int nearly, ncgen_passage *passage);

/* Keep the state from which modes are tried, in passage->room. */
void ncgen_begin_modes(int n, const ncgen_moment *moment, const ncgen_passage *passage);

/* The mode that holds the gaps in the first half of passage->wanted is the present one, with the moment on its constraints from the state that
 * was kept; behind that, values and sizes of its conditions and loads are written. NCGEN_AT_REST where no mode holds these gaps. */
int ncgen_try_mode(const ncgen_driven *d, const ncgen_events *events, const ncgen_real *p, ncgen_moment *moment, ncgen_passage *passage);

#endif
