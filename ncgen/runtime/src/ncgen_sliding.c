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

/* The largest change of a velocity at which a contact slides where coordinates change by so much (n). */
static ncgen_real largest_change(const ncgen_slide *slide, const ncgen_scalar *change)
{
    ncgen_real most = 0;
    for (int k = 0; k < slide->directions; ++k) {
        ncgen_real sum = 0;
        for (int j = 0; j < slide->n; ++j)
            sum += NCGEN_ABS(slide->gradients[k * slide->n + j]) * change[j];
        most = sum > most ? sum : most;
    }
    return most;
}

/* The sliding velocity that steps may miss around rest. */
static ncgen_real missed_speed(const ncgen_slide *slide, int is_alone)
{
    return (is_alone ? missed_alone : missed) * largest_change(slide, slide->unseen);
}

/* The largest velocity of the present slide of a contact in space that is known; 0 in the plane. */
static ncgen_real largest_so_far(const ncgen_slide *slide)
{
    return slide->directions > 1 ? ncgen_norm(2, slide->slip) : 0;
}

int ncgen_slide_is_still(const ncgen_slide *slide, ncgen_scalar speed)
{
    ncgen_real velocity = 0;
    for (int k = 0; k < slide->directions; ++k)
        velocity = NCGEN_ABS(slide->velocity[k]) > velocity ? NCGEN_ABS(slide->velocity[k]) : velocity;
    return ncgen_is_still(velocity, largest_change(slide, slide->sizes) * speed + largest_so_far(slide), 0);
}

int ncgen_slide_is_unseen(const ncgen_slide *slide)
{
    return ncgen_norm(slide->directions, slide->velocity) <= missed_speed(slide, 0);
}

ncgen_real ncgen_along_slide(const ncgen_slide *slide, const ncgen_real *way, const ncgen_real *change)
{
    ncgen_real sum = 0;
    for (int k = 0; k < slide->directions; ++k)
        sum += way[k] * ncgen_dot(slide->n, slide->gradients + k * slide->n, change);
    return sum;
}

/* How long the direction is in which a contact in space begins to slide: much longer than the velocity that friction would give it over its
 * natural size at this deceleration, so that it keeps the direction until it is faster than what steps miss. */
static ncgen_real first_length(const ncgen_slide *slide, ncgen_scalar deceleration, int is_alone)
{
    const ncgen_scalar speed = longer * NCGEN_SQRT(deceleration * largest_change(slide, slide->sizes));
    const ncgen_scalar least = missed_speed(slide, is_alone) / NCGEN_REST;
    return speed > least ? speed : least;
}

/* The largest velocity that is known of a slide: the one so far, the present one, and so much of its terms at least that rounding does not hide
 * that it comes to rest. */
static ncgen_real largest_slide(const ncgen_slide *slide, ncgen_scalar own, ncgen_scalar speed)
{
    const ncgen_scalar so_far = largest_so_far(slide), least = rounding_share * largest_change(slide, slide->sizes) * speed;
    const ncgen_scalar known = so_far > own ? so_far : own;
    return known > least ? known : least;
}

void ncgen_write_slip(const ncgen_slide *slide, const ncgen_active *active, int number, const ncgen_real *way, ncgen_scalar mobility,
    ncgen_scalar speed, int alone, ncgen_real *slip)
{
    const ncgen_real force = ncgen_norm(slide->directions, way), velocity = ncgen_norm(slide->directions, slide->velocity);
    const int slides = ncgen_slide_of(active, number, force > 0, velocity > 0), begins = slides == NCGEN_BEGINS;
    ncgen_real length = 1;
    if (slides == NCGEN_SLIDES_AS_BEFORE)
        return;
    if (slide->directions > 1)
        length = begins ? first_length(slide, mobility * force, alone) / force : largest_slide(slide, velocity, speed) / velocity;
    for (int k = 0; k < slide->directions; ++k) {
        const ncgen_real along = begins ? way[k] : slide->velocity[k];
        slip[k] = slides == NCGEN_SLIDES_NOT ? 0 : slide->directions > 1 ? along * length : (ncgen_real)((along > 0) - (along < 0));
    }
}
