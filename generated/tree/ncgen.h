/* ncgen.h: what every generated model looks like from outside.
 *
 * One mechanism in natural coordinates is one `const ncgen_model`, reached through the getter
 * `<name>_model()` of its own header. Kernels allocate nothing, keep no state, read their inputs and
 * write their output; they may be called from any number of threads.
 *
 * Define NCGEN_SINGLE, NCGEN_LONG_DOUBLE or NCGEN_QUAD (all files alike) to change the number type;
 * the default is double. Or define NCGEN_REAL and NCGEN_SCALAR yourself, together with the functions of
 * ncgen_math.h.
 */
#ifndef NCGEN_H
#define NCGEN_H

#include <stddef.h>

#if defined(NCGEN_REAL)
typedef NCGEN_REAL ncgen_real;
typedef NCGEN_SCALAR ncgen_scalar;
#elif defined(NCGEN_SINGLE)
typedef float ncgen_real;
typedef float ncgen_scalar;
#elif defined(NCGEN_LONG_DOUBLE)
typedef long double ncgen_real;
typedef long double ncgen_scalar;
#elif defined(NCGEN_QUAD)
typedef __float128 ncgen_real;
typedef __float128 ncgen_scalar;
#else
typedef double ncgen_real;
typedef double ncgen_scalar;
#endif

#ifdef __cplusplus
#define NCGEN_RESTRICT
extern "C" {
#else
#define NCGEN_RESTRICT restrict
#endif

/* A part of a long function, which stays one of its own: compilers would be slow on the whole. */
#if defined(__GNUC__)
#define NCGEN_NOINLINE __attribute__((noinline))
#else
#define NCGEN_NOINLINE
#endif

/* Before a loop, no run of which reads what another one has written: it is unrolled. */
#if defined(__GNUC__) && !defined(__clang__) && __GNUC__ >= 8
#define NCGEN_UNROLLED _Pragma("GCC unroll 4") _Pragma("GCC ivdep")
#else
#define NCGEN_UNROLLED
#endif

#define NCGEN_ABI_VERSION 1

/* begin cdef */

/* What kernels return; anything but NCGEN_OK leaves the output undefined. */
enum ncgen_status {
    NCGEN_OK = 0,
    NCGEN_NOT_CONVERGED = 1, /* an iteration used up its steps */
    NCGEN_SINGULAR = 2,      /* a matrix has no inverse */
    NCGEN_PIVOT = 3,         /* a factorisation with fixed pivots became inaccurate */
    NCGEN_DOMAIN = 4,        /* a function left its domain */
    NCGEN_ARGUMENT = 5       /* an argument is out of range */
};

/* Sparsity of a matrix in compressed rows: row r has the columns
 * indices[indptr[r]] .. indices[indptr[r + 1] - 1], in increasing order. */
typedef struct ncgen_pattern {
    int rows;
    int columns;
    const int *indptr;  /* rows + 1 */
    const int *indices; /* indptr[rows] */
} ncgen_pattern;

/* Kernels of time t (s), free coordinates q (m, rad), their velocities qd and parameters p. */
typedef int ncgen_position_kernel(ncgen_real t, const ncgen_real *q, const ncgen_real *p, ncgen_real *out);
typedef int ncgen_velocity_kernel(ncgen_real t, const ncgen_real *q, const ncgen_real *qd, const ncgen_real *p,
                                  ncgen_real *out);

/* A mechanism. Kernels that it does not need are NULL: without drivers nu is zero, without bodies
 * mass, force and energy are. New members are only ever added at the end. */
typedef struct ncgen_model {
    unsigned abi_version; /* NCGEN_ABI_VERSION of the generator */
    unsigned struct_size; /* sizeof(ncgen_model) there */
    unsigned real_size;   /* sizeof(ncgen_real) there */
    const char *name;
    const char *fingerprint; /* of the generated source */

    int n_coordinates;                     /* length of q and qd */
    int n_rows;                            /* constraint equations */
    int n_parameters;                      /* length of p */
    const char *const *coordinate_names;
    const char *const *row_names;
    const char *const *parameter_names;    /* NULL without parameters */
    const ncgen_scalar *initial_position;  /* q at the position in which the model was described */
    const ncgen_scalar *default_parameters; /* NULL without parameters */

    ncgen_pattern phi_q_pattern;
    ncgen_pattern mass_pattern;
    int mass_is_constant;

    ncgen_position_kernel *phi;    /* n_rows: constraint equations, zero when satisfied */
    ncgen_position_kernel *phi_q;  /* values of the Jacobian in phi_q_pattern */
    ncgen_position_kernel *nu;     /* n_rows: phi_q qd = nu */
    ncgen_velocity_kernel *gamma;  /* n_rows: phi_q qdd = gamma */
    ncgen_position_kernel *mass;   /* values of the mass matrix in mass_pattern */
    ncgen_velocity_kernel *force;  /* n_coordinates: applied and velocity-dependent forces */
    ncgen_velocity_kernel *energy; /* 3: kinetic and potential energy (J), power of other forces (W) */
    ncgen_velocity_kernel *constraints; /* phi, then the values of phi_q, then gamma: quicker than one by one */
    int n_inputs; /* the last of p: forces that change with time as the caller sets them */
    ncgen_velocity_kernel *power; /* 1: the power in energy, alone; NULL: ask energy */
} ncgen_model;

/* Kernels that take accelerations qdd, and multipliers lam of the rows, too. */
typedef int ncgen_motion_kernel(ncgen_real t, const ncgen_real *q, const ncgen_real *qd, const ncgen_real *qdd,
                                const ncgen_real *p, ncgen_real *out);
typedef int ncgen_balance_kernel(ncgen_real t, const ncgen_real *q, const ncgen_real *qd, const ncgen_real *qdd,
                                 const ncgen_real *lam, const ncgen_real *p, ncgen_real *out);

/* How the equations of motion change, for implicit methods and linearisation: with the balance of forces
 * b = M qdd + phi_q' lam - Q and the second derivative of the rows phidd = phi_q qdd - gamma. Kernels write the values of
 * their patterns; those of structural zeros are NULL. */
typedef struct ncgen_tangents {
    unsigned abi_version;
    unsigned struct_size; /* sizeof(ncgen_tangents) in the generator */
    ncgen_pattern stiffness_pattern;
    ncgen_pattern damping_pattern;
    ncgen_pattern phidd_q_pattern;
    ncgen_pattern phidd_qd_pattern;
    ncgen_balance_kernel *stiffness; /* db/dq */
    ncgen_velocity_kernel *damping;  /* db/dqd = -dQ/dqd */
    ncgen_motion_kernel *phidd_q;    /* dphidd/dq */
    ncgen_velocity_kernel *phidd_qd; /* dphidd/dqd = -dgamma/dqd */
} ncgen_tangents;

/* How they change with the parameters. */
typedef struct ncgen_parameter_tangents {
    unsigned abi_version;
    unsigned struct_size; /* sizeof(ncgen_parameter_tangents) in the generator */
    ncgen_pattern phi_p_pattern;
    ncgen_pattern phid_p_pattern;
    ncgen_pattern phidd_p_pattern;
    ncgen_pattern balance_p_pattern;
    ncgen_position_kernel *phi_p;    /* dphi/dp */
    ncgen_velocity_kernel *phid_p;   /* d(phi_q qd - nu)/dp */
    ncgen_motion_kernel *phidd_p;    /* dphidd/dp */
    ncgen_balance_kernel *balance_p; /* db/dp */
} ncgen_parameter_tangents;

/* end cdef */

#ifdef __cplusplus
}
#endif

#endif
