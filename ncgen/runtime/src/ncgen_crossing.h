/* ncgen_crossing.h: where a polynomial changes its sign for the first time on [0, 1]. Nothing is sampled: its coefficients in the basis
 * of Bernstein bound it on every part of the interval, so none of its sign changes is missed and none is seen twice. */
#ifndef NCGEN_CROSSING_H
#define NCGEN_CROSSING_H

#include "ncgen.h"

enum { NCGEN_CROSSING_DEGREE = 8 }; /* of interpolants in time: at most 7 */

/* values: at 0, 1/8, ... 1; noise: what is smaller has no sign, but for the first and the last of them.
 * direction: 1 from negative to positive, -1 the other way, 0 either. Returns 1 and shares low < high with one change of sign in between,
 * or 0 where there is none. Two of them that are nearer to each other than 2^-30, or part by less than the noise, are none. */
int ncgen_first_crossing(const ncgen_real *values, ncgen_scalar noise, int direction, ncgen_scalar *low, ncgen_scalar *high);

#endif
