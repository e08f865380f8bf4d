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
    int (*settle)(ncgen_run *r, ncgen_scalar t, ncgen_real *y, int precise);
    int (*accept)(ncgen_run *r, ncgen_scalar t);
    int (*state)(ncgen_run *r, ncgen_scalar t, ncgen_real *y);
    /* For implicit methods: how the velocities' derivatives change with velocities and positions, row by row. */
    int (*jacobian)(ncgen_run *r, ncgen_scalar t, ncgen_real *y, ncgen_real *jacobian);
    struct ncgen_partitioning *partitioning;
    struct ncgen_constrained *constrained;
    long patience;                  /* steps until the watch is called; -1: it has ended the run */
    int careful;                    /* the step is repeated: emitted eliminations give way to those with row exchanges */
    struct ncgen_slopes *slopes;

    /* Output. */
    int n_times;
    const ncgen_scalar *times;
    ncgen_real *out_q, *out_qd, *out_work;
    int rows;
};

/* A choice of independent coordinates in a run. */
typedef struct ncgen_choice {
    ncgen_partition of;
    int orientation, first_orientation;       /* sign of the determinant of Phi_q^d, now and at the start; 0: not known */
    ncgen_real amplification;                 /* at the start of the run */
} ncgen_choice;

/* Coordinate partitioning (ncgen_partitioning.c). */
typedef struct ncgen_partitioning {
    ncgen_real *out;                          /* of the last evaluation: qd, zdd, power, amplification */
    ncgen_real *step, *phi;                   /* one behind the other: an emitted Newton step writes both */
    ncgen_choice choices[2];
    ncgen_choice *velocities, *positions;     /* the same one unless there are rolling conditions */
    const ncgen_partition *factored;          /* whose Phi_q^d has been factored */
    /* Where nothing is emitted, or rows are given, with d dependent and z independent coordinates: */
    ncgen_real *jacobian, *mass;              /* nonzeros */
    ncgen_real *lu;                           /* d x d, row by row */
    ncgen_real *R, *MR;                       /* z rows of n */
    ncgen_real *place;                        /* R of the positions: a row of n for each independent one */
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
    int kept;                                  /* solution and factors are those of the last step's end */
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

/* The tangent kernels' values, and changes of the equations of motion (ncgen_jacobian.c). */
typedef struct ncgen_slopes {
    ncgen_real *stiffness, *damping, *phidd_q, *phidd_qd; /* nonzeros */
    ncgen_real *rolled;                                   /* nonzeros of phidd_q: what qdd = qd adds to it; for rolling conditions */
    ncgen_real *qdd, *lam;                                /* n, m: where they are taken */
    ncgen_real *dq, *dqd;                                 /* n */
    ncgen_real *change;                                   /* n + m: of forces and rows */
} ncgen_slopes;

/* What an integrator works in. */
typedef struct ncgen_stepping {
    ncgen_real *new_y, *at;      /* ny: the end of a step, and a state in between */
    ncgen_real *slopes;          /* stages of ny each */
    ncgen_real *interpolant;     /* coefficients of ny each */
    int interpolated;            /* are they those of this step? */
    ncgen_real event;            /* value of the event's function at the last accepted state */
    /* at: the state at t + s h, inside a step from y to new_y */
    int (*interpolate)(ncgen_run *r, struct ncgen_stepping *w, ncgen_scalar t, ncgen_scalar h, ncgen_scalar s);
    int repeated;                /* is the step taken again, since its error was too large or a stage had no derivative? */
    int stiff, not_stiff;        /* steps in a row that spoke for a stiff mechanism, and against it since then */
    int tiny;                    /* looks in a row at steps far too short */
    ncgen_scalar mark;           /* the time at the last look at how far the steps come */
} ncgen_stepping;

/* A factored matrix s - J, see ncgen_implicit.c. */
typedef struct ncgen_shifted {
    int parts;                   /* 2 where s is complex */
    ncgen_scalar inverse[2];     /* of s */
    ncgen_real *matrix;
    int *order;
} ncgen_shifted;

/* What an implicit integrator works in besides (ncgen_implicit.c). */
typedef struct ncgen_implicit {
    int follows;                 /* are positions the integrals of as many velocities? */
    int count;                   /* unknowns of the linear systems: velocities, and positions where these do not follow */
    int width;                   /* velocities and positions */
    ncgen_real *jacobian;        /* count rows of width */
    ncgen_shifted real, complex;
    int factored, fresh;         /* for this Jacobian and step? Is the Jacobian that of the present state? */
    ncgen_real *stages, *rates;  /* three of ny: changes since the start of the step, and derivatives */
    ncgen_real *unknowns, *right, *change; /* three of weighed */
    ncgen_real *reduced;         /* 4 half */
    int iterations;              /* of the last step, and how fast they converged */
    ncgen_real rate;
    ncgen_scalar last_step;      /* accepted, and its error; 0 if there is none */
    ncgen_real last_error;
} ncgen_implicit;

/* The equations of a step and their Newton steps (ncgen_correction.c). */
typedef struct ncgen_correction {
    int size;                    /* n, or n + m where multipliers are unknowns */
    ncgen_real *matrix;          /* size x size */
    ncgen_real *right, *x;       /* size; both without units */
    ncgen_real *rest;            /* n + m: what is missing in forces, and Phi */
    ncgen_real *change;          /* n + m: of q or qdd, and of lam */
    ncgen_real *auxiliary;       /* n: the auxiliary acceleration of generalized-alpha */
    ncgen_real *base;            /* 2 n: qd and q without the accelerations at the end of the step */
    ncgen_real *left;            /* nonzeros of Phi_q that the multipliers act by */
    ncgen_real *halfway, *rolled; /* nonzeros of Phi_q in the middle of the step, n + m: for rolling conditions */
    ncgen_real *gap, *along;     /* m, n: what energy-momentum adds to Phi_q in the middle, gap along' */
    int is_corrected;            /* does it? */
    int *order;
    ncgen_real unit;             /* the largest inertia */
    ncgen_real power;            /* at the end of the last step */
} ncgen_correction;

/* ncgen_run.c */
int ncgen_uses_tangents(const ncgen_model *model, const ncgen_dynamics *dynamics, const ncgen_options *options);
int ncgen_is_stepper(const ncgen_options *options); /* does the method discretise the constrained equations themselves? */
int ncgen_accept(ncgen_run *r, ncgen_scalar t, const ncgen_real *y);
void ncgen_keep_state(ncgen_run *r, ncgen_scalar t, ncgen_real work);
ncgen_scalar ncgen_step_count(const ncgen_run *r, ncgen_scalar span); /* 0: more than can be counted */
int ncgen_listen(ncgen_run *r, ncgen_scalar t);       /* before whatever takes long, at time t; NCGEN_INTERRUPTED ends the run */
int ncgen_is_finite(int count, const ncgen_real *x);  /* is no number infinite or none at all? */
ncgen_real *ncgen_take(ncgen_space *space, int count);
void ncgen_copy(int count, const ncgen_real *from, ncgen_real *to);
ncgen_real ncgen_dot(int count, const ncgen_real *a, const ncgen_real *b);
int ncgen_solve_positive(int size, ncgen_real *a, ncgen_real *right); /* a by rows, lower half; both are overwritten */
void ncgen_solve_positive_again(int size, const ncgen_real *a, ncgen_real *right); /* with the factors that are left in a */
void ncgen_times_mass(const ncgen_run *r, const ncgen_real *mass, const ncgen_real *x, ncgen_real *product);
void ncgen_row_rates(const ncgen_run *r, const ncgen_real *phi_q, const ncgen_real *qd, ncgen_real *rates);
void ncgen_write_row(ncgen_run *r, ncgen_real work);

/* ncgen_partitioning.c and ncgen_constrained.c: layout deals out workspace, begin makes the first y. */
void ncgen_partitioning_layout(ncgen_run *r, ncgen_partitioning *w);
void ncgen_partitioning_begin(ncgen_run *r, const ncgen_real *velocities);
int ncgen_partitioning_position(ncgen_run *r, ncgen_scalar t, ncgen_real *y);             /* q of the independent ones in y */
int ncgen_partitioning_accelerate(ncgen_run *r, ncgen_scalar t, const ncgen_real *zd);    /* leaves factors behind */
int ncgen_partitioning_place(ncgen_run *r, ncgen_scalar t, ncgen_real *amplification);     /* R of the positions at r->q */
void ncgen_partitioning_solve(const ncgen_run *r, const ncgen_real *right, ncgen_real *x); /* with the factors of Phi_q^d */
void ncgen_partitioning_multipliers(const ncgen_run *r, const ncgen_real *right, ncgen_real *lam);
void ncgen_constrained_layout(ncgen_run *r, ncgen_constrained *w);
int ncgen_constrained_begin(ncgen_run *r, const ncgen_real *velocities);
int ncgen_constrained_accelerations(ncgen_run *r, ncgen_scalar t); /* of r->q, r->qd, into solution; its factors stay */
int ncgen_constrained_power(ncgen_run *r, ncgen_scalar t, ncgen_real *power); /* of drivers and forces without a potential */
int ncgen_constrained_matrices(ncgen_run *r, ncgen_scalar t);      /* M and Phi_q at r->q, into kkt.values */
int ncgen_constrained_factor(ncgen_run *r);
int ncgen_constrained_solve(ncgen_run *r);                         /* solution for what is in right */
int ncgen_constrained_position(ncgen_run *r, ncgen_scalar t);      /* r->q, r->qd onto the constraints, with these factors */
int ncgen_constrained_velocity(ncgen_run *r, ncgen_scalar t);
void ncgen_constrained_rows(ncgen_run *r);                         /* which of redundant rows count from here on */

/* ncgen_dense.c: accelerations by QR; and which of redundant rows are farthest from dependent, in w->let_go. */
void ncgen_choose_rows(ncgen_run *r, ncgen_constrained *w);
int ncgen_dense_accelerations(ncgen_run *r, ncgen_constrained *w);

/* ncgen_lu.c: a by rows, row exchanges in order; orientation: sign of the determinant. right and x are two arrays. */
int ncgen_lu_factor(int size, ncgen_real *a, int *order, int *orientation);
void ncgen_lu_solve(int size, const ncgen_real *a, const int *order, const ncgen_real *right, ncgen_real *x);

/* ncgen_jacobian.c */
void ncgen_slopes_layout(ncgen_run *r, ncgen_slopes *w);
int ncgen_partitioning_jacobian(ncgen_run *r, ncgen_scalar t, ncgen_real *y, ncgen_real *jacobian);
int ncgen_constrained_jacobian(ncgen_run *r, ncgen_scalar t, ncgen_real *y, ncgen_real *jacobian);
int ncgen_find_tangents(ncgen_run *r, ncgen_scalar t); /* stiffness and damping at r->q, r->qd and qdd, lam of r->slopes */

/* ncgen_grid.c: rows of the time grid and the event, inside steps from y to new_y. A step's end has been evaluated last. */
int ncgen_grid_begin(ncgen_run *r, ncgen_stepping *w);
int ncgen_grid_step(ncgen_run *r, ncgen_stepping *w, ncgen_scalar t, ncgen_scalar t_new); /* new_y becomes y */
int ncgen_creeps(const ncgen_run *r, ncgen_stepping *w, ncgen_scalar t);
void ncgen_interpolate_cubic(ncgen_run *r, ncgen_stepping *w, const ncgen_real *first, const ncgen_real *last, ncgen_scalar h,
                             ncgen_scalar s);

/* ncgen_explicit.c, ncgen_implicit.c, ncgen_steppers.c: a run over the grid with Runge-Kutta methods, with implicit ones, and
 * with those for constrained equations. */
void ncgen_explicit_layout(ncgen_run *r, ncgen_stepping *w);
int ncgen_explicit(ncgen_run *r, ncgen_stepping *w);
ncgen_real ncgen_weighted_square(const ncgen_run *r, const ncgen_real *x, const ncgen_real *a, const ncgen_real *b);
ncgen_scalar ncgen_first_step(ncgen_run *r, ncgen_stepping *w, int order, ncgen_scalar t, ncgen_scalar span);
void ncgen_implicit_layout(ncgen_run *r, ncgen_stepping *w, ncgen_implicit *m);
int ncgen_implicit_run(ncgen_run *r, ncgen_stepping *w, ncgen_implicit *m);
void ncgen_steppers_layout(ncgen_run *r, ncgen_stepping *w, ncgen_correction *c);
int ncgen_steppers(ncgen_run *r, ncgen_stepping *w, ncgen_correction *c);

/* Methods for constrained equations, one a file: a step from t to t + h, whose end is left in r->q, r->qd and the work in
 * w->new_y. */
typedef int ncgen_stepper(ncgen_run *r, ncgen_stepping *w, ncgen_correction *c, ncgen_scalar t, ncgen_scalar h);
ncgen_stepper ncgen_rattle, ncgen_rattle_with_damping, ncgen_energy_momentum, ncgen_energy_momentum_corrected;
ncgen_stepper ncgen_generalized_alpha, ncgen_ali3p;

/* ncgen_correction.c: what they share. */
ncgen_real ncgen_correction_size(const ncgen_run *r, const ncgen_real *x);
int ncgen_is_rounding(const ncgen_run *r, ncgen_real size, ncgen_real last);
ncgen_real *ncgen_phi_q_values(const ncgen_run *r);
void ncgen_subtract_multipliers(const ncgen_run *r, const ncgen_real *values, ncgen_real *forces);
int ncgen_begin_correction(ncgen_run *r, ncgen_scalar t); /* counts a Newton step on the equations of a step, and listens */
int ncgen_find_forces(ncgen_run *r, ncgen_correction *c, ncgen_scalar t);
int ncgen_find_rest(ncgen_run *r, ncgen_correction *c, ncgen_scalar t, ncgen_scalar h);
int ncgen_find_closure(ncgen_run *r, ncgen_correction *c, ncgen_scalar t, ncgen_scalar h, const ncgen_real *end);
void ncgen_fill_weight(const ncgen_run *r, ncgen_correction *c, ncgen_real by_qd, ncgen_real by_q);
int ncgen_solve_with_multipliers(ncgen_run *r, ncgen_correction *c, ncgen_real by_qd, ncgen_real by_q, const ncgen_real *left,
                                 ncgen_real step);
int ncgen_end_step(ncgen_run *r, ncgen_stepping *w, ncgen_correction *c, ncgen_scalar t, ncgen_scalar h);

/* ncgen_sparse.c */
void ncgen_kkt_layout(ncgen_kkt *k, const ncgen_elimination *plan, int nonzeros, ncgen_space *space);
int ncgen_kkt_factor(ncgen_kkt *k);
void ncgen_kkt_solve(ncgen_kkt *k, const ncgen_real *right, ncgen_real *x);

#endif
