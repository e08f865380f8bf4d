/* ncgen_tree.h: the motion of an open tree of bodies by the articulated recursion, in loops over tables. */
#ifndef NCGEN_TREE_H
#define NCGEN_TREE_H

#include "ncgen_state.h"

typedef struct ncgen_tree_work {
    const ncgen_tree *tree;
    int mass_is_there;
    ncgen_real *values;   /* coordinates, then fixed components */
    ncgen_real *mass;     /* values of M */
    ncgen_real *lever;    /* 3 an element: from its link's reference point, of a vector itself */
    ncgen_real *axis;     /* 3 a screw */
    ncgen_real *twist;    /* 6 a link: angular velocity, velocity of its reference point */
    ncgen_real *change;   /* 6 a link: the same of accelerations, first without those of the joints */
    ncgen_real *wrench;   /* 6 a link: moment about its reference point, force */
    ncgen_real *inertia;  /* 21 a link: of what it carries */
    ncgen_real *momentum; /* 6 a screw: at rate 1 */
    ncgen_real *pivot;    /* of a screw: 1 / (screw . momentum) */
    ncgen_real *push;     /* of a screw: force along a measured coordinate, then what is left for it */
    ncgen_real *rate;     /* of a screw */
    ncgen_real *force, *bias, *inertial; /* n */
    ncgen_real *square, *right;          /* of the rows that close a link */
    ncgen_real *jacobian;                /* values of Phi_q */
    ncgen_real *dense;                   /* the part of a link */
} ncgen_tree_work;

void ncgen_tree_layout(ncgen_run *r, ncgen_tree_work *w);

/* Functions of an ncgen_motion. growth is 0, or huge where a joint moves nothing. */
void ncgen_tree_derivative(ncgen_run *r, ncgen_tree_work *w, ncgen_scalar t, const ncgen_real *q, const ncgen_real *qd, ncgen_real *out);
void ncgen_tree_velocities(ncgen_run *r, ncgen_tree_work *w, ncgen_scalar t, const ncgen_real *q, const ncgen_real *qd, ncgen_real *out);

#endif
