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

#endif

#endif
