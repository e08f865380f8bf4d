/* ncgen_impacts.h: an instant of events, and what impulses change in it. */
#ifndef NCGEN_IMPACTS_H
#define NCGEN_IMPACTS_H

#include "ncgen_chain.h"
#include "ncgen_event_log.h"
#include "ncgen_vectors.h"

/* An instant on its way; its arrays are in the workspace of the passage. */
typedef struct ncgen_instant {
    const ncgen_driven *d;
    const ncgen_events *events;
    ncgen_real *p;
    ncgen_moment *moment;
    ncgen_passage *passage;
    int n, count;
    ncgen_real *values, *before, *scales;        /* pairs (value, size) of each condition, now and before; scales (count) */
    ncgen_real *derivatives;                     /* count x (2 n + 1) */
    ncgen_real *responses, *G;                   /* most x (n + 1), count x count */
    ncgen_real *kept, *prior, *numbers;          /* n, n: velocities before what is noted, what actions set */
    ncgen_real *arrived;                         /* n: velocities before the instant */
    ncgen_real *sliding;                         /* n_sliding velocities at which contacts slide, and of each its derivatives by qd */
    /* of an impact, as ncgen_impact has them: gaps that take part, and what is known of them */
    ncgen_real *velocities, *impulses, *lost, *terms, *coefficients, *space;
    int *taking, *places, *sticks;
    int *rows; /* of each velocity its condition, or count and the number of a contact's velocity */
} ncgen_instant;

static inline int ncgen_is_closed(const ncgen_instant *i, int k)
{
    return ncgen_is_zero(i->values[2 * k], i->scales[k]);
}

/* The derivatives of a condition by q and qd (n each) and t; of velocities of joints and ratchets those by qd stand first, and 0 for t. */
static inline const ncgen_real *ncgen_gradient(const ncgen_instant *i, int k)
{
    return i->derivatives + (size_t)k * (size_t)(2 * i->n + 1);
}

/* The derivatives of a velocity at which a contact slides by qd. */
static inline const ncgen_real *ncgen_sliding_gradient(const ncgen_instant *i, int number)
{
    return i->sliding + i->events->n_sliding + (size_t)number * (size_t)i->n;
}

/* The values of the conditions, with their derivatives and scales, at the moment. */
int ncgen_look(ncgen_instant *i);

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
