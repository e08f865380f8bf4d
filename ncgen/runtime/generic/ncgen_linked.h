/* ncgen_linked.h: a mechanism in motion whose kernels are linked to the runtime where it runs, such as two modules of WebAssembly.
 *
 * A function is given as its number in the table of functions. There is one mechanism at a time. The caller allocates its memory,
 * writes to its state and its parameters, and calls the functions below, which return a status of ncgen.h.
 *
 * Integers that describe it, in the words of ncgen_dynamics:
 *   n_coordinates, n_rows, n_parameters, n_dependent, singular_mass, conservative, drives, lines, curves, jumps
 *   of ncgen_events count, most, n_actions, law; how many numbers `values` has, degree; n_events, n_holds, n_loads; how many numbers of p
 *   are the motion's own; rows of the mechanism with what is held; follows_loads, n_rubbings, n_sliding
 *   numbers of the functions phi, phi_q, nu, gamma, mass, force, energy, switches, conditions, condition_derivatives, condition_rates,
 *   action_values, held_phi, held_phi_q, held_nu, held_gamma, held_conditions, friction_forces, contact_velocities, 0 for one that it does
 *   not have
 *   phi_q_pattern with one row more a drive: indptr, indices; mass_pattern: indptr, indices
 *   nonzeros and arrays of the elimination, and of that with the rows of drives
 *   directions of the conditions, -1 as often as there are conditions and loads, actions, holds, rubbings, places of the motion's own numbers in p
 *   with holds phi_q_pattern and elimination of the mechanism with what is held
 * Numbers: interval of the breaks; column_sizes; row_sizes with those of drives; position and velocity at the start; parameters; with
 * events noise, nodes, inverse, row_sizes with what is held.
 *
 * A drive is one more row, a coordinate with a prescribed position.
 */
#ifndef NCGEN_LINKED_H
#define NCGEN_LINKED_H

#include "ncgen.h"

#ifdef __cplusplus
extern "C" {
#endif

/* begin functions */

/* How many numbers of memory a mechanism needs. */
size_t ncgen_linked_size(const int *integers);

/* Begin with a mechanism. Returns its state: t, work, power, the next step, then q, qd, qdd and multipliers of the rows; of every event on
 * which side its condition is, and how often it has happened; 1 where one has ended the motion; the motion's own numbers of p. */
ncgen_real *ncgen_linked_begin(const int *integers, const ncgen_real *numbers, ncgen_real *room);

/* Its parameters. */
ncgen_real *ncgen_linked_parameters(void);

/* Of every drive position, velocity and acceleration, then the force along it that they take. */
ncgen_real *ncgen_linked_drives(void);

/* A force from outside on one place, whose three components are linear in q: their rows of n_coordinates numbers; then a force, a
 * target, a stiffness and a damping: the force is force + stiffness (target - row q) - damping (row qd) along each row. */
ncgen_real *ncgen_linked_pull(void);

/* Does that force act from now on? */
void ncgen_linked_set_pull(int acts);

/* The state at the start. */
int ncgen_linked_start(void);

/* After a change of the state or of parameters: position and velocity onto the constraints, and where is_driven is set onto those of the
 * drives, too; accelerations and multipliers. */
int ncgen_linked_project_state(int is_driven);

/* Accelerations and multipliers, where positions are on the constraints. */
int ncgen_linked_evaluate(void);

/* On to a time: by Runge-Kutta steps of `step` seconds, or where that is 0 with error control; past the first instant of events at most
 * where `one` is set. */
int ncgen_linked_advance(ncgen_scalar t_end, ncgen_scalar step, ncgen_scalar rtol, ncgen_scalar atol, int one);

/* What kernels call: sine and cosine of an angle, and a piecewise polynomial. */
void ncgen_linked_sincos(ncgen_real x, ncgen_real *sine, ncgen_real *cosine);
ncgen_real ncgen_linked_pieces(ncgen_real x, const ncgen_scalar *knots, const ncgen_scalar *rows, int count, int degree, ncgen_scalar period);

/* end functions */

#ifdef __cplusplus
}
#endif

#endif
