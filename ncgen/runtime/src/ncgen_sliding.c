/* ncgen_sliding.c: parts of what slides, and coming to rest in space. */
#include "ncgen_sliding.h"
#include "ncgen_rest.h"

enum { MOST_PARTS = 12 };

/* Loads are determined where all determinants are above this share of those without friction. */
static const ncgen_scalar positive = R(1.0e-9);

/* Around rest, where friction jumps, steps miss velocities by so many times what they are to see. To come to rest so much too early changes the
 * motion by the square of that: friction has the same impulse in the end. The second where every step may take the whole tolerance, while
 * friction turns the velocity the faster the smaller it is. */
static const ncgen_scalar missed = R(20.0), missed_alone = R(1000.0);

/* How much longer the direction is in which a contact begins to slide; a velocity has no digits below a share of its terms; of a fixed step,
 * what it changes that is not seen. */
static const ncgen_scalar longer = R(100.0), rounding_share = R(1.0e-3), of_step = R(0.1);

int ncgen_next_part(int count, int *chosen)
{
    int last = count - 1, moved = 1;
    for (; last >= 0 && chosen[last]; --last, ++moved) /* those at the end move up to the next one before them */
        chosen[last] = 0;
    while (last >= 0 && !chosen[last])
        --last;
    if (last >= 0)
        chosen[last] = 0;
    else if (moved > (count > MOST_PARTS ? 2 : count))
        return 0;
    for (; moved > 0; --moved)
        chosen[++last] = 1;
    return 1;
}

int ncgen_is_positive(ncgen_scalar determinant, ncgen_scalar plain)
{
    return determinant > positive * NCGEN_ABS(plain);
}

ncgen_scalar ncgen_unseen_velocity(ncgen_scalar rtol, ncgen_scalar atol, ncgen_scalar step, ncgen_scalar size, ncgen_scalar qd, ncgen_scalar qdd)
{
    return rtol > 0 ? atol * size + rtol * NCGEN_ABS(qd) : of_step * step * NCGEN_ABS(qdd);
}

ncgen_scalar ncgen_missed_speed(ncgen_scalar change, int alone)
{
    return (alone ? missed_alone : missed) * change;
}

ncgen_scalar ncgen_first_length(ncgen_scalar deceleration, ncgen_scalar size, ncgen_scalar missed_speed)
{
    const ncgen_scalar speed = longer * NCGEN_SQRT(deceleration * size), least = missed_speed / NCGEN_REST;
    return speed > least ? speed : least;
}

ncgen_scalar ncgen_largest_slide(ncgen_scalar so_far, ncgen_scalar speed, ncgen_scalar terms)
{
    const ncgen_scalar least = rounding_share * terms, known = so_far > speed ? so_far : speed;
    return known > least ? known : least;
}
