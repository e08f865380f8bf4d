/* ncgen_least.h: linear equations of any rank. */
#ifndef NCGEN_LEAST_H
#define NCGEN_LEAST_H

#include "ncgen_vectors.h"

/* The x of least norm among those with the least |a x - right|. a: size x size by rows, overwritten; v: room for as many numbers. */
void ncgen_least_squares(int size, ncgen_real *a, ncgen_real *v, const ncgen_real *right, ncgen_real *x);

#endif
