/* ncgen_joint_loops.h: loops over joints are closed by Newton's method; for exports without the runtime. */
#ifndef NCGEN_JOINT_LOOPS_H
#define NCGEN_JOINT_LOOPS_H

#include "ncgen_math.h"

/* Displacements of all joints, and coordinates that follow them, count numbers, of which some are independent. */
typedef struct ncgen_joint_loops {
    int count;
    int n_independent;
    int n_coordinates;
    const int *independent;
    const ncgen_real *sizes;         /* natural ones, count */
    ncgen_position_kernel *position; /* q, n_coordinates, and behind it a step of Newton's method for all displacements */
} ncgen_joint_loops;

/* What the independent joints do not say. output: what position writes, which begins with q. NCGEN_NOT_CONVERGED where loops do not close. */
static inline int ncgen_find_joints(const ncgen_joint_loops *loops, ncgen_real t, ncgen_real *all, const ncgen_real *p, ncgen_real *output)
{
    const ncgen_real rounding = (ncgen_real)1e-14L, stalled = (ncgen_real)1e-9L;
    ncgen_real last = 1;
    for (int k = 0; k < 12; ++k) {
        const int status = loops->position(t, all, p, output);
        ncgen_real size = 0;
        if (status)
            return status;
        for (int i = 0; i < loops->count; ++i) {
            const ncgen_real step = output[loops->n_coordinates + i], share = NCGEN_ABS(step) / loops->sizes[i];
            if (!(share <= 1))
                return NCGEN_NOT_CONVERGED;
            size = share > size ? share : size;
            all[i] += step;
        }
        if (size <= rounding || (size <= stalled && size >= last / 2))
            return NCGEN_OK;
        last = size;
    }
    return NCGEN_NOT_CONVERGED;
}

/* All displacements where the independent ones have the values x, by way of positions between; output: as of ncgen_find_joints.
 * NCGEN_ARGUMENT where x is far away. */
static inline int ncgen_close_joints(const ncgen_joint_loops *loops, ncgen_real t, const ncgen_real *x, const ncgen_real *p, ncgen_real *all,
    ncgen_real *output)
{
    ncgen_real way = 0;
    int status = NCGEN_OK;
    for (int i = 0; i < loops->n_independent; ++i) {
        const int j = loops->independent[i];
        const ncgen_real share = NCGEN_ABS(x[i] - all[j]) / loops->sizes[j];
        way = share > way ? share : way;
    }
    if (!(way <= 1000))
        return NCGEN_ARGUMENT;
    for (int left = 1 + (int)(5 * way); left > 0 && status == NCGEN_OK; --left) {
        for (int i = 0; i < loops->n_independent; ++i) {
            ncgen_real *joint = all + loops->independent[i];
            *joint = left == 1 ? x[i] : *joint + (x[i] - *joint) / left;
        }
        status = ncgen_find_joints(loops, t, all, p, output);
    }
    return status;
}

#endif
