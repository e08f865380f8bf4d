/* ncgen_stage_sums.h: sums of the derivatives at the stages of a Runge-Kutta step; of numbers or of lanes. */
#ifndef NCGEN_STAGE_SUMS_H
#define NCGEN_STAGE_SUMS_H

#include "ncgen_math.h"
#include "ncgen_tableaus.h"

enum { NCGEN_AT_ONCE = 8 }; /* over few numbers a pass costs more than what it adds */

/* out = y + h times the sum of weight times derivative over some stages, or without y the sum alone. `count` is a number that the compiler
 * knows. */
static inline void ncgen_add_up(int count, int size, const unsigned char *stages, const ncgen_scalar *weights, ncgen_real *const *derivatives,
                                const ncgen_real *y, ncgen_real h, ncgen_real *out)
{
    const ncgen_real *terms[NCGEN_AT_ONCE];
    ncgen_scalar factors[NCGEN_AT_ONCE];
    for (int k = 0; k < count; ++k) {
        terms[k] = derivatives[stages[k]];
        factors[k] = weights[k];
    }
    NCGEN_UNROLLED
    for (int i = 0; i < size; ++i) {
        ncgen_real sum = count ? factors[0] * terms[0][i] : NCGEN_SPLAT((ncgen_scalar)0);
        for (int k = 1; k < count; ++k)
            sum += factors[k] * terms[k][i];
        out[i] = y ? y[i] + h * sum : sum;
    }
}

/* A function for each count, since one for all of them saves and restores what none but the longest needs. */
#define NCGEN_ADD_UP(COUNT)                                                                                                                \
    static NCGEN_NOINLINE void ncgen_add_up_##COUNT(int size, const unsigned char *stages, const ncgen_scalar *weights,                    \
                                                    ncgen_real *const *derivatives, const ncgen_real *y, ncgen_real h, ncgen_real *out)    \
    {                                                                                                                                      \
        ncgen_add_up(COUNT, size, stages, weights, derivatives, y, h, out);                                                                \
    }
NCGEN_ADD_UP(0)
NCGEN_ADD_UP(1)
NCGEN_ADD_UP(2)
NCGEN_ADD_UP(3)
NCGEN_ADD_UP(4)
NCGEN_ADD_UP(5)
NCGEN_ADD_UP(6)
NCGEN_ADD_UP(7)
NCGEN_ADD_UP(8)

/* By the number of stages. */
typedef void ncgen_adding(int size, const unsigned char *stages, const ncgen_scalar *weights, ncgen_real *const *derivatives,
                          const ncgen_real *y, ncgen_real h, ncgen_real *out);
static ncgen_adding *const ncgen_adding_of[NCGEN_AT_ONCE + 1] = {ncgen_add_up_0, ncgen_add_up_1, ncgen_add_up_2, ncgen_add_up_3, ncgen_add_up_4,
                                                                 ncgen_add_up_5, ncgen_add_up_6, ncgen_add_up_7, ncgen_add_up_8};

/* The same for a row of more stages, in as many passes as it takes, each of which adds to the sum of those before it. */
static NCGEN_NOINLINE void ncgen_add_passes(int size, const tableau_row *row, ncgen_real *const *derivatives, const ncgen_real *y, ncgen_real h,
                                            ncgen_real *out)
{
    static const unsigned char in_order[NCGEN_AT_ONCE] = {0, 1, 2, 3, 4, 5, 6, 7};
    ncgen_real *terms[NCGEN_AT_ONCE];
    ncgen_scalar weights[NCGEN_AT_ONCE];
    int next = NCGEN_AT_ONCE;
    ncgen_add_up_8(size, row->stages, row->weights, derivatives, NULL, h, out);
    while (next < row->count) {
        int count = 1;
        terms[0] = out;
        weights[0] = 1;
        for (; next < row->count && count < NCGEN_AT_ONCE; ++next) {
            terms[count] = derivatives[row->stages[next]];
            weights[count++] = row->weights[next];
        }
        ncgen_adding_of[count](size, in_order, weights, terms, next < row->count ? NULL : y, h, out);
    }
}

/* out = y + h times the sum over the stages of a row, or without y the sum alone. */
static inline void ncgen_sum_stages(int size, const tableau_row *row, ncgen_real *const *derivatives, const ncgen_real *y, ncgen_real h,
                                    ncgen_real *out)
{
    if (row->count > NCGEN_AT_ONCE)
        ncgen_add_passes(size, row, derivatives, y, h, out);
    else
        ncgen_adding_of[row->count](size, row->stages, row->weights, derivatives, y, h, out);
}

#endif
