/* ncgen_batch.h: kernels of many states, NCGEN_LANES of them at a time, in any number of threads.
 *
 * Compiled with ncgen_lanes.h in front, as is the model's source, a number is a vector with one state a lane; without, one
 * state follows the other. States are rows of doubles one after the other; the results do not depend on the number of
 * threads, which counts only where OpenMP is.
 */
#ifndef NCGEN_BATCH_H
#define NCGEN_BATCH_H

#include "ncgen.h"

/* begin cdef */

/* Many states: t and p have one row for all (stride 0), or one for each (stride 1 and n_parameters). */
typedef struct ncgen_states {
    long count;
    const double *t;
    const double *q;
    const double *qd; /* NULL for kernels of the position */
    const double *p;
    int t_stride;
    int p_stride;
} ncgen_states;

/* end cdef */
/* begin functions */

/* How many states are computed side by side, and whether there are threads. */
int ncgen_batch_lanes(void);
int ncgen_batch_threads(void);

/* Numbers of workspace that one thread needs, for a kernel that writes `size` numbers. */
size_t ncgen_batch_workspace(const ncgen_model *model, int size);

/* One kernel of all states: out has count rows of `size` numbers. The workspace begins at a multiple of 64 bytes and
 * has room for every thread. Returns the worst status of any state. */
int ncgen_batch_kernel(const ncgen_model *model, ncgen_position_kernel *position, ncgen_velocity_kernel *velocity,
                       const ncgen_states *states, int size, double *out, int threads, double *workspace);

/* end functions */

#endif
