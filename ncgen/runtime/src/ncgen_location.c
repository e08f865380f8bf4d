/* ncgen_location.c: states inside a step, values of conditions there, and where one of them passes zero. */
#include "ncgen_location.h"
#include "ncgen_vectors.h"

/* What leaves zero is looked for until it is no larger than this many times its noise. */
static const ncgen_scalar clear = R(16.0);

int ncgen_check_state(const ncgen_run *r, ncgen_real work)
{
    return ncgen_is_finite(r->n, r->q) && ncgen_is_finite(r->n, r->qd) && ncgen_is_finite(1, &work) ? NCGEN_OK : NCGEN_DOMAIN;
}

int ncgen_state_inside(ncgen_run *r, ncgen_stepping *w, ncgen_scalar t, ncgen_scalar h, ncgen_scalar s)
{
    int status = w->interpolate(r, w, t, h, s);
    if (status == NCGEN_OK)
        status = r->state(r, t + s * h, w->at);
    return status == NCGEN_OK ? ncgen_check_state(r, w->at[r->error_size - 1]) : status;
}

int ncgen_evaluate_conditions(ncgen_run *r, ncgen_scalar t, const ncgen_real *q, const ncgen_real *qd, ncgen_real *values)
{
    const ncgen_event *event = r->options->event;
    int status = event->function ? ncgen_read_inputs(r, t) : NCGEN_OK;
    if (event->function && status == NCGEN_OK)
        status = event->function(t, q, qd, r->p, values);
    for (int k = 0; k < event->count; ++k) {
        const int place = event->coordinates[k];
        if (place < 0)
            continue;
        values[2 * k] = (place < r->n ? q[place] : qd[place - r->n]) - event->values[k];
        values[2 * k + 1] = NCGEN_ABS(event->values[k]);
    }
    return status;
}

int ncgen_evaluate_inside(ncgen_run *r, ncgen_stepping *w, const ncgen_part *p, ncgen_scalar s, ncgen_real *values)
{
    const int status = ncgen_state_inside(r, w, p->t, p->h, ncgen_share_of(p, s));
    return status == NCGEN_OK ? ncgen_evaluate_conditions(r, p->t + ncgen_share_of(p, s) * p->h, r->q, r->qd, values) : status;
}

/* The share *s of the part, first the end of what it may be, at which condition k happens: Illinois' rule on the interpolant. */
static int locate(ncgen_run *r, ncgen_stepping *w, const ncgen_part *p, int k, ncgen_real at_low, ncgen_real at_high, ncgen_scalar low,
                  ncgen_scalar *s)
{
    const ncgen_event *event = r->options->event;
    ncgen_real *values = ncgen_sample(event, event->degree + 1);
    ncgen_scalar high = *s;
    int side = 0;
    for (int step = 0; step < 60 && high - low > 64 * r->rounding; ++step) {
        *s = low + (high - low) * (at_low / (at_low - at_high));
        const int status = ncgen_evaluate_inside(r, w, p, *s, values);
        if (status != NCGEN_OK || !(NCGEN_ABS(values[2 * k]) > 0))
            return status;
        const int beyond = (values[2 * k] > 0) == (at_high > 0);
        if (beyond) {
            high = *s;
            at_high = values[2 * k];
            at_low *= side > 0 ? R(0.5) : R(1.0);
        } else {
            low = *s;
            at_low = values[2 * k];
            at_high *= side < 0 ? R(0.5) : R(1.0);
        }
        side = beyond ? 1 : -1;
    }
    *s = high;
    return NCGEN_OK;
}

/* The same where it was zero but for the noise at `low`, and is no longer at *s: where it has become as clear as that, not where it was seen. */
static int locate_departure(ncgen_run *r, ncgen_stepping *w, const ncgen_part *p, int k, ncgen_real at_high, ncgen_scalar noise,
                            ncgen_scalar low, ncgen_scalar *s)
{
    ncgen_real *values = ncgen_sample(r->options->event, r->options->event->degree + 1);
    for (int step = 0; step < 60 && *s - low > 64 * r->rounding && NCGEN_ABS(at_high) > clear * noise; ++step) {
        const ncgen_scalar middle = low + (*s - low) / 2;
        const int status = ncgen_evaluate_inside(r, w, p, middle, values);
        if (status != NCGEN_OK)
            return status;
        if ((at_high > 0 ? values[2 * k] : -values[2 * k]) > noise) {
            *s = middle;
            at_high = values[2 * k];
        } else
            low = middle;
    }
    return NCGEN_OK;
}

/* Has condition k come to zero or beyond already at the share *low, as where a step begins at the very instant of an event? Where it only
 * leaves from there, as a gap that opens, *low and *at_low become those of a place where it is on its side. A load may be at its limit,
 * and where a run resumes its events have just been carried out: rounding must not bring them about again and again. */
static int is_there(ncgen_run *r, ncgen_stepping *w, const ncgen_part *p, int k, ncgen_scalar high, ncgen_scalar *low, ncgen_real *at_low, int *there)
{
    const ncgen_event *event = r->options->event;
    const int way = event->directions[k];
    const int is_start = ncgen_resumes(r, p) && !(*low > 0);
    *there = way == 0 && !(NCGEN_ABS(*at_low) > 0) && !is_start;
    if (way == 0 || *at_low * (ncgen_real)way < 0 || is_start || ncgen_is_sampled(event, k))
        return NCGEN_OK;
    ncgen_real *values = ncgen_sample(event, event->degree + 1);
    const ncgen_scalar next = *low + (high - *low) * R(0.0009765625);
    const int status = ncgen_evaluate_inside(r, w, p, next, values);
    *there = !(values[2 * k] * (ncgen_real)way < 0);
    if (!*there) {
        *low = next;
        *at_low = values[2 * k];
    }
    return status;
}

int ncgen_locate(ncgen_run *r, ncgen_stepping *w, const ncgen_part *p, int k, const ncgen_place *place, ncgen_scalar *s)
{
    const ncgen_event *event = r->options->event;
    ncgen_real *values = ncgen_sample(event, event->degree + 1);
    ncgen_scalar low = place->low;
    *s = place->high;
    ncgen_real at_low = ncgen_sample(event, 0)[2 * k], at_high = ncgen_sample(event, event->degree)[2 * k];
    int status = NCGEN_OK, there = 0;
    if (low > 0) {
        status = ncgen_evaluate_inside(r, w, p, low, values);
        at_low = values[2 * k];
    }
    if (status == NCGEN_OK && *s < 1) {
        status = ncgen_evaluate_inside(r, w, p, *s, values);
        at_high = values[2 * k];
    }
    if (status == NCGEN_OK)
        status = is_there(r, w, p, k, *s, &low, &at_low, &there);
    if (status == NCGEN_OK && there)
        *s = low;
    else if (status == NCGEN_OK && ((at_low < 0 && at_high > 0) || (at_low > 0 && at_high < 0)))
        status = locate(r, w, p, k, at_low, at_high, low, s);
    else if (status == NCGEN_OK && NCGEN_ABS(at_low) <= place->noise && NCGEN_ABS(at_high) > place->noise)
        status = locate_departure(r, w, p, k, at_high, place->noise, low, s);
    return status;
}
