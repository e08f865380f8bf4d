/* ncgen_event_table.h: the events of a mechanism as a table, and what is known of them on the way of a motion. */
#ifndef NCGEN_EVENT_TABLE_H
#define NCGEN_EVENT_TABLE_H

#include "ncgen_driven.h"

/* What the functions of ncgen_events.h return besides: bounces accumulate at a gap that is to be held closed, which nobody does here; events bring about
 * each other without end; there are several impacts at one instant without a law; a gap is below zero at the start; an event has ended the
 * motion before; a lock cannot close, since drivers or other locks move it; no set of what may be held agrees with its loads. */
enum { NCGEN_AT_REST = 16, NCGEN_ENDLESS, NCGEN_NO_ORDER, NCGEN_OVERLAP, NCGEN_STOPPED, NCGEN_MOVED, NCGEN_NO_MODE };

/* As much workspace as the functions of ncgen_events.h need for `count` conditions, at most `most` velocities that one event sets, or count if
 * that is more, n coordinates and the numbers of `values`. */
#define NCGEN_EVENTS_WORKSPACE(count, most, n, values) ((count) * (2 * (n) + (count) + 11) + (most) * ((n) + 1) + 2 * (n) + (values))

/* What an event does: p[place] or qd[place] becomes the value; an impact along the gradient of the condition, whose restitution is the
 * value, place being 1 where the motion ends at a gap in which bounces accumulate; the end of the motion; the lock `place` of the holds
 * closes or opens. */
enum { NCGEN_SET, NCGEN_SET_VELOCITY, NCGEN_IMPACT, NCGEN_STOP, NCGEN_LOCK, NCGEN_FREE };

/* Laws of several impacts at one instant; without one they are refused. */
enum { NCGEN_NO_LAW, NCGEN_SIMULTANEOUS, NCGEN_IN_TURN };

typedef struct ncgen_action {
    int event, kind, place, value; /* event: -1 for what is done where a motion begins; value: its number among those of `values` */
} ncgen_action;

/* What may be held: a gap that is closed, as long as it is pushed; a joint that does not slip, as long as static friction is enough; a
 * ratchet that is at rest, as long as it is pushed back; a lock, until it is freed. */
enum { NCGEN_HOLDS_GAP, NCGEN_HOLDS_JOINT, NCGEN_HOLDS_RATCHET, NCGEN_HOLDS_LOCK };

typedef struct ncgen_hold {
    int kind;
    int condition; /* the number of its condition, which is its gap or its velocity; -1 of a lock */
    int on;        /* p[on] is 1 while it is held, and 0 otherwise */
    int held;      /* p[held] is where it is held, and the number `value` of values where it is; -1 of a gap */
    int value;
    int slip;      /* p[slip] is the direction in which a joint slips, 0 where it sticks; -1 of others */
    int load;      /* the number of the first condition of its load: one of a gap and of a ratchet, two of a joint, none of a lock */
} ncgen_hold;

typedef struct ncgen_events {
    int count, most, n_actions, law; /* count: of all conditions; most: as above */
    int n_events;                 /* so many conditions are those of events; behind them stand velocities of joints and of ratchets */
    const int *directions;        /* of each: 1 rising, -1 falling, 0 either */
    const ncgen_action *actions;  /* in the order of the events, all velocities that one sets together */
    ncgen_velocity_kernel *conditions; /* of each its value, and the size of the terms that it is a sum of */
    ncgen_velocity_kernel *slopes;     /* of each its derivatives by q, qd (n_coordinates each) and t */
    ncgen_forced_kernel *rates;        /* of q, qd, qdd, p: all first derivatives along the motion, then all second ones */
    ncgen_velocity_kernel *values;     /* what actions set, and where things are; NULL: nothing */
    ncgen_scalar noise;           /* what is smaller than this share of a condition's terms has no sign */
    int n_holds, n_loads;         /* no holds: the motion ends with NCGEN_AT_REST where bounces accumulate */
    const ncgen_hold *holds;
    const ncgen_model *held_model;       /* the mechanism with all that may be held as its last rows, each times p[on] */
    const ncgen_dynamics *held_dynamics;
    ncgen_velocity_kernel *held_conditions; /* conditions, and behind them those of loads, which are positive as long as they hold */
} ncgen_events;

/* What is known of the events besides the state. */
typedef struct ncgen_passage {
    int *signs;    /* of each condition: the side on which it is, 0 for that of its value; then of loads */
    int *happened; /* how often each has happened */
    int *due;      /* 1 for those that are to happen at this instant, 0 afterwards; 4 count numbers, of which these are the first */
    int *stopped;  /* 1: an event has ended the motion */
    ncgen_real *workspace;
    int *directions;  /* with holds: as many numbers as signs */
    int *flags;       /* with holds: 3 n_holds numbers: what is held, what is wanted, and to which side what was released begins to move */
    ncgen_real *room; /* with holds: 2 n_coordinates and twice as many numbers as signs */
} ncgen_passage;

#endif
