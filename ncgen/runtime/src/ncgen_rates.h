/* ncgen_rates.h: velocities that are set at an instant. */
#ifndef NCGEN_RATES_H
#define NCGEN_RATES_H

#include "ncgen_event_table.h"

/* begin functions */

/* Velocities qd (n) of which `count`, places[0], places[stride] and so on, become what is wanted; all others follow with the least kinetic
 * energy of the change. sizes (n): natural ones; responses (count x n): what unit impulses along these coordinates change, overwritten.
 * Returns -1, or the number of the one that the constraints allow least. */
int ncgen_set_rates(int n, int count, const int *places, int stride, const ncgen_real *wanted, const ncgen_scalar *sizes,
    ncgen_real *responses, ncgen_real *qd);

/* end functions */

#endif
