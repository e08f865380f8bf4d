/* ncgen_stages.h: sums of the derivatives at the stages of a Runge-Kutta step. */
#ifndef NCGEN_STAGES_H
#define NCGEN_STAGES_H

#include "ncgen_inside.h"
#include "ncgen_tableaus.h"

typedef char ncgen_there_are_enough_stages[(int)WIDTH <= (int)NCGEN_MOST_STAGES ? 1 : -1];

/* sum = sum over the stages of weight times derivative, in their order. */
void ncgen_combine_stages(const ncgen_run *r, const ncgen_stepping *w, const tableau_row *row, ncgen_real *NCGEN_RESTRICT sum);
/* y_new = y + h sum */
void ncgen_advance_by_stages(const ncgen_run *r, const ncgen_stepping *w, ncgen_scalar h, const tableau_row *row, ncgen_real *NCGEN_RESTRICT y_new);
/* The same with weights of as many stages, of which some may be 0. */
void ncgen_advance_by_weights(const ncgen_run *r, const ncgen_stepping *w, ncgen_scalar h, int count, const ncgen_scalar *weights,
                              ncgen_real *NCGEN_RESTRICT y_new);

#endif
