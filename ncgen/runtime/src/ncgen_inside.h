/* ncgen_inside.h: states inside a step from y to new_y, and the conditions that are fulfilled there. */
#ifndef NCGEN_INSIDE_H
#define NCGEN_INSIDE_H

#include "ncgen_state.h"

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
    int stiff, not_stiff;        /* steps in a row that spoke for a stiff mechanism, and against it since then */
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

/* Conditions of options->event at the first state, and after a step that was accepted: *happens and the share *s of the step at which the
 * first of them is fulfilled, whose state then is the one that was evaluated last. */
int ncgen_conditions_begin(ncgen_run *r, ncgen_scalar t);
int ncgen_conditions_step(ncgen_run *r, ncgen_stepping *w, ncgen_scalar t, ncgen_scalar h, int *happens, ncgen_scalar *s);

#endif
