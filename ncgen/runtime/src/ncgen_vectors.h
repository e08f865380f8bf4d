/* ncgen_vectors.h: numbers in a row: sums and small matrices. */
#ifndef NCGEN_VECTORS_H
#define NCGEN_VECTORS_H

#include "ncgen_space.h"

/* A literal of the number type, with the digits of the longest type that C99 has. */
#define R(x) ((ncgen_scalar)(x##L))

/* Before an inner loop of few runs: it becomes vectors of the processor, and is not unrolled. */
#if defined(__GNUC__) && !defined(__clang__) && __GNUC__ >= 8
#define NCGEN_VECTORISED _Pragma("GCC unroll 1")
#else
#define NCGEN_VECTORISED
#endif

ncgen_real ncgen_dot(int count, const ncgen_real *a, const ncgen_real *b);
ncgen_real ncgen_norm(int count, const ncgen_real *x);
int ncgen_is_finite(int count, const ncgen_real *x);  /* is no number infinite or none at all? */
ncgen_real ncgen_largest(int count, const ncgen_real *x, const ncgen_scalar *sizes); /* |x| over its size; not a number if one is not */
ncgen_scalar ncgen_next_random(unsigned *seed); /* of a sequence of numbers in (-1, 1) without a pattern, the same in every run (Lehmer 1951) */

#endif
