/* ncgen_stiffness.c: whether a mechanism is stiff, before the first step of an explicit method and from its steps. */
#include "ncgen_stiffness.h"
#include "ncgen_constrained.h"

enum {
    SELDOM = 1000,  /* accepted steps between two looks where no implicit method could go on, and as long as nothing speaks for it */
    TINY_LIMIT = 10 /* looks in a row at steps that are a thousand times too short */
};

/* Before the first step a mechanism is stiff where the fastest decay makes steps so much shorter than the motion would. */
static const ncgen_scalar far_beyond = R(10.0);

/* Evaluations for the fastest decay: the first one leaves of random velocities what the mechanism allows, the others bring out the fastest. */
enum { DECAY_EVALUATIONS = 3 };

/* Does an accepted step speak for a stiff mechanism? A spring may be so stiff that the rounding of its length is a force; then no eigenvalue is
 * to be seen, but steps are tiny: for good, while near a singular position they are so for a moment. */
static int is_limited_by_stability(const ncgen_run *r, ncgen_stepping *w, const tableau *method, ncgen_scalar h, int *tiny)
{
    const int last = method->stages;
    const ncgen_stage_pair pair = {h, r->y, w->new_y, w->at, w->stage_derivatives[last - 1], w->stage_derivatives[last]};
    ncgen_real moved;
    *tiny = 0;
    if (r->options->max_step > 0 && !(h < r->options->max_step))
        return 0; /* the user holds it down */
    ncgen_advance_by_stages(r, w, h, &method->a[last - 1], w->at);
    const ncgen_scalar needed = NCGEN_POW(r->options->rtol, 1 / (ncgen_scalar)(method->order + 1));
    const int speaks = ncgen_is_held_by_stability(r->options, r->error_size - 1, &pair, needed, method->stability, &moved);
    *tiny = moved < R(1.0e-3);
    return speaks;
}

/* Would an implicit method from here on solve for the degrees of freedom alone, and is there far to go? */
static int can_switch_to_implicit(const ncgen_run *r, ncgen_scalar h)
{
    const int is_cheap = r->options->stop_when_stiff && r->constrained && r->constrained->is_recursive && !r->dynamics->rolling;
    return is_cheap && r->times[r->n_times - 1] - r->start_t > h * ncgen_implicit_cost(ncgen_degrees_of_freedom(r));
}

/* Before the first step ---------------------------------------------------------------------------------------- */

/* Do forces change with velocities? x: others */
static int has_dampers(ncgen_run *r, const ncgen_real *x, ncgen_real *room)
{
    const int n = r->n;
    ncgen_real *before = room, *after = room + n;
    if (r->dynamics->conservative || !r->model->force)
        return 0;
    int status = r->model->force(r->times[0], r->y + n, r->y, r->p, before);
    status |= r->model->force(r->times[0], r->y + n, x, r->p, after);
    for (int i = 0; i < n && status == NCGEN_OK; ++i)
        if (before[i] < after[i] || before[i] > after[i])
            return 1;
    return 0;
}

/* The rate (1/s) on which velocities and accelerations without dampers change positions, in natural sizes; 0 where it is not known. */
static ncgen_real rate_of_motion(ncgen_run *r, ncgen_stepping *w, ncgen_real *rates)
{
    const ncgen_real speed = ncgen_constrained_size(r, r->y);
    ncgen_copy(r->ny, r->y, w->at);
    for (int i = 0; i < r->n; ++i)
        w->at[i] = 0;
    if (r->derivative(r, r->times[0], w->at, rates) != NCGEN_OK)
        return 0;
    const ncgen_real fall = NCGEN_SQRT(ncgen_constrained_size(r, rates));
    return speed > fall ? speed : fall;
}

/* x: the change of accelerations where velocities change along x; the return value is how many times as large it is, 0 where it is not known. */
static ncgen_real move_on(ncgen_run *r, ncgen_stepping *w, ncgen_real *x, ncgen_real *rates)
{
    const ncgen_real *base = w->stage_derivatives[0], size = ncgen_constrained_size(r, x), speed = ncgen_constrained_size(r, r->y);
    const ncgen_real length = NCGEN_SQRT(r->rounding) * (1 + speed) / size;
    if (!(size > 0))
        return 0;
    ncgen_copy(r->ny, r->y, w->at);
    for (int i = 0; i < r->n; ++i)
        w->at[i] += length * x[i];
    if (r->derivative(r, r->times[0], w->at, rates) != NCGEN_OK)
        return 0;
    for (int i = 0; i < r->n; ++i)
        x[i] = (rates[i] - base[i]) / length;
    return ncgen_constrained_size(r, x) / size;
}

/* Would stability hold steps down far below what accuracy asks for, and is there far to go? The fastest decay comes from the power method on
 * how accelerations change with velocities, and steps for accuracy from the motion at its start, without what dampers take of it. */
static int decays_fast(ncgen_run *r, ncgen_stepping *w, const tableau *method)
{
    const ncgen_scalar needed = NCGEN_POW(r->options->rtol, 1 / (ncgen_scalar)(method->order + 1));
    ncgen_real *rates = w->stage_derivatives[1], *x = w->stage_derivatives[2], decay = 0;
    unsigned seed = 1;
    for (int i = 0; i < r->n; ++i)
        x[i] = ncgen_next_random(&seed) * r->dynamics->column_sizes[i];
    if (!has_dampers(r, x, rates))
        return 0;
    for (int k = 0; k < DECAY_EVALUATIONS; ++k) {
        decay = move_on(r, w, x, rates);
        if (!(decay > 0) || !can_switch_to_implicit(r, method->stability / (decay * far_beyond)))
            return 0; /* no later one will be so much faster */
    }
    const ncgen_real motion = rate_of_motion(r, w, rates), step = method->stability / decay;
    const int is_held_down = r->options->max_step > 0 && r->options->max_step < step * far_beyond; /* by the user */
    return motion > 0 && !is_held_down && can_switch_to_implicit(r, step) && step * motion * far_beyond < needed;
}

int ncgen_begins_stiff(ncgen_run *r, ncgen_stepping *w, const tableau *method)
{
    if (!can_switch_to_implicit(r, 0) || r->constrained->is_factored || r->options->tape || r->options->first_step > 0)
        return 0;
    const int is_stiff = decays_fast(r, w, method);
    ncgen_copy(r->n, r->y, r->qd);
    ncgen_copy(r->n, r->y + r->n, r->q);
    return is_stiff;
}

/* During a run ------------------------------------------------------------------------------------------------- */

/* Is the mechanism stiff? Looked at now and then, and at every step once one speaks for it. */
int ncgen_is_stiff(const ncgen_run *r, ncgen_stepping *w, const tableau *method, ncgen_scalar h)
{
    const long step = r->statistics->steps + 1;
    const int due = step % SELDOM == 0;
    int tiny;
    if (w->stiff.speaking == 0 && !due && !(step % NCGEN_STIFF_EVERY == 0 && can_switch_to_implicit(r, h)))
        return 0;
    const int speaks = is_limited_by_stability(r, w, method, h, &tiny);
    if (due)
        w->tiny = tiny ? w->tiny + 1 : 0;
    if (w->tiny == TINY_LIMIT) {
        w->tiny = 0;
        return 1;
    }
    return ncgen_counts_as_stiff(&w->stiff, speaks);
}
