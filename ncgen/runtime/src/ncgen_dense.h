/* ncgen_dense.h: accelerations by QR. */
#ifndef NCGEN_DENSE_H
#define NCGEN_DENSE_H

#include "ncgen_constrained.h"

int ncgen_dense_accelerations(ncgen_run *r, ncgen_constrained *w);

#endif
