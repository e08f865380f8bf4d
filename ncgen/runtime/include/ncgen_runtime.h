/* ncgen_runtime.h: whole simulations of a generated model, in one call.
 *
 * The runtime is the same for every mechanism. It allocates nothing: the caller gives the workspace, whose
 * length ncgen_workspace() returns. Runs in different workspaces may take place at the same time.
 */
#ifndef NCGEN_RUNTIME_H
#define NCGEN_RUNTIME_H

#include "ncgen.h"
#include "ncgen_methods.h"

/* For AddressSanitizer: so many numbers behind each part of a workspace, which may not be on the stack then, belong to nobody. A workspace
 * whose length is a formula has room for those of 64 parts. */
#ifndef NCGEN_GAP
#define NCGEN_GAP 0
#endif
#define NCGEN_GAPS (64 * NCGEN_GAP)

/* A part of a long function that stands in another file, and which nothing else calls. */
#if defined(__GNUC__) && !defined(_WIN32) && !defined(__wasm__)
#define NCGEN_PART NCGEN_NOINLINE __attribute__((visibility("hidden")))
#else
#define NCGEN_PART NCGEN_NOINLINE
#endif

#ifdef __cplusplus
extern "C" {
#endif

/* begin cdef */

/* The state derivative of a model, for one choice of independent coordinates.
 *
 * newton and acceleration are emitted for one mechanism and one choice, with the elimination as straight-line code; where they are
 * NULL the runtime does the same with the model's kernels and dense elimination with row exchanges.
 * newton writes the correction of the dependent coordinates (n_dependent numbers), then phi (n_rows); where it `closes` at once it
 * writes the dependent coordinates themselves, and reads the independent ones alone;
 * acceleration writes qd (n_coordinates), zdd (n_independent), power, amplification: how much an error of the
 * independent coordinates grows in the others, squared. */
typedef int ncgen_acceleration_kernel(ncgen_real t, const ncgen_real *q, const ncgen_real *zd, const ncgen_real *p,
                                      ncgen_real *out);

/* How to factor [A Phi_q'; Phi_q -E], where A has the pattern of the mass matrix: the order of elimination and the pattern of its factor L D L', found once for a mechanism.
 *
 * order[k] is eliminated as the k-th: coordinate order[k], or row order[k] - n_coordinates
 * Row k of L has the columns row_columns[row_start[k]] .. (increasing), with their values at row_positions[...];
 * column k of L has its values at column_start[k] .. and their rows in column_rows.
 * Row k of the matrix gets, left of the diagonal and on it, at entry_columns[entry_start[k]] .., the values numbered
 * entry_values[...] of the list [mass, phi_q]. */
typedef struct ncgen_elimination {
    int size;     /* n_coordinates + n_rows */
    int nonzeros; /* of L */
    const int *order;
    const int *row_start, *row_columns, *row_positions;
    const int *column_start, *column_rows;
    const int *entry_start, *entry_columns, *entry_values;
} ncgen_elimination;

/* A choice of independent coordinates for positions, where it is not that for velocities. */
typedef struct ncgen_partition {
    int n_independent;
    int n_dependent;
    const int *independent; /* positions in q */
    const int *dependent;
    const int *rows;        /* n_dependent kept rows */
} ncgen_partition;

/* A kernel that takes forces along the coordinates (n_coordinates), too. */
typedef int ncgen_forced_kernel(ncgen_real t, const ncgen_real *q, const ncgen_real *qd, const ncgen_real *forces, const ncgen_real *p,
                                ncgen_real *out);

/* What depends on parameters alone, inputs not among them. */
typedef int ncgen_prepare_kernel(const ncgen_real *p, ncgen_real *out);

/* The motion of all coordinates, emitted for one mechanism as straight-line code. Where the pivot growth, how much worse their order
 * is than usual, is large, the matrix [M Phi_q'; Phi_q -E] is factored instead. What is prepared follows the parameters in the p that
 * the other functions read. The first three write what a run integrates, qdd, qd (n_coordinates each) and power, and behind them the
 * growth. */
typedef struct ncgen_motion {
    ncgen_velocity_kernel *derivative; /* qd as the joints allow; NULL where it is `forced` */
    ncgen_velocity_kernel *velocities; /* of these the nearest qd that the joints allow, in the sense of kinetic energy, and growth alone */
    ncgen_velocity_kernel *projected;  /* this qd, and all else there; NULL where it is `forced` */
    ncgen_position_kernel *closing;    /* a Newton step: dq (n_coordinates), and phi */
    int n_closing_rows;                /* of phi: n_rows, or none where positions close at once */
    ncgen_prepare_kernel *prepare;     /* n_prepared numbers; NULL: none */
    int n_prepared;
    ncgen_forced_kernel *forced;       /* NULL, or the derivative with the forces of ncgen_dynamics.external */
    int follow_from_angles;            /* does closing leave the angles of hinges alone, and all positions follow from these? */
} ncgen_motion;

/* An open tree of bodies as tables: its motion by the articulated recursion, in loops over them, so that no code is emitted for a
 * mechanism. A component is a coordinate, or n_coordinates + its number among the fixed ones.
 *
 * Links stand after their parents. A screw turns about the reference point of its link, or moves along an axis, which is a sum of weighted
 * elements. Elements stand with the link nearest to the ground that they move with. A pair of elements of one body has mass M I, a single
 * entry of the mass matrix is one that is not of that form; bodies that share elements at the end of a loop share what is between these.
 * A measured coordinate grows `ratio` times as fast as its screw. Rows close the position link by link: none of them has coordinates of
 * later links. What moves with a link only where loops are closed has a copy there, a number behind the coordinates. */
typedef struct ncgen_tree {
    int n_links, n_screws, n_elements, n_fixed, n_measured, n_rotors, n_groups, n_copies;
    int most_rows;                 /* of a link */
    const int *parent;             /* of a link; -1: the ground */
    const int *reference;          /* 3 components of a point of each link */
    const int *screw_start;        /* n_links + 1 */
    const int *turns, *is_carried; /* of a screw: does it turn? does its axis turn with the parent? */
    const int *term_start;         /* n_screws + 1 */
    const int *terms;              /* 3 components of each term of an axis */
    const ncgen_scalar *weights;   /* of a term */
    const int *element_start;      /* n_links + 1 */
    const int *elements;           /* 3 components of each */
    const ncgen_scalar *is_point;  /* of an element: 1, or 0 for a vector */
    const ncgen_scalar *heaviness; /* of an element: how much its velocity counts where a joint's rates are found */
    const int *member_start;       /* n_links + 1 */
    const int *members;            /* 3 components of elements between which a body has mass that is the same along all axes, without the
                                    * reference point, but with it, without mass, where they are less than three */
    const ncgen_scalar *member_is_point;
    const int *pair_start;         /* n_links + 1 */
    const int *pairs;              /* 3 of each pair: two members of its link, number of its value in the mass matrix; the number behind
                                    * the last member is the reference point */
    const ncgen_scalar *pair_shares;   /* of a pair: the link's share of that value */
    const int *single_start;       /* n_links + 1 */
    const int *singles;            /* 5 of each entry: element and axis, element and axis, number of its value */
    const ncgen_scalar *single_shares;
    const int *measured;           /* 2 of each measured coordinate: itself, its screw */
    const ncgen_scalar *ratios;
    const int *meter;              /* of a screw: the number of the measured coordinate that gives its rate; -1: elements do */
    const int *leader;             /* of a screw: the one that it follows; -1: none */
    const ncgen_scalar *ratio;     /* of a screw: its rate over that of its leader, 1 without one */
    const int *coupling;           /* of a link: the group of joints that move as one to which its only screw belongs; -1: none */
    const int *carrier;            /* of a group: the link that its links hang on, or hang on one another on; -1: the ground */
    const int *rotors;             /* 2 of each inertia along a measured coordinate: its screw, number of its value in the mass matrix */
    const ncgen_scalar *gears;     /* ratios squared */
    const int *row_start, *rows;   /* n_links + 1: the rows that close a link */
    const int *slot_start, *slots; /* of the rows in this order, one more: the coordinate, or copy, that each entry of Phi_q stands for */
    const int *own_start, *own;    /* the same: entries of Phi_q of the link's own coordinates and copies */
    const int *entry_start;        /* n_links: where its products of two rows begin, below the diagonal and on it */
    const int *product_start;      /* of such a product, one more */
    const int *products;           /* 2 of each term: entries of Phi_q */
    const ncgen_scalar *fixed;     /* values of the fixed components */
    int n_closing, n_opposed;
    const int *closing;            /* n_opposed rows that do not allow all that the joints do, such as those that close loops; the first n_closing
                                    * of them imply the others, but in some positions */
    const int *way_start, *way;    /* n_opposed + 1: the links that carry a closing row's coordinates, with those before them, the last first */
    const int *reach_start, *reach; /* n_opposed + 1: the screws of these links, and their groups, numbered behind the screws */
} ncgen_tree;

typedef struct ncgen_dynamics {
    int n_independent;
    int n_dependent;        /* with formalisms over all coordinates: the rank of phi_q, if rows are redundant, else 0 */
    const int *independent; /* positions in q */
    const int *dependent;
    const int *rows;        /* n_dependent kept rows; with emitted functions NULL, or what to fall back upon */
    const ncgen_scalar *column_sizes; /* natural size of every coordinate; where rows are given */
    const ncgen_scalar *row_sizes; /* n_rows: what a residual is compared with */
    ncgen_position_kernel *newton;
    ncgen_acceleration_kernel *acceleration;
    const ncgen_motion *motion;           /* NULL, or emitted for lagrange */
    const ncgen_elimination *elimination; /* for formalisms that solve with [M Phi_q'; Phi_q -E] */
    int singular_mass;                    /* 1: M is singular, and the elimination takes rows before their coordinates */
    int conservative;                     /* 1: no forces without a potential and no drivers, so no work to integrate */
    const ncgen_tangents *tangents;       /* for methods that need them; rows and column_sizes are needed, too */
    const int *rolling;                   /* n_rows: 1 for a rolling condition, which is no equation of position; NULL: there are none */
    const ncgen_partition *positions;     /* NULL, or with rolling conditions and dense elimination: fewer velocities are
                                           * independent, of which the members above speak, than positions */
    const ncgen_tree *tree;               /* NULL, or where no motion is emitted an open tree for lagrange */
    int closed_form;                      /* 1: newton finds the dependent coordinates from the independent ones, in closed form */
    ncgen_velocity_kernel *external;      /* NULL, or forces (n_coordinates) besides the model's, such as those of a host program. An emitted
                                           * `motion` is `forced` then, and there is no emitted `acceleration`. A step that it refuses is
                                           * repeated with a shorter one; after NCGEN_INTERRUPTED the run ends */
} ncgen_dynamics;

/* Operations of formulas. A number is at `a` of the numbers, a state at `a` of the inputs, a parameter at `a` of p; others take the results
 * of the operations a and b. A lookup takes that of a, and at b of the numbers are how many knots, degree and period, the knots, and the
 * rows of an origin and coefficients. */
enum {
    NCGEN_FORMULA_NUMBER, NCGEN_FORMULA_STATE, NCGEN_FORMULA_TIME, NCGEN_FORMULA_PARAMETER, NCGEN_FORMULA_ADD, NCGEN_FORMULA_SUBTRACT,
    NCGEN_FORMULA_MULTIPLY, NCGEN_FORMULA_DIVIDE, NCGEN_FORMULA_NEGATE, NCGEN_FORMULA_SQRT, NCGEN_FORMULA_SIN, NCGEN_FORMULA_COS,
    NCGEN_FORMULA_EXP, NCGEN_FORMULA_LOG, NCGEN_FORMULA_ATAN2, NCGEN_FORMULA_ABS, NCGEN_FORMULA_SIGN, NCGEN_FORMULA_LOOKUP
};

struct ncgen_formulas;
struct ncgen_basis;
struct ncgen_walk;

/* A step from t to t + h with the parameters p, on which a condition is bounded. rounding: distance from 1 to the next number */
typedef struct ncgen_formula_step {
    const struct ncgen_formulas *formulas;
    int degree;
    ncgen_scalar rounding, t, h;
    const ncgen_real *p;
} ncgen_formula_step;

/* ncgen_walk_formula of ncgen_formula.h, which says what it does. */
typedef int ncgen_formula_walker(const ncgen_formula_step *step, const struct ncgen_basis *basis, int k, ncgen_scalar size,
                                 struct ncgen_walk *walk, ncgen_scalar *reached, ncgen_scalar *unbounded, int *parts);

/* Conditions as formulas, which bound them between the nodes. */
typedef struct ncgen_formulas {
    ncgen_formula_walker *walk;
    const int *first;               /* of each condition its first operation, and the end of the last one's; what has none is sampled */
    const int *operations;          /* of each what it is, a and b, operations counted from the condition's first */
    const ncgen_scalar *numbers;
    int n_inputs;
    const int *inputs;              /* positions in q, or n_coordinates + position in qd */
    const ncgen_scalar *through;    /* (degree + 1)^2: from values at the nodes to coefficients in Chebyshev's basis */
    const ncgen_scalar *cosines;    /* 2 degree: cos(pi k / degree) */
    ncgen_real *values;             /* of each input the values at the nodes and coefficients, degree + 1 each: workspace */
    ncgen_real *workspace;          /* 16 for each operation of the longest of them */
    int *sampled;                   /* of each condition: 1 where it had no bounds somewhere, and was sampled there */
} ncgen_formulas;

/* Conditions, at the first of which a run stops: where a coordinate, a velocity or a function of (t, q, qd, p) passes a value. Within a
 * step they are polynomials in time through as many values as the basis has nodes: those of coordinates, velocities and time, and with
 * degree 14 products of two of them, are polynomials indeed, so that none of their crossings is missed; others are bounded by formulas. */
typedef struct ncgen_event {
    int count;
    const int *coordinates;       /* of each: position in q, or n_coordinates + position in qd; -1: the function's */
    const ncgen_scalar *values;   /* what it passes */
    const int *directions;        /* 1: rising, -1: falling, 0: both, 2: not asked for */
    const int *sampled;           /* NULL, or of each: 1 where it is sampled, as densely as it takes */
    int n_loads;                  /* so many, the last ones, are loads, which are sampled, too */
    int resumes;                  /* 1 where the run begins at an instant whose events have just been carried out */
    int *signs;                   /* -1 or 1: the side on which each is to begin, whatever rounding makes of its value; 0: that of the value */
    ncgen_velocity_kernel *function; /* NULL, or of each its value, and the size of the terms that it is a sum of */
    int degree;                   /* 14 at most */
    const ncgen_scalar *nodes;    /* degree + 1 shares of a step, the first 0, the last 1 */
    const ncgen_scalar *inverse;  /* (degree + 1)^2: from values there to coefficients in the basis of Bernstein */
    ncgen_real *samples;          /* (degree + 3) x 2 count: workspace */
    int *crossed;                 /* count: 1 where it is one of those that stopped the run */
    const ncgen_formulas *formulas; /* NULL, or of conditions that are no such polynomials */
} ncgen_event;

/* The inputs of a mechanism at time t, inside a step that began at the time `from`: a value that jumps at the start of a step is the
 * one after the jump, at its end the one before. Anything but NCGEN_OK refuses the step. */
typedef int ncgen_inputs(void *context, ncgen_scalar from, ncgen_scalar t, ncgen_real *values);

/* What drives a run; without it inputs keep the values that p has. The breaks are pairs: where a step ends before something that depends
 * on time alone changes its formula, and where the next one begins after it; both are the same where it does not jump. */
typedef struct ncgen_signals {
    ncgen_inputs *inputs;       /* NULL: they keep their values */
    void *context;
    int n_breaks;               /* even */
    const ncgen_scalar *breaks; /* ascending */
} ncgen_signals;

/* Inputs as polynomials of time: from knot k to the next one c[0] + c[1] s + c[2] s^2 + c[3] s^3 with s = t - knots[k] and
 * c = coefficients + 4 k; input i has the knots start[i] .. start[i + 1] - 1, ascending, and continues beyond the last one. */
typedef struct ncgen_piecewise {
    int count;
    const int *start;
    const ncgen_scalar *knots;
    const ncgen_scalar *coefficients;
    ncgen_inputs *others; /* NULL, or asked before for those without knots */
    void *context;        /* of others */
} ncgen_piecewise;

/* What a run returns besides: the progress function has ended it; it is stiff and options->stop_when_stiff is set; its steps became too
 * short, or too many; its tape is full; coordinate partitioning comes to a singular position. */
enum { NCGEN_INTERRUPTED = 6, NCGEN_STIFF = 7, NCGEN_STEP_TOO_SHORT = 8, NCGEN_TAPE_FULL = 9, NCGEN_SINGULAR_AHEAD = 10 };

/* Parameters that follow from the position (n_coordinates), set anew at the start and after every accepted step: in between they keep their
 * values. Anything but NCGEN_OK ends the run. */
typedef int ncgen_parameter_rule(const ncgen_real *q, ncgen_real *p);

/* Progress of a long run: called now and then with the time reached, on the caller's own thread. Returns how many steps
 * may be tried before the next call, 0 to end the run at the last accepted state. Every stage of a step and every iteration
 * in it counts as one, since a large mechanism takes long for each. */
typedef long ncgen_progress_function(void *context, ncgen_scalar t);

/* What a run by an emitted motion with an explicit method leaves behind for its derivatives (ncgen_differentiated.h): when its steps
 * began and ended, and for every step the states of its stages, q and qd, the last of them as the step left it; then q as it was closed,
 * before it was moved along the constraints. After the last step follows the state where it ended. */
typedef struct ncgen_tape {
    long capacity;       /* in steps */
    long steps;          /* how many there are */
    ncgen_scalar *times; /* room + 1 */
    ncgen_real *states;  /* (room x (2 stages of the method + 3) + 2) x n_coordinates */
    long first_other;    /* the first step, counted from 1, that went by the matrix, or whose stages were brought onto the constraints,
                          * too: there is no derivative of that; 0: none did */
} ncgen_tape;

/* What rows of a run say against it once it has come to its end, whose inputs keep the values that p has: how far the energy T + V - W
 * changes, and what velocities leave of phi_q qd = nu. */
typedef struct ncgen_inspection {
    int count;              /* rows, at least one */
    const int *rows;        /* ascending */
    int is_known;           /* 1: what follows is, and is finite */
    ncgen_scalar energy;    /* T + V - W in the first row */
    ncgen_scalar change;    /* the farthest that it is from there */
    ncgen_scalar kinetic;   /* the largest T */
    ncgen_scalar remainder; /* the largest of phi_q qd - nu, relative to row_sizes, where there are rolling conditions, or drivers move */
} ncgen_inspection;

typedef struct ncgen_options {
    int method;
    ncgen_scalar rtol;         /* with error control: error of a step, relative and absolute; both 0: there is none, as of methods with a */
    ncgen_scalar atol;         /* fixed step */
    const ncgen_scalar *sizes; /* what atol is multiplied by, one a velocity, position and the work that are integrated; NULL: 1 */
    ncgen_scalar span;         /* explicit methods with error control: a step of length h may have h / span of the tolerance; 0: all */
    ncgen_scalar max_step;     /* with error control: longest step, 0 for none; others: the step, negative for one from each time to the next */
    ncgen_scalar tolerance;    /* of the position problem, relative to row_sizes */
    ncgen_scalar max_growth;   /* coordinate partitioning: stop with NCGEN_PIVOT when the amplification has grown by this factor */
    long max_steps;            /* 0 for no limit */
    int formalism;
    int project;            /* 1: back onto the constraints after each step; of energy-momentum the velocities alone */
    ncgen_scalar penalty;   /* alpha of augmented Lagrangian and penalty, relative to the largest mass; of ali3p: times h^2 / 4 */
    ncgen_scalar damping;   /* xi and omega (1/s) of gamma - 2 xi omega Phid - omega^2 Phi; omega 0: none */
    ncgen_scalar frequency;
    const ncgen_event *event;             /* NULL: run to the end; else where it ends before */
    ncgen_scalar alpha_m;                 /* generalized-alpha: weights of the accelerations at the start of a step; for rho at infinity */
    ncgen_scalar alpha_f;                 /* they are (2 rho - 1) / (rho + 1) and rho / (rho + 1); for HHT 0 and its alpha */
    ncgen_progress_function *progress;    /* NULL: no progress is reported */
    void *context;                        /* of the progress function */
    long attempts_left;                   /* steps that are tried before the first call of the progress function, at least 1 */
    int stop_when_stiff;                  /* 1: dopri5 and dop853 end with NCGEN_STIFF where an implicit method would serve better */
    const ncgen_signals *signals;         /* NULL: inputs keep their values */
    ncgen_scalar first_step;              /* of explicit methods with error control; 0: they find one */
    ncgen_tape *tape;                     /* NULL: the run is not taped */
    const int *movable;                   /* NULL, or one a time: 1 where a row may have the state of the end of its step, if no other row needs an */
    ncgen_scalar *row_times;              /* interpolant there; times of the rows: filled in by the caller, changed where a row was moved */
    ncgen_parameter_rule *parameter_rule; /* NULL: parameters keep their values, inputs aside */
    ncgen_inspection *inspection;         /* NULL: nobody asks */
} ncgen_options;

typedef struct ncgen_statistics {
    long steps;
    long rejected;    /* steps repeated because of the error estimate */
    long repeated;    /* steps repeated because the position problem or a pivot failed */
    long evaluations;
    long newton_steps;
    ncgen_scalar t;   /* time reached */
    long factorisations; /* of [A Phi_q'; Phi_q -E] */
    long perturbed;   /* pivots without mass in them that were made larger */
    long refinements;
    int stopped;      /* 1: by the event, at t */
    ncgen_scalar largest_projection; /* how far a step's end was moved onto the constraints, in natural sizes */
    long jacobians;   /* of the state derivative, or of a step's equations */
    long fallbacks;   /* accelerations with row exchanges, since an emitted elimination divided by zero or a step was repeated */
    ncgen_scalar tried; /* time of the last stage or iteration: how far a step went that did not succeed */
    long stiff;       /* how often dopri5 or dop853 found that stability, not the error, holds the step down */
    ncgen_scalar next_step; /* what an explicit method with error control would try next; 0: it has not begun */
} ncgen_statistics;

/* end cdef */
/* begin functions */

/* Numbers of workspace that ncgen_simulate needs; besides, it needs 4 n_coordinates + 3 n_rows
 * integers, and 3 n_coordinates more with rolling conditions or an implicit method. */
size_t ncgen_workspace(const ncgen_model *model, const ncgen_dynamics *dynamics, const ncgen_options *options);

/* Simulate from times[0] to times[n_times - 1].
 *
 * q, velocities: consistent initial position; independent velocities with coordinate partitioning, all velocities else
 * out_q, out_qd: n_times + 1 rows of n_coordinates; out_work: work (J) of drivers and forces without a potential.
 *     The additional row is the state at statistics->t, from which a run that stops early can go on.
 * rows: how many rows of the grid have been written
 * returns NCGEN_OK, or why it stopped at statistics->t */
int ncgen_simulate(const ncgen_model *model, const ncgen_dynamics *dynamics, const ncgen_options *options,
                   const ncgen_real *p, const ncgen_real *q, const ncgen_real *velocities, int n_times,
                   const ncgen_scalar *times, ncgen_real *out_q, ncgen_real *out_qd, ncgen_real *out_work, int *rows,
                   ncgen_statistics *statistics, ncgen_real *workspace, int *integers);

/* How the accelerations change with velocities and positions: n_independent rows of 2 n_independent numbers with coordinate
 * partitioning, where velocities and positions are the independent ones, else n_coordinates rows of 2 n_coordinates. The
 * derivatives with respect to velocities come first in a row. Where more positions than velocities are independent, rows for
 * how these positions change follow: it is a square of both numbers together. Arguments are those of ncgen_simulate at one time. */
int ncgen_dynamics_jacobian(const ncgen_model *model, const ncgen_dynamics *dynamics, const ncgen_options *options,
                            ncgen_scalar t, const ncgen_real *p, const ncgen_real *q, const ncgen_real *velocities,
                            ncgen_real *jacobian, ncgen_real *workspace, int *integers);

/* The ncgen_inputs of an ncgen_piecewise, which is its context. */
int ncgen_piecewise_inputs(void *context, ncgen_scalar from, ncgen_scalar t, ncgen_real *values);

/* end functions */

#ifdef __cplusplus
}
#endif

#endif
