/* ncgen_stages.c: sums of the derivatives at the stages of a Runge-Kutta step. */
#include "ncgen_stages.h"
#include "ncgen_stage_sums.h"

void ncgen_combine_stages(const ncgen_run *r, const ncgen_stepping *w, int stages, const ncgen_scalar *weights,
                          ncgen_real *NCGEN_RESTRICT sum)
{
    ncgen_sum_stages(r->ny, stages, weights, w->stage_derivatives, NULL, 1, sum);
}

void ncgen_advance_by_stages(const ncgen_run *r, const ncgen_stepping *w, ncgen_scalar h, int stages, const ncgen_scalar *weights,
                             ncgen_real *NCGEN_RESTRICT y_new)
{
    ncgen_sum_stages(r->ny, stages, weights, w->stage_derivatives, r->y, h, y_new);
}
