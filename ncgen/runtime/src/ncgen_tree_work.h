/* ncgen_tree_work.h: what the loops over the tables of an open tree share.
 *
 * A link, an element, a member and a screw are one record each, with what the tables say of it (int) and what belongs to a state.
 */
#ifndef NCGEN_TREE_WORK_H
#define NCGEN_TREE_WORK_H

#include "ncgen_state.h"
#include "ncgen_tree_blocks.h"

/* Of loops of few passes, most of them of two to six, vectors only lengthen the way there and back. */
#if defined(__GNUC__) && !defined(__clang__)
#define NCGEN_SHORT_LOOPS __attribute__((optimize("no-tree-vectorize")))
#else
#define NCGEN_SHORT_LOOPS
#endif

/* A link; of the ground, the one before the first, all numbers are zero. */
typedef struct ncgen_tree_link {
    int parent, reference[3]; /* -1: the ground; components of its reference point */
    int n_elements, n_screws, n_members;
    int group;    /* of joints that move as one, to which its only screw belongs; -1: none */
    int is_hinge; /* its joint is one screw that turns, has a measured coordinate and belongs to no group */
    int has_sum;  /* `inertia` is not zero: of singles, and of links that hang on it but do not stand next to it */
    ncgen_real *lane;      /* its numbers in its block */
    ncgen_real offset[3];  /* its reference point from that of its parent */
    ncgen_real inertia[INERTIA];
} ncgen_tree_link;

/* A point or a vector that moves with a link. */
typedef struct ncgen_tree_element {
    int c[3]; /* its components */
    ncgen_scalar is_point, heaviness;
    ncgen_real *lane; /* its numbers in its slot */
} ncgen_tree_element;

/* What has mass that is the same along all axes. */
typedef struct ncgen_tree_member {
    int slot; /* of its link's block */
    ncgen_scalar is_point;
} ncgen_tree_member;

/* One of the motions of a joint. */
typedef struct ncgen_tree_screw {
    int turns, c[3];             /* components of the first term of its axis */
    int first_term, end_term;    /* the others */
    int leader;                  /* the screw that it follows; -1: none */
    int coordinate;              /* the measured one that gives its rate; -1: elements do */
    ncgen_scalar weight;         /* of the first term */
    ncgen_scalar is_carried;     /* 1: its axis turns with the parent; else 0 */
    ncgen_scalar ratio, slowness; /* its rate over that of its leader; over that of the coordinate, 1 without one */
    ncgen_real axis[3];
    ncgen_real momentum[6]; /* at rate 1 */
    ncgen_real share[6];    /* of a hinge alone: the same over screw . momentum, about the reference point of the parent */
    ncgen_real pivot;       /* 1 / (screw . momentum) */
    ncgen_real push;        /* force along a measured coordinate, then what is left for the screw, then its acceleration */
    ncgen_real rate;
    ncgen_real rotor; /* inertia along a measured coordinate */
} ncgen_tree_screw;

/* Where a loop over the links has come to in the other records, which are in their order. */
typedef struct ncgen_tree_place {
    ncgen_tree_element *element;
    ncgen_tree_screw *screw;
} ncgen_tree_place;

typedef struct ncgen_tree_work {
    const ncgen_tree *tree;
    int mass_is_there;
    int is_measured_in_order; /* the k-th measured coordinate is that of the k-th screw, of every one */
    int is_factored, is_regular; /* momenta and pivots are those of the position in `values`; every joint moves something */
    int n_blocks, n_others; /* elements of other links between which bodies have mass, three components of each */
    ncgen_tree_block *block;
    ncgen_link_lanes *numbers, *masses; /* of all blocks */
    ncgen_tree_slot *slot;              /* of all blocks; the last ones have what belongs to no element */
    int *where;                         /* of a coordinate: its number among those of the slots */
    int *other_at, *other;              /* the same of n_others components, and these */
    ncgen_tree_link *link;
    ncgen_tree_element *element;
    ncgen_tree_member *member;
    ncgen_tree_screw *screw;
    ncgen_real *values; /* coordinates, then fixed components */
    ncgen_real *moved;  /* n + n_fixed: velocities or accelerations */
    ncgen_real *force;  /* n + n_fixed: forces along the coordinates, then zeros */
    ncgen_real *mass;   /* values of M */
    ncgen_real *joined; /* 6 a link of a group, then 6 a group for its carrier: momentum at rate 1 of the group's first screw */
    ncgen_real *group;  /* 2 a group: 1 / its pivot, and its push, then what is left for it */
    ncgen_real *bias;            /* n + n_fixed: of velocities, then zeros */
    ncgen_real *step;            /* n + n_copies: of a position */
    ncgen_real *jacobian;        /* values of Phi_q */
    ncgen_real *scaled;          /* ... in natural sizes of the coordinates */
    ncgen_real *gram, *right;    /* of the rows that close a link */
    int closed_form;             /* are positions known from measured coordinates? NCGEN_UNKNOWN: not looked at yet */
    ncgen_real *first, *placed;  /* n + n_fixed: the first position of the run, and one in closed form */
    ncgen_real *axes;            /* 4 a screw: its unit axis in the first position, and how long that was */
    ncgen_real *travel;          /* of a screw: its rate summed up since then; of all half a turn; 1 - cosine; sine */
    int are_there;               /* is the matrix of closing rows that of the position in `values`? */
    int n_rows;                  /* of the matrix: n_closing, or n_opposed since a position where the former nearly depended on each other */
    ncgen_real least_share;      /* of a pivot of the matrix in its row's own response: small where closing rows are about to depend */
    int n_independent, most_independent; /* closing rows here, and anywhere so far */
    ncgen_real *left, *weights;  /* n_screws + n_groups a closing row (n_opposed): what of a force along it every screw and group sees; their 1 / pivots */
    ncgen_real *square, *own;    /* n_opposed squared: the matrix of their products with rows, factored; its diagonal before, then multipliers */
    ncgen_real *missing;         /* n_opposed: of the rows */
    ncgen_real *gamma;           /* n_rows: of accelerations, or of positions */
    ncgen_real *still, *room;    /* n, 2 n + 2 */
    int *order;                  /* n_opposed: in which rows are eliminated */
    ncgen_link_lanes *turns;     /* 12 a block: columns of rotations since then, and reference points */
} ncgen_tree_work;

enum { NCGEN_UNKNOWN = -1 };

static const ncgen_real ncgen_nothing[6] = {0, 0, 0, 0, 0, 0};

static inline ncgen_tree_place ncgen_tree_begin(const ncgen_tree_work *w)
{
    const ncgen_tree_place place = {w->element, w->screw};
    return place;
}

static inline void ncgen_tree_go_on(const ncgen_tree_link *own, ncgen_tree_place *place)
{
    place->element += own->n_elements;
    place->screw += own->n_screws;
}

/* The lane of the link on which one hangs. */
static inline const ncgen_real *ncgen_lane_before(const ncgen_tree_work *w, const ncgen_tree_link *own)
{
    return w->link[own->parent].lane;
}

/* Of a link 12 numbers of w->turns. */
static inline ncgen_real *ncgen_turn_lane(const ncgen_tree_work *w, int link)
{
    return (ncgen_real *)(w->turns + 12 * (link / NCGEN_LINK_LANES)) + link % NCGEN_LINK_LANES;
}

/* Is all mass the same along all axes? */
static inline int ncgen_has_pairs_alone(const ncgen_tree_work *w)
{
    return w->tree->single_start[w->tree->n_links] == 0;
}

#endif
