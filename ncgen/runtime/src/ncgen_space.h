/* ncgen_space.h: workspace that is dealt out, for numbers of any kind, vectors among them. */
#ifndef NCGEN_SPACE_H
#define NCGEN_SPACE_H

#include "ncgen_math.h"
#include "ncgen_runtime.h"

/* Without a base it is only counted. */
typedef struct ncgen_space {
    ncgen_real *base;
    size_t used;
} ncgen_space;

ncgen_real *ncgen_take(ncgen_space *space, int count);

void ncgen_copy(int count, const ncgen_real *NCGEN_RESTRICT from, ncgen_real *NCGEN_RESTRICT to);

#endif
