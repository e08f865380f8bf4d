/* ncgen_space.c: see ncgen_space.h. */
#include "ncgen_space.h"

#if NCGEN_GAP
#include <sanitizer/asan_interface.h>

/* A part that is dealt may be read and written, though another one may have ended there before; the gap behind it may not. */
static void fence(ncgen_real *part, int count)
{
    ASAN_UNPOISON_MEMORY_REGION(part, (size_t)count * sizeof *part);
    ASAN_POISON_MEMORY_REGION(part + count, NCGEN_GAP * sizeof *part);
}
#endif

ncgen_real *ncgen_take(ncgen_space *space, int count)
{
    ncgen_real *part = space->base ? space->base + space->used : NULL;
    space->used += (size_t)count + NCGEN_GAP;
#if NCGEN_GAP
    if (part)
        fence(part, count);
#endif
    return part;
}

void ncgen_copy(int count, const ncgen_real *NCGEN_RESTRICT from, ncgen_real *NCGEN_RESTRICT to)
{
    for (int i = 0; i < count; ++i)
        to[i] = from[i];
}
