/* ncgen_event_log.h: notes of what happens at events. */
#ifndef NCGEN_EVENT_LOG_H
#define NCGEN_EVENT_LOG_H

#include "ncgen_event_table.h"

/* Numbers of a note, for n coordinates. */
#define NCGEN_NOTE(n) (8 + 3 * (n))

/* An instant begins with the events that are due (count). */
void ncgen_begin_notes(ncgen_log *log, int count, const int *due);

/* From here on events follow from others of the instant, or no longer. */
void ncgen_notes_follow(ncgen_log *log, int follows);

/* What happened to an event, or to the gap that it closes; before (n): velocities. A log that is NULL takes none. */
void ncgen_note(ncgen_log *log, int n, const ncgen_moment *moment, int event, int what, const ncgen_real *before, ncgen_real impulse,
    ncgen_real lost);

/* The bounces of an event end in so much time: add it to its notes of this instant. */
void ncgen_note_limit(ncgen_log *log, int n, int event, ncgen_real time);

#endif
