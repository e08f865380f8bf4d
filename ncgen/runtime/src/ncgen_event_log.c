/* ncgen_event_log.c: what happens at events, a row of numbers each. */
#include "ncgen_event_log.h"
#include "ncgen_vectors.h"

enum { OWNER, EVENT, WHAT, CAUSE, TIME, IMPULSE, LOST, LIMIT, STATE };

void ncgen_begin_notes(ncgen_log *log, int count, const int *due)
{
    if (!log)
        return;
    log->first = log->count;
    log->follows = 0;
    for (int k = 0; k < count; ++k)
        log->due[k] = due[k];
}

void ncgen_notes_follow(ncgen_log *log, int follows)
{
    if (log)
        log->follows = follows;
}

void ncgen_note(ncgen_log *log, int n, const ncgen_moment *moment, int event, int what, const ncgen_real *before, ncgen_real impulse,
    ncgen_real lost)
{
    if (!log || log->count++ >= log->room)
        return;
    ncgen_real *row = log->rows + (size_t)(log->count - 1) * (size_t)NCGEN_NOTE(n);
    row[OWNER] = (ncgen_real)log->owner;
    row[EVENT] = (ncgen_real)event;
    row[WHAT] = (ncgen_real)what;
    const int by_another = what == NCGEN_LEAVES ? NCGEN_BY_LOAD : NCGEN_FOLLOWS;
    row[CAUSE] = (ncgen_real)(log->due[event] && !log->follows ? log->cause : by_another);
    if (log->due[event] && !log->follows && log->cause == NCGEN_WATCHED && log->sampled && log->sampled[event])
        row[CAUSE] = NCGEN_BY_LOAD;
    row[TIME] = moment->t;
    row[IMPULSE] = impulse;
    row[LOST] = lost;
    row[LIMIT] = -1;
    ncgen_copy(n, moment->q, row + STATE);
    ncgen_copy(n, before, row + STATE + n);
    ncgen_copy(n, moment->qd, row + STATE + 2 * n);
}

void ncgen_note_limit(ncgen_log *log, int n, int event, ncgen_real time)
{
    for (int k = log ? log->first : 0; log && k < log->count && k < log->room; ++k) {
        ncgen_real *row = log->rows + (size_t)k * (size_t)NCGEN_NOTE(n);
        if ((int)row[EVENT] == event)
            row[LIMIT] = time;
    }
}
