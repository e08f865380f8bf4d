/* ncgen_internal.h: what the parts of the runtime know of each other. Not for embedders.
 *
 * A run is a state y with a derivative; ncgen_explicit.c steps it without knowing which formalism it is.
 */
#ifndef NCGEN_INTERNAL_H
#define NCGEN_INTERNAL_H

#include "ncgen_math.h"
#include "ncgen_runtime.h"

/* A literal of the number type, with the digits of the longest type that C99 has. */
#define R(x) ((ncgen_scalar)(x##L))

/* Workspace that is dealt out; without a base it is only counted. */
typedef struct ncgen_space {
    ncgen_real *base;
    size_t used;
} ncgen_space;

/* The matrix [A Phi_q'; Phi_q -E] and its factors. */
typedef struct ncgen_kkt {
    const ncgen_elimination *plan;
    ncgen_real *values;             /* [mass, phi_q] as the plan numbers them */
    ncgen_real *lower;              /* nonzeros of L */
    ncgen_real *pivots, *row;       /* size; row is zero between calls */
    ncgen_real *corner;             /* the diagonal -E in elimination order, zero for coordinates */
    ncgen_real *least, *instead;    /* size: smallest pivot that is left as it is, and what replaces a smaller one */
    ncgen_real *permuted;           /* size: for solutions */
    long perturbed;                 /* pivots of the last factorisation that were made larger */
} ncgen_kkt;

typedef struct ncgen_run ncgen_run;

struct ncgen_run {
    const ncgen_model *model;
    const ncgen_dynamics *dynamics;
    const ncgen_options *options;
    const ncgen_real *p;
    ncgen_statistics *statistics;
    int n, m, nz, ny;
    int weighed;                    /* components of y that the error estimate looks at, work being the last of them */
    ncgen_scalar rounding;          /* distance from 1 to the next number */
    ncgen_space space;
    int *integers;

    ncgen_real *q, *qd;             /* of the last evaluation */
    ncgen_real *start_q, *start_qd; /* the last accepted state */
    ncgen_real start_work;
    ncgen_scalar start_t;
    ncgen_real *y;

    /* The formalism. settle brings a new state onto the constraints before its derivative is taken; accept looks at a
     * new state whose derivative is the last evaluation; state computes q and qd of an interpolated state. */
    int (*derivative)(ncgen_run *r, ncgen_scalar t, ncgen_real *y, ncgen_real *yd);
    int (*settle)(ncgen_run *r, ncgen_scalar t, ncgen_real *y);
    int (*accept)(ncgen_run *r, ncgen_scalar t);
    int (*state)(ncgen_run *r, ncgen_scalar t, ncgen_real *y);
    struct ncgen_partitioning *partitioning;
    struct ncgen_constrained *constrained;

    /* Output. */
    int n_times;
    const ncgen_scalar *times;
    ncgen_real *out_q, *out_qd, *out_work;
    int rows;
};

/* Coordinate partitioning (ncgen_partitioning.c). */
typedef struct ncgen_partitioning {
    ncgen_real *out;                          /* of the last evaluation: qd, zdd, power, amplification */
    ncgen_real *step, *phi;                   /* one behind the other: an emitted Newton step writes both */
    ncgen_real amplification;                 /* at the start of the run */
    int orientation, first_orientation;       /* sign of the determinant of Phi_q^d, now and at the start; 0: not known */
    /* Where nothing is emitted, with d dependent and z independent coordinates: */
    ncgen_real *jacobian, *mass;              /* nonzeros */
    ncgen_real *lu;                           /* d x d, row by row */
    ncgen_real *R, *MR;                       /* z rows of n */
    ncgen_real *reduced;                      /* z x z */
    ncgen_real *bias, *force, *missing;       /* n */
    ncgen_real *nu, *gamma, *lam;             /* m */
    ncgen_real *column;                       /* d */
    int *order;                               /* row exchanges */
} ncgen_partitioning;

/* Formalisms on all coordinates (ncgen_constrained.c, ncgen_dense.c). */
typedef struct ncgen_constrained {
    ncgen_kkt kkt;
    int n_mass, n_phi_q;                       /* nonzeros */
    int jacobian_is_there;                     /* kkt.values hold Phi_q of the state that comes next */
    ncgen_real *right, *solution, *residual;   /* n + m: forces and rows; qdd and lam */
    ncgen_real *nu, *phi;                      /* m */
    ncgen_real *corner;                        /* m: the diagonal E */
    ncgen_real *natural, *reduced;             /* n, m: sizes of the masses, and of rows once these are eliminated */
    /* Where QR is used: */
    ncgen_real mass_size;                      /* the largest mass in natural sizes */
    ncgen_real *jacobian;                      /* n x m */
    ncgen_real *basis;                         /* columns of n */
    ncgen_real *square;                        /* (n + m) x n */
    ncgen_real *scaled;                        /* 4 (n + m) */
    int *columns;                              /* exchanges, of n or m columns */
    int *let_go;                               /* m: is a row left out, since others imply it? */
    int redundant;                             /* are there such rows? */
    int iterated;                              /* is the effect of E removed by iteration? */
} ncgen_constrained;

/* What an integrator works in (ncgen_explicit.c). */
typedef struct ncgen_stepping {
    ncgen_real *new_y, *at;      /* ny */
    ncgen_real *slopes;          /* stages of ny each */
    ncgen_real *interpolant;     /* coefficients of ny each */
    int interpolated;            /* are they those of this step? */
    ncgen_real event;            /* value of the event's function at the last accepted state */
} ncgen_stepping;

/* ncgen_run.c */
int ncgen_accept(ncgen_run *r, ncgen_scalar t, const ncgen_real *y);
void ncgen_keep_state(ncgen_run *r, ncgen_scalar t, ncgen_real work);
ncgen_scalar ncgen_step_count(const ncgen_run *r, ncgen_scalar span);
ncgen_real *ncgen_take(ncgen_space *space, int count);
void ncgen_copy(int count, const ncgen_real *from, ncgen_real *to);
ncgen_real ncgen_dot(int count, const ncgen_real *a, const ncgen_real *b);
int ncgen_solve_positive(int size, ncgen_real *a, ncgen_real *right); /* a by rows, lower half; both are overwritten */
void ncgen_times_mass(const ncgen_run *r, const ncgen_real *mass, const ncgen_real *x, ncgen_real *product);
void ncgen_row_rates(const ncgen_run *r, const ncgen_real *phi_q, const ncgen_real *qd, ncgen_real *rates);
void ncgen_write_row(ncgen_run *r, ncgen_real work);

/* ncgen_partitioning.c and ncgen_constrained.c: layout deals out workspace, begin makes the first y. */
void ncgen_partitioning_layout(ncgen_run *r, ncgen_partitioning *w);
void ncgen_partitioning_begin(ncgen_run *r, const ncgen_real *velocities);
void ncgen_constrained_layout(ncgen_run *r, ncgen_constrained *w);
int ncgen_constrained_begin(ncgen_run *r, const ncgen_real *velocities);
int ncgen_constrained_accelerations(ncgen_run *r, ncgen_scalar t); /* of r->q, r->qd, into solution; its factors stay */
int ncgen_constrained_position(ncgen_run *r, ncgen_scalar t);      /* r->q, r->qd onto the constraints, with these factors */
int ncgen_constrained_velocity(ncgen_run *r, ncgen_scalar t);
void ncgen_constrained_rows(ncgen_run *r);                         /* which of redundant rows count from here on */

/* ncgen_dense.c: accelerations by QR; and which of redundant rows are farthest from dependent, in w->let_go. */
void ncgen_choose_rows(ncgen_run *r, ncgen_constrained *w);
int ncgen_dense_accelerations(ncgen_run *r, ncgen_constrained *w);

/* ncgen_steppers.c: a run over the grid with a method for constrained equations. */
int ncgen_steppers(ncgen_run *r, ncgen_stepping *w);

/* ncgen_explicit.c: a run over the grid with Runge-Kutta methods. */
void ncgen_stepping_layout(ncgen_run *r, ncgen_stepping *w);
int ncgen_explicit(ncgen_run *r, ncgen_stepping *w);

/* ncgen_sparse.c */
void ncgen_kkt_layout(ncgen_kkt *k, const ncgen_elimination *plan, int nonzeros, ncgen_space *space);
int ncgen_kkt_factor(ncgen_kkt *k);
void ncgen_kkt_solve(ncgen_kkt *k, const ncgen_real *right, ncgen_real *x);

#endif
