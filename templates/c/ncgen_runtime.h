/* ncgen_runtime.h: whole simulations of a generated model, in one call.
 *
 * The runtime is the same for every mechanism. It allocates nothing: the caller gives the workspace, whose
 * length ncgen_workspace() tells. Runs in different workspaces may go on at the same time.
 */
#ifndef NCGEN_RUNTIME_H
#define NCGEN_RUNTIME_H

#include "ncgen.h"

#ifdef __cplusplus
extern "C" {
#endif

/* begin cdef */

/* The state derivative of a model, for one choice of independent coordinates.
 *
 * newton and acceleration are emitted for one mechanism and one choice, with the elimination written out; where they are
 * NULL the runtime does the same with the model's kernels and dense elimination with row exchanges.
 * newton writes the correction of the dependent coordinates (n_dependent numbers), then phi (n_rows);
 * acceleration writes qd (n_coordinates), zdd (n_independent), power, amplification: how much an error of the
 * independent coordinates grows in the others, squared. */
typedef int ncgen_acceleration_kernel(ncgen_real t, const ncgen_real *q, const ncgen_real *zd, const ncgen_real *p,
                                      ncgen_real *out);

typedef struct ncgen_dynamics {
    int n_independent;
    int n_dependent;
    const int *independent; /* positions in q */
    const int *dependent;
    const int *rows;        /* n_dependent kept rows; not used by emitted functions */
    const ncgen_scalar *column_sizes; /* natural size of every coordinate; not used by emitted functions */
    const ncgen_scalar *row_sizes; /* n_rows: what a residual is compared with */
    ncgen_position_kernel *newton;
    ncgen_acceleration_kernel *acceleration;
} ncgen_dynamics;

enum ncgen_method {
    NCGEN_DOPRI5 = 0, /* Dormand-Prince 5(4) with error control and dense output */
    NCGEN_RK4 = 1     /* classical Runge-Kutta with a fixed step */
};

typedef struct ncgen_options {
    int method;
    ncgen_scalar rtol;      /* dopri5: error per step, relative and absolute */
    ncgen_scalar atol;
    ncgen_scalar max_step;  /* dopri5: longest step, 0 for none; rk4: the step */
    ncgen_scalar tolerance; /* of the position problem, relative to row_sizes */
    ncgen_scalar growth;    /* stop with NCGEN_PIVOT when the amplification has grown by this factor */
    long max_steps;         /* 0 for no limit */
} ncgen_options;

typedef struct ncgen_statistics {
    long steps;
    long rejected;    /* steps repeated because of the error estimate */
    long repeated;    /* steps repeated because the position problem or a pivot failed */
    long evaluations;
    long newton_steps;
    ncgen_scalar t;   /* time reached */
} ncgen_statistics;

/* end cdef */
/* begin functions */

/* Numbers of workspace that ncgen_simulate needs; besides, it needs n_dependent integers. */
size_t ncgen_workspace(const ncgen_model *model, const ncgen_dynamics *dynamics);

/* Simulate from times[0] to times[n_times - 1].
 *
 * q, zd: consistent initial position and independent velocities
 * out_q, out_qd: n_times + 1 rows of n_coordinates; out_work: work (J) of drivers and forces without a potential.
 *     The additional row is the state at statistics->t, from which a run that stops early can go on.
 * rows: how many rows of the grid have been written
 * returns NCGEN_OK, or why it stopped at statistics->t */
int ncgen_simulate(const ncgen_model *model, const ncgen_dynamics *dynamics, const ncgen_options *options,
                   const ncgen_real *p, const ncgen_real *q, const ncgen_real *zd, int n_times, const ncgen_scalar *times,
                   ncgen_real *out_q, ncgen_real *out_qd, ncgen_real *out_work, int *rows, ncgen_statistics *statistics,
                   ncgen_real *workspace, int *integers);

/* end functions */

#ifdef __cplusplus
}
#endif

#endif
