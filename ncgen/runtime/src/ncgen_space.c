/* ncgen_space.c: see ncgen_space.h. */
#include "ncgen_space.h"

ncgen_real *ncgen_take(ncgen_space *space, int count)
{
    ncgen_real *part = space->base ? space->base + space->used : NULL;
    space->used += (size_t)count;
    return part;
}

void ncgen_copy(int count, const ncgen_real *NCGEN_RESTRICT from, ncgen_real *NCGEN_RESTRICT to)
{
    for (int i = 0; i < count; ++i)
        to[i] = from[i];
}
