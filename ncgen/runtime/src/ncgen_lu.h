/* ncgen_lu.h: LU decomposition with row exchanges. */
#ifndef NCGEN_LU_H
#define NCGEN_LU_H

#include "ncgen_vectors.h"

/* a by rows, row exchanges in order; orientation: sign of the determinant. right and x are two arrays. */
int ncgen_lu_factor(int size, ncgen_real *a, int *order, int *orientation);
void ncgen_lu_solve(int size, const ncgen_real *a, const int *order, const ncgen_real *right, ncgen_real *x);

#endif
