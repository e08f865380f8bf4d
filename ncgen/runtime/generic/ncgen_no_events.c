/* ncgen_no_events.c: what ncgen_linked.c calls of events, for mechanisms without any: it is never reached, and takes no room. */
#include "ncgen_events.h"
#include "ncgen_held.h"

void ncgen_enter_held(const ncgen_driven *d, const ncgen_events *events, const ncgen_real *p, const ncgen_passage *passage, ncgen_entered *in)
{
    (void)events;
    (void)p;
    (void)passage;
    in->driven = *d;
}

int ncgen_begin_events(const ncgen_driven *d, const ncgen_events *events, ncgen_real *p, ncgen_moment *moment, ncgen_passage *passage)
{
    (void)d;
    (void)events;
    (void)p;
    (void)moment;
    (void)passage;
    return NCGEN_ARGUMENT;
}

int ncgen_advance_through_events(const ncgen_driven *d, const struct ncgen_breaks *breaks, const ncgen_events *events, ncgen_real *p,
    ncgen_moment *moment, ncgen_scalar t_end, int one, ncgen_passage *passage, ncgen_statistics *statistics)
{
    (void)breaks;
    (void)t_end;
    (void)one;
    (void)statistics;
    return ncgen_begin_events(d, events, p, moment, passage);
}
