/* ncgen_stages.c: sums of the derivatives at the stages of a Runge-Kutta step. */
#include "ncgen_stages.h"

enum { AT_ONCE = 8 };

/* Terms of a sum of weight times derivative, as many as are added in a pass: over few numbers a pass costs more than what it adds. */
typedef struct {
    const ncgen_real *derivatives[AT_ONCE];
    ncgen_scalar weights[AT_ONCE];
    int count;
} terms;

/* The next terms that have a weight, from stage *j on, which becomes the one behind them; one more, without a weight, where they are odd. */
static inline void next_terms(const ncgen_stepping *w, int *j, int stages, const ncgen_scalar *weights, terms *s)
{
    for (; *j < stages && s->count < AT_ONCE; ++*j)
        if (NCGEN_ABS(weights[*j]) > 0) {
            s->weights[s->count] = weights[*j];
            s->derivatives[s->count++] = w->stage_derivatives[*j];
        }
    if (s->count < AT_ONCE) {
        s->derivatives[s->count] = w->stage_derivatives[0];
        s->weights[s->count] = 0;
    }
}

/* out = y + h times the sum of the terms, or without y the sum alone. `count` is a number that the compiler knows. */
static inline void add_up(int count, int ny, const terms *s, const ncgen_real *y, ncgen_scalar h, ncgen_real *out)
{
    const ncgen_real *derivatives[AT_ONCE];
    ncgen_scalar weights[AT_ONCE];
    for (int k = 0; k < count; ++k) {
        derivatives[k] = s->derivatives[k];
        weights[k] = s->weights[k];
    }
    NCGEN_UNROLLED
    for (int i = 0; i < ny; ++i) {
        ncgen_real sum = weights[0] * derivatives[0][i];
        for (int k = 1; k < count; ++k)
            sum += weights[k] * derivatives[k][i];
        out[i] = y ? y[i] + h * sum : sum;
    }
}

static void add_terms(int ny, const terms *s, const ncgen_real *y, ncgen_scalar h, ncgen_real *out)
{
    if (s->count <= 1)
        add_up(1, ny, s, y, h, out);
    else if (s->count <= 2)
        add_up(2, ny, s, y, h, out);
    else if (s->count <= 4)
        add_up(4, ny, s, y, h, out);
    else if (s->count <= 6)
        add_up(6, ny, s, y, h, out);
    else
        add_up(8, ny, s, y, h, out);
}

/* As add_up of all terms, in as many passes as they take: each adds to the sum of those before it. */
static void sum_stages(const ncgen_run *r, const ncgen_stepping *w, int stages, const ncgen_scalar *weights, const ncgen_real *y,
                       ncgen_scalar h, ncgen_real *out)
{
    terms s;
    int j = 0;
    s.count = 0;
    next_terms(w, &j, stages, weights, &s);
    while (j < stages) {
        add_terms(r->ny, &s, NULL, 0, out);
        s.derivatives[0] = out;
        s.weights[0] = 1;
        s.count = 1;
        next_terms(w, &j, stages, weights, &s);
    }
    add_terms(r->ny, &s, y, h, out);
}

void ncgen_combine_stages(const ncgen_run *r, const ncgen_stepping *w, int stages, const ncgen_scalar *weights,
                          ncgen_real *NCGEN_RESTRICT sum)
{
    sum_stages(r, w, stages, weights, NULL, 0, sum);
}

void ncgen_advance_by_stages(const ncgen_run *r, const ncgen_stepping *w, ncgen_scalar h, int stages, const ncgen_scalar *weights,
                             ncgen_real *NCGEN_RESTRICT y_new)
{
    sum_stages(r, w, stages, weights, r->y, h, y_new);
}
