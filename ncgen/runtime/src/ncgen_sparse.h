/* ncgen_sparse.h: a quasidefinite matrix factored by a plan that is made once. */
#ifndef NCGEN_SPARSE_H
#define NCGEN_SPARSE_H

#include "ncgen_runtime.h"
#include "ncgen_vectors.h"

/* The matrix [A Phi_q'; Phi_q -E] and its factors. */
typedef struct ncgen_kkt {
    const ncgen_elimination *plan;
    ncgen_real *values;                  /* [mass, phi_q] as the plan numbers them */
    ncgen_real *lower;                   /* nonzeros of L */
    ncgen_real *pivots, *row;            /* size; row is zero between calls */
    ncgen_real *diagonal;                /* the diagonal -E in elimination order, zero for coordinates */
    ncgen_real *min_pivot, *replacement; /* size: smallest pivot that is left as it is, and what replaces a smaller one */
    ncgen_real *permuted;                /* size: for solutions */
    long perturbed;                      /* pivots of the last factorisation that were made larger */
    long let_go;                         /* rows that got no multiplier in it */
    long weak;                           /* pivots that have lost many digits, but are left as they are */
} ncgen_kkt;

void ncgen_kkt_layout(ncgen_kkt *k, const ncgen_elimination *plan, int nonzeros, ncgen_space *space);
int ncgen_kkt_factor(ncgen_kkt *k);
void ncgen_kkt_solve(ncgen_kkt *k, const ncgen_real *right, ncgen_real *x);

#endif
