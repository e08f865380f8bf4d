/* ncgen_directions.h: how a run that was taped changes along many directions, NCGEN_LANES of them at a time.
 *
 * Needs an emitted motion along a direction and this source compiled with ncgen_lanes.h in front.
 */
#ifndef NCGEN_DIRECTIONS_H
#define NCGEN_DIRECTIONS_H

#include "ncgen_differentiated.h"

/* begin functions */

/* How many directions go side by side: NCGEN_LANES. */
int ncgen_directions_lanes(void);

/* Numbers of workspace, which begins at a multiple of 64 bytes. */
size_t ncgen_directions_workspace(int n_coordinates, int n_parameters, int n_prepared, int method);

/* Changes of q and qd along the directions where steps begin and end.
 *
 * motion: an ncgen_seeded_motion of lanes; from n_coordinates to inputs: as of an ncgen_taped; steps, times, states: as of its tape
 * seeds: 2 n_coordinates + n_parameters rows, changes of q and qd at the start and of p, of `count` directions each
 * changes: steps + 1 times 2 n_coordinates rows of `count` directions
 * taped: NULL, or changes of all states of the tape, then of what is prepared, in rows of `count` directions */
void ncgen_directions(const void *motion, int n_coordinates, int n_parameters, int n_prepared, int is_driven, int method,
                      int n_inputs, const double *p, const double *inputs, long steps, const double *times, const double *states, long count, const double *seeds,
                      double *changes, double *taped, double *workspace);

/* Changes, n_coordinates rows, along the directions at one state [q, qd] of what comes before the run: of the velocities that the joints
 * allow, or of a step of Newton's method, whose seeds of q and qd are not asked for. Other arguments as above. */
void ncgen_starts_jvp(const void *motion, int n_coordinates, int n_parameters, int n_prepared, int method, const double *p,
                        int of_velocities, double t, const double *state, long count, const double *seeds, double *changes,
                        double *workspace);

/* end functions */

#endif
