/* ncgen_chain.h: rules of events at one instant, whatever a state and an action are: which are due, what they bring about, and the sides of
 * zero on which conditions go on. */
#ifndef NCGEN_CHAIN_H
#define NCGEN_CHAIN_H

#include "ncgen_event_table.h"

/* begin cdef */

/* The events at an instant. A condition is a pair of its value and the size of its terms; its scale is what a gap is compared with. */
typedef struct ncgen_chain {
    int count;             /* of events */
    const int *directions; /* of each: 1 rising, -1 falling, 0 either */
    int *due;              /* of each: 1 if it is to happen; afterwards 0, or 1 for those that would go on without end */
    int *done;             /* of each: 1 if it is one of those that happened last */
    int *happened;         /* of each: 1 if it has */
    ncgen_real *pairs;     /* of each its value and size now, */
    ncgen_real *before;    /* and before the last ones that happened */
    ncgen_real *scales;    /* of each */
    void *context;
    int (*look)(void *context); /* write pairs and scales of the present state */
    int (*act)(void *context);  /* what is due does what it does */
} ncgen_chain;

/* end cdef */
/* begin functions */

/* What is due happens, and what that brings about, until nothing changes. pairs are those of the state before. NCGEN_ENDLESS where that has no
 * end, or the status of a function. */
int ncgen_follow_chain(ncgen_chain *chain);

/* Mark as due what the last changes carried to the other side in its direction, but for what was done; how many. */
int ncgen_find_turned(ncgen_chain *chain);

/* Mark as due what begins at zero and moves on in its direction; rates: of the conditions along the motion; keeps: 1 for an event whose
 * gap does not change; gaps: 1 for events with an impact. Writes the sides; returns -1, or the first gap that is below zero. */
int ncgen_find_first(ncgen_chain *chain, const ncgen_real *rates, const int *gaps, const int *keeps, int *signs);

/* The sides of zero on which conditions go on; above: 1 for gaps that are at rest or were let go, which close if they fall from here on,
 * whatever rounding makes of their values. */
void ncgen_set_sides(const ncgen_chain *chain, const int *above, int *signs);

/* Is a condition zero, but for rounding of states? */
int ncgen_is_zero(ncgen_scalar value, ncgen_scalar scale);

/* Is the next bounce of a gap one that cannot be told from none? scale: what its value is compared with; rate, acceleration: of the
 * gap; noise: share of a scale that has no sign. */
int ncgen_is_at_rest(ncgen_scalar value, ncgen_scalar scale, ncgen_scalar rate, ncgen_scalar acceleration, ncgen_scalar noise);

/* The time in which all bounces of such a gap end. */
ncgen_scalar ncgen_time_of_bounces(ncgen_scalar rate, ncgen_scalar acceleration, ncgen_scalar restitution);

/* end functions */

#endif
