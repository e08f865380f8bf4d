/* ncgen_event_runs.h: motions with events over a grid of times, one after the other: rows, and notes of what happened.
 *
 * A motion is what a single run makes of it: parts from event to event, each by ncgen_simulate with the step that the part before tried next.
 */
#ifndef NCGEN_EVENT_RUNS_H
#define NCGEN_EVENT_RUNS_H

#include "ncgen_event_table.h"

/* begin cdef */

typedef struct ncgen_event_runs {
    ncgen_driven driven;        /* workspace for ncgen_simulate and the functions of ncgen_driven.h, in all modes; 7 n_coordinates + 3 rows
                                 * integers */
    const ncgen_events *events;
    ncgen_passage passage;      /* with a log */
    int n_times;
    const ncgen_scalar *times;  /* s, ascending */
    long at, count;             /* number of the present motion, and where to end */
    const ncgen_real *q, *qd, *p; /* of each motion where it begins, and its parameters */
    ncgen_real *out_q, *out_qd, *out_work; /* of each motion n_times rows; those behind its end stay as they are */
    ncgen_signals *signals;     /* NULL, or those of the options, which each motion has with its own breaks: */
    const int *first_break;     /* the number of its first one, and behind the last motion how many there are */
    const ncgen_scalar *breaks; /* of all motions (s) */
    int *rows;                  /* of each: how many there are */
    long *steps;
    ncgen_scalar *ended;        /* of each: the time that it reached (s) */
    ncgen_moment moment;        /* the present motion: its arrays and parameters, */
    ncgen_real *own_p;
    int begun, row;             /* whether it has begun, and how many rows of the grid it has */
    ncgen_scalar *part_times;   /* room for a part: n_times + 1, and n_times + 2 rows */
    ncgen_real *part_q, *part_qd, *part_work;
    ncgen_real *kept;           /* room to go back: 3 n_coordinates and parameters */
    int *kept_integers;         /* as many as signs, and events */
} ncgen_event_runs;

/* end cdef */
/* begin functions */

/* NCGEN_EVENTS_WORKSPACE, NCGEN_EVENTS_INTEGERS and NCGEN_HELD_INTEGERS. */
size_t ncgen_events_workspace(int count, int most, int n, int values);
int ncgen_events_integers(int count);
int ncgen_held_integers(int holds);

/* On to motion `count`, or to the first one that cannot go on; where that is NCGEN_AT_REST since no mode holds the gaps that passage.wanted
 * names, or NCGEN_LOG_FULL, the same call continues once there is one, or the log is empty. */
int ncgen_go_on_with_runs(ncgen_event_runs *runs);

/* end functions */

#endif
