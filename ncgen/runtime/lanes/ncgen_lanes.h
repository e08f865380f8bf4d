/* ncgen_lanes.h: a number is a vector of NCGEN_LANES doubles, one of each of as many states.
 *
 * Included before everything else (-include), it makes the generated text and ncgen_batch.c work on several states at
 * once, with the vectors of GNU C. Functions that are no instructions are called lane by lane, so every lane has the
 * numbers that the same text gives in double.
 */
#ifndef NCGEN_LANES_H
#define NCGEN_LANES_H

#include <math.h>

#if defined(NCGEN_LANES)
#elif defined(__AVX512F__)
#define NCGEN_LANES 8
#else
#define NCGEN_LANES 4
#endif

typedef double ncgen_lanes __attribute__((vector_size(8 * NCGEN_LANES)));
typedef long long ncgen_mask __attribute__((vector_size(8 * NCGEN_LANES))); /* -1 or 0 in every lane */

#define NCGEN_REAL ncgen_lanes
#define NCGEN_SCALAR double

/* A lane of the result is of a where the mask is set, of b elsewhere. */
static inline ncgen_lanes ncgen_select(ncgen_mask mask, ncgen_lanes a, ncgen_lanes b)
{
    return (ncgen_lanes)((mask & (ncgen_mask)a) | (~mask & (ncgen_mask)b));
}

static inline int ncgen_any(ncgen_mask mask)
{
    long long any = 0;
    for (int i = 0; i < NCGEN_LANES; ++i)
        any |= mask[i];
    return any != 0;
}

static inline int ncgen_all(ncgen_mask mask)
{
    return !ncgen_any(~mask);
}

#define NCGEN_LANEWISE(name)                                       \
    static inline ncgen_lanes ncgen_lanes_##name(ncgen_lanes x)    \
    {                                                              \
        ncgen_lanes y;                                             \
        for (int i = 0; i < NCGEN_LANES; ++i)                      \
            y[i] = name(x[i]);                                     \
        return y;                                                  \
    }
#define NCGEN_LANEWISE_PAIR(name)                                             \
    static inline ncgen_lanes ncgen_lanes_##name(ncgen_lanes a, ncgen_lanes b) \
    {                                                                         \
        ncgen_lanes y;                                                        \
        for (int i = 0; i < NCGEN_LANES; ++i)                                 \
            y[i] = name(a[i], b[i]);                                          \
        return y;                                                             \
    }

NCGEN_LANEWISE(sqrt)
NCGEN_LANEWISE(sin)
NCGEN_LANEWISE(cos)
NCGEN_LANEWISE(tan)
NCGEN_LANEWISE(asin)
NCGEN_LANEWISE(acos)
NCGEN_LANEWISE(atan)
NCGEN_LANEWISE(sinh)
NCGEN_LANEWISE(cosh)
NCGEN_LANEWISE(tanh)
NCGEN_LANEWISE(exp)
NCGEN_LANEWISE(log)
NCGEN_LANEWISE_PAIR(atan2)
NCGEN_LANEWISE_PAIR(pow)

static inline ncgen_lanes ncgen_lanes_fabs(ncgen_lanes x)
{
    return (ncgen_lanes)((ncgen_mask)x & 0x7fffffffffffffffLL);
}

static inline ncgen_lanes ncgen_lanes_sign(ncgen_lanes x)
{
    const ncgen_lanes zero = {0}, one = zero + 1.0;
    return ncgen_select(x > 0.0, one, zero) - ncgen_select(x < 0.0, one, zero);
}

static inline ncgen_lanes ncgen_splat(double x)
{
    const ncgen_lanes zero = {0};
    return zero + x;
}

/* An argument that may be a number, the same for all lanes, or lanes; a zero taken away changes neither, not even the sign of a zero. */
#define NCGEN_LANES_OF(x) ((x) - (ncgen_lanes){0})

#define NCGEN_SPLAT(x) ncgen_splat(x)
#define NCGEN_SQRT(x) ncgen_lanes_sqrt(NCGEN_LANES_OF(x))
#define NCGEN_SIN(x) ncgen_lanes_sin(NCGEN_LANES_OF(x))
#define NCGEN_COS(x) ncgen_lanes_cos(NCGEN_LANES_OF(x))
#define NCGEN_TAN(x) ncgen_lanes_tan(NCGEN_LANES_OF(x))
#define NCGEN_ASIN(x) ncgen_lanes_asin(NCGEN_LANES_OF(x))
#define NCGEN_ACOS(x) ncgen_lanes_acos(NCGEN_LANES_OF(x))
#define NCGEN_ATAN(x) ncgen_lanes_atan(NCGEN_LANES_OF(x))
#define NCGEN_ATAN2(y, x) ncgen_lanes_atan2(NCGEN_LANES_OF(y), NCGEN_LANES_OF(x))
#define NCGEN_SINH(x) ncgen_lanes_sinh(NCGEN_LANES_OF(x))
#define NCGEN_COSH(x) ncgen_lanes_cosh(NCGEN_LANES_OF(x))
#define NCGEN_TANH(x) ncgen_lanes_tanh(NCGEN_LANES_OF(x))
#define NCGEN_EXP(x) ncgen_lanes_exp(NCGEN_LANES_OF(x))
#define NCGEN_LOG(x) ncgen_lanes_log(NCGEN_LANES_OF(x))
#define NCGEN_ABS(x) ncgen_lanes_fabs(NCGEN_LANES_OF(x))
#define NCGEN_SIGN(x) ncgen_lanes_sign(NCGEN_LANES_OF(x))
#define NCGEN_POW(x, y) ncgen_lanes_pow(NCGEN_LANES_OF(x), NCGEN_LANES_OF(y))
#define NCGEN_FLOOR(x) floor(x) /* of a scalar */

/* Lanes with angles that ncgen_sincos does not reduce take the library's sine and cosine. */
#define NCGEN_SINCOS_FAR(n, x, sine, cosine)                                          \
    do {                                                                              \
        ncgen_mask far = {0};                                                         \
        for (int i = 0; i < (n); ++i)                                                 \
            far |= ~(NCGEN_ABS((x)[i]) < NCGEN_FAR);                                  \
        for (int i = 0; ncgen_any(far) && i < (n); ++i) {                             \
            const ncgen_mask own = ~(NCGEN_ABS((x)[i]) < NCGEN_FAR);                  \
            (sine)[i] = ncgen_select(own, NCGEN_SIN((x)[i]), (sine)[i]);              \
            (cosine)[i] = ncgen_select(own, NCGEN_COS((x)[i]), (cosine)[i]);          \
        }                                                                             \
    } while (0)

#endif
