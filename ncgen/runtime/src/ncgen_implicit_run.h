/* ncgen_implicit_run.h: a run with a method that takes implicit steps. They are nearly half of the library to compile: one that is
 * compiled with NCGEN_EXPLICIT_ONLY defined goes without them, and refuses such methods. */
#ifndef NCGEN_IMPLICIT_RUN_H
#define NCGEN_IMPLICIT_RUN_H

#include "ncgen_grid.h"
#ifndef NCGEN_EXPLICIT_ONLY
#include "ncgen_implicit.h"
#include "ncgen_jacobian.h"
#include "ncgen_steppers.h"

typedef struct ncgen_implicit_workspace {
    ncgen_linearisation linearisation;
    ncgen_implicit implicit;
    ncgen_correction correction;
} ncgen_implicit_workspace;

/* The workspace of such a method, and what gives the Jacobian. Returns whether the method is one. */
int ncgen_implicit_run_layout(ncgen_run *r, ncgen_stepping *w, ncgen_implicit_workspace *workspace);
int ncgen_implicit_run(ncgen_run *r, ncgen_stepping *w, ncgen_implicit_workspace *workspace);
#else
typedef int ncgen_implicit_workspace;
#define ncgen_implicit_run_layout(r, w, workspace) (0)
#define ncgen_implicit_run(r, w, workspace) (NCGEN_ARGUMENT)
#endif

#endif
