/* ncgen_instant.h: an instant of events, and what conditions are at it. */
#ifndef NCGEN_INSTANT_H
#define NCGEN_INSTANT_H

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
    ncgen_real *arrived, *unseen;                /* n, n: velocities before the instant, and those that steps do not tell from none */
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

/* The side of zero on which a condition is: 1, -1, or 0. */
static inline int ncgen_side(const ncgen_instant *i, int k)
{
    return (i->values[2 * k] > 0) - (i->values[2 * k] < 0);
}

/* The greatest of velocities (n) in natural sizes. */
static inline ncgen_real ncgen_speed(const ncgen_instant *i, const ncgen_real *qd)
{
    return ncgen_largest(i->n, qd, i->d->dynamics->column_sizes);
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

/* How many conditions are those of events. */
static inline int ncgen_n_events(const ncgen_instant *i)
{
    return i->count - i->events->n_velocities;
}

/* The numbers that actions set, and places, at the moment. */
int ncgen_find_numbers(ncgen_instant *i);

/* The greatest of velocities in natural sizes, now or before the instant. */
ncgen_real ncgen_greatest_speed(const ncgen_instant *i);

/* Does a condition, or the velocity that it is, not change but for rounding of the greatest velocity? */
int ncgen_is_still_along(const ncgen_instant *i, int condition, int drifts);

/* Arrays in the workspace of the passage, and the moment's velocities before anything happens. */
void ncgen_open_instant(ncgen_instant *i, const ncgen_driven *d, const ncgen_events *events, ncgen_real *p, ncgen_moment *moment,
    ncgen_passage *passage);

/* The values of the conditions, with their derivatives and scales, at the moment. */
int ncgen_look(ncgen_instant *i);

#endif
