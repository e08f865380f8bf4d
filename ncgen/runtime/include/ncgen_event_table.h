/* ncgen_event_table.h: the events of a mechanism as a table, and what is known of them on the way of a motion. */
#ifndef NCGEN_EVENT_TABLE_H
#define NCGEN_EVENT_TABLE_H

#include "ncgen_driven.h"

/* As much workspace as the functions of ncgen_events.h need for `count` conditions, at most `most` velocities that one event sets, or count if that is
 * more, n coordinates, and the numbers that actions set with those of `sliding`. */
#define NCGEN_EVENTS_WORKSPACE(count, most, n, values) \
    (NCGEN_GAPS + (count) * (2 * (n) + (count) + 13) + (most) * ((n) + 1) + 4 * (n) + (values) + NCGEN_IMPACT_WORKSPACE(count))

/* The same for integers. */
#define NCGEN_EVENTS_INTEGERS(count) (9 * (count))

/* The same for what may be held. */
#define NCGEN_HELD_INTEGERS(n_holds) (10 * (n_holds))

/* So many parts of a motion, one after the other, may begin and end at one time. */
enum { NCGEN_MOST_REPEATED = 100 };

/* Numbers of workspace of an impact of gaps that have so many velocities. */
#define NCGEN_IMPACT_WORKSPACE(rows) (NCGEN_GAPS + 3 * (rows) * (rows) + 16 * (rows))

/* begin cdef */

/* What the functions of ncgen_events.h return besides: bounces accumulate at a gap that is to be held closed, which nobody does here; events bring about
 * each other without end; there are several impacts at one instant without a law; a gap is below zero at the start; an event has ended the
 * motion before; no impulses obey the laws of impact and friction; an impact would give energy; a log is full;
 * no set of what may be held agrees with its loads; a lock cannot close, since drivers or other locks move it;
 * the load that friction follows is not determined. */
enum { NCGEN_AT_REST = 16, NCGEN_ENDLESS, NCGEN_NO_ORDER, NCGEN_OVERLAP, NCGEN_STOPPED, NCGEN_NO_IMPULSES, NCGEN_GAIN, NCGEN_LOG_FULL,
       NCGEN_NO_MODE, NCGEN_MOVED, NCGEN_UNDETERMINED };

/* Laws of several impacts at one instant; without one they are refused. */
enum { NCGEN_NO_LAW, NCGEN_SIMULTANEOUS, NCGEN_IN_TURN };

/* What may be held: a gap that is closed, as long as it is pushed; a joint that does not slip, as long as static friction is enough; a ratchet
 * that is at rest, as long as it is pushed back; a lock, until it is freed; a gap of surfaces with friction; a contact that sticks, as long as
 * its gap is held and friction is enough. Joints have two conditions of their load, locks none, others one. */
enum { NCGEN_HOLDS_GAP, NCGEN_HOLDS_JOINT, NCGEN_HOLDS_RATCHET, NCGEN_HOLDS_LOCK, NCGEN_HOLDS_RUBBING_GAP, NCGEN_HOLDS_CONTACT };

/* The direction of a condition that is not watched. */
enum { NCGEN_UNWATCHED = 2 };

/* What a note says: an event happened, a gap or joint is held from now on, or is no longer, a joint slips to the other side. */
enum { NCGEN_HAPPENS, NCGEN_RESTS, NCGEN_LEAVES, NCGEN_TURNS };

/* end cdef */
/* begin table */

/* What an event does: p[place] or qd[place] becomes the value; an impact along the gradient of the condition, whose restitution is the
 * value, place being 1 where the motion ends at a gap in which bounces accumulate; the end of the motion; the lock
 * `place` of the holds closes or opens. */
enum { NCGEN_SET, NCGEN_SET_VELOCITY, NCGEN_IMPACT, NCGEN_STOP, NCGEN_LOCK, NCGEN_FREE };

typedef struct ncgen_action {
    int event, kind, place, value; /* event: -1 for what is done where a motion begins; value: its number among those of `values` */
} ncgen_action;

/* A set of gaps that are held closed: a mechanism with their conditions as more constraints, as long as these push. */
typedef struct ncgen_mode {
    int count;
    const int *held;                   /* the events whose gaps they are, ascending */
    const ncgen_model *model;          /* coordinates and parameters are those of the mechanism itself */
    const ncgen_dynamics *dynamics;
    ncgen_velocity_kernel *conditions; /* those of the mechanism, and behind them of each its load, and what that is compared with */
} ncgen_mode;

/* What may be held in one mechanism with switches, which takes the place of modes. */
typedef struct ncgen_hold {
    int kind;
    int condition; /* the number of its condition, which is its gap or its velocity; -1 of a lock */
    int on;        /* p[on] is 1 while it is held, and 0 otherwise */
    int held;      /* p[held] is where it is held, and the number `value` of values where it is; -1 of a gap */
    int value;
    int slip;      /* p[slip] is the direction in which a joint slips, 0 where it sticks; -1 of others */
    int load;      /* the number of the first condition of its load: one of a gap and of a ratchet, two of a joint, none of a lock; of a contact
                    * that sticks one, behind which its force along each direction stands, which is not watched */
} ncgen_hold;

/* A contact with friction. */
typedef struct ncgen_rubbing {
    int event;      /* whose gap it is */
    int condition;  /* the number of the condition that is its velocity along p[slip], */
    int turn;       /* and of the one that is positive as long as this direction has turned by less than 45 degrees; -1 in the plane */
    int directions; /* in which it slides: 1 in the plane, 2 in space */
    int first;      /* the number of its first velocity among those of `sliding` */
    int slip[2];    /* p[slip[k]]: the direction in which it slides, 0 where it sticks or is open; in space it is as long as the
                     * largest velocity of the present slide is known to be */
    int value;      /* the number of its friction among those of `values`; the next one is its tangential restitution */
    int poisson;    /* 1: law of Poisson */
    int gap, stick; /* numbers of holds: of its gap, and of the contact that sticks; -1 where a motion ends at rest */
} ncgen_rubbing;

typedef struct ncgen_events {
    int count, most, n_actions, law; /* most: as above */
    const int *directions;        /* of each: 1 rising, -1 falling, 0 either */
    const ncgen_action *actions;  /* in the order of the events, all velocities that one sets together */
    ncgen_velocity_kernel *conditions; /* of each its value, and the size of the terms that it is a sum of */
    ncgen_velocity_kernel *derivatives; /* of each its derivatives by q, qd (n_coordinates each) and t */
    ncgen_forced_kernel *rates;        /* of q, qd, qdd, p: all first derivatives along the motion, then all second ones */
    ncgen_velocity_kernel *values;     /* what actions set; NULL: nothing */
    ncgen_scalar noise;           /* what is smaller than this share of a condition's terms has no sign */
    int n_modes;                  /* 0: no gap is held closed, and the motion ends with NCGEN_AT_REST where bounces accumulate */
    const ncgen_mode *modes;      /* from number 1 on */
    int n_velocities;             /* so many conditions, the last ones, are velocities of joints, contacts and ratchets, no events */
    int n_holds, n_loads;         /* instead of modes */
    int follows_loads;            /* 1: friction of joints follows loads; the mechanism with switches then moves even where nothing is held */
    int rubs;                     /* 1: friction of joints or contacts follows loads; the last condition of loads is positive as long as these are
                                   * determined */
    int n_rubbings, n_sliding;    /* contacts with friction, and how many velocities they have */
    const ncgen_rubbing *rubbings;
    ncgen_velocity_kernel *sliding; /* velocities at which contacts slide, and then of each its derivatives by qd (n_coordinates) */
    const ncgen_hold *holds;
    const ncgen_model *held_model;       /* the mechanism with all that may be held as its last rows, each times p[on] */
    const ncgen_dynamics *held_dynamics;
    ncgen_velocity_kernel *held_conditions; /* conditions, and behind them those of loads, which are positive as long as they hold */
} ncgen_events;

/* How what a note says was detected: by a condition that was watched, at the start, since another event of the instant brought it about, or by a
 * load. */
enum { NCGEN_WATCHED, NCGEN_AT_START, NCGEN_FOLLOWS, NCGEN_BY_LOAD };

/* What happened, in the order of time. */
typedef struct ncgen_log {
    int count, room;  /* notes, of which no more than the room are there */
    int owner;        /* number of the motion */
    int first, cause; /* of the present instant its first note, and how it was detected */
    int follows;      /* 1: what happens follows from what has happened at this instant */
    int *due;         /* of each condition: 1 where the present instant began with it; and 1 for each of the holds, which a note names by the
                       * number behind those of conditions, where a lock is closed from the start on */
    int *sampled;     /* NULL, or of each event: 1 where its condition had no bounds somewhere, which a note says as for a load */
    ncgen_real *rows; /* of each note: owner, event, what, how it was detected, t, impulse, energy that it took, time until bounces that
                       * accumulate have ended or -1; q, qd before and after (n_coordinates each) */
} ncgen_log;

/* What is known of the events besides the state. */
typedef struct ncgen_passage {
    int *signs;    /* of each: the side on which it is, 0 for that of its value; with modes as many more as the largest holds gaps */
    int *happened; /* how often each has happened */
    int *due;      /* 1 for those that are to happen at this instant, 0 afterwards; NCGEN_EVENTS_INTEGERS(count) numbers, of which these are the first */
    int *stopped;  /* 1: an event has ended the motion */
    ncgen_real *workspace;
    int *mode;        /* with modes: the number of the present one, 0 where no gap is held */
    int *directions;  /* with modes or holds: as many numbers as signs */
    int *wanted;      /* with modes: 2 count numbers */
    ncgen_real *room; /* with modes or holds: 2 n_coordinates and twice as many numbers as signs */
    int *flags;       /* with holds: NCGEN_HELD_INTEGERS(n_holds) numbers: what was held, what is wanted, to which side what was released begins
                       * to move, what impacts leave sticking, and room */
    ncgen_real *ways; /* with rubbings: 4 n_holds numbers: forces of contacts that stick, along which they would begin to slide, and slip before */
    ncgen_log *log;   /* NULL: nobody wants to know what happens */
} ncgen_passage;

/* end table */

#endif
