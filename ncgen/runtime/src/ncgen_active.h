/* ncgen_active.h: rules of what is held after an instant, whatever a state is: all that may be, less what its load does not allow, the worst
 * one first. */
#ifndef NCGEN_ACTIVE_H
#define NCGEN_ACTIVE_H

#include "ncgen_event_table.h"

/* begin cdef */

/* Whether something is still; opposed: a contact that would begin to slide against others that do. */
enum { NCGEN_MOVES, NCGEN_STILL, NCGEN_OPPOSED };

/* How a contact slides: not at all; it begins to, in the direction in which it was released; in that of its velocity; in the direction so far. */
enum { NCGEN_SLIDES_NOT, NCGEN_BEGINS, NCGEN_SLIDES_ON, NCGEN_SLIDES_AS_BEFORE };

/* `count` things that may be held; 1 and 0 are yes and no. */
typedef struct ncgen_active {
    int count;
    const int *kinds;    /* of holds */
    const int *needs;    /* of a contact: the number of its gap; else -1 */
    const int *before;   /* was it held? */
    const int *happened; /* has its condition passed zero at this instant? of a contact: has it come to rest? */
    const int *rests;    /* is it at rest for other reasons: bounces end, an impact leaves it so, or nothing has hit it? */
    const int *closed;   /* is a gap closed? */
    const int *still;    /* NCGEN_STILL where a gap does not change, or others do not move */
    int *wanted;         /* what is to be held */
    int *released;       /* what is not: 1, or of a joint the direction in which it slips, 1 or -1; else 0 */
    ncgen_real *loads;   /* conditions of loads of what is wanted, in this order: values, and sizes that they are compared with */
    void *context;
    int (*find_loads)(void *context, int projected); /* write loads with the state brought onto the constraints of what is wanted, or as it is */
} ncgen_active;

/* end cdef */
/* begin functions */

/* What is held: `wanted`, from what was released by its load on the way. NCGEN_NO_MODE where no set agrees with its loads, or the status of
 * find_loads. */
int ncgen_find_active(ncgen_active *active);

/* How many conditions the load of a kind of holds has, and to which side it is released where one of them, l, does not hold. */
int ncgen_loads_of(int kind);
int ncgen_side_of(int kind, int l);

/* The direction in which the condition of something that may be held is watched: NCGEN_UNWATCHED while it is held, of a joint until it stops,
 * slip being its direction, of a contact until it stops where it touches, otherwise its own. */
int ncgen_way_of(int kind, int is_held, int touches, int slip, int direction);

/* Does a load no longer hold, by a condition with this value and size? nearly: also where it cannot be told from its limit. */
int ncgen_is_used_up(ncgen_scalar value, ncgen_scalar size, int nearly);

/* Is something still whose velocity consists of terms: those of coordinates and a drift? */
int ncgen_is_still(ncgen_scalar velocity, ncgen_scalar terms, ncgen_scalar drift);

/* Can nothing move along a direction, of whose mobility with nothing held this is left? */
int ncgen_is_blocked(ncgen_scalar mobility, ncgen_scalar whole);

/* Do velocities qd miss constraints Phi_q qd = nu, whose numbers are `values`, by more than rounding of their terms, `speed` having been the largest
 * velocity in natural sizes before? Then a lock cannot close. nu: NULL for zeros */
int ncgen_is_missed(const ncgen_pattern *phi_q, const ncgen_real *values, const ncgen_real *nu, const ncgen_scalar *sizes, ncgen_scalar speed,
    const ncgen_real *qd);

/* How a contact slides. released: is it known in which direction it was released? moves: has it a velocity? */
int ncgen_slide_of(const ncgen_active *active, int number, int released, int moves);

/* What has become of something: NCGEN_RESTS, NCGEN_LEAVES, or NCGEN_TURNS where it slips to the other side; 0 where nothing has, or its gap says
 * so. */
int ncgen_change_of(const ncgen_active *active, int number);

/* The direction in which a joint slips: before `slip`; side: of its velocity. */
int ncgen_slip_of(const ncgen_active *active, int number, int slip, int side);

/* end functions */

#endif
