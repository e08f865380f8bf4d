/* timing.c: calls kernels many times, so that a clock outside measures them and not the way into C. */
#include "ncgen.h"

/* begin functions */

/* Call up to two kernels of the position and one of the velocity, `times` times; those that are NULL are left out. */
int ncgen_repeat(int times, ncgen_real t, const ncgen_real *q, const ncgen_real *v, const ncgen_real *p,
                 ncgen_position_kernel *first, ncgen_real *first_out, ncgen_position_kernel *second, ncgen_real *second_out,
                 ncgen_velocity_kernel *third, ncgen_real *third_out);

/* Call a kernel of the position or of the velocity once for each of `count` states, whose q, v and results are rows of n and
 * `size` numbers. */
int ncgen_each(long count, ncgen_real t, int n, const ncgen_real *q, const ncgen_real *v, const ncgen_real *p,
               ncgen_position_kernel *position, ncgen_velocity_kernel *velocity, int size, ncgen_real *out);

/* 24 multiplications and additions in each of `times` turns: the rate of plain arithmetic. */
ncgen_real ncgen_arithmetic(int times, ncgen_real a, ncgen_real b);

/* end functions */

int ncgen_repeat(int times, ncgen_real t, const ncgen_real *q, const ncgen_real *v, const ncgen_real *p,
                 ncgen_position_kernel *first, ncgen_real *first_out, ncgen_position_kernel *second, ncgen_real *second_out,
                 ncgen_velocity_kernel *third, ncgen_real *third_out)
{
    int status = NCGEN_OK;
    for (int i = 0; i < times; ++i) {
        if (first)
            status |= first(t, q, p, first_out);
        if (second)
            status |= second(t, q, p, second_out);
        if (third)
            status |= third(t, q, v, p, third_out);
    }
    return status;
}

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
