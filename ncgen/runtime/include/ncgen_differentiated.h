/* ncgen_differentiated.h: how a run by an emitted motion changes with where it starts and with its parameters.
 *
 * What is differentiated are the steps that were taken, as the run's tape (ncgen_tape) has them: stages, closing, the way along the
 * constraints and velocities, each by an emitted program; the lengths of steps are held.
 */
#ifndef NCGEN_DIFFERENTIATED_H
#define NCGEN_DIFFERENTIATED_H

#include "ncgen_runtime.h"

#ifdef __cplusplus
extern "C" {
#endif

/* begin cdef */

typedef int ncgen_seeded_position_kernel(ncgen_real t, const ncgen_real *q, const ncgen_real *p, const ncgen_real *seed,
                                         ncgen_real *out);
typedef int ncgen_seeded_velocity_kernel(ncgen_real t, const ncgen_real *q, const ncgen_real *qd, const ncgen_real *p,
                                         const ncgen_real *seed, ncgen_real *out);
typedef int ncgen_seeded_prepare_kernel(const ncgen_real *p, const ncgen_real *seed, ncgen_real *out);

/* The parts of an ncgen_motion, differentiated. Along a direction: from changes of q, qd (closing has none) and p to those of what the
 * part writes, [qd, qdd], qd and dq. Transposed: from weights of these to how their sum changes with q, qd and p. What is prepared
 * belongs to p. */
typedef struct ncgen_seeded_motion {
    ncgen_seeded_velocity_kernel *derivative;
    ncgen_seeded_velocity_kernel *velocities;
    ncgen_seeded_position_kernel *closing;
    ncgen_seeded_prepare_kernel *prepare; /* NULL where nothing is prepared */
} ncgen_seeded_motion;

/* A run that was taped, with the tableau that its method names. */
typedef struct ncgen_taped {
    int n_coordinates;
    int n_parameters;
    int n_prepared;
    int is_driven; /* 1: rows depend on time, so velocities are not 0 where nothing else moves */
    int method;
    int n_inputs;             /* the last of p, where something drives them; else 0 */
    const ncgen_real *p;      /* with what is prepared behind it */
    const ncgen_real *inputs; /* of all stages of all steps, n_inputs each */
    const ncgen_tape *tape;
} ncgen_taped;

/* end cdef */
/* begin functions */

/* Numbers of workspace of ncgen_adjoint. */
size_t ncgen_adjoint_workspace(const ncgen_taped *run);

/* How a number changes with the start and with p, by one sweep back through all steps.
 *
 * weights: how it depends on [q, qd] where steps begin and end, steps + 1 rows of 2 n_coordinates
 * gradient: by q and qd at the start, then by p, inputs by what is added to them all the time: 2 n_coordinates + n_parameters
 * by_inputs: by the inputs of every stage, in the order of run->inputs */
void ncgen_adjoint(const ncgen_taped *run, const ncgen_seeded_motion *transposed, const ncgen_real *weights, ncgen_real *gradient,
                   ncgen_real *by_inputs, ncgen_real *workspace);

/* The transposed parts by themselves, for what comes before the run; numbers that are no doubles are passed by their place. */
void ncgen_velocities_vjp(const ncgen_seeded_motion *transposed, ncgen_scalar t, const ncgen_real *q, const ncgen_real *qd,
                           const ncgen_real *p, const ncgen_real *weights, ncgen_real *gradient);
void ncgen_closing_vjp(const ncgen_seeded_motion *transposed, ncgen_scalar t, const ncgen_real *q, const ncgen_real *p,
                        const ncgen_real *weights, ncgen_real *gradient);
void ncgen_prepare_vjp(const ncgen_seeded_motion *transposed, const ncgen_real *p, const ncgen_real *weights, ncgen_real *gradient);

/* end functions */

#ifdef __cplusplus
}
#endif

#endif
