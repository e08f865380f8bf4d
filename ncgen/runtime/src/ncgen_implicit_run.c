/* ncgen_implicit_run.c: which implicit method a run takes. */
#include "ncgen_implicit_run.h"
#ifndef NCGEN_EXPLICIT_ONLY
#include "ncgen_method.h"

int ncgen_implicit_run_layout(ncgen_run *r, ncgen_stepping *w, ncgen_implicit_workspace *workspace)
{
    r->jacobian = r->partitioning ? ncgen_partitioning_jacobian : ncgen_constrained_jacobian;
    if (r->dynamics->tangents)
        ncgen_linearisation_layout(r, &workspace->linearisation);
    if (ncgen_is_implicit(r->options))
        ncgen_implicit_layout(r, w, &workspace->implicit);
    else if (ncgen_is_stepper(r->options))
        ncgen_steppers_layout(r, w, &workspace->correction);
    else
        return 0;
    return 1;
}

int ncgen_implicit_run(ncgen_run *r, ncgen_stepping *w, ncgen_implicit_workspace *workspace)
{
    if (ncgen_is_stepper(r->options))
        return ncgen_steppers(r, w, &workspace->correction);
    return r->options->method == NCGEN_RADAU ? ncgen_radau(r, w, &workspace->implicit) : ncgen_trapezoidal(r, w, &workspace->implicit);
}

#endif
