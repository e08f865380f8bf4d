/* ncgen_motions.h: runs of many states by an emitted motion, NCGEN_LANES of them at a time, that leave tapes; and the ways back.
 *
 * Needs the emitted motion, its transposed derivative and this source compiled with ncgen_lanes.h in front. The method is that of
 * ncgen_explicit.c and ncgen_projection.c, over steps that are the same for all states.
 */
#ifndef NCGEN_MOTIONS_H
#define NCGEN_MOTIONS_H

#include "ncgen_differentiated.h"

/* begin functions */

/* States side by side. */
int ncgen_motions_lanes(void);

/* Of an ncgen_taped the sizes are read here, neither p nor its tape. A block is NCGEN_LANES states, in lanes; tapes and workspace begin at
 * multiples of 64 bytes. */

/* Numbers of the tape of a block. */
size_t ncgen_motions_tape(const ncgen_taped *sizes, long steps);

/* Numbers of workspace of any function below. */
size_t ncgen_motions_workspace(const ncgen_taped *sizes, int n_rows, long steps);

/* Runs of `count` states, with one step from each time to the next.
 *
 * motion: an ncgen_motion of lanes; n_rows, column_sizes, row_sizes: of the mechanism; times: steps + 1
 * q, qd: closed positions and velocities that the joints allow, count rows; p: count rows of n_parameters
 * out_q, out_qd: count x (steps + 1) x n_coordinates
 * other: of each state 0, or 1 where it has to run alone: its numbers are NaN, or it comes to where an emitted motion does not do; its rows
 *     mean nothing then
 * taped: steps, and tapes has one of each block of states; or 1, and it has room for one step, over which all of them go */
void ncgen_motions(const void *motion, const ncgen_taped *sizes, int n_rows, const double *column_sizes, const double *row_sizes,
                   long steps, const double *times, long count, const double *q, const double *qd, const double *p, double *out_q,
                   double *out_qd, int *other, long taped, double *tapes, double *workspace);

/* How a number of each state changes with its start and its p.
 *
 * transposed: an ncgen_seeded_motion of lanes; by_q, by_qd: how it changes with q and qd at all times, count x (steps + 1) x n_coordinates
 * gradient: count rows of 2 n_coordinates + n_parameters */
void ncgen_motions_adjoint(const void *transposed, const ncgen_taped *sizes, long steps, const double *times, long count,
                        const double *by_q, const double *by_qd, const double *tapes, double *gradient, double *workspace);

/* Back through the velocities that the joints allow at the start (of_velocities 1), or a step of Newton's method there: how a sum with
 * weights, count rows of n_coordinates, changes with q, with qd where it is of velocities, and with p. */
void ncgen_starts_vjp(const void *transposed, const ncgen_taped *sizes, int of_velocities, long steps, double t, long count,
                       const double *weights, const double *tapes, double *gradient, double *workspace);

/* end functions */

#endif
