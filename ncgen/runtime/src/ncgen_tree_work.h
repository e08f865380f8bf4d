/* ncgen_tree_work.h: what the loops over the tables of an open tree share. */
#ifndef NCGEN_TREE_WORK_H
#define NCGEN_TREE_WORK_H

#include "ncgen_inertia.h"
#include "ncgen_state.h"

/* A link; of the ground, the one before the first, all is zero. */
typedef struct ncgen_tree_link {
    ncgen_real origin[3];        /* its reference point */
    ncgen_real offset[3];        /* ... from that of its parent */
    ncgen_real twist[6];         /* angular velocity, velocity of its reference point */
    ncgen_real change[6];        /* the same of accelerations, first without those of the joints */
    ncgen_real wrench[6];        /* moment about its reference point, force; then what the joints' accelerations add to the link's */
    ncgen_real inertia[INERTIA]; /* of its own body, then of what it carries */
} ncgen_tree_link;

/* One of the motions of a joint. */
typedef struct ncgen_tree_screw {
    ncgen_real axis[3];
    ncgen_real momentum[6]; /* at rate 1 */
    ncgen_real pivot;       /* 1 / (screw . momentum) */
    ncgen_real push;        /* force along a measured coordinate, then what is left for the screw, then its acceleration */
    ncgen_real rate;
    ncgen_real rotor; /* inertia along a measured coordinate */
} ncgen_tree_screw;

typedef struct ncgen_tree_work {
    const ncgen_tree *tree;
    int mass_is_there;
    ncgen_tree_link *link;
    ncgen_tree_screw *screw;
    ncgen_real *values; /* coordinates, then fixed components */
    ncgen_real *moved;  /* n + n_fixed: velocities or accelerations, those of fixed components being zero, or nearly */
    ncgen_real *force;  /* n + n_fixed: forces along the coordinates, then zeros */
    ncgen_real *mass;   /* values of M */
    ncgen_real *masses; /* of every link: its mass, of every member the mass that it has with points, the masses between members by rows */
    ncgen_real *member; /* 3 a member of a link */
    ncgen_real *lever;  /* 3 an element: from its link's reference point, of a vector itself */
    ncgen_real *joined; /* 6 a link of a group, then 6 a group for its carrier: momentum at rate 1 of the group's first screw */
    ncgen_real *group;  /* 2 a group: its pivot, and its push, then what is left for it */
    ncgen_real *bias, *inertial; /* n, where there is mass that is not the same along all axes, and for velocities */
    ncgen_real *scaled;          /* values of Phi_q in natural sizes */
    ncgen_real *gram, *right;    /* of the rows that close a link */
    ncgen_real *jacobian;        /* values of Phi_q */
} ncgen_tree_work;

static const ncgen_real ncgen_nothing[6] = {0, 0, 0, 0, 0, 0};

/* A screw's rate added to a twist. */
static inline void ncgen_add_screw(const ncgen_tree_work *w, int screw, ncgen_real rate, ncgen_real *twist)
{
    ncgen_add_times(rate, w->screw[screw].axis, twist + (w->tree->turns[screw] ? 0 : 3));
}

/* Is all mass the same along all axes? */
static inline int ncgen_has_pairs_alone(const ncgen_tree_work *w)
{
    return w->tree->single_start[w->tree->n_links] == 0;
}

#endif
