/* ncgen_linked_model.h: a mechanism of linked kernels, as its description in whole numbers has it. */
#ifndef NCGEN_LINKED_MODEL_H
#define NCGEN_LINKED_MODEL_H

#include "ncgen_driven.h"
#include "ncgen_events.h"

/* A model, its dynamics and how it is eliminated: without drives, with them, and with what is held. */
typedef struct ncgen_linked_variant {
    ncgen_model model;
    ncgen_elimination elimination;
    ncgen_dynamics dynamics;
    ncgen_driven driven;
} ncgen_linked_variant;

/* own, with drives and with what is held; conditions of events as a run watches them; friction that follows loads, or NULL; coordinates of
 * drives; places in p of the motion's own numbers; m: rows; n_values: how many numbers the kernel `values` has; when laws jump, or NULL */
typedef struct ncgen_linked_model {
    ncgen_linked_variant own, with_drives, held;
    ncgen_event watched;
    ncgen_events events;
    ncgen_velocity_kernel *friction;
    const int *drive_places, *own_places;
    int n, m, n_drives, n_own, m_held, n_values, is_conservative;
    int (*switches)(ncgen_real t, const ncgen_real *p, ncgen_real *out);
} ncgen_linked_model;

/* Kernels with drives are the caller's, and so is what is not in whole numbers. */
void ncgen_linked_read(const int *integers, ncgen_linked_model *l);

#endif
