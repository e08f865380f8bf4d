/* ncgen_call.c: one kernel on arrays that stay where they are. Getting into C costs by the argument, so there is one. */
#include "ncgen.h"

/* begin cdef */

/* A kernel with its arguments; a kernel of the position leaves velocity NULL, one of the velocity leaves position NULL. */
typedef struct ncgen_frame {
    ncgen_real t;
    const ncgen_real *q, *qd, *p;
    ncgen_real *out;
    ncgen_position_kernel *position;
    ncgen_velocity_kernel *velocity;
} ncgen_frame;

int ncgen_call(const ncgen_frame *frame);

/* end cdef */

int ncgen_call(const ncgen_frame *f)
{
    return f->position ? f->position(f->t, f->q, f->p, f->out) : f->velocity(f->t, f->q, f->qd, f->p, f->out);
}
