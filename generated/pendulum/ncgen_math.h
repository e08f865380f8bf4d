/* ncgen_math.h: the elementary functions of generated code, for the number type chosen in ncgen.h. */
#ifndef NCGEN_MATH_H
#define NCGEN_MATH_H

#include "ncgen.h"

#if !defined(NCGEN_REAL)

#if defined(NCGEN_QUAD)
#include <quadmath.h>
#define NCGEN_FUNCTION(name) name##q
#else
#include <math.h>
#if defined(NCGEN_SINGLE)
#define NCGEN_FUNCTION(name) name##f
#elif defined(NCGEN_LONG_DOUBLE)
#define NCGEN_FUNCTION(name) name##l
#else
#define NCGEN_FUNCTION(name) name
#endif
#endif

#define NCGEN_SPLAT(x) (x)
#define NCGEN_SQRT(x) NCGEN_FUNCTION(sqrt)(x)
#define NCGEN_SIN(x) NCGEN_FUNCTION(sin)(x)
#define NCGEN_COS(x) NCGEN_FUNCTION(cos)(x)
#define NCGEN_TAN(x) NCGEN_FUNCTION(tan)(x)
#define NCGEN_ASIN(x) NCGEN_FUNCTION(asin)(x)
#define NCGEN_ACOS(x) NCGEN_FUNCTION(acos)(x)
#define NCGEN_ATAN(x) NCGEN_FUNCTION(atan)(x)
#define NCGEN_ATAN2(y, x) NCGEN_FUNCTION(atan2)(y, x)
#define NCGEN_SINH(x) NCGEN_FUNCTION(sinh)(x)
#define NCGEN_COSH(x) NCGEN_FUNCTION(cosh)(x)
#define NCGEN_TANH(x) NCGEN_FUNCTION(tanh)(x)
#define NCGEN_EXP(x) NCGEN_FUNCTION(exp)(x)
#define NCGEN_LOG(x) NCGEN_FUNCTION(log)(x)
#define NCGEN_ABS(x) NCGEN_FUNCTION(fabs)(x)
#define NCGEN_SIGN(x) ((ncgen_real)(((x) > 0) - ((x) < 0)))
#define NCGEN_POW(x, y) NCGEN_FUNCTION(pow)(x, y)
#define NCGEN_FLOOR(x) NCGEN_FUNCTION(floor)(x)

/* What ncgen_sincos leaves to the library: everything in other number types, angles beyond NCGEN_FAR in double. */
#define NCGEN_SINCOS_FAR(n, x, sine, cosine)          \
    do {                                              \
        int far = 0;                                  \
        for (int i = 0; i < (n); ++i)                 \
            far |= !(NCGEN_ABS((x)[i]) < NCGEN_FAR);  \
        for (int i = 0; far && i < (n); ++i)          \
            if (!(NCGEN_ABS((x)[i]) < NCGEN_FAR)) {   \
                (sine)[i] = NCGEN_SIN((x)[i]);        \
                (cosine)[i] = NCGEN_COS((x)[i]);      \
            }                                         \
    } while (0)

#endif

/* Sine and cosine of n angles at once: the loop has no branches and calls nothing, so the compiler computes several
 * angles side by side. It adds, multiplies and nothing else, so a number may also be a vector of numbers, and every
 * machine gives the same result. */
#if defined(NCGEN_SINGLE) || defined(NCGEN_LONG_DOUBLE) || defined(NCGEN_QUAD) || defined(NCGEN_DUAL_H)

static inline void ncgen_sincos(int n, const ncgen_real *NCGEN_RESTRICT x, ncgen_real *NCGEN_RESTRICT sine,
                                ncgen_real *NCGEN_RESTRICT cosine)
{
    for (int i = 0; i < n; ++i) {
        sine[i] = NCGEN_SIN(x[i]);
        cosine[i] = NCGEN_COS(x[i]);
    }
}

#else

/* Angles below this many radians are reduced here, within 0.8 units in the last place. */
#define NCGEN_FAR 1e6

static inline void ncgen_sincos(int n, const ncgen_real *NCGEN_RESTRICT x, ncgen_real *NCGEN_RESTRICT sine,
                                ncgen_real *NCGEN_RESTRICT cosine)
{
    const ncgen_scalar to_integer = 6755399441055744.0; /* 1.5 * 2^52: added and taken away, it rounds to an integer */

    /* x = k pi/2 + r + tail, with pi/2 in three parts of which the first two have 33 bits: k times them is exact. */
    for (int i = 0; i < n; ++i) {
        const ncgen_real k = (x[i] * 0.6366197723675814 + to_integer) - to_integer;
        const ncgen_real head = x[i] - k * 1.5707963267341256;
        const ncgen_real middle = k * 6.077100506303966e-11;
        const ncgen_real rest = head - middle;
        const ncgen_real lost = ((head - rest) - middle) - k * 2.0222662487959506e-21;
        const ncgen_real r = rest + lost;
        sine[i] = r;
        cosine[i] = (rest - r) + lost;
    }

    /* Minimax polynomials of sine and cosine on |r| <= pi/4, by pairs, so that their parts need not wait for each other. */
    for (int i = 0; i < n; ++i) {
        const ncgen_real r = sine[i], tail = cosine[i];
        const ncgen_real z = r * r;
        const ncgen_real zz = z * z;
        const ncgen_real half = 0.5 * z;
        const ncgen_real one_less = 1.0 - half;
        const ncgen_real sine_sum =
            (-0.16666666666666632 + z * 0.008333333333322413) +
            zz * ((-0.00019841269829807819 + z * 2.7557313691921887e-06) +
                  zz * (-2.5050758115840255e-08 + z * 1.589679568451575e-10));
        const ncgen_real cosine_sum =
            (0.0416666666666666 + z * -0.0013888888888874125) +
            zz * ((2.4801587289482184e-05 + z * -2.7557314352332913e-07) +
                  zz * (2.0875723273266597e-09 + z * -1.1359647806143871e-11));
        sine[i] = r + (r * z * sine_sum + tail * one_less);
        cosine[i] = one_less + (((1.0 - one_less) - half) + (zz * cosine_sum - r * tail));
    }

    /* The quarter of the circle, k modulo 4, as numbers that are 0 or 1: is it upside down, are s and c exchanged? */
    for (int i = 0; i < n; ++i) {
        const ncgen_real s = sine[i], c = cosine[i];
        const ncgen_real k = (x[i] * 0.6366197723675814 + to_integer) - to_integer;
        const ncgen_real quarter = k - 4.0 * (((k * 0.25 - 0.375) + to_integer) - to_integer);
        const ncgen_real down = ((quarter * 0.5 - 0.25) + to_integer) - to_integer;
        const ncgen_real swap = quarter - 2.0 * down;
        const ncgen_real keep = 1.0 - swap;
        const ncgen_real left = down + swap - 2.0 * (down * swap);
        sine[i] = (1.0 - 2.0 * down) * (keep * s + swap * c);
        cosine[i] = (1.0 - 2.0 * left) * (keep * c + swap * s);
    }
    NCGEN_SINCOS_FAR(n, x, sine, cosine);
}

#endif

/* How many of ascending knots are not after s. */
static inline int ncgen_knots_passed(const ncgen_scalar *knots, int count, ncgen_scalar s)
{
    int low = 0, high = count;
    while (low < high) {
        const int middle = (low + high) / 2;
        if (knots[middle] <= s)
            low = middle + 1;
        else
            high = middle;
    }
    return low;
}

/* A polynomial in every piece, and its derivative: a row of its origin and degree + 1 coefficients before the first of count knots, and one
 * behind each. What has a period begins again. */
static inline ncgen_scalar ncgen_piece(ncgen_scalar s, const ncgen_scalar *knots, const ncgen_scalar *rows, int count, int degree,
                                       ncgen_scalar period, ncgen_scalar *derivative)
{
    if (period > 0)
        s -= period * NCGEN_FLOOR((s - knots[0]) / period);
    const ncgen_scalar *row = rows + ncgen_knots_passed(knots, count, s) * (degree + 2);
    ncgen_scalar y = row[degree + 1];
    s -= row[0];
    *derivative = 0;
    for (int k = degree; k > 0; --k) {
        *derivative = *derivative * s + y;
        y = y * s + row[k];
    }
    return y;
}

#if !defined(NCGEN_PIECES)
#define NCGEN_PIECES(x, knots, rows, count, degree, period) ncgen_pieces(x, knots, rows, count, degree, period)

/* A number may be a vector of scalars, each with a piece of its own. */
static inline ncgen_real ncgen_pieces(ncgen_real x, const ncgen_scalar *knots, const ncgen_scalar *rows, int count, int degree,
                                      ncgen_scalar period)
{
    union {
        ncgen_real all;
        ncgen_scalar each[sizeof(ncgen_real) / sizeof(ncgen_scalar)];
    } number;
    ncgen_scalar derivative;
    number.all = x;
    for (size_t i = 0; i < sizeof(ncgen_real) / sizeof(ncgen_scalar); ++i)
        number.each[i] = ncgen_piece(number.each[i], knots, rows, count, degree, period, &derivative);
    return number.all;
}

#endif

#endif
