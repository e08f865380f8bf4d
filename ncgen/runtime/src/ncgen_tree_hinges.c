/* ncgen_tree_hinges.c: hinges alone that hang on one another, most joints of a long arm.
 *
 * Their loops call nothing, so that what goes from link to link need not be stored in between. A link waits for the one before as shortly as
 * can be: what its hinge does not pass on is known about the reference point of its parent.
 */
#include "ncgen_tree_hinges.h"

/* A hinge alone: what its parent gets in place of what was carried to its link. What it does not pass on moves to the parent's
 * point by itself, so that nothing else waits for the division. */
static inline int pass_hinge(const ncgen_tree_link *own, ncgen_tree_screw *screw, ncgen_tree_carried *passed)
{
    const ncgen_real d[3] = {own->offset[0], own->offset[1], own->offset[2]};
    const ncgen_real axis[3] = {screw->axis[0], screw->axis[1], screw->axis[2]};
    ncgen_real momentum[6], share[6];
    ncgen_tree_carried carries;
    ncgen_tree_add_body(own, passed, &carries);
    ncgen_find_momentum(carries.inertia, 1, axis, momentum);
    const ncgen_real pivot = (screw->rotor + axis[0] * momentum[0]) + (axis[1] * momentum[1] + axis[2] * momentum[2]);
    const ncgen_real inverse = 1 / pivot, push = screw->push + ncgen_dot3(axis, carries.wrench);
    screw->pivot = inverse;
    screw->push = push;
    ncgen_set6(momentum, screw->momentum);
    ncgen_shift_wrench(d, carries.wrench);
    ncgen_shift_wrench(d, momentum);
    for (int i = 0; i < 6; ++i)
        share[i] = inverse * momentum[i];
    ncgen_set6(share, screw->share);
    for (int i = 0; i < 6; ++i)
        passed->wrench[i] = carries.wrench[i] - push * share[i];
    ncgen_set_shifted(carries.inertia, d, passed->inertia);
    ncgen_take_product(share, momentum, passed->inertia);
    return pivot > 0;
}

int ncgen_tree_pass_hinges(const ncgen_tree_work *w, int link, ncgen_tree_screw *screw, ncgen_tree_carried *passed, int *is_regular)
{
    const ncgen_tree_link *own = w->link + link;
    ncgen_tree_carried carries = *passed;
    int are_regular = 1;
    for (;; --own, --screw) {
        are_regular &= pass_hinge(own, screw, &carries);
        if (own->parent < 0 || w->link + own->parent != own - 1 || !own[-1].is_hinge || own[-1].has_sum)
            break;
    }
    *passed = carries;
    *is_regular &= are_regular;
    return (int)(own - w->link);
}

int ncgen_tree_push_hinges(const ncgen_tree_work *w, int link, ncgen_tree_screw *screw, ncgen_real *passed)
{
    const ncgen_tree_link *own = w->link + link;
    ncgen_real carries[6];
    ncgen_set6(passed, carries);
    for (;;) {
        ncgen_real wrench[6];
        ncgen_get6(own->lane, WRENCH, wrench);
        ncgen_add_times(1, carries, wrench);
        ncgen_add_times(1, carries + 3, wrench + 3);
        const ncgen_real push = screw->push + ncgen_dot3(screw->axis, wrench);
        screw->push = push;
        ncgen_shift_wrench(own->offset, wrench);
        for (int i = 0; i < 6; ++i)
            carries[i] = wrench[i] - push * screw->share[i];
        if (own->parent < 0 || w->link + own->parent != own - 1 || !own[-1].is_hinge)
            break;
        --own;
        --screw;
    }
    ncgen_set6(carries, passed);
    return (int)(own - w->link);
}

int ncgen_tree_release_hinges(ncgen_tree_work *w, int link, ncgen_tree_screw *screw)
{
    const ncgen_tree_link *own = w->link + link, *end = w->link + w->tree->n_links;
    ncgen_real added[6];
    ncgen_get6(ncgen_lane_before(w, own), WRENCH, added);
    do {
        const ncgen_real *u = screw->share;
        const ncgen_real a = u[0] * added[0] + u[1] * added[1], b = u[2] * added[2] + u[3] * added[3];
        const ncgen_real push = screw->pivot * screw->push - a - (b + (u[4] * added[4] + u[5] * added[5]));
        ncgen_add_cross(added, own->offset, added + 3);
        screw->push = push;
        ncgen_add_times(push, screw->axis, added);
        ncgen_put6(added, own->lane, WRENCH);
        ++screw;
        ++own;
    } while (own < end && own->is_hinge && w->link + own->parent == own - 1);
    return (int)(own - w->link);
}
