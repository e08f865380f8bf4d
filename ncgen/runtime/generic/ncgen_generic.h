/* ncgen_generic.h: the kernels of any mechanism whose terms a table describes (its layout: ncgen/program/term_tables.py).
 *
 * The table takes the place of the parameters p, so one set of compiled kernels serves all mechanisms, and numbers such as lengths and
 * masses may change from call to call. The matrices are dense.
 */
#ifndef NCGEN_GENERIC_H
#define NCGEN_GENERIC_H

#include "ncgen.h"

#ifdef __cplusplus
extern "C" {
#endif

/* begin cdef */

/* A type of terms: what it contributes is a function of its scalars (in the place of q), their rates and its constants (of p). It writes
 * phi, nu, gamma, kinetic energy, potential energy and power, then n_scalars numbers of phi_q or of forces, then, where it has mass,
 * n_scalars x n_scalars numbers of that. */
typedef struct ncgen_type {
    const char *key;
    ncgen_velocity_kernel *evaluate;
    int n_scalars;
    int n_data;
    int has_mass;
} ncgen_type;

/* end cdef */

extern const ncgen_type ncgen_types[];
extern const int ncgen_n_types;

/* begin functions */

/* Is a table of so many numbers one that the kernels can read? */
int ncgen_generic_is_table(const ncgen_real *table, long length);

/* The mechanism of a table; integers (m + 1 + m n + n + 1 + n n) hold the patterns of its matrices as long as the model is used. */
void ncgen_generic_describe(const ncgen_real *table, int *integers, ncgen_model *model);

int ncgen_generic_phi(ncgen_real t, const ncgen_real *q, const ncgen_real *table, ncgen_real *phi);
int ncgen_generic_phi_q(ncgen_real t, const ncgen_real *q, const ncgen_real *table, ncgen_real *phi_q);
int ncgen_generic_nu(ncgen_real t, const ncgen_real *q, const ncgen_real *table, ncgen_real *nu);
int ncgen_generic_gamma(ncgen_real t, const ncgen_real *q, const ncgen_real *qd, const ncgen_real *table, ncgen_real *gamma);
int ncgen_generic_mass(ncgen_real t, const ncgen_real *q, const ncgen_real *table, ncgen_real *mass);
int ncgen_generic_force(ncgen_real t, const ncgen_real *q, const ncgen_real *qd, const ncgen_real *table, ncgen_real *force);
int ncgen_generic_energy(ncgen_real t, const ncgen_real *q, const ncgen_real *qd, const ncgen_real *table, ncgen_real *energy);

/* end functions */

#ifdef __cplusplus
}
#endif

#endif
