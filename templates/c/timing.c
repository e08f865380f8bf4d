/* timing.c: calls a kernel many times, so that a clock outside measures the kernel and not the call into C. */
#include "ncgen.h"

int ncgen_repeat_position(ncgen_position_kernel *kernel, int times, ncgen_real t, const ncgen_real *q, const ncgen_real *p,
                          ncgen_real *out);
int ncgen_repeat_velocity(ncgen_velocity_kernel *kernel, int times, ncgen_real t, const ncgen_real *q, const ncgen_real *qd,
                          const ncgen_real *p, ncgen_real *out);

int ncgen_repeat_position(ncgen_position_kernel *kernel, int times, ncgen_real t, const ncgen_real *q, const ncgen_real *p,
                          ncgen_real *out)
{
    int status = NCGEN_OK;
    for (int i = 0; i < times && status == NCGEN_OK; ++i)
        status = kernel(t, q, p, out);
    return status;
}

int ncgen_repeat_velocity(ncgen_velocity_kernel *kernel, int times, ncgen_real t, const ncgen_real *q, const ncgen_real *qd,
                          const ncgen_real *p, ncgen_real *out)
{
    int status = NCGEN_OK;
    for (int i = 0; i < times && status == NCGEN_OK; ++i)
        status = kernel(t, q, qd, p, out);
    return status;
}
