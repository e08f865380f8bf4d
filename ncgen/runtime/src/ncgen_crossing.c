/* ncgen_crossing.c: the first change of sign of a polynomial, by Bernstein's coefficients.
 *
 * A polynomial lies between its smallest and its largest coefficient, and has at most as many roots in the interval as these change
 * their sign (Farouki and Rajan, On the numerical condition of polynomials in Bernstein form, 1987). Parts of the interval are halved
 * until none or one is left.
 */
#include "ncgen_crossing.h"
#include "ncgen_vectors.h"

enum { MOST = NCGEN_CROSSING_DEGREE + 1 };

static const int whole = 1 << 30; /* places in the interval are counted in 2^-30 of it */

static int sign_of(ncgen_real value, ncgen_scalar noise)
{
    return (value > noise) - (value < -noise);
}

/* Is the sign at a place the one that is waited for, and was it the other one before? */
static int turns(ncgen_walk *w, ncgen_scalar place, int sign)
{
    w->next = place;
    if (w->sign && sign && sign != w->sign && sign * w->direction >= 0)
        return 1;
    if (sign) {
        w->seen = 1;
        w->sign = sign;
        w->at = place;
    }
    return 0;
}

static void to_coefficients(const ncgen_basis *basis, const ncgen_real *values, int stride, ncgen_real *b)
{
    const int count = basis->degree + 1;
    for (int i = 0; i < count; ++i) {
        const ncgen_scalar *row = basis->inverse + (size_t)i * (size_t)count;
        b[i] = i == 0 || i == basis->degree ? values[(size_t)i * (size_t)stride] : 0;
        for (int k = 0; k < count && i > 0 && i < basis->degree; ++k)
            b[i] += row[k] * values[(size_t)k * (size_t)stride];
    }
}

/* The coefficients on the part from `low` to `high`, by de Casteljau's rule for either end. */
static void restrict_to(int degree, const ncgen_real *b, ncgen_scalar low, ncgen_scalar high, ncgen_real *c)
{
    for (int i = 0; i <= degree; ++i)
        c[i] = b[i];
    if (!(low > 0) && !(high < 1))
        return;
    for (int j = 1; j <= degree; ++j)
        for (int i = degree; i >= j; --i)
            c[i] = (1 - high) * c[i - 1] + high * c[i];
    const ncgen_scalar share = low / high;
    for (int j = 1; j <= degree; ++j)
        for (int i = 0; i <= degree - j; ++i)
            c[i] = (1 - share) * c[i] + share * c[i + 1];
}

/* How often the coefficients change their sign; *sign: the last one that has any. */
static int changes_of(int degree, const ncgen_real *c, ncgen_scalar noise, int *sign)
{
    int changes = 0;
    *sign = 0;
    for (int i = 0; i <= degree; ++i) {
        const int here = sign_of(c[i], noise);
        if (!here)
            continue;
        changes += *sign && here != *sign;
        *sign = here;
    }
    return changes;
}

/* Is the part of width / whole from place / whole on to be halved? Else: does the sign turn in it? The places are shares of from .. to. */
static int is_mixed(ncgen_walk *w, int degree, const ncgen_real *b, int place, int width, ncgen_scalar noise, ncgen_scalar from,
                    ncgen_scalar to, int *crossed)
{
    ncgen_real c[MOST];
    int sign;
    const ncgen_scalar unit = 1 / (ncgen_scalar)whole, low = (ncgen_scalar)place * unit, high = (ncgen_scalar)(place + width) * unit;
    const ncgen_scalar span = to - from;
    restrict_to(degree, b, low, high, c);
    const int changes = changes_of(degree, c, noise, &sign), first = sign_of(c[0], noise), last = sign_of(c[degree], noise);
    if (width > 1 && (changes > 1 || (changes == 1 && !(first && last))))
        return 1;
    if (changes == 0)
        *crossed = turns(w, from + (low + (high - low) / 2) * span, sign);
    else
        *crossed = turns(w, from + low * span, first) || turns(w, from + high * span, last);
    return 0;
}

int ncgen_walk_part(ncgen_walk *w, const ncgen_basis *basis, const ncgen_real *values, int stride, ncgen_scalar noise, ncgen_scalar from,
                    ncgen_scalar to)
{
    ncgen_real b[MOST];
    const ncgen_scalar least = noise > w->noise ? noise : w->noise;
    int crossed = 0, place = 0, width = whole;
    to_coefficients(basis, values, stride, b);
    while (place < whole && !crossed) {
        if (is_mixed(w, basis->degree, b, place, width, least, from, to, &crossed)) {
            width /= 2;
            continue;
        }
        for (place += width; width < whole && place % (2 * width) == 0;) /* the next part is as wide as its place among the halves allows */
            width *= 2;
    }
    return crossed;
}

int ncgen_walk_to(ncgen_walk *w, ncgen_scalar place, ncgen_real value)
{
    return turns(w, place, sign_of(value, w->noise));
}

int ncgen_walk_end(ncgen_walk *w, ncgen_real last)
{
    const int sign = sign_of(last, w->noise), before = w->sign; /* to end at zero is to get there, but not to be there throughout */
    if ((sign || w->seen) && turns(w, 1, sign ? sign : -w->sign))
        return 1;
    w->sign = sign ? w->sign : before;
    return 0;
}

ncgen_real ncgen_polynomial_at(const ncgen_basis *basis, const ncgen_real *values, int stride, ncgen_scalar place)
{
    ncgen_real b[MOST];
    to_coefficients(basis, values, stride, b);
    for (int j = 1; j <= basis->degree; ++j)
        for (int i = 0; i <= basis->degree - j; ++i)
            b[i] = (1 - place) * b[i] + place * b[i + 1];
    return b[0];
}

int ncgen_has_one_sign(const ncgen_basis *basis, const ncgen_real *values, int stride, ncgen_scalar noise)
{
    ncgen_real b[MOST];
    to_coefficients(basis, values, stride, b);
    const int sign = sign_of(b[0], noise);
    for (int i = 1; i <= basis->degree; ++i)
        if (sign_of(b[i], noise) != sign)
            return 0;
    return sign != 0;
}

int ncgen_first_crossing(const ncgen_basis *basis, const ncgen_real *values, int stride, ncgen_scalar noise, int direction, int *sign,
                         ncgen_scalar *low, ncgen_scalar *high)
{
    ncgen_walk w = {direction, *sign ? *sign : sign_of(values[0], 0), 0, 0, 0, 0};
    const ncgen_real last = values[(size_t)basis->degree * (size_t)stride];
    int crossed = ncgen_walk_part(&w, basis, values, stride, noise, 0, 1);
    if (!crossed && (!*sign || w.seen || sign_of(last, noise))) /* else it stays where it has no sign, and keeps the one that it had */
        crossed = ncgen_walk_end(&w, last);
    *low = w.at;
    *high = w.next;
    *sign = w.sign;
    return crossed;
}
