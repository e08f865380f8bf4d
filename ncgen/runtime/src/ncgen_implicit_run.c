/* ncgen_implicit_run.c: which implicit method a run takes. */
#include "ncgen_implicit_run.h"
#ifndef NCGEN_EXPLICIT_ONLY
#include "ncgen_method.h"

int ncgen_implicit_run_layout(ncgen_run *r, ncgen_stepping *w, ncgen_implicit_parts *parts)
{
    r->jacobian = r->partitioning ? ncgen_partitioning_jacobian : ncgen_constrained_jacobian;
    if (r->dynamics->tangents)
        ncgen_slopes_layout(r, &parts->slopes);
    if (ncgen_is_implicit(r->options))
        ncgen_implicit_layout(r, w, &parts->implicit);
    else if (ncgen_is_stepper(r->options))
        ncgen_steppers_layout(r, w, &parts->correction);
    else
        return 0;
    return 1;
}

int ncgen_implicit_run(ncgen_run *r, ncgen_stepping *w, ncgen_implicit_parts *parts)
{
    if (ncgen_is_stepper(r->options))
        return ncgen_steppers(r, w, &parts->correction);
    return r->options->method == NCGEN_RADAU ? ncgen_radau(r, w, &parts->implicit) : ncgen_trapezoidal(r, w, &parts->implicit);
}

#endif
