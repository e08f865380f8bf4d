/* ncgen_driven.h: a motion that continues from call to call, as controllers and co-simulation need it.
 *
 * It is that of ncgen_simulate with a formalism over all coordinates and an explicit method, which options->method names. Between two calls
 * everything may change: p with its inputs, the state, the method. The workspace keeps nothing.
 */
#ifndef NCGEN_DRIVEN_H
#define NCGEN_DRIVEN_H

#include "ncgen_runtime.h"

#ifdef __cplusplus
extern "C" {
#endif

/* As much workspace as the functions below need at most, for arrays whose length the compiler has to know: n coordinates, m rows,
 * nonzeros of mass and phi_q together, those of the elimination's factor, vectors of all unknowns by which redundant rows are chosen (0
 * without such rows, else one more than there are combinations in ncgen_redundant.h), the width of the method's tableau, and parameters
 * with what is prepared of them, 0 where nothing is. */
#define NCGEN_DRIVEN_WORKSPACE(n, m, nonzeros, factor, vectors, width, p_copy) \
    (NCGEN_GAPS + (p_copy) + 17 * (n) + 14 * (m) + 2 + (3 + (width)) * (2 * (n) + 2) + (nonzeros) + (factor) + (vectors) * ((n) + (m)))

/* begin cdef */

/* A mechanism and how it moves; workspace: as many numbers as ncgen_driven_workspace returns; integers: 4 n_coordinates + 3 n_rows. */
typedef struct ncgen_driven {
    const ncgen_model *model;
    const ncgen_dynamics *dynamics;
    const ncgen_options *options;
    ncgen_real *workspace;
    int *integers;
} ncgen_driven;

/* Where it is. */
typedef struct ncgen_moment {
    ncgen_scalar t;  /* s */
    ncgen_scalar h;  /* with error control: the step that is tried next (s); 0: one is found */
    ncgen_real work; /* of drivers and forces without a potential since the start (J) */
    ncgen_real power; /* theirs now (W), and the accelerations: with the p of the call that found them */
    ncgen_real *q;   /* n_coordinates each */
    ncgen_real *qd;
    ncgen_real *qdd;
} ncgen_moment;

/* end cdef */
/* begin functions */

/* Numbers of workspace; reads model, dynamics and options. */
size_t ncgen_driven_workspace(const ncgen_driven *d);

/* On to the time t_end > moment->t: with error control by as many steps as that takes, else by equal steps of at most
 * options->max_step. Where it fails the moment stays as it was. At the first condition of options->event it ends before, and
 * statistics->stopped is 1; accelerations and power are then those of another time. */
int ncgen_advance(const ncgen_driven *d, const ncgen_real *p, ncgen_moment *moment, ncgen_scalar t_end, ncgen_statistics *statistics);

/* The same for `count` moments one after the other, each on by h seconds with n_p numbers of p of its own, count n_p in all. statuses
 * (count): that of every moment; one that fails stays where it was, and the others go on. statistics: of the last one. */
void ncgen_advance_each(const ncgen_driven *d, int count, int n_p, const ncgen_real *p, ncgen_moment *moments, ncgen_scalar h,
    int *statuses, ncgen_statistics *statistics);

/* After a change of t, q, qd or p: q and qd onto the constraints, by the smallest change in the sense of kinetic energy, and qdd and
 * power as they follow. Where it fails the moment stays as it was. */
int ncgen_project_moment(const ncgen_driven *d, const ncgen_real *p, ncgen_moment *moment);

/* The same, for integrators outside, where q is on the constraints: it is left as it is. */
int ncgen_evaluate_moment(const ncgen_driven *d, const ncgen_real *p, ncgen_moment *moment);

/* Multipliers of the rows (n_rows): M qdd + phi_q' lam = force. */
int ncgen_multipliers(const ncgen_driven *d, const ncgen_real *p, const ncgen_moment *moment, ncgen_real *lam);

/* What impulses along the coordinates (n_coordinates) change of the velocities, the constraints answering with impulses of their own:
 * M change + phi_q' mu = impulses, phi_q change = 0. */
int ncgen_respond(const ncgen_driven *d, const ncgen_real *p, const ncgen_moment *moment, const ncgen_real *impulses, ncgen_real *change);

/* Velocities onto the constraints where q is on them, by the smallest change in the sense of kinetic energy, however little they miss;
 * accelerations stay as they were. */
int ncgen_project_velocities(const ncgen_driven *d, const ncgen_real *p, ncgen_moment *moment);

/* end functions */

#ifdef __cplusplus
}
#endif

#endif
