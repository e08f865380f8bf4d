/* ncgen_stiffness.c: whether a mechanism is stiff, from the steps of an explicit method. */
#include "ncgen_stiffness.h"
#include "ncgen_constrained.h"

enum {
    STIFF_EVERY = 1000,             /* accepted steps between two looks at stiffness, as long as nothing speaks for it */
    STIFF_EVERY_WITH_IMPLICIT = 16, /* the same where an implicit method could go on and `implicit_cost` steps are left */
    STIFF_LIMIT = 15,               /* steps in a row that speak for it before it counts */
    STIFF_DOUBT = 6,                /* steps that speak against it and make these count anew */
    TINY_LIMIT = 10                 /* looks in a row at steps that are a thousand times too short */
};

/* From this share of the stability interval on the real axis stability begins to hold the step down: along the imaginary axis,
 * where springs without damping are, it may end at 0.4 of that. */
static const ncgen_scalar stability_fraction = R(0.3);

/* Steps of this method that an implicit one, with its Jacobian and first steps, costs no more than. */
static const ncgen_scalar implicit_cost = R(200.0);

/* Does an accepted step speak for a stiff mechanism? It does where the motion itself, whose rate its derivatives show, would allow
 * far longer ones at this tolerance, and what holds it down is the stability of the method: the last two stages are both at
 * the end of the step, and the difference of their derivatives over that of their states is about the largest eigenvalue (Hairer
 * and Wanner, Solving Ordinary Differential Equations II, IV.2). Work is left out, since nothing depends on it.
 *
 * A spring may be so stiff that the rounding of its length is a force; then no eigenvalue is to be seen, but steps are tiny:
 * for good, while near a singular position they are so for a moment. */
static int is_limited_by_stability(const ncgen_run *r, const ncgen_stepping *w, const tableau *method, ncgen_scalar h, int *tiny)
{
    const int last = method->stages;
    const ncgen_real *first = ncgen_stage_derivative(r, w, last - 1), *second = ncgen_stage_derivative(r, w, last);
    const ncgen_scalar needed = NCGEN_POW(r->options->rtol, 1 / (ncgen_scalar)(method->order + 1));
    ncgen_real stage_derivatives = 0, states = 0, rates = 0, sizes = 0;
    *tiny = 0;
    if (r->options->max_step > 0 && !(h < r->options->max_step))
        return 0; /* the user holds it down */
    ncgen_advance_by_stages(r, w, h, last - 1, method->a[last - 1], w->at);
    for (int i = 0; i < r->error_size - 1; ++i) {
        const ncgen_real size = ncgen_tolerance_of(r, i, r->y[i], w->new_y[i]), state = w->new_y[i] / size, rate = second[i] / size;
        const ncgen_real by_derivative = rate - first[i] / size, by_state = state - w->at[i] / size;
        stage_derivatives += by_derivative * by_derivative;
        states += by_state * by_state;
        rates += rate * rate;
        sizes += state * state;
    }
    const ncgen_real moved = h * NCGEN_SQRT(rates / sizes);
    const ncgen_scalar bound = stability_fraction * method->stability;
    *tiny = moved < R(1.0e-3) * needed;
    return moved < R(0.1) * needed && h * h * stage_derivatives > bound * bound * states;
}

/* Would an implicit method from here on solve for the degrees of freedom alone, and is there far to go? */
static int can_switch_to_implicit(const ncgen_run *r, ncgen_scalar h)
{
    const int is_cheap = r->options->stop_when_stiff && r->constrained && r->constrained->is_recursive && !r->dynamics->rolling;
    return is_cheap && r->times[r->n_times - 1] - r->start_t > implicit_cost * h;
}

/* Is the mechanism stiff? Looked at now and then, and at every step once one speaks for it. */
int ncgen_is_stiff(const ncgen_run *r, ncgen_stepping *w, const tableau *method, ncgen_scalar h)
{
    const long step = r->statistics->steps + 1;
    const int due = step % STIFF_EVERY == 0;
    int tiny;
    if (w->stiff == 0 && !due && !(step % STIFF_EVERY_WITH_IMPLICIT == 0 && can_switch_to_implicit(r, h)))
        return 0;
    const int speaks = is_limited_by_stability(r, w, method, h, &tiny);
    if (due)
        w->tiny = tiny ? w->tiny + 1 : 0;
    if (w->tiny == TINY_LIMIT) {
        w->tiny = 0;
        return 1;
    }
    if (speaks) {
        w->not_stiff = 0;
        w->stiff = w->stiff + 1 < STIFF_LIMIT ? w->stiff + 1 : 0;
        return w->stiff == 0;
    }
    w->not_stiff += 1;
    if (w->not_stiff >= STIFF_DOUBT)
        w->stiff = 0;
    return 0;
}
