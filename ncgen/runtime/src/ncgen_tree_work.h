/* ncgen_tree_work.h: what the loops over the tables of an open tree share. */
#ifndef NCGEN_TREE_WORK_H
#define NCGEN_TREE_WORK_H

#include "ncgen_inertia.h"
#include "ncgen_state.h"

typedef struct ncgen_tree_work {
    const ncgen_tree *tree;
    int mass_is_there;
    ncgen_real *values;   /* coordinates, then fixed components */
    ncgen_real *mass;     /* values of M */
    ncgen_real *square;   /* of every link: masses between its members, symmetric */
    ncgen_real *total;    /* of a link: the mass of its members */
    ncgen_real *moments;  /* 9 a link: sum of m x y' of its members as xx, yy, zz, xy, xz, yz, and of their points m x */
    ncgen_real *member;   /* 3 a member of a link */
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
    ncgen_real *joined;   /* 6 a link of a group, then 6 a group for its carrier: momentum at rate 1 of the group's first screw */
    ncgen_real *group;    /* 2 a group: its pivot, and its push, then what is left for it */
    ncgen_real *force, *bias, *inertial; /* n */
    ncgen_real *gram, *right;            /* of the rows that close a link */
    ncgen_real *jacobian;                /* values of Phi_q */
    ncgen_real *unknown;                 /* of a link */
    ncgen_real *dense;                   /* the part of a link */
} ncgen_tree_work;

static const ncgen_real ncgen_nothing[6] = {0, 0, 0, 0, 0, 0};

/* The reference point of a link, from that of its parent. */
static inline void ncgen_between(const ncgen_tree_work *w, int link, ncgen_real *d)
{
    const ncgen_tree *tree = w->tree;
    const int *mine = tree->reference + 3 * link, *before = tree->reference + 3 * tree->parent[link];
    for (int i = 0; i < 3; ++i)
        d[i] = w->values[mine[i]] - w->values[before[i]];
}

static inline const ncgen_real *ncgen_of_parent(const ncgen_tree_work *w, const ncgen_real *all, int link)
{
    return w->tree->parent[link] < 0 ? ncgen_nothing : all + 6 * w->tree->parent[link];
}

/* A screw's rate added to a twist. */
static inline void ncgen_add_screw(const ncgen_tree_work *w, int screw, ncgen_real rate, ncgen_real *twist)
{
    ncgen_add_times(rate, w->axis + 3 * screw, twist + (w->tree->turns[screw] ? 0 : 3));
}

#endif
