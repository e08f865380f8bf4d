/* ncgen_stage_sums.h: sums of the derivatives at the stages of a Runge-Kutta step; of numbers or of lanes. */
#ifndef NCGEN_STAGE_SUMS_H
#define NCGEN_STAGE_SUMS_H

#include "ncgen_math.h"

enum { NCGEN_AT_ONCE = 8 };

/* Terms of a sum of weight times derivative, as many as are added in a pass: over few numbers a pass costs more than what it adds. */
typedef struct {
    const ncgen_real *derivatives[NCGEN_AT_ONCE];
    ncgen_scalar weights[NCGEN_AT_ONCE];
    int count;
} ncgen_terms;

/* The next terms that have a weight, from stage j on, behind those that are there: the stage behind them; one more, without a weight, where
 * they are odd. */
static inline int ncgen_next_terms(int j, int stages, const ncgen_scalar *weights, ncgen_real *const *derivatives, ncgen_terms *s)
{
    int count = s->count;
    for (; j < stages && count < NCGEN_AT_ONCE; ++j)
        if (weights[j] < 0 || weights[j] > 0) {
            s->weights[count] = weights[j];
            s->derivatives[count++] = derivatives[j];
        }
    if (count < NCGEN_AT_ONCE) {
        s->weights[count] = 0;
        s->derivatives[count] = count ? s->derivatives[0] : NULL;
    }
    s->count = count;
    return j;
}

/* out = y + h times the sum of the terms, or without y the sum alone. `count` is a number that the compiler knows. */
static inline void ncgen_add_up(int count, int size, const ncgen_terms *s, const ncgen_real *y, ncgen_real h, ncgen_real *out)
{
    const ncgen_real *derivatives[NCGEN_AT_ONCE];
    ncgen_scalar weights[NCGEN_AT_ONCE];
    for (int k = 0; k < count; ++k) {
        derivatives[k] = s->derivatives[k];
        weights[k] = s->weights[k];
    }
    NCGEN_UNROLLED
    for (int i = 0; i < size; ++i) {
        ncgen_real sum = count ? weights[0] * derivatives[0][i] : NCGEN_SPLAT((ncgen_scalar)0);
        for (int k = 1; k < count; ++k)
            sum += weights[k] * derivatives[k][i];
        out[i] = y ? y[i] + h * sum : sum;
    }
}

/* A function for each count, since one for all of them saves and restores what none but the longest needs. */
#define NCGEN_ADD_UP(COUNT)                                                                                                                \
    static NCGEN_NOINLINE void ncgen_add_up_##COUNT(int size, const ncgen_terms *s, const ncgen_real *y, ncgen_real h, ncgen_real *out)     \
    {                                                                                                                                      \
        ncgen_add_up(COUNT, size, s, y, h, out);                                                                                           \
    }
NCGEN_ADD_UP(0)
NCGEN_ADD_UP(1)
NCGEN_ADD_UP(2)
NCGEN_ADD_UP(4)
NCGEN_ADD_UP(6)
NCGEN_ADD_UP(8)

static inline void ncgen_add_terms(int size, const ncgen_terms *s, const ncgen_real *y, ncgen_real h, ncgen_real *out)
{
    if (s->count == 0)
        ncgen_add_up_0(size, s, y, h, out);
    else if (s->count == 1)
        ncgen_add_up_1(size, s, y, h, out);
    else if (s->count == 2)
        ncgen_add_up_2(size, s, y, h, out);
    else if (s->count <= 4)
        ncgen_add_up_4(size, s, y, h, out);
    else if (s->count <= 6)
        ncgen_add_up_6(size, s, y, h, out);
    else
        ncgen_add_up_8(size, s, y, h, out);
}

/* The sum of terms, and of those from stage j on, in as many passes as it takes, each of which adds to the sum of those before it. */
static NCGEN_NOINLINE void ncgen_add_passes(int size, int j, int stages, const ncgen_scalar *weights, ncgen_real *const *derivatives,
                                            ncgen_terms *s, const ncgen_real *y, ncgen_real h, ncgen_real *out)
{
    while (j < stages) {
        ncgen_add_terms(size, s, NULL, h, out);
        s->derivatives[0] = out;
        s->weights[0] = 1;
        s->count = 1;
        j = ncgen_next_terms(j, stages, weights, derivatives, s);
    }
    ncgen_add_terms(size, s, y, h, out);
}

/* out = y + h times the sum over the stages of weight times derivative, or without y the sum alone. */
static inline void ncgen_sum_stages(int size, int stages, const ncgen_scalar *weights, ncgen_real *const *derivatives, const ncgen_real *y,
                                    ncgen_real h, ncgen_real *out)
{
    ncgen_terms s;
    s.count = 0;
    const int j = ncgen_next_terms(0, stages, weights, derivatives, &s);
    if (j < stages)
        ncgen_add_passes(size, j, stages, weights, derivatives, &s, y, h, out);
    else
        ncgen_add_terms(size, &s, y, h, out);
}

#endif
