/* ncgen_modes.h: what is held at one time, and the mechanism that it makes. */
#ifndef NCGEN_MODES_H
#define NCGEN_MODES_H

#include "ncgen_impacts.h"

/* A mechanism with what is watched in it. */
typedef struct ncgen_entered {
    ncgen_driven driven;
    ncgen_dynamics dynamics;
    ncgen_options options;
    ncgen_event watched;
} ncgen_entered;

/* The mechanism with what p says is held; passage: NULL, or where its directions and signs stand. */
void ncgen_enter(const ncgen_driven *d, const ncgen_events *events, const ncgen_real *p, const ncgen_passage *passage, ncgen_entered *in);

/* What p says is held, to flags (n_holds), or from them; locks are left as they are unless `all` is set. */
void ncgen_read_held(const ncgen_events *events, const ncgen_real *p, int *flags);
void ncgen_write_held(const ncgen_events *events, const int *flags, int all, ncgen_real *p);

/* The direction in which a condition happens: 1, -1, 0 for either, 2 for none; as of ncgen_enter. */
int ncgen_way(const ncgen_events *events, const ncgen_real *p, int condition);

/* Can a condition change where locks are closed? */
int ncgen_can_move(ncgen_instant *i, int condition, int *can);

/* Do not watch gaps that are closed, and joints at rest, that cannot move while others are held. i: at the values there */
int ncgen_skip_blocked(ncgen_instant *i, ncgen_entered *in);

/* Mark what its load no longer holds as released, in passage->flags; how many, or a negative status. nearly: also where the load cannot
 * be told from its limit. */
int ncgen_release(const ncgen_events *events, const ncgen_real *p, const ncgen_moment *moment, int nearly, const ncgen_passage *passage);

/* The same for the load condition of this number. */
void ncgen_release_load(const ncgen_events *events, int load, const ncgen_passage *passage);

/* Close a lock where it is, with the impulses of its constraint. */
int ncgen_lock(ncgen_instant *i, int hold);

/* The directions of slip at the start. */
void ncgen_begin_slip(ncgen_instant *i);

/* The largest part of what may be held whose loads all hold: held from here on, with the moment on its constraints. happened (count): what
 * has; resting (count): which gaps are at rest; was_hit: whether velocities have changed at this instant. */
int ncgen_choose_mode(ncgen_instant *i, const int *happened, const int *resting, int was_hit);

#endif
