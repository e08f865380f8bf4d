/* ncgen_block.h: NCGEN_LANES states side by side, with coordinate partitioning: their derivative, where they end, what they leave.
 *
 * The method is that of ncgen_partitioning.c and ncgen_explicit.c; what is a branch there is a mask here.
 */
#ifndef NCGEN_BLOCK_H
#define NCGEN_BLOCK_H

#include "ncgen_math.h"
#include "ncgen_runtime.h"

#define R(x) ((ncgen_scalar)(x##L))
#include "ncgen_stiff_steps.h"
#include "ncgen_tableaus.h"

#ifdef _OPENMP
#include <omp.h>
#define PRAGMA(text) _Pragma(#text)
#define ATOMIC(how) PRAGMA(omp atomic how)
#else
#define ATOMIC(how)
#endif

/* A residual or an amplification that leaves no digit of the solution. */
static const double max_residual = 1e30;

/* What the threads of a call have in common. The calling one alone calls the progress function; the others read its answer. */
typedef struct ncgen_common {
    const ncgen_options *options;
    long count;         /* states */
    long completed;     /* states that have */
    long attempts_left; /* steps until the progress function is called again */
    int idle;           /* threads that have nothing left to do */
    int stopped;        /* 1: the progress function has ended the call */
} ncgen_common;

/* Where results go. */
typedef struct ncgen_output {
    int n_times;
    const double *times;
    double *q, *qd, *work;
    int *status;
    long *steps;
    double *reached;
    const int *break_start; /* of each state and behind the last one: where its breaks begin; NULL: there are none */
    const double *breaks;   /* as of ncgen_signals */
} ncgen_output;

/* A block of states. Masks: the lanes that a function is to compute, and those in which it succeeded. */
typedef struct ncgen_block {
    const ncgen_model *model;
    const ncgen_dynamics *dynamics;
    const ncgen_options *options;
    ncgen_output to;              /* of the block's first state */
    int n, nz, ny;
    int given, given_end;    /* the coordinates from which positions are closed: the independent ones and those between, or all */
    int first_together;      /* the first of the dependent coordinates if they follow one another and are found in closed form, else -1 */
    ncgen_common *shared;
    int output_start; /* where the numbers of `out` begin that somebody reads: at the velocities, or after them */
    int reports;      /* 1: in the thread that calls the progress function */
    ncgen_mask running;
    ncgen_mask not_finite;   /* lanes in which the last evaluation met what is not a number */
    ncgen_mask singular;     /* lanes in which it met a singular position */
    int row[NCGEN_LANES];    /* how many rows are written */
    int ahead[NCGEN_LANES];  /* the next of its breaks */
    ncgen_stiff_steps stiff[NCGEN_LANES];
    ncgen_real *p, *q, *out; /* out = qd, zdd, power, amplification of the last evaluation */
    ncgen_real *step, *phi;  /* one behind the other: an emitted Newton step writes both */
    ncgen_real *per_size;    /* one over the rows' sizes: vectors divide slowly */
    ncgen_real *start_q, *start_qd, *end_q, *end_qd;
    ncgen_real start_t, amplification;
    ncgen_real *y, *new_y, *at, *k[WIDTH];
} ncgen_block;

size_t ncgen_block_workspace(const ncgen_model *model, const ncgen_dynamics *dynamics); /* numbers that a block needs */
void ncgen_block_lay_out(ncgen_block *r, ncgen_real *workspace); /* the parts of the workspace */

/* The states of a block, from their rows, and the first row of the grid; lanes beyond `count` repeat the last one and are
 * not running. */
void ncgen_block_begin(ncgen_block *r, int count, const double *q, const double *zd, const double *p, int p_stride);

/* A run over the grid, by steps with error control or of a fixed length, whichever the method takes (ncgen_block_steps.c). */
void ncgen_block_run(ncgen_block *r, const tableau *method);

/* The dependent coordinates of some lanes at time t, from r->q on, which has the independent ones; those that close. */
ncgen_mask ncgen_block_close(ncgen_block *r, ncgen_real t, ncgen_mask open);

/* Accelerations of the lanes that are closed, in r->out; those that have them. */
ncgen_mask ncgen_block_accelerate(ncgen_block *r, ncgen_real t, const ncgen_real *zd, ncgen_mask closed);

/* q in r->q, extrapolated from the last state and closed; velocities and accelerations in r->out. */
ncgen_mask ncgen_block_evaluate(ncgen_block *r, ncgen_real t, const ncgen_real *y, ncgen_mask wanted);
ncgen_mask ncgen_block_derivative(ncgen_block *r, ncgen_real t, const ncgen_real *y, ncgen_real *yd, ncgen_mask wanted);

/* The last evaluation and y become the state of some lanes, with the derivative yd. */
void ncgen_block_accept(ncgen_block *r, ncgen_mask lanes, ncgen_real t, const ncgen_real *y, const ncgen_real *yd);

/* The next row of the grid of some lanes. */
void ncgen_block_write(ncgen_block *r, ncgen_mask lanes, const ncgen_real *q, const ncgen_real *qd, ncgen_real work);

void ncgen_block_end(ncgen_block *r, ncgen_mask lanes, int status); /* lanes end; those that have ended already keep their status */
void ncgen_block_fail(ncgen_block *r, ncgen_mask lanes);            /* lanes end because their last evaluation failed */

void ncgen_block_report_attempt(ncgen_block *r); /* before every step that is tried: may the block go on? */
void ncgen_block_report(ncgen_common *shared);   /* calls the progress function, which may end the call */
int ncgen_block_is_stopped(ncgen_common *shared);

#endif
