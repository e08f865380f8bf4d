/* ncgen_sliding.h: rules of what slides with friction, whatever the mechanism is: whether its loads are determined; in space, when a contact
 * has come to rest, and how one begins to slide. */
#ifndef NCGEN_SLIDING_H
#define NCGEN_SLIDING_H

#include "ncgen_active.h"
#include "ncgen_vectors.h"

/* begin cdef */

/* A contact that touches, at a moment. */
typedef struct ncgen_slide {
    int n;                       /* coordinates */
    int directions;              /* 1 in the plane, 2 in space */
    const ncgen_real *velocity;  /* at which it slides (m/s) */
    const ncgen_real *gradients; /* directions x n: its derivatives by qd */
    const ncgen_real *slip;      /* the direction so far, in space as long as the largest velocity that is known of the slide */
    const ncgen_scalar *sizes;   /* n: natural sizes of coordinates */
    const ncgen_real *unseen;    /* n: velocities that steps do not tell from none */
} ncgen_slide;

/* end cdef */
/* begin functions */

/* The next part of `count` things that slide, after the part that is chosen (count): those of fewer things come first, nothing (all 0) is the first
 * one. Returns 0 behind the last one. Of more than 12 things only single ones and pairs are looked at. */
int ncgen_next_part(int count, int *chosen);

/* Are the loads of a part determined, whose determinant is this, and that without friction `plain`? */
int ncgen_is_positive(ncgen_scalar determinant, ncgen_scalar plain);

/* A velocity of a coordinate of natural size `size` that steps do not tell from none: of an error within the tolerances, or where rtol is 0 a part
 * of what a fixed step changes. */
ncgen_scalar ncgen_unseen_velocity(ncgen_scalar rtol, ncgen_scalar atol, ncgen_scalar step, ncgen_scalar size, ncgen_scalar qd, ncgen_scalar qdd);

/* Does a contact not slide, but for rounding, at most this velocity in natural sizes being the greatest? */
int ncgen_slide_is_still(const ncgen_slide *slide, ncgen_scalar speed);

/* Is a contact slower than steps may miss around rest? */
int ncgen_slide_is_unseen(const ncgen_slide *slide);

/* How far a change of velocities (n) goes along the direction `way` (directions) in which a contact begins to slide. Another one that brings it
 * about, as it begins to slide, is opposed to this one where that is negative: as rigid bodies move, it will not. */
ncgen_real ncgen_along_slide(const ncgen_slide *slide, const ncgen_real *way, const ncgen_real *change);

/* The direction in which a contact slides, a number among what may be held, written to slip (directions), where that so far stands.
 * way: the force (N) along which it was released, or zeros; mobility: the greatest change of its velocity by an impulse of 1 N s; speed: the greatest
 * velocity in natural sizes; alone: a step may take the whole tolerance */
void ncgen_write_slip(const ncgen_slide *slide, const ncgen_active *active, int number, const ncgen_real *way, ncgen_scalar mobility,
    ncgen_scalar speed, int alone, ncgen_real *slip);

/* end functions */

#endif
