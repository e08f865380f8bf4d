/* ncgen_location.h: states inside a step from y to new_y, values of conditions there, and where one of them passes zero. */
#ifndef NCGEN_LOCATION_H
#define NCGEN_LOCATION_H

#include "ncgen_state.h"
#include "ncgen_stiff_steps.h"

enum { NCGEN_MOST_STAGES = 24 };

/* What an integrator works in. */
typedef struct ncgen_stepping {
    ncgen_real *new_y, *at;        /* ny: the end of a step, and a state in between */
    ncgen_real *stage_derivatives[NCGEN_MOST_STAGES]; /* ny each; [0]: where the step begins */
    ncgen_real *interpolant;       /* coefficients of ny each */
    int interpolated;              /* are they those of this step? */
    /* at: the state at t + s h, inside a step from y to new_y */
    int (*interpolate)(ncgen_run *r, struct ncgen_stepping *w, ncgen_scalar t, ncgen_scalar h, ncgen_scalar s);
    int repeated;                /* is the step taken again, since its error was too large or a stage had no derivative, or near such a one? */
    ncgen_stiff_steps stiff;
    int tiny;                    /* looks in a row at steps far too short */
    ncgen_scalar mark;           /* the time at the last look at how far the steps come */
} ncgen_stepping;

/* Room for the derivatives at so many stages. */
static inline void ncgen_take_stages(ncgen_run *r, ncgen_stepping *w, int count)
{
    for (int k = 0; k < count; ++k)
        w->stage_derivatives[k] = ncgen_take(&r->space, r->ny);
}

/* A step begins where the last one ended: the derivative there, at this stage, becomes that of the first. */
static inline void ncgen_begin_at_stage(ncgen_stepping *w, int last)
{
    ncgen_real *first = w->stage_derivatives[0];
    w->stage_derivatives[0] = w->stage_derivatives[last];
    w->stage_derivatives[last] = first;
}

/* NCGEN_DOMAIN unless the state that was evaluated last, and its work, are numbers. */
int ncgen_check_state(const ncgen_run *r, ncgen_real work);
/* q and qd at t + s h. */
int ncgen_state_inside(ncgen_run *r, ncgen_stepping *w, ncgen_scalar t, ncgen_scalar h, ncgen_scalar s);

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
