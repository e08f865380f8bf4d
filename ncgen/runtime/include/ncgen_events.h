/* ncgen_events.h: a motion that goes on from call to call through the events of a mechanism.
 *
 * Conditions are watched by ncgen_go_on, whose options name them; what happens at an instant is a table of actions.
 */
#ifndef NCGEN_EVENTS_H
#define NCGEN_EVENTS_H

#include "ncgen_driven.h"

#ifdef __cplusplus
extern "C" {
#endif

/* As much workspace as the functions below need for `count` events, at most `most` velocities that one of them sets, or count if that is
 * more, n coordinates and the numbers that actions set. */
#define NCGEN_EVENTS_WORKSPACE(count, most, n, values) ((count) * (2 * (n) + (count) + 11) + (most) * ((n) + 1) + (n) + (values))

/* What an event does: p[place] or qd[place] becomes the value; an impact along the gradient of the condition, whose restitution is the
 * value, place being 1 where the motion ends at a gap in which bounces accumulate; the end of the motion. */
enum { NCGEN_SET, NCGEN_SET_VELOCITY, NCGEN_IMPACT, NCGEN_STOP };

/* Laws of several impacts at one instant; without one they are refused. */
enum { NCGEN_NO_LAW, NCGEN_SIMULTANEOUS, NCGEN_IN_TURN };

/* What these functions return besides: bounces accumulate at a gap that is to be held closed, which nobody does here; events bring about
 * each other without end; there are several impacts at one instant without a law; a gap is below zero at the start; an event has ended the
 * motion before. */
enum { NCGEN_AT_REST = 16, NCGEN_ENDLESS, NCGEN_NO_ORDER, NCGEN_OVERLAP, NCGEN_STOPPED };

struct ncgen_breaks;

typedef struct ncgen_action {
    int event, kind, place, value; /* value: its number among those of `values` */
} ncgen_action;

/* A set of gaps that are held closed: a mechanism with their conditions as more constraints, as long as these push. */
typedef struct ncgen_mode {
    int count;
    const int *held;                   /* the events whose gaps they are, ascending */
    const ncgen_model *model;          /* coordinates and parameters are those of the mechanism itself */
    const ncgen_dynamics *dynamics;
    ncgen_velocity_kernel *conditions; /* those of the mechanism, and behind them of each its load, and what that is compared with */
} ncgen_mode;

typedef struct ncgen_events {
    int count, most, n_actions, law; /* most: as above */
    const int *directions;        /* of each: 1 rising, -1 falling, 0 either */
    const ncgen_action *actions;  /* in the order of the events, all velocities that one sets together */
    ncgen_velocity_kernel *conditions; /* of each its value, and the size of the terms that it is a sum of */
    ncgen_velocity_kernel *slopes;     /* of each its derivatives by q, qd (n_coordinates each) and t */
    ncgen_forced_kernel *rates;        /* of q, qd, qdd, p: all first derivatives along the motion, then all second ones */
    ncgen_velocity_kernel *values;     /* what actions set; NULL: nothing */
    ncgen_scalar noise;           /* what is smaller than this share of a condition's terms has no sign */
    int n_modes;                  /* 0: no gap is held closed, and the motion ends with NCGEN_AT_REST where bounces accumulate */
    const ncgen_mode *modes;      /* from number 1 on */
} ncgen_events;

/* What is known of the events besides the state. */
typedef struct ncgen_passage {
    int *signs;    /* of each: the side on which it is, 0 for that of its value; with modes as many more as the largest holds gaps */
    int *happened; /* how often each has happened */
    int *due;      /* 1 for those that are to happen at this instant, 0 afterwards; 4 count numbers, of which these are the first */
    int *stopped;  /* 1: an event has ended the motion */
    ncgen_real *workspace;
    int *mode;        /* with modes: the number of the present one, 0 where no gap is held */
    int *directions;  /* with modes: as many numbers as signs */
    int *wanted;      /* with modes: 2 count numbers */
    ncgen_real *room; /* with modes: 2 n_coordinates and twice as many numbers as signs */
} ncgen_passage;

/* Events at the start: conditions that are zero there and move on in their direction, p (n_parameters) and the moment being changed as
 * they say. All statuses of these functions leave the caller to go back to what was. */
int ncgen_begin_events(const ncgen_driven *d, const ncgen_events *events, ncgen_real *p, ncgen_moment *moment, ncgen_passage *passage);

/* What is due, and what that brings about at the same instant. */
int ncgen_happen(const ncgen_driven *d, const ncgen_events *events, ncgen_real *p, ncgen_moment *moment, ncgen_passage *passage);

/* Mark as due what has come to the other side of zero in its direction, as where p or, for integrators outside, the state was changed.
 * nearly: whether what is not clear of zero counts, too. A gap that is held and no longer pushes is due as well. Returns how many are
 * due, or a negative status. */
int ncgen_look_for_events(const ncgen_driven *d, const ncgen_events *events, const ncgen_real *p, const ncgen_moment *moment, int nearly,
    ncgen_passage *passage);

/* ncgen_go_on through events, whose conditions options->event watches with the passage's signs, to t_end, past the first instant of events
 * before it where `one` is set, or to the event that ends the motion. breaks: NULL, or where laws of time change their formula. */
int ncgen_go_through_events(const ncgen_driven *d, const struct ncgen_breaks *breaks, const ncgen_events *events, ncgen_real *p,
    ncgen_moment *moment, ncgen_scalar t_end, int one, ncgen_passage *passage, ncgen_statistics *statistics);

#ifdef __cplusplus
}
#endif

#endif
