/* ncgen_tree_blocks.h: links of a tree side by side, so that the processor computes for several at once what each needs alone.
 *
 * A block is of as many links, in their order, as a vector of the processor has numbers. It has slots, each an element of every link:
 * first those that stand with the links, then other members of their bodies. Where a link has less than others of its block, zeros stand.
 */
#ifndef NCGEN_TREE_BLOCKS_H
#define NCGEN_TREE_BLOCKS_H

#include "ncgen_inertia.h"

#if !defined(__GNUC__) || defined(__TINYC__) || defined(NCGEN_REAL) || defined(NCGEN_SINGLE) || defined(NCGEN_LONG_DOUBLE) || \
    defined(NCGEN_QUAD)
#define NCGEN_LINK_LANES 1
typedef ncgen_real ncgen_link_lanes;
#else
#if defined(__AVX512F__)
#define NCGEN_LINK_LANES 8
#elif defined(__AVX__)
#define NCGEN_LINK_LANES 4
#else
#define NCGEN_LINK_LANES 2
#endif
typedef double ncgen_link_lanes __attribute__((vector_size(8 * NCGEN_LINK_LANES), aligned(8), may_alias));
#endif

/* Places in the numbers of a block: reference points; angular velocities and velocities of these; the same of accelerations, first without
 * those of the joints; moments about them and forces, then what the joints' accelerations add to the links'; of their own bodies P and h
 * (see ncgen_tree_bodies.h) and masses. */
enum { ORIGIN = 0, TWIST = 3, CHANGE = 9, WRENCH = 15, MOMENTS = 21, MASS = 30, BLOCK_NUMBERS = 31 };

/* Places in a slot: components; from a link's reference point, of a vector itself; velocity or acceleration; force; lever in the first
 * position of a run; 1 for a point. */
enum { VALUE = 0, LEVER = 3, MOVED = 6, FORCE = 9, FIRST = 12, IS_POINT = 15, SLOT_NUMBERS = 16 };

typedef struct ncgen_tree_slot {
    ncgen_link_lanes numbers[SLOT_NUMBERS];
} ncgen_tree_slot;

typedef struct ncgen_tree_block {
    ncgen_link_lanes *numbers;
    ncgen_tree_slot *slot;
    ncgen_link_lanes *masses; /* of every slot the mass that it has with points, then the masses between slots by rows */
    int n_own, n_slots;
} ncgen_tree_block;

/* Numbers of one link, from a place in its lane on. */
static inline void ncgen_get3(const ncgen_real *lane, int place, ncgen_real *to)
{
    for (int i = 0; i < 3; ++i)
        to[i] = lane[(place + i) * NCGEN_LINK_LANES];
}

static inline void ncgen_get6(const ncgen_real *lane, int place, ncgen_real *to)
{
    ncgen_get3(lane, place, to);
    ncgen_get3(lane, place + 3, to + 3);
}

static inline void ncgen_put3(const ncgen_real *from, ncgen_real *lane, int place)
{
    for (int i = 0; i < 3; ++i)
        lane[(place + i) * NCGEN_LINK_LANES] = from[i];
}

static inline void ncgen_put6(const ncgen_real *from, ncgen_real *lane, int place)
{
    ncgen_put3(from, lane, place);
    ncgen_put3(from + 3, lane, place + 3);
}

#endif
