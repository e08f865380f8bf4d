/* ncgen_location.h: values of conditions inside a step, and where one of them passes zero. */
#ifndef NCGEN_LOCATION_H
#define NCGEN_LOCATION_H

#include "ncgen_inside.h"

/* The part of the step from t to t + h between two shares of it. */
typedef struct ncgen_part {
    ncgen_scalar t, h, from, to;
} ncgen_part;

/* Shares of a part between which a condition happens; what is not larger than the noise has no sign. */
typedef struct ncgen_place {
    ncgen_scalar low, high, noise;
} ncgen_place;

enum { NCGEN_OFF = 2 }; /* direction of a condition that is not asked for */

static inline ncgen_scalar ncgen_share_of(const ncgen_part *p, ncgen_scalar s)
{
    return p->from + (p->to - p->from) * s;
}

/* At one state: of every condition its value, and the size of the terms that it is a sum of. */
static inline ncgen_real *ncgen_sample(const ncgen_event *event, int row)
{
    return event->samples + (size_t)row * 2 * (size_t)event->count;
}

/* Fill them in. */
int ncgen_evaluate_conditions(ncgen_run *r, ncgen_scalar t, const ncgen_real *q, const ncgen_real *qd, ncgen_real *values);
/* The same at the share s of the part, of the state on the constraints. */
int ncgen_evaluate_inside(ncgen_run *r, ncgen_stepping *w, const ncgen_part *p, ncgen_scalar s, ncgen_real *values);

/* Is condition k asked for, and known at samples only? */
static inline int ncgen_is_sampled(const ncgen_event *event, int k)
{
    const int is_load = k >= event->count - event->n_loads;
    return event->coordinates[k] < 0 && event->directions[k] != NCGEN_OFF && (is_load || (event->sampled && event->sampled[k]));
}

/* Where condition k happens: the share *s of the part, between two others. The state on the constraints may turn a little off the interpolant,
 * and then it is the second one, or the first one where the condition is there. */
int ncgen_locate(ncgen_run *r, ncgen_stepping *w, const ncgen_part *p, int k, const ncgen_place *place, ncgen_scalar *s);

/* Does the part begin where the run resumes, at an instant whose events have just been carried out? */
static inline int ncgen_resumes(const ncgen_run *r, const ncgen_part *p)
{
    return r->options->event->resumes && !(p->from > 0) && !(p->t > r->times[0]);
}

#endif
