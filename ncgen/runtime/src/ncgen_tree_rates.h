/* ncgen_tree_rates.h: rates of the joints of an open tree from velocities of coordinates. */
#ifndef NCGEN_TREE_RATES_H
#define NCGEN_TREE_RATES_H

#include "ncgen_tree_work.h"

/* The velocity of an element that moves with a link. */
static inline void ncgen_carried(const ncgen_tree_element *e, const ncgen_real *twist, ncgen_real *velocity)
{
    ncgen_real lever[3];
    ncgen_get3(e->lane, LEVER, lever);
    ncgen_cross(twist, lever, velocity);
    ncgen_add_times(e->is_point, twist + 3, velocity);
}

/* The rates of a link's joint: of what follows another joint that one's, of what is measured its own, which no error of the elements
 * touches; of all else what fits best the velocities of its elements, the twist without them being known. */
int ncgen_tree_find_rates(const ncgen_run *r, ncgen_tree_work *w, const ncgen_tree_link *own, const ncgen_tree_place *at,
                          const ncgen_real *qd, const ncgen_real *twist);

#endif
