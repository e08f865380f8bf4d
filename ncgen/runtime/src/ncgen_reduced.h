/* ncgen_reduced.h: the Jacobian of an implicit method in the degrees of freedom of a tree of bodies, over all coordinates. */
#ifndef NCGEN_REDUCED_H
#define NCGEN_REDUCED_H

#include "ncgen_state.h"

/* The velocities that the constraints allow are the columns of a basis, which are unit vectors on as many chosen coordinates; in loops over
 * tables those of the joints take their place. */
typedef struct ncgen_reduced {
    int count;           /* columns */
    int is_of_joints;    /* are the chosen velocities those of joints of a tree, whether loops allow them or not? */
    ncgen_real *basis;   /* count columns of n; of joints one */
    ncgen_scalar t;      /* where the basis is taken: time, */
    ncgen_real *q;       /* n: and position */
    ncgen_real *driven;  /* count: what the derivative sees of the chosen velocities where all coordinates are at rest; room before */
    ncgen_real *state;   /* ny: a state near the one that is looked at */
    ncgen_real *base;    /* ny: the derivative there */
    ncgen_real *rates;   /* ny: the derivative of the state near it */
    int *chosen;         /* count coordinates */
    int *index;          /* n: which of the chosen ones a coordinate is, or -1 */
} ncgen_reduced;

/* How many there are. */
int ncgen_reduced_count(const ncgen_run *r);

/* integers: 2 n of them, or NULL where workspace is only counted. */
void ncgen_reduced_layout(ncgen_run *r, ncgen_reduced *w, int *integers);

/* How the chosen accelerations change along the basis: count rows of 2 count, by velocities and then by positions. */
int ncgen_reduced_jacobian(ncgen_run *r, ncgen_reduced *w, ncgen_scalar t, const ncgen_real *y, ncgen_real *jacobian);

/* The velocities of the chosen coordinates that the derivative sees in n velocities, whether the constraints allow these or not. */
void ncgen_reduced_measure(ncgen_run *r, const ncgen_reduced *w, const ncgen_real *velocities, ncgen_real *chosen);

/* The same of a change of positions, or of another one that the constraints allow. */
void ncgen_reduced_measure_positions(ncgen_run *r, const ncgen_reduced *w, const ncgen_real *change, ncgen_real *chosen);

/* velocities += the basis times as much of its columns as is chosen. */
void ncgen_reduced_add(ncgen_run *r, const ncgen_reduced *w, const ncgen_real *chosen, ncgen_real *velocities);

#endif
