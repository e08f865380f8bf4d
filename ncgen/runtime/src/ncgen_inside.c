/* ncgen_inside.c: the first of several conditions that is fulfilled inside a step.
 *
 * Each condition is a polynomial in time within a step, known by its values at the nodes of a basis. All that happen are located on the
 * states that satisfy the constraints; the first one counts, and with it those at the same time.
 *
 * Of a condition that is sampled the polynomial is compared with values between the nodes. Where it is wrong the step is taken in parts,
 * halves of halves, as if these were steps.
 */
#include "ncgen_crossing.h"
#include "ncgen_inside.h"

/* A value of a condition below this, in units of rounding and over its size, has no sign: rounding of the values times the largest sum of a
 * row of the inverse, 560 for degree 8 and 11,700 for degree 14. */
static const ncgen_scalar noise_of_8 = R(1000.0), noise_of_14 = R(20000.0);

/* Conditions are fulfilled at the same time if their fractions of a step differ by less than this many roundings. */
static const ncgen_scalar same_instant = R(256.0);

/* Where polynomials are compared with their conditions: away from the nodes of either degree, and without a common period. */
static const ncgen_scalar between[] = {R(0.0309), R(0.4472), R(0.8463)};

/* By how much they may differ, over the size of the condition and besides rounding; and how much larger than at these places the error may
 * be elsewhere. */
static const ncgen_scalar resolved = R(1.0e-6), unseen = R(8.0);

enum { PLACES = sizeof between / sizeof *between, FINEST = 1 << 12 /* parts of a step */ };

/* Values of the conditions at the share s of the part, of the state on the interpolant over all coordinates, which stays in w->at. */
static int evaluate_at(ncgen_run *r, ncgen_stepping *w, const ncgen_part *p, ncgen_scalar s, ncgen_real *values)
{
    const int status = w->interpolate(r, w, p->t, p->h, ncgen_share_of(p, s));
    return status == NCGEN_OK ? ncgen_evaluate_conditions(r, p->t + ncgen_share_of(p, s) * p->h, w->at + r->n, w->at, values) : status;
}

/* Of the inputs of formulas: at a node, of the state y of velocities and positions, and then as polynomials. */
static void keep_inputs(const ncgen_run *r, int node, const ncgen_real *q, const ncgen_real *qd)
{
    const ncgen_formulas *f = r->options->event->formulas;
    for (int i = 0; f && r->constrained && i < f->n_inputs; ++i) {
        const int place = f->inputs[i];
        f->values[2 * i * (r->options->event->degree + 1) + node] = place < r->n ? q[place] : qd[place - r->n];
    }
}

static void make_polynomials(const ncgen_run *r)
{
    const ncgen_formulas *f = r->options->event->formulas;
    const int count = r->options->event->degree + 1;
    for (int i = 0; f && r->constrained && i < f->n_inputs; ++i) {
        const ncgen_real *values = f->values + (size_t)(2 * i) * (size_t)count;
        for (int j = 0; j < count; ++j)
            f->values[(2 * i + 1) * count + j] = ncgen_dot(count, f->through + (size_t)j * (size_t)count, values);
    }
}

/* At all nodes but the first, where they are known; y itself is a polynomial in time, and over all coordinates it is the velocities and
 * the positions. */
static int evaluate_nodes(ncgen_run *r, ncgen_stepping *w, const ncgen_part *p)
{
    const ncgen_event *event = r->options->event;
    const int last = event->degree, at_end = !(p->to < 1);
    int status = NCGEN_OK;
    if (p->from > 0) {
        status = w->interpolate(r, w, p->t, p->h, p->from);
        keep_inputs(r, 0, w->at + r->n, w->at);
    } else
        keep_inputs(r, 0, r->y + r->n, r->y);
    if (at_end && status == NCGEN_OK) {
        keep_inputs(r, last, r->q, r->qd);
        status = ncgen_evaluate_conditions(r, p->t + p->h, r->q, r->qd, ncgen_sample(event, last));
    }
    for (int k = 1; k < last + !at_end && status == NCGEN_OK; ++k) {
        status = (r->constrained ? evaluate_at : ncgen_evaluate_inside)(r, w, p, event->nodes[k], ncgen_sample(event, k));
        keep_inputs(r, k, w->at + r->n, w->at);
    }
    return status;
}

/* The largest value of condition k at the nodes, or term of it. */
static ncgen_scalar size_of(const ncgen_event *event, int k)
{
    ncgen_scalar size = 0;
    for (int node = 0; node <= event->degree; ++node) {
        const ncgen_scalar value = NCGEN_ABS(ncgen_sample(event, node)[2 * k]), terms = ncgen_sample(event, node)[2 * k + 1];
        size = value > size ? value : size;
        size = terms > size ? terms : size;
    }
    return size;
}

static ncgen_scalar noise_of(const ncgen_run *r, ncgen_scalar size)
{
    return (r->options->event->degree > 8 ? noise_of_14 : noise_of_8) * r->rounding * size;
}

/* Do the polynomials of sampled conditions tell their signs? Where they are wrong between the nodes, only those far from zero do. */
static int compare(ncgen_run *r, ncgen_stepping *w, const ncgen_part *p, int *are_right)
{
    const ncgen_event *event = r->options->event;
    const ncgen_basis basis = {event->degree, event->nodes, event->inverse};
    ncgen_real *values = ncgen_sample(event, event->degree + 1), *errors = ncgen_sample(event, event->degree + 2);
    int status = NCGEN_OK, some = 0;
    *are_right = 1;
    for (int k = 0; k < event->count; ++k) {
        errors[k] = 0;
        some |= ncgen_is_sampled(event, k);
    }
    for (int i = 0; i < PLACES && some && status == NCGEN_OK; ++i) {
        status = evaluate_at(r, w, p, between[i], values);
        for (int k = 0; k < event->count && status == NCGEN_OK; ++k) {
            if (!ncgen_is_sampled(event, k))
                continue;
            const ncgen_scalar error = NCGEN_ABS(values[2 * k] - ncgen_polynomial_at(&basis, event->samples + 2 * k, 2 * event->count, between[i]));
            errors[k] = error > errors[k] ? error : errors[k];
        }
    }
    for (int k = 0; k < event->count && some && status == NCGEN_OK; ++k) {
        const ncgen_scalar size = size_of(event, k);
        if (errors[k] > resolved * size + noise_of(r, size))
            *are_right &= ncgen_has_one_sign(&basis, event->samples + 2 * k, 2 * event->count, unseen * errors[k]);
    }
    return status;
}

/* Does condition k change its sign between two of the nodes from one share of the part to another? */
static int find_by_samples(ncgen_run *r, ncgen_stepping *w, const ncgen_part *p, int k, ncgen_scalar low, ncgen_scalar high, ncgen_walk *walk,
                           int *crossed)
{
    const ncgen_event *event = r->options->event;
    ncgen_real *values = ncgen_sample(event, event->degree + 1);
    int status = NCGEN_OK;
    for (int node = 0; node <= event->degree && status == NCGEN_OK && !*crossed; ++node) {
        const ncgen_scalar s = low + (high - low) * event->nodes[node];
        status = evaluate_at(r, w, p, s, values);
        *crossed = status == NCGEN_OK && ncgen_walk_to(walk, s, values[2 * k]);
    }
    return status;
}

/* Does condition k, which has a formula, happen within the part? Shares of it without bounds are sampled. */
static int find_by_formula(ncgen_run *r, ncgen_stepping *w, const ncgen_part *p, int k, ncgen_scalar size, ncgen_walk *walk, int *crossed)
{
    const ncgen_event *event = r->options->event;
    const ncgen_basis basis = {event->degree, event->nodes, event->inverse};
    const ncgen_formula_step step = {event->formulas, event->degree, r->rounding, p->t + p->from * p->h, (p->to - p->from) * p->h,
                                      r->p};
    ncgen_scalar reached = 0, unbounded = 1;
    int status = NCGEN_OK, parts = 0;
    *crossed = 0;
    while (!*crossed && status == NCGEN_OK) {
        *crossed = event->formulas->walk(&step, &basis, k, size, walk, &reached, &unbounded, &parts);
        if (*crossed || !(reached < 1))
            break;
        event->formulas->sampled[k] = 1;
        status = find_by_samples(r, w, p, k, reached, unbounded, walk, crossed);
        reached = unbounded;
    }
    *crossed = status == NCGEN_OK && (*crossed || ncgen_walk_end(walk, ncgen_sample(event, event->degree)[2 * k]));
    return status;
}

/* Does condition k change its sign from node to node? */
static int find_at_nodes(const ncgen_event *event, int k, ncgen_walk *walk, int *crossed)
{
    *crossed = 0;
    for (int node = 0; node <= event->degree && !*crossed; ++node)
        *crossed = ncgen_walk_to(walk, event->nodes[node], ncgen_sample(event, node)[2 * k]);
    *crossed = *crossed || ncgen_walk_end(walk, ncgen_sample(event, event->degree)[2 * k]);
    return NCGEN_OK;
}

/* Of each condition, what has no sign throughout the run; 0 of what is sampled, as loads are, which may be beyond their limits by little. */
static ncgen_real *rounding_left(const ncgen_event *event)
{
    return ncgen_sample(event, event->degree + 2) + event->count; /* behind errors and shares */
}

/* Does condition k happen within the part? Then between two shares of it. */
static int find(ncgen_run *r, ncgen_stepping *w, const ncgen_part *p, int k, int *crossed, ncgen_place *place)
{
    const ncgen_event *event = r->options->event;
    const ncgen_basis basis = {event->degree, event->nodes, event->inverse};
    const ncgen_formulas *formulas = event->formulas;
    const ncgen_scalar size = size_of(event, k), noise = noise_of(r, size), left = rounding_left(event)[k];
    const ncgen_real first = ncgen_sample(event, 0)[2 * k];
    place->noise = left > noise ? left : noise;
    const int has_formula = formulas && formulas->first[k] < formulas->first[k + 1];
    const int jumps = ncgen_is_sampled(event, k) && !((p->to - p->from) * (ncgen_scalar)FINEST > 1); /* no polynomial is right there */
    if (r->constrained && (has_formula || jumps)) {
        ncgen_walk walk = {event->directions[k], event->signs[k] ? event->signs[k] : (first > 0) - (first < 0), 0, 0, 0, left};
        const int status = jumps ? find_at_nodes(event, k, &walk, crossed) : find_by_formula(r, w, p, k, size, &walk, crossed);
        event->signs[k] = walk.sign;
        place->low = walk.at;
        place->high = walk.next;
        return status;
    }
    *crossed = ncgen_first_crossing(&basis, event->samples + 2 * k, 2 * event->count, place->noise, event->directions[k], &event->signs[k],
                                  &place->low, &place->high);
    return NCGEN_OK;
}

/* Where a run resumes on a side that the value there contradicts, as if the condition had happened, that is rounding, and so is twice as much. */
int ncgen_conditions_begin(ncgen_run *r, ncgen_scalar t)
{
    const ncgen_event *event = r->options->event;
    const int status = ncgen_evaluate_conditions(r, t, r->q, r->qd, ncgen_sample(event, 0));
    for (int k = 0; k < event->count; ++k) {
        const ncgen_real first = ncgen_sample(event, 0)[2 * k];
        const int happens = first * (ncgen_real)event->signs[k] < 0 && !(first * (ncgen_real)event->directions[k] < 0);
        event->crossed[k] = 0;
        rounding_left(event)[k] = event->resumes && happens && !ncgen_is_sampled(event, k) ? 2 * NCGEN_ABS(first) : 0;
    }
    return status;
}

/* The share *s of the part at which the first condition happens, and those that do; where none does, it is followed by the next part. */
static int find_first(ncgen_run *r, ncgen_stepping *w, const ncgen_part *p, int *happens, ncgen_scalar *s)
{
    const ncgen_event *event = r->options->event;
    ncgen_real *shares = ncgen_sample(event, event->degree + 2); /* of those that happen; 2 for others */
    int status = NCGEN_OK;
    make_polynomials(r);
    *s = 2;
    for (int k = 0; k < event->count && status == NCGEN_OK; ++k) {
        ncgen_place place = {0, 1, 0};
        ncgen_scalar share = 2;
        shares[k] = 2;
        if (event->directions[k] == NCGEN_OFF)
            continue;
        int crossed = 0;
        status = find(r, w, p, k, &crossed, &place);
        if (status != NCGEN_OK || !crossed || place.low > *s)
            continue;
        status = ncgen_locate(r, w, p, k, &place, &share);
        shares[k] = share;
        *s = share < *s ? share : *s;
    }
    *happens = status == NCGEN_OK && *s <= 1;
    if (!*happens) {
        ncgen_copy(2 * event->count, ncgen_sample(event, event->degree), ncgen_sample(event, 0));
        return status;
    }
    const ncgen_scalar same = same_instant * r->rounding * (1 + NCGEN_ABS(p->t) / ((p->to - p->from) * p->h));
    for (int k = 0; k < event->count; ++k)
        event->crossed[k] = shares[k] <= 1 && shares[k] <= *s + same; /* in a step over a jump of a law all are at one time */
    *s = ncgen_share_of(p, *s);
    return status;
}

int ncgen_conditions_step(ncgen_run *r, ncgen_stepping *w, ncgen_scalar t, ncgen_scalar h, int *happens, ncgen_scalar *s)
{
    int status = NCGEN_OK, place = 0, width = FINEST;
    *happens = 0;
    while (place < FINEST && status == NCGEN_OK && !*happens) {
        const ncgen_scalar parts = FINEST;
        const ncgen_part p = {t, h, (ncgen_scalar)place / parts, (ncgen_scalar)(place + width) / parts};
        int are_right = 1;
        status = evaluate_nodes(r, w, &p);
        if (status == NCGEN_OK && r->constrained && width > 1)
            status = compare(r, w, &p, &are_right);
        if (!are_right) {
            width /= 2;
            continue;
        }
        if (status == NCGEN_OK)
            status = find_first(r, w, &p, happens, s);
        for (place += width; width < FINEST && place % (2 * width) == 0;) /* the next part is as wide as its place allows */
            width *= 2;
    }
    return *happens ? ncgen_state_inside(r, w, t, h, *s) : status;
}
