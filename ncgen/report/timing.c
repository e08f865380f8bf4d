/* timing.c: calls kernels many times, so that a clock outside measures them and not the way into C. */
#include "ncgen.h"

/* begin functions */

/* Call up to two kernels of the position and one of the velocity, `times` times; those that are NULL are left out. */
int ncgen_repeat(int times, ncgen_real t, const ncgen_real *q, const ncgen_real *v, const ncgen_real *p,
                 ncgen_position_kernel *first, ncgen_real *first_out, ncgen_position_kernel *second, ncgen_real *second_out,
                 ncgen_velocity_kernel *third, ncgen_real *third_out);

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
