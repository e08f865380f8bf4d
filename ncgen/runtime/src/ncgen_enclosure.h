/* ncgen_enclosure.h: functions of one variable on [-1, 1] between bounds: a polynomial in Chebyshev's basis, and how far the function may be
 * from it. Operations on such functions give such functions (Epstein, Miranker and Rivlin, Ultra-arithmetic, 1982; Brisebarre and Joldes,
 * Chebyshev interpolation polynomial-based tools for rigorous computing, 2010). */
#ifndef NCGEN_ENCLOSURE_H
#define NCGEN_ENCLOSURE_H

#include "ncgen_runtime.h"
#include "ncgen_vectors.h"

enum { NCGEN_ENCLOSURE_DEGREE = 14 }; /* at most */

/* An error that says nothing; so does a larger one, and NaN. */
#define NCGEN_UNBOUNDED R(1.0e30)

/* c: coefficients; error: a bound of the distance */
typedef struct ncgen_enclosure {
    ncgen_scalar c[NCGEN_ENCLOSURE_DEGREE + 1];
    ncgen_scalar error;
} ncgen_enclosure;

/* What all operations need. cosines: cos(pi k / degree), k = 0 .. 2 degree - 1; the degree is even. rounding: what an operation adds to the
 * error, over the size of its result */
typedef struct ncgen_enclosing {
    int degree;
    const ncgen_scalar *cosines;
    ncgen_scalar rounding;
} ncgen_enclosing;

/* The polynomial through values at the degree + 1 places cos(pi k / degree), and its values there. */
void ncgen_enclosure_through(const ncgen_enclosing *with, const ncgen_scalar *values, ncgen_scalar *c);
void ncgen_enclosure_values(const ncgen_enclosing *with, const ncgen_scalar *c, ncgen_scalar *values);
/* Of a polynomial at x. */
ncgen_scalar ncgen_enclosure_at(int degree, const ncgen_scalar *c, ncgen_scalar x);
/* The largest size that the function may have. */
ncgen_scalar ncgen_enclosure_size(const ncgen_enclosing *with, const ncgen_enclosure *u);

void ncgen_enclose_number(const ncgen_enclosing *with, ncgen_scalar x, ncgen_enclosure *w);
/* w = an operation of NCGEN_FORMULA_... on u, and v where it takes two; pieces: of a lookup. w differs from the others. */
void ncgen_enclose(const ncgen_enclosing *with, int operation, const ncgen_enclosure *u, const ncgen_enclosure *v,
                   const ncgen_scalar *pieces, ncgen_enclosure *w);

#endif
