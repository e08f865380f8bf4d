/* ncgen_dual.h: a number is a double with its change along a direction: x + h i dx, complex, with an h so small that what is of second
 * order in it vanishes next to what is of first.
 *
 * Included before everything else (-include), it makes derivatives of whatever the generated text and ncgen_adjoint.c compute: with
 * derivatives for values, second derivatives. Comparisons, signs and pieces look at x alone.
 */
#ifndef NCGEN_DUAL_H
#define NCGEN_DUAL_H

#include <math.h>

#define NCGEN_REAL double _Complex
#define NCGEN_SCALAR double

#include "ncgen.h"

typedef union ncgen_dual {
    ncgen_real all;
    double part[2]; /* x, h dx */
} ncgen_dual;

static inline double ncgen_value(ncgen_real x)
{
    const ncgen_dual number = {x};
    return number.part[0];
}

static inline double ncgen_change(ncgen_real x)
{
    const ncgen_dual number = {x};
    return number.part[1];
}

static inline ncgen_real ncgen_with_change(double x, double change)
{
    ncgen_dual number;
    number.part[0] = x;
    number.part[1] = change;
    return number.all;
}

/* A function of the number x, of which y is the value: its value and its derivative. */
#define NCGEN_DUAL_FUNCTION(name, value, derivative)                    \
    static inline ncgen_real ncgen_dual_##name(ncgen_real number)       \
    {                                                                   \
        const double x = ncgen_value(number), y = value;                \
        return ncgen_with_change(y, (derivative) * ncgen_change(number)); \
    }

NCGEN_DUAL_FUNCTION(sqrt, sqrt(x), 0.5 / y)
NCGEN_DUAL_FUNCTION(sin, sin(x), cos(x))
NCGEN_DUAL_FUNCTION(cos, cos(x), -sin(x))
NCGEN_DUAL_FUNCTION(tan, tan(x), 1.0 + y * y)
NCGEN_DUAL_FUNCTION(asin, asin(x), 1.0 / sqrt((1.0 - x) * (1.0 + x)))
NCGEN_DUAL_FUNCTION(acos, acos(x), -1.0 / sqrt((1.0 - x) * (1.0 + x)))
NCGEN_DUAL_FUNCTION(atan, atan(x), 1.0 / (1.0 + x * x))
NCGEN_DUAL_FUNCTION(sinh, sinh(x), cosh(x))
NCGEN_DUAL_FUNCTION(cosh, cosh(x), sinh(x))
NCGEN_DUAL_FUNCTION(tanh, tanh(x), 1.0 - y * y)
NCGEN_DUAL_FUNCTION(exp, exp(x), y)
NCGEN_DUAL_FUNCTION(log, log(x), 1.0 / x)
NCGEN_DUAL_FUNCTION(fabs, fabs(x), (x > 0) - (x < 0))
NCGEN_DUAL_FUNCTION(sign, (x > 0) - (x < 0), 0.0)

static inline ncgen_real ncgen_dual_atan2(ncgen_real up, ncgen_real along)
{
    const double y = ncgen_value(up), x = ncgen_value(along);
    return ncgen_with_change(atan2(y, x), (x * ncgen_change(up) - y * ncgen_change(along)) / (x * x + y * y));
}

/* The exponent's change counts where there is one: log(x) need not exist else. */
static inline ncgen_real ncgen_dual_pow(ncgen_real base, ncgen_real exponent)
{
    const double x = ncgen_value(base), n = ncgen_value(exponent), dx = ncgen_change(base), dn = ncgen_change(exponent);
    const double y = pow(x, n), by_base = dx < 0 || dx > 0 ? n * pow(x, n - 1.0) * dx : 0.0;
    return ncgen_with_change(y, by_base + (dn < 0 || dn > 0 ? y * log(x) * dn : 0.0));
}

#define NCGEN_SPLAT(x) (x)
#define NCGEN_SQRT(x) ncgen_dual_sqrt(x)
#define NCGEN_SIN(x) ncgen_dual_sin(x)
#define NCGEN_COS(x) ncgen_dual_cos(x)
#define NCGEN_TAN(x) ncgen_dual_tan(x)
#define NCGEN_ASIN(x) ncgen_dual_asin(x)
#define NCGEN_ACOS(x) ncgen_dual_acos(x)
#define NCGEN_ATAN(x) ncgen_dual_atan(x)
#define NCGEN_ATAN2(y, x) ncgen_dual_atan2(y, x)
#define NCGEN_SINH(x) ncgen_dual_sinh(x)
#define NCGEN_COSH(x) ncgen_dual_cosh(x)
#define NCGEN_TANH(x) ncgen_dual_tanh(x)
#define NCGEN_EXP(x) ncgen_dual_exp(x)
#define NCGEN_LOG(x) ncgen_dual_log(x)
#define NCGEN_ABS(x) ncgen_dual_fabs(x)
#define NCGEN_SIGN(x) ncgen_dual_sign(x)
#define NCGEN_POW(x, y) ncgen_dual_pow(x, y)
#define NCGEN_FLOOR(x) floor(x) /* of a scalar */

#define NCGEN_PIECES(x, knots, rows, count, degree, period) ncgen_dual_pieces(x, knots, rows, count, degree, period)

#include "ncgen_math.h"

static inline ncgen_real ncgen_dual_pieces(ncgen_real x, const double *knots, const double *rows, int count, int degree, double period)
{
    double derivative;
    const double y = ncgen_piece(ncgen_value(x), knots, rows, count, degree, period, &derivative);
    return ncgen_with_change(y, derivative * ncgen_change(x));
}

#endif
