/* ncgen_batch_run.h: simulations of many states, NCGEN_LANES of them at a time, in any number of threads.
 *
 * Needs an emitted state derivative and this source compiled with ncgen_lanes.h in front. Every lane has its own time,
 * step and number of Newton iterations; lanes that have finished or failed wait for the others of their block.
 */
#ifndef NCGEN_BATCH_RUN_H
#define NCGEN_BATCH_RUN_H

#include "ncgen_batch.h"
#include "ncgen_runtime.h"

/* begin functions */

/* Numbers of workspace that one thread needs. */
size_t ncgen_batch_run_workspace(const ncgen_model *model, const ncgen_dynamics *dynamics);

/* Simulate `count` states over times[0] .. times[n_times - 1], with dopri5, dop853 or rk4.
 *
 * q, zd: consistent positions (count x n_coordinates) and independent velocities (count x n_independent); p: a row of
 *     n_parameters for all (p_stride 0) or each
 * out_q, out_qd: count x n_times x n_coordinates; out_work: count x n_times. Rows that a state did not reach are left
 * break_start, breaks: of state k breaks[break_start[k]] .. breaks[break_start[k + 1] - 1], as of ncgen_signals; NULL: there are none
 * status: of each state; steps: accepted ones of each; reached: time of each
 * The watch is asked by the calling thread, for every step of its own that is tried, with the share of the states that have
 * arrived; while that thread waits for others it asks again and again, so the watch may take its time then.
 * The workspace begins at a multiple of 64 bytes and has room for every thread.
 * returns NCGEN_OK, NCGEN_INTERRUPTED where the watch has ended it, or NCGEN_ARGUMENT, and nothing is written: for another
 * method, times that do not ascend, and rk4 without max_step or with more steps than can be counted */
int ncgen_batch_simulate(const ncgen_model *model, const ncgen_dynamics *dynamics, const ncgen_options *options, long count,
                         const double *q, const double *zd, const double *p, int p_stride, const int *break_start,
                         const double *breaks, int n_times, const double *times, double *out_q, double *out_qd, double *out_work,
                         int *status, long *steps, double *reached, int threads, double *workspace);

/* The state derivative of `count` states at time t: q is closed, the coordinates of the choice stay as they are.
 *
 * out_q, out_qd: count x n_coordinates; out_q may be q, out_qd NULL; out_zdd: count x n_independent; rows of states without
 *     status 0 mean nothing
 * status: NCGEN_NOT_CONVERGED where a position does not close, NCGEN_SINGULAR, NCGEN_DOMAIN where a number is NaN
 * Of the options the tolerance counts; everything else as above. */
void ncgen_batch_accelerate(const ncgen_model *model, const ncgen_dynamics *dynamics, const ncgen_options *options, long count,
                            const double *q, const double *zd, const double *p, int p_stride, double t, double *out_q,
                            double *out_qd, double *out_zdd, int *status, int threads, double *workspace);

/* end functions */

#endif
