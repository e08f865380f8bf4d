/* ncgen_state.h: a run: its mechanism, its state, and what every integrator does with them.
 *
 * A run is a state y with a derivative, which integrators step without knowing which formalism it is.
 */
#ifndef NCGEN_STATE_H
#define NCGEN_STATE_H

#include "ncgen_runtime.h"
#include "ncgen_vectors.h"

/* A record with all its members 0, in C and in C++. */
#ifdef __cplusplus
#define NCGEN_ALL_ZERO {}
#else
#define NCGEN_ALL_ZERO {0}
#endif

typedef struct ncgen_run ncgen_run;

struct ncgen_run {
    const ncgen_model *model;
    const ncgen_dynamics *dynamics;
    const ncgen_options *options;
    const ncgen_real *p;
    ncgen_real *p_copy;             /* the same in memory of the run's own, where signals or choices change them, or what is prepared
                                     * follows; else NULL */
    int is_driven;                  /* do signals change them? */
    ncgen_scalar step_start;        /* where the present step began */
    ncgen_statistics *statistics;
    int n, m, nz, ny;
    int error_size;                 /* components of y that the error estimate looks at, work being the last of them */
    ncgen_scalar rounding;          /* distance from 1 to the next number */
    ncgen_space space;
    int *integers;

    ncgen_real *q, *qd;             /* of the last evaluation */
    ncgen_real *external;           /* forces of the dynamics' own function there; NULL without it */
    ncgen_real *start;              /* 2 n: room for the last accepted state */
    const ncgen_real *start_q, *start_qd; /* that state, there or in y */
    ncgen_real start_work;
    ncgen_scalar start_t;
    ncgen_real *y;

    /* The formalism. project_state brings a new state onto the constraints, or refuses it, and takes its derivative there, unless yd is NULL;
     * accept looks at a new state whose derivative is the last evaluation; state computes q and qd of an interpolated state. */
    int (*derivative)(ncgen_run *r, ncgen_scalar t, ncgen_real *y, ncgen_real *yd);
    int (*stage_derivative)(ncgen_run *r, ncgen_scalar t, ncgen_real *y, ncgen_real *yd); /* the same, and r->q, r->qd may stay as they are */
    int (*project_state)(ncgen_run *r, ncgen_scalar t, ncgen_real *y, int precise, ncgen_real *yd);
    int (*accept)(ncgen_run *r, ncgen_scalar t);
    int (*state)(ncgen_run *r, ncgen_scalar t, ncgen_real *y);
    /* For implicit methods: how the velocities' derivatives change with velocities and positions, row by row. */
    int (*jacobian)(ncgen_run *r, ncgen_scalar t, ncgen_real *y, ncgen_real *jacobian);
    struct ncgen_partitioning *partitioning;
    struct ncgen_constrained *constrained;
    long attempts_left;              /* steps until progress is reported; -1: the progress function has ended the run */
    int projects_stages;             /* those of a repeated step are brought onto the constraints, too: it may be near a singular position */
    int projecting;                  /* those of the step under way are */
    int uses_exchanges;              /* the step is repeated: emitted eliminations give way to those with row exchanges */
    struct ncgen_linearisation *linearisation;

    /* Output. */
    int n_times;
    const ncgen_scalar *times;
    ncgen_real *out_q, *out_qd, *out_work;
    int rows;
};

/* Is a step one that moves the clock? Near t = 0 the clock can distinguish steps that are shorter than any rounding of the run, down to
 * the smallest number of all, which times a factor above 1/2 is itself: a step that is refused again and again would never end. */
static inline int ncgen_is_step(const ncgen_run *r, ncgen_scalar t, ncgen_scalar h)
{
    return t + h > t && h > r->rounding * r->rounding * (r->times[r->n_times - 1] - r->times[0]);
}

/* The rounding unit of numbers. */
ncgen_scalar ncgen_rounding(void);

/* Those of a motion from call to call: by RK4 in steps of this length, or by DOP853 within tolerances where it is 0. */
ncgen_options ncgen_options_of_calls(ncgen_scalar step, ncgen_scalar rtol, ncgen_scalar atol);

/* A run without workspace; its state once that is known, or is being counted; and its first state. */
void ncgen_describe(ncgen_run *r, const ncgen_model *model, const ncgen_dynamics *dynamics, const ncgen_options *options);
void ncgen_state_layout(ncgen_run *r);
void ncgen_begin(ncgen_run *r);
int ncgen_accept(ncgen_run *r, ncgen_scalar t, const ncgen_real *y);
/* The derivative of a new state, first brought onto the constraints where the formalism does that. */
int ncgen_end_derivative(ncgen_run *r, ncgen_scalar t, ncgen_real *y, int precise, ncgen_real *yd);
int ncgen_choose(ncgen_run *r); /* parameters that follow from the last accepted position */
void ncgen_save_state(ncgen_run *r, ncgen_scalar t, ncgen_real work);
ncgen_scalar ncgen_step_count(const ncgen_run *r, ncgen_scalar span); /* 0: more than can be counted */
int ncgen_report_progress(ncgen_run *r, ncgen_scalar reached);        /* before whatever takes long; reached: the state that an end now leaves */
void ncgen_write_row(ncgen_run *r, ncgen_real work);

/* The rows' kernels, of which a mechanism without rows has none. */
int ncgen_phi(const ncgen_run *r, ncgen_real t, const ncgen_real *q, ncgen_real *phi);
int ncgen_phi_q(const ncgen_run *r, ncgen_real t, const ncgen_real *q, ncgen_real *values);
int ncgen_gamma(const ncgen_run *r, ncgen_real t, const ncgen_real *q, const ncgen_real *qd, ncgen_real *gamma);

/* Forces of the dynamics' own function, in r->external; NCGEN_DOMAIN where they, or the state, are not finite. */
int ncgen_external_forces(ncgen_run *r, ncgen_real t, const ncgen_real *q, const ncgen_real *qd);

/* All forces, and kinetic and potential energy and the power of other forces; zero without bodies. Energies follow the forces of the same
 * state. */
int ncgen_forces(ncgen_run *r, ncgen_real t, const ncgen_real *q, const ncgen_real *qd, ncgen_real *forces);
int ncgen_energies(const ncgen_run *r, ncgen_real t, const ncgen_real *q, const ncgen_real *qd, ncgen_real energies[3]);

/* The last of these alone. */
int ncgen_power(const ncgen_run *r, ncgen_real t, const ncgen_real *q, const ncgen_real *qd, ncgen_real *power);

/* Sparse matrices, of which one without rows has no pattern. */
int ncgen_degrees_of_freedom(const ncgen_run *r); /* how many velocities the constraints leave, redundant rows counted once */
int ncgen_nonzeros(const ncgen_pattern *pattern);

/* Row i of A x. */
static inline ncgen_real ncgen_row_times(const ncgen_pattern *pattern, const ncgen_real *values, const ncgen_real *x, int i)
{
    ncgen_real sum = 0;
    for (int k = pattern->indptr ? pattern->indptr[i] : 0; k < (pattern->indptr ? pattern->indptr[i + 1] : 0); ++k)
        sum += values[k] * x[pattern->indices[k]];
    return sum;
}

void ncgen_times_mass(const ncgen_run *r, const ncgen_real *mass, const ncgen_real *x, ncgen_real *product);
void ncgen_row_velocities(const ncgen_run *r, const ncgen_real *phi_q, const ncgen_real *qd, ncgen_real *rates);

int ncgen_ask_for_inputs(ncgen_run *r, ncgen_scalar t);

/* What drives the run, before forces at time t. */
static inline int ncgen_read_inputs(ncgen_run *r, ncgen_scalar t)
{
    return r->is_driven ? ncgen_ask_for_inputs(r, t) : NCGEN_OK;
}

/* Progress before an attempt at time t; NCGEN_INTERRUPTED ends the run. */
static inline int ncgen_report_attempt(ncgen_run *r, ncgen_scalar t)
{
    r->statistics->tried = t;
    if (r->attempts_left <= 0)
        return ncgen_report_progress(r, r->start_t);
    r->attempts_left -= 1;
    return NCGEN_OK;
}

#endif
