/* ncgen_stages.c: sums of the derivatives at the stages of a Runge-Kutta step. */
#include "ncgen_stages.h"

/* Terms of a sum of weight times derivative, as many as are added in a pass: over few numbers a pass costs more than what it adds. */
typedef struct {
    const ncgen_real *stage_derivatives[4];
    ncgen_scalar weights[4];
} terms;

/* The next stage from j on that has a weight. */
static inline int next_stage(int j, int stages, const ncgen_scalar *weights)
{
    while (j < stages && !(NCGEN_ABS(weights[j]) > 0))
        ++j;
    return j;
}

/* The next terms that have a weight, from stage *j on, which becomes the one behind them: how many. Others have a weight of 0. */
static inline int next_terms(const ncgen_stepping *w, int *j, int stages, const ncgen_scalar *weights, terms *s)
{
    int count = 0;
    for (int k = 0; k < 4; ++k) {
        s->stage_derivatives[k] = w->stage_derivatives[0];
        s->weights[k] = 0;
    }
    for (; *j < stages && count < 4; ++*j)
        if (NCGEN_ABS(weights[*j]) > 0) {
            s->weights[count] = weights[*j];
            s->stage_derivatives[count++] = w->stage_derivatives[*j];
        }
    return count;
}

/* sum = sum over the stages of weight times derivative, in their order. */
void ncgen_combine_stages(const ncgen_run *r, const ncgen_stepping *w, int stages, const ncgen_scalar *weights,
                    ncgen_real *NCGEN_RESTRICT sum)
{
    const int ny = r->ny;
    terms s;
    int j = 0, count = next_terms(w, &j, stages, weights, &s);
    for (int is_first = 1; is_first || count > 0; is_first = 0) {
        const ncgen_real *NCGEN_RESTRICT a = s.stage_derivatives[0], *NCGEN_RESTRICT b = s.stage_derivatives[1];
        const ncgen_real *NCGEN_RESTRICT c = s.stage_derivatives[2], *NCGEN_RESTRICT d = s.stage_derivatives[3];
        const ncgen_scalar u = s.weights[0], v = s.weights[1], x = s.weights[2], y = s.weights[3];
        if (is_first && count > 2)
            for (int i = 0; i < ny; ++i)
                sum[i] = u * a[i] + v * b[i] + x * c[i] + y * d[i];
        else if (is_first)
            for (int i = 0; i < ny; ++i)
                sum[i] = u * a[i] + v * b[i];
        else if (count > 2)
            for (int i = 0; i < ny; ++i)
                sum[i] = sum[i] + u * a[i] + v * b[i] + x * c[i] + y * d[i];
        else
            for (int i = 0; i < ny; ++i)
                sum[i] = sum[i] + u * a[i] + v * b[i];
        count = next_terms(w, &j, stages, weights, &s);
    }
}

void ncgen_advance_by_stages(const ncgen_run *r, const ncgen_stepping *w, ncgen_scalar h, int stages, const ncgen_scalar *weights,
                    ncgen_real *NCGEN_RESTRICT y_new)
{
    const ncgen_real *NCGEN_RESTRICT y = r->y;
    const int ny = r->ny, first = next_stage(0, stages, weights);
    if (first < stages && next_stage(first + 1, stages, weights) == stages) {
        const ncgen_real *NCGEN_RESTRICT only = w->stage_derivatives[first];
        const ncgen_scalar weight = weights[first];
        NCGEN_UNROLLED
        for (int i = 0; i < ny; ++i)
            y_new[i] = y[i] + h * (weight * only[i]);
        return;
    }
    terms s;
    int j = 0;
    (void)next_terms(w, &j, stages, weights, &s);
    const ncgen_real *NCGEN_RESTRICT a = s.stage_derivatives[0], *NCGEN_RESTRICT b = s.stage_derivatives[1];
    const ncgen_real *NCGEN_RESTRICT c = s.stage_derivatives[2], *NCGEN_RESTRICT d = s.stage_derivatives[3];
    if (j == stages) {
        NCGEN_UNROLLED
        for (int i = 0; i < ny; ++i)
            y_new[i] = y[i] + h * (s.weights[0] * a[i] + s.weights[1] * b[i] + s.weights[2] * c[i] + s.weights[3] * d[i]);
        return;
    }
    ncgen_combine_stages(r, w, stages, weights, y_new);
    for (int i = 0; i < ny; ++i)
        y_new[i] = y[i] + h * y_new[i];
}
