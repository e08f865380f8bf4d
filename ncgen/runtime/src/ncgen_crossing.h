/* ncgen_crossing.h: where a polynomial changes its sign for the first time on [0, 1]. Nothing is sampled: its coefficients in the basis
 * of Bernstein bound it on every part of the interval, so none of its sign changes is missed and none is seen twice. */
#ifndef NCGEN_CROSSING_H
#define NCGEN_CROSSING_H

#include "ncgen.h"

enum { NCGEN_CROSSING_DEGREE = 14 }; /* at most: of a product of two interpolants in time, whose degree is 7 at most */

/* Where a polynomial's values are taken, degree + 1 shares from 0 to 1, and what makes coefficients of them, row by row. */
typedef struct ncgen_basis {
    int degree;
    const ncgen_scalar *nodes;
    const ncgen_scalar *inverse;
} ncgen_basis;

/* What is known of a function as parts of the interval are walked through from left to right: the sign to begin with or seen last, whether
 * any was seen, where, and the place of the last look. direction: 1 from negative to positive, -1 the other way, 0 either; noise: what is
 * not larger has no sign anywhere. */
typedef struct ncgen_walk {
    int direction, sign, seen;
    ncgen_scalar at, next, noise;
} ncgen_walk;

/* Walks through the part from `from` to `to`, where the function is within `noise` of the polynomial of degree basis->degree through its
 * values at the nodes, `stride` numbers from each other. Is there a change of sign, between w->at and w->next? Two of them that are nearer
 * to each other than 2^-30 of the part, or separate by less than the noise, do not count. */
int ncgen_walk_part(ncgen_walk *w, const ncgen_basis *basis, const ncgen_real *values, int stride, ncgen_scalar noise, ncgen_scalar from,
                    ncgen_scalar to);
/* The same for one value. */
int ncgen_walk_to(ncgen_walk *w, ncgen_scalar place, ncgen_real value);
/* The same at the end of the interval, by the last value whatever the noise of the polynomial. */
int ncgen_walk_end(ncgen_walk *w, ncgen_real last);
/* The polynomial at a place in the interval. */
ncgen_real ncgen_polynomial_at(const ncgen_basis *basis, const ncgen_real *values, int stride, ncgen_scalar place);
/* Has the polynomial one sign, by more than the noise? */
int ncgen_has_one_sign(const ncgen_basis *basis, const ncgen_real *values, int stride, ncgen_scalar noise);

/* For a polynomial on the whole interval. *sign: the sign to begin with, or 0 for that of the first value; then the last one that is clear.
 * Returns 1 and shares low < high with one change of sign in between, or 0 where there is none. With a sign to begin with, values that are noise
 * throughout have no other one, at their end neither. */
int ncgen_first_crossing(const ncgen_basis *basis, const ncgen_real *values, int stride, ncgen_scalar noise, int direction, int *sign,
                         ncgen_scalar *low, ncgen_scalar *high);

#endif
