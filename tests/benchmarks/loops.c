/* loops.c: kernels called for rows of states one after the other, and plain arithmetic, for clocks outside. */
#include "ncgen.h"

/* begin functions */

/* Call a kernel of the position or of the velocity once for each of `count` states, whose q, v and results are rows of n and
 * `size` numbers. */
int ncgen_each(long count, ncgen_real t, int n, const ncgen_real *q, const ncgen_real *v, const ncgen_real *p,
               ncgen_position_kernel *position, ncgen_velocity_kernel *velocity, int size, ncgen_real *out);

/* 24 multiplications and additions in each of `times` turns: the rate of plain arithmetic. */
ncgen_real ncgen_arithmetic(int times, ncgen_real a, ncgen_real b);

/* end functions */

int ncgen_each(long count, ncgen_real t, int n, const ncgen_real *q, const ncgen_real *v, const ncgen_real *p,
               ncgen_position_kernel *position, ncgen_velocity_kernel *velocity, int size, ncgen_real *out)
{
    int status = NCGEN_OK;
    for (long i = 0; i < count; ++i, q += n, v += n, out += size)
        status |= position ? position(t, q, p, out) : velocity(t, q, v, p, out);
    return status;
}

ncgen_real ncgen_arithmetic(int times, ncgen_real a, ncgen_real b)
{
    /* twelve chains that differ, so that none is computed once for all */
    ncgen_real c[12];
    for (int i = 0; i < 12; ++i)
        c[i] = (ncgen_real)(i + 1) * b;
    for (int r = 0; r < times; ++r)
        for (int i = 0; i < 12; ++i)
            c[i] = c[i] * a + b;
    for (int i = 1; i < 12; ++i)
        c[0] += c[i];
    return c[0];
}
