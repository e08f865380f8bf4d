/* ncgen_table_run.h: a mechanism of a table in motion, for programs that have neither Python nor a compiler, such as pages in WebAssembly.
 *
 * There is one mechanism at a time, in memory of fixed size. The caller writes its table into ncgen_table_numbers() and its state into
 * ncgen_table_state(), begins, and lets it go on. Numbers of the table may change between two calls, its layout only before `begin`.
 */
#ifndef NCGEN_TABLE_RUN_H
#define NCGEN_TABLE_RUN_H

#include "ncgen_generic.h"

#ifdef __cplusplus
extern "C" {
#endif

/* begin functions */

/* How many numbers a table may have, and how many coordinates and rows together a mechanism. */
int ncgen_table_most_numbers(void);
int ncgen_table_most_unknowns(void);

/* Where the table is. */
ncgen_real *ncgen_table_numbers(void);

/* Where the state is: q, qd, qdd, the multipliers of the rows, and the natural sizes of the coordinates (of a length the extent of the
 * mechanism, of an angle 1), ncgen_table_most_unknowns() numbers each; then kinetic and potential energy (J), power (W) and work (J). */
ncgen_real *ncgen_table_state(void);

/* A mechanism whose table has so many numbers, at time t; rtol, atol: tolerances of its motion. Position and velocity are brought onto the
 * constraints. Returns a status of ncgen.h; NCGEN_ARGUMENT for a table that is invalid or too large, NCGEN_SINGULAR for a singular position,
 * where constraints depend on each other that do not nearby. */
int ncgen_table_begin(int length, ncgen_scalar t, ncgen_scalar rtol, ncgen_scalar atol);

/* After a change of the state or of numbers of the table: the state onto the constraints, and accelerations as they follow. */
int ncgen_table_project_state(void);

/* On to a time. Where it fails the state stays as it was. */
int ncgen_table_advance(ncgen_scalar t_end);

/* Constraint equations that are independent of each other in the position where the motion began. */
int ncgen_table_rank(void);

/* end functions */

#ifdef __cplusplus
}
#endif

#endif
