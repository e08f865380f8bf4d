/* ncgen_sliding.h: rules of what slides with friction, whatever the mechanism is: whether its loads are determined; in space, when a contact
 * has come to rest, and how one begins to slide. */
#ifndef NCGEN_SLIDING_H
#define NCGEN_SLIDING_H

#include "ncgen_vectors.h"

/* begin functions */

/* The next part of `count` things that slide, after the part that is chosen (count): those of fewer things come first, nothing (all 0) is the first
 * one. Returns 0 behind the last one. Of more than 12 things only single ones and pairs are looked at. */
int ncgen_next_part(int count, int *chosen);

/* Are the loads of a part determined, whose determinant is this, and that without friction `plain`? */
int ncgen_is_positive(ncgen_scalar determinant, ncgen_scalar plain);

/* A velocity of a coordinate of natural size `size` that steps do not tell from none: of an error within the tolerances, or where rtol is 0 a part
 * of what a fixed step changes. */
ncgen_scalar ncgen_unseen_velocity(ncgen_scalar rtol, ncgen_scalar atol, ncgen_scalar step, ncgen_scalar size, ncgen_scalar qd, ncgen_scalar qdd);

/* The sliding velocity that steps may miss around rest, which unseen velocities change by so much. alone: a step may take the whole tolerance */
ncgen_scalar ncgen_missed_speed(ncgen_scalar change, int alone);

/* How long the direction is in which a contact in space begins to slide: much longer than the velocity that friction would give it over its
 * natural size at this deceleration, so that it keeps the direction until it is faster than what steps miss. */
ncgen_scalar ncgen_first_length(ncgen_scalar deceleration, ncgen_scalar size, ncgen_scalar missed);

/* The largest velocity that is known of a slide: the one so far, the present one, and so much of its terms at least that rounding does not hide
 * that it comes to rest. */
ncgen_scalar ncgen_largest_slide(ncgen_scalar so_far, ncgen_scalar speed, ncgen_scalar terms);

/* end functions */

#endif
