/* ncgen_space.c: what ncgen_adjoint.c takes of ncgen_vectors.c, whose other functions need numbers in an order, or one number. */
#include "ncgen_vectors.h"

ncgen_real *ncgen_take(ncgen_space *space, int count)
{
    ncgen_real *part = space->base ? space->base + space->used : NULL;
    space->used += (size_t)count;
    return part;
}

void ncgen_copy(int count, const ncgen_real *from, ncgen_real *to)
{
    for (int i = 0; i < count; ++i)
        to[i] = from[i];
}
