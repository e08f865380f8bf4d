/* ncgen_constrained.h: formalisms on all coordinates as state derivatives. */
#ifndef NCGEN_CONSTRAINED_H
#define NCGEN_CONSTRAINED_H

#include "ncgen_closing_rules.h"
#include "ncgen_sparse.h"
#include "ncgen_state.h"
#ifndef NCGEN_WITHOUT_TABLES
#include "ncgen_tree_closing.h"
#else /* no tree of bodies moves in loops over tables, as in exports */
typedef int ncgen_tree_work;
#define ncgen_tree_layout(r, w) ((void)(w))
#define ncgen_tree_derivative(r, w, t, q, qd, out) ((void)(w))
#define ncgen_tree_velocities(r, w, t, q, qd, out) ((void)(w))
#define ncgen_tree_closing(r, w, t, q, out) ((void)(w))
#define ncgen_tree_is_in_closed_form(w) ((void)(w), 0)
#define ncgen_tree_joints(tree) ((void)(tree), 0)
#define ncgen_tree_measure(r, w, velocities, chosen) ((void)(r), (void)(w), (void)(velocities), (void)(chosen))
#define ncgen_tree_along(r, w, chosen) ((void)(r), (void)(w), (void)(chosen), (const ncgen_real *)NULL)
#endif

typedef struct ncgen_constrained {
    ncgen_kkt kkt;
    int n_mass, n_phi_q;                       /* nonzeros */
    int has_phi_q;                             /* kkt.values hold Phi_q of the state that comes next */
    int is_recursive;                          /* is there a recursion over the tree of bodies? */
    const ncgen_motion *motion;                /* it is emitted, or NULL: it is that of `tree` */
    ncgen_tree_work tree;
    ncgen_real *emitted;                       /* 2 n + m + 2: room for what it writes */
    ncgen_real *offset;                        /* n: how far a position is from another one */
    ncgen_real *closed_position;               /* n: for a tape, where closing brought the last state, before it was moved on */
    ncgen_real moved_at_once;                  /* how far closing moved a position, in natural sizes; -1: it took more than one step */
    int came_along;                            /* the derivative at r->q, r->qd is known: ncgen_motion.projected */
    ncgen_real pivot_growth;                   /* of its elimination, where it was called last */
    int uses_matrix;                           /* this step goes without it */
    int is_prepared;                           /* are sizes and diagonal of the matrix known? */
    int is_factored;                           /* the factors are those of the state that was looked at last */
    int is_reusable;                           /* solution and factors are those of the last step's end */
    ncgen_real *right, *solution, *residual;   /* n + m: forces and rows; qdd and lam */
    ncgen_real *nu, *phi;                      /* m */
    ncgen_real *diagonal;                      /* m: the diagonal E */
    ncgen_real *natural, *reduced;             /* n, m: sizes of the masses, and of rows once these are eliminated */
    ncgen_real mass_size;                      /* the largest mass in natural sizes */
    /* Where rows are redundant: */
    ncgen_real *combinations;                  /* of rows (m), and what is left of them in the coordinates (n), one after the other */
    ncgen_real *probe;                         /* n + m */
    ncgen_real largest_share;                  /* that rows that count have in others, when they were chosen; 0: not known yet */
    /* Where QR is used: */
    ncgen_real *jacobian;                      /* n x m */
    ncgen_real *basis;                         /* columns of n */
    ncgen_real *square;                        /* (n + m) x n */
    ncgen_real *scaled;                        /* 4 (n + m) */
    int *columns;                              /* exchanges, of n or m columns */
    int *is_left_out;                          /* m: is a row left out, since others imply it? */
    int left_out;                              /* how many */
    int redundant;                             /* are there such rows? */
    int iterated;                              /* is the effect of E removed by iteration? */
} ncgen_constrained;

/* layout deals out workspace, begin makes the first y. */
void ncgen_constrained_layout(ncgen_run *r, ncgen_constrained *w);
int ncgen_constrained_begin(ncgen_run *r, const ncgen_real *velocities);
int ncgen_constrained_accelerations(ncgen_run *r, ncgen_scalar t); /* of r->q, r->qd, into solution; its factors stay */
int ncgen_constrained_power(ncgen_run *r, ncgen_scalar t, ncgen_real *power); /* of drivers and forces without a potential */
int ncgen_constrained_matrices(ncgen_run *r, ncgen_scalar t);      /* M and Phi_q at r->q, into kkt.values */
int ncgen_constrained_phi_q(ncgen_run *r, ncgen_scalar t);           /* Phi_q alone */
int ncgen_constrained_factor(ncgen_run *r);
void ncgen_constrained_rows(ncgen_run *r, int factors_are_near);   /* which of redundant rows count from here on */

/* Largest violation of rows in their sizes, largest of n numbers in the coordinates' sizes; are accelerations found by QR? */
ncgen_real ncgen_constrained_violation(const ncgen_run *r, const ncgen_real *rows);
ncgen_real ncgen_constrained_size(const ncgen_run *r, const ncgen_real *x);
int ncgen_constrained_is_dense(const ncgen_run *r);
/* Where a motion writes its growth: behind what is integrated, so that it may write the derivative of y where that is wanted. */
static inline ncgen_real *ncgen_growth_in(const ncgen_run *r, ncgen_real *out)
{
    return out + 2 * r->n + 1;
}

/* The functions of an ncgen_motion, emitted or by tables. */
void ncgen_recursive_derivative(ncgen_run *r, ncgen_scalar t, const ncgen_real *q, const ncgen_real *qd, ncgen_real *out);
void ncgen_recursive_velocities(ncgen_run *r, ncgen_scalar t, const ncgen_real *q, const ncgen_real *qd, ncgen_real *out);
int ncgen_recursive_projected(ncgen_run *r, ncgen_scalar t, const ncgen_real *q, const ncgen_real *qd, ncgen_real *out); /* 0: velocities alone */
int ncgen_recursive_taken(ncgen_run *r, ncgen_real *yd); /* is yd, which came along with the last ones, a derivative? */
void ncgen_recursive_closing(ncgen_run *r, ncgen_scalar t, const ncgen_real *q, ncgen_real *out);
int ncgen_recursive_rows(const ncgen_run *r); /* that closing writes behind changes of coordinates */
int ncgen_recursive_joints(const ncgen_run *r); /* of ncgen_tree.h where loops over its tables give the motion, else 0 */
void ncgen_recursive_measure(ncgen_run *r, const ncgen_real *velocities, ncgen_real *chosen); /* of ncgen_tree.h */
const ncgen_real *ncgen_recursive_along(ncgen_run *r, const ncgen_real *chosen);
int ncgen_follows_from_measured(const ncgen_run *r); /* is the position that closing gave that of its measured coordinates? */

/* From the limit on a digit is lost; where a tape is written that is put up with, since the matrix leaves nothing to differentiate,
 * until three are. */
static inline ncgen_scalar ncgen_pivot_growth_limit(const ncgen_run *r, ncgen_scalar limit)
{
    return r->options->tape ? limit * NCGEN_TAPED_GROWTH : limit;
}

/* Of an emitted elimination. */
static inline int ncgen_has_pivot_growth(const ncgen_run *r, ncgen_real growth)
{
    return !(growth < ncgen_pivot_growth_limit(r, NCGEN_BAD_GROWTH));
}

#endif
