/* ncgen_stages.h: sums of the derivatives at the stages of a Runge-Kutta step. */
#ifndef NCGEN_STAGES_H
#define NCGEN_STAGES_H

#include "ncgen_inside.h"
#include "ncgen_tableaus.h"

typedef char ncgen_there_are_enough_stages[(int)WIDTH <= (int)NCGEN_MOST_STAGES ? 1 : -1];

/* sum = sum over the stages of weight times derivative, in their order. */
void ncgen_combine_stages(const ncgen_run *r, const ncgen_stepping *w, int stages, const ncgen_scalar *weights,
                          ncgen_real *NCGEN_RESTRICT sum);
/* y_new = y + h sum */
void ncgen_advance_by_stages(const ncgen_run *r, const ncgen_stepping *w, ncgen_scalar h, int stages, const ncgen_scalar *weights,
                             ncgen_real *NCGEN_RESTRICT y_new);

#endif
