/* ncgen_breaks.h: a motion from call to call in parts, at whose ends laws of time change their formula. */
#ifndef NCGEN_BREAKS_H
#define NCGEN_BREAKS_H

#include "ncgen_driven.h"

#ifdef __cplusplus
extern "C" {
#endif

/* The switches of a mechanism's laws of time. Of each of `lines` ones it writes four numbers b, n, a, x: where a is not 0, the formula
 * changed last at b / a and changes next at n / a, known to the rounding of x / a. Of each of `curves` ones it writes the number of the
 * piece that it is in, which is looked at every `interval` seconds. */
typedef struct ncgen_breaks {
    int (*switches)(ncgen_real t, const ncgen_real *p, ncgen_real *out);
    int lines, curves;
    ncgen_scalar interval;
    int jumps;             /* 1: velocities of drivers may jump at a break */
    ncgen_real *workspace; /* 2 (4 lines + curves) numbers of workspace */
} ncgen_breaks;

/* The next break after t, or t_end. */
ncgen_scalar ncgen_break_after(const ncgen_breaks *b, const ncgen_real *p, ncgen_scalar t, ncgen_scalar t_end);

/* t, or where that is at a break the time next to it at which laws have their formulas of before or, where `behind` is set, of after. */
ncgen_scalar ncgen_time_next_to_break(const ncgen_breaks *b, const ncgen_real *p, ncgen_scalar t, int behind);

/* ncgen_advance in parts: each ends before a law of time changes its formula, and the next one begins behind that. Where it fails the moment
 * is the one that the last part began with. It ends where ncgen_advance ends before. */
int ncgen_advance_over_breaks(const ncgen_driven *d, const ncgen_breaks *b, const ncgen_real *p, ncgen_moment *moment, ncgen_scalar t_end,
                         ncgen_statistics *statistics);

#ifdef __cplusplus
}
#endif

#endif
