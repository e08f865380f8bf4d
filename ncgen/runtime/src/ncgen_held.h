/* ncgen_held.h: the mechanism with what p says is held, and the loads that hold it. */
#ifndef NCGEN_HELD_H
#define NCGEN_HELD_H

#include "ncgen_modes.h"

static inline int ncgen_is_lock(const ncgen_hold *hold)
{
    return hold->kind == NCGEN_HOLDS_LOCK;
}

static inline int ncgen_is_gap(const ncgen_hold *hold)
{
    return hold->kind == NCGEN_HOLDS_GAP || hold->kind == NCGEN_HOLDS_RUBBING_GAP;
}

/* Does p say that a contact touches, and does not stick? */
static inline int ncgen_slides(const ncgen_events *events, const ncgen_real *p, const ncgen_rubbing *rubbing)
{
    return rubbing->gap >= 0 && p[events->holds[rubbing->gap].on] > 0 && !(p[events->holds[rubbing->stick].on] > 0);
}

/* Flags of all that may be held: what was held before an instant, what is wanted, to which side what was released begins to move, room for six
 * more, and 1 for contacts that impacts of this instant leave sticking. */
enum { NCGEN_BEFORE, NCGEN_WANTED, NCGEN_RELEASED, NCGEN_ROOM, NCGEN_STUCK = NCGEN_ROOM + 6 };

static inline int *ncgen_flags(const ncgen_events *events, const ncgen_passage *passage, int which)
{
    return passage->flags + which * events->n_holds;
}

/* The mechanism with what p says is held; passage: NULL, or where its directions and signs stand. */
void ncgen_enter_held(const ncgen_driven *d, const ncgen_events *events, const ncgen_real *p, const ncgen_passage *passage, ncgen_entered *in);

/* What p says is held, to `held` (n_holds), or from it, NULL for nothing; locks are left as they are unless `all` is set. */
void ncgen_read_held(const ncgen_events *events, const ncgen_real *p, int *held);
void ncgen_write_held(const ncgen_events *events, const int *held, int all, ncgen_real *p);

/* Has the instant that was last changed what is held? */
int ncgen_holds_others(const ncgen_events *events, const ncgen_real *p, const ncgen_passage *passage);

/* The direction in which a condition happens: 1, -1, 0 for either, NCGEN_UNWATCHED for none. */
int ncgen_way(const ncgen_events *events, const ncgen_real *p, int condition);

/* Are the loads that friction follows determined? pairs: the held_conditions */
int ncgen_is_determined(const ncgen_events *events, const ncgen_real *pairs);

/* Mark what its load no longer holds as released, in passage->flags; how many, or a negative status. nearly: also where the load cannot
 * be told from its limit. */
int ncgen_find_released(const ncgen_events *events, const ncgen_real *p, const ncgen_moment *moment, int nearly, ncgen_passage *passage);

/* What crossed at the end of a run, of so many that were watched: conditions that are due, and what is released. NCGEN_UNDETERMINED where
 * loads that friction follows no longer are. */
int ncgen_mark_crossed(const ncgen_events *events, int count, const int *crossed, const ncgen_passage *passage);

#endif
