/* ncgen_crossing.c: the first change of sign of a polynomial, by Bernstein's coefficients.
 *
 * A polynomial lies between its smallest and its largest coefficient, and has at most as many roots in the interval as these change
 * their sign (Farouki and Rajan, On the numerical condition of polynomials in Bernstein form, 1987). Parts of the interval are halved
 * until none or one is left.
 */
#include "ncgen_crossing.h"
#include "ncgen_vectors.h"

enum { DEGREE = NCGEN_CROSSING_DEGREE, COEFFICIENTS = DEGREE + 1 };

static const int whole = 1 << 30; /* places in the interval are counted in 2^-30 of it */

/* 88200 times rows 1 to 4 of the inverse of B, B[i][k] the k-th polynomial of Bernstein at i / 8; rows 5 to 7 are 3 to 1 backwards. */
static const ncgen_scalar inverse[4][COEFFICIENTS] = {
    {-151515, 705600, -1234800, 1646400, -1543500, 987840, -411600, 100800, -11025},
    {199390, -1359360, 3790080, -5680640, 5619600, -3709440, 1576960, -391680, 43290},
    {-204765, 1622720, -5480720, 10153920, -11147500, 7819840, -3459120, 883520, -99695},
    {163812, -1396736, 5193216, -10924032, 14015680, -10924032, 5193216, -1396736, 163812},
};

/* What is known as parts of the interval are walked through from left to right: the last sign and where it was seen. */
typedef struct walk {
    int direction, sign;
    ncgen_scalar at, next;
} walk;

static int sign_of(ncgen_real value, ncgen_scalar noise)
{
    return (value > noise) - (value < -noise);
}

/* Is the sign at a place the one that is waited for, and was it the other one before? */
static int turns(walk *w, ncgen_scalar place, int sign)
{
    w->next = place;
    if (w->sign && sign && sign != w->sign && sign * w->direction >= 0)
        return 1;
    if (sign) {
        w->sign = sign;
        w->at = place;
    }
    return 0;
}

static void to_coefficients(const ncgen_real *values, ncgen_real *b)
{
    b[0] = values[0];
    b[DEGREE] = values[DEGREE];
    for (int i = 1; i < DEGREE; ++i) {
        b[i] = 0;
        for (int k = 0; k < COEFFICIENTS; ++k)
            b[i] += (i <= 4 ? inverse[i - 1][k] : inverse[DEGREE - i - 1][DEGREE - k]) * values[k];
        b[i] /= R(88200.0);
    }
}

/* The coefficients on the part from `low` to `high`, by de Casteljau's rule for either end. */
static void restrict_to(const ncgen_real *b, ncgen_scalar low, ncgen_scalar high, ncgen_real *c)
{
    for (int i = 0; i < COEFFICIENTS; ++i)
        c[i] = b[i];
    for (int j = 1; j < COEFFICIENTS; ++j)
        for (int i = DEGREE; i >= j; --i)
            c[i] = (1 - high) * c[i - 1] + high * c[i];
    const ncgen_scalar share = low / high;
    for (int j = 1; j < COEFFICIENTS; ++j)
        for (int i = 0; i < COEFFICIENTS - j; ++i)
            c[i] = (1 - share) * c[i] + share * c[i + 1];
}

/* How often the coefficients change their sign; *sign: the last one that has any. */
static int changes_of(const ncgen_real *c, ncgen_scalar noise, int *sign)
{
    int changes = 0;
    *sign = 0;
    for (int i = 0; i < COEFFICIENTS; ++i) {
        const int here = sign_of(c[i], noise);
        if (!here)
            continue;
        changes += *sign && here != *sign;
        *sign = here;
    }
    return changes;
}

/* Is the part of width / whole from place / whole on to be halved? Else: does the sign turn in it? */
static int is_mixed(walk *w, const ncgen_real *b, int place, int width, ncgen_scalar noise, int *found)
{
    ncgen_real c[COEFFICIENTS];
    int sign;
    const ncgen_scalar unit = 1 / (ncgen_scalar)whole, low = (ncgen_scalar)place * unit, high = (ncgen_scalar)(place + width) * unit;
    restrict_to(b, low, high, c);
    const int changes = changes_of(c, noise, &sign), first = sign_of(c[0], noise), last = sign_of(c[DEGREE], noise);
    if (width > 1 && (changes > 1 || (changes == 1 && !(first && last))))
        return 1;
    if (changes == 0)
        *found = turns(w, low + (high - low) / 2, sign);
    else
        *found = turns(w, low, first) || turns(w, high, last);
    return 0;
}

int ncgen_first_crossing(const ncgen_real *values, ncgen_scalar noise, int direction, ncgen_scalar *low, ncgen_scalar *high)
{
    ncgen_real b[COEFFICIENTS];
    walk w = {direction, sign_of(values[0], 0), 0, 0};
    int found = 0, place = 0, width = whole;
    to_coefficients(values, b);
    while (place < whole && !found) {
        if (is_mixed(&w, b, place, width, noise, &found)) {
            width /= 2;
            continue;
        }
        for (place += width; width < whole && place % (2 * width) == 0;) /* the next part is as wide as its place among the halves allows */
            width *= 2;
    }
    const int last = sign_of(values[DEGREE], 0); /* to end at zero is to get there */
    found = found || turns(&w, 1, last ? last : -w.sign);
    *low = w.at;
    *high = w.next;
    return found;
}
