/* ncgen_stages.c: sums of the derivatives at the stages of a Runge-Kutta step. */
#include "ncgen_stages.h"
#include "ncgen_stage_sums.h"

void ncgen_combine_stages(const ncgen_run *r, const ncgen_stepping *w, const tableau_row *row, ncgen_real *NCGEN_RESTRICT sum)
{
    ncgen_sum_stages(r->ny, row, w->stage_derivatives, NULL, 1, sum);
}

void ncgen_advance_by_stages(const ncgen_run *r, const ncgen_stepping *w, ncgen_scalar h, const tableau_row *row, ncgen_real *NCGEN_RESTRICT y_new)
{
    ncgen_sum_stages(r->ny, row, w->stage_derivatives, r->y, h, y_new);
}

void ncgen_advance_by_weights(const ncgen_run *r, const ncgen_stepping *w, ncgen_scalar h, int count, const ncgen_scalar *weights,
                              ncgen_real *NCGEN_RESTRICT y_new)
{
    unsigned char stages[WIDTH];
    ncgen_scalar chosen[WIDTH];
    tableau_row row = {0, stages, chosen};
    for (int j = 0; j < count; ++j)
        if (weights[j] < 0 || weights[j] > 0) {
            stages[row.count] = (unsigned char)j;
            chosen[row.count++] = weights[j];
        }
    ncgen_advance_by_stages(r, w, h, &row, y_new);
}
