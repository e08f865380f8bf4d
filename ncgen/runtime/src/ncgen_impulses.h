/* ncgen_impulses.h: laws of impact of several contacts at one instant.
 *
 * Velocities of gaps, and those at which contacts slide, change by G times the impulses along them. With the law of Newton
 * 0 <= L, u_after + e u_before >= 0, one of both zero, for the impulse L along a gap; that across it is in the disc of radius mu L: inside
 * w_after + e_t w_before = 0, at its edge it is against that (Moreau 1988; Glocker 2001). With that of Poisson this holds for e = e_t = 0
 * first, at the end of the compression; then the same with L >= e times L of the compression.
 */
#ifndef NCGEN_IMPULSES_H
#define NCGEN_IMPULSES_H

#include "ncgen_event_table.h"

/* begin cdef */

enum { NCGEN_MOST_TURNS = 10000 };

typedef struct ncgen_impact {
    int count, rows, law;
    const int *places;           /* count x 3: the velocity of its gap, behind which stand those of its 0, 1 or 2 directions of sliding; how
                                  * many these are; 1: law of Poisson */
    const ncgen_scalar *coefficients; /* count x 3: restitution, friction, tangential restitution */
    const ncgen_real *G;         /* rows x rows */
    const ncgen_real *terms;     /* rows: what velocities are sums of, before */
    ncgen_scalar energy;         /* kinetic, before (J) */
    ncgen_real *velocities;      /* rows: before, and then after */
    ncgen_real *impulses;        /* rows */
    ncgen_real *lost;            /* count: the energy that each takes (J) */
    int *sticks;                 /* count: whether friction holds it */
    int closes;                  /* whether some gap did */
    int which;                   /* the contact that a status is about */
    int n_turns;                 /* in turn: how many impacts there were */
    int *turns;                  /* NULL, or NCGEN_MOST_TURNS: the contact of each, */
    ncgen_real *pushes;          /* and three times as many: its impulses */
    ncgen_real *workspace;
} ncgen_impact;

/* end cdef */
/* begin functions */

size_t ncgen_impact_workspace(int rows);

/* Does an impulse of one contact change a velocity of another one? Else laws do not differ. It reads the members up to G. */
int ncgen_are_coupled(const ncgen_impact *impact);

/* The impact of contacts whose gaps are closed; nothing happens unless one closes. NCGEN_SINGULAR: no impulse changes a gap;
 * NCGEN_NO_ORDER: laws differ, and the order is not given; NCGEN_NO_IMPULSES: none obey the laws; NCGEN_GAIN: they would give energy;
 * NCGEN_ENDLESS: impacts in turn do not end. */
int ncgen_impact_of_gaps(ncgen_impact *impact);

/* end functions */

#endif
