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

/* values: at the nodes, `stride` numbers from each other; noise: what is smaller has no sign, but for the first and the last of them.
 * direction: 1 from negative to positive, -1 the other way, 0 either. *sign: the sign to begin with, or 0 for that of the first value;
 * then the last one that is clear. Returns 1 and shares low < high with one change of sign in between,
 * or 0 where there is none. Two of them that are nearer to each other than 2^-30, or part by less than the noise, do not count. */
int ncgen_first_crossing(const ncgen_basis *basis, const ncgen_real *values, int stride, ncgen_scalar noise, int direction, int *sign,
                         ncgen_scalar *low, ncgen_scalar *high);

#endif
