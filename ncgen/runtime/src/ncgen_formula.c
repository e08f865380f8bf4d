/* ncgen_formula.c: conditions as formulas on the polynomials of coordinates and velocities in time.
 *
 * On a part of a step a condition is a polynomial and an error. Where the polynomial is clearer than the error its sign is that of the
 * condition; elsewhere the part is halved until the error is rounding, which takes few halvings as the error falls with the power
 * degree + 1 of the width. Kinks and jumps are halved down to 2^-30 of the step.
 */
#include "ncgen_formula.h"

/* Errors below this, in units of rounding and over the size of a condition, count as rounding: what sums of derivatives leave. */
static const ncgen_scalar resolved = R(20000.0);

enum {
    MOST = NCGEN_ENCLOSURE_DEGREE + 1,
    NARROWEST = 30, /* halvings */
    NARROWEST_UNBOUNDED = 8, /* the same where there are no bounds */
    MOST_PARTS = 2000 /* of one condition in one step; the rest is sampled */
};

static ncgen_enclosing enclosing_of(const ncgen_formula_step *step)
{
    const ncgen_enclosing with = {step->degree, step->formulas->cosines, 2 * (ncgen_scalar)(step->degree + 1) * step->rounding};
    return with;
}

/* An input on a part of the step. */
static void restrict_input(const ncgen_formula_step *step, const ncgen_enclosing *with, int i, ncgen_scalar low, ncgen_scalar high, ncgen_enclosure *w)
{
    const int n = step->degree;
    const ncgen_real *c = step->formulas->values + (size_t)(2 * i + 1) * (size_t)(n + 1);
    ncgen_scalar values[MOST];
    if (low > 0 || high < 1) {
        for (int k = 0; k <= n; ++k)
            values[k] = ncgen_enclosure_at(n, c, low + high - 1 + (high - low) * with->cosines[k]);
        ncgen_enclosure_through(with, values, w->c);
    } else {
        for (int k = 0; k <= n; ++k)
            w->c[k] = c[k];
    }
    w->error = 0;
    w->error = with->rounding * ncgen_enclosure_size(with, w);
}

const ncgen_enclosure *ncgen_bounded_formula(const ncgen_formula_step *step, int k, ncgen_scalar low, ncgen_scalar high)
{
    const ncgen_formulas *f = step->formulas;
    const ncgen_enclosing with = enclosing_of(step);
    ncgen_enclosure *results = (ncgen_enclosure *)(void *)f->workspace;
    const int count = f->first[k + 1] - f->first[k];
    for (int i = 0; i < count; ++i) {
        const int *operation = f->operations + 3 * (f->first[k] + i), a = operation[1], b = operation[2];
        ncgen_enclosure *w = results + i;
        switch (operation[0]) {
        case NCGEN_FORMULA_NUMBER: ncgen_enclose_number(&with, f->numbers[a], w); break;
        case NCGEN_FORMULA_PARAMETER: ncgen_enclose_number(&with, step->p[a], w); break;
        case NCGEN_FORMULA_STATE: restrict_input(step, &with, a, low, high, w); break;
        case NCGEN_FORMULA_TIME:
            ncgen_enclose_number(&with, step->t + step->h * (low + high) / 2, w);
            w->c[1] = step->h * (high - low) / 2;
            w->error = with.rounding * (NCGEN_ABS(step->t) + step->h);
            break;
        case NCGEN_FORMULA_LOOKUP: ncgen_enclose(&with, operation[0], results + a, NULL, f->numbers + b, w); break;
        default: ncgen_enclose(&with, operation[0], results + a, results + b, NULL, w);
        }
    }
    return results + count - 1;
}

/* The largest result of the operations of condition k on the part that was bounded last. */
static ncgen_scalar largest_result(const ncgen_formula_step *step, int k)
{
    const ncgen_enclosing with = enclosing_of(step);
    const ncgen_enclosure *results = (const ncgen_enclosure *)(void *)step->formulas->workspace;
    ncgen_scalar largest = 0;
    for (int i = 0; i < step->formulas->first[k + 1] - step->formulas->first[k]; ++i) {
        const ncgen_scalar size = ncgen_enclosure_size(&with, results + i);
        largest = size > largest ? size : largest;
    }
    return largest;
}

/* Is the error of half a part hardly less than that of the whole, and small over the condition, or over what it is made of where that
 * cancels, as in a condition that is zero on one side of a kink? */
static int is_rounding(const ncgen_formula_step *step, int k, ncgen_scalar error, ncgen_scalar of_whole, ncgen_scalar size)
{
    return error > R(0.8) * of_whole && (error < R(1.0e-9) * size || error < R(1.0e-11) * largest_result(step, k));
}

int ncgen_walk_formula(const ncgen_formula_step *step, const ncgen_basis *basis, int k, ncgen_scalar size, ncgen_walk *walk,
                       ncgen_scalar *reached, ncgen_scalar *unbounded, int *parts)
{
    const int whole = 1 << NARROWEST;
    ncgen_scalar errors[NARROWEST + 1]; /* of the last part of every width */
    for (int i = 0; i <= NARROWEST; ++i)
        errors[i] = NCGEN_UNBOUNDED;
    ncgen_real values[MOST];
    int width = whole, level = 0, place = (int)(*reached * (ncgen_scalar)whole);
    while (place < whole) {
        *parts += 1;
        while (place % width) {
            width /= 2;
            ++level;
        }
        const ncgen_scalar low = (ncgen_scalar)place / (ncgen_scalar)whole, high = (ncgen_scalar)(place + width) / (ncgen_scalar)whole;
        const ncgen_enclosure *g = ncgen_bounded_formula(step, k, low, high);
        const int has_bounds = g->error < NCGEN_UNBOUNDED;
        for (int i = 0; i <= basis->degree; ++i)
            values[i] = ncgen_enclosure_at(basis->degree, g->c, 2 * basis->nodes[i] - 1);
        errors[level] = g->error;
        const int rounds = g->error <= resolved * step->rounding * size || (level > 0 && is_rounding(step, k, g->error, errors[level - 1], size));
        const int is_narrow = level == (has_bounds ? NARROWEST : NARROWEST_UNBOUNDED) || *parts >= MOST_PARTS;
        if (!rounds && !is_narrow && !(has_bounds && ncgen_has_one_sign(basis, values, 1, g->error))) {
            width /= 2;
            ++level;
            continue;
        }
        *reached = low;
        *unbounded = *parts < MOST_PARTS ? high : 1;
        if (!has_bounds || *parts >= MOST_PARTS)
            return 0;
        if (ncgen_walk_part(walk, basis, values, 1, g->error, low, high))
            return 1;
        for (place += width; width < whole && place % (2 * width) == 0; --level)
            width *= 2;
    }
    *reached = 1;
    return 0;
}
