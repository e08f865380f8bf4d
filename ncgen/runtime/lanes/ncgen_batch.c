/* ncgen_batch.c: kernels of many states, a block of NCGEN_LANES states at a time. */
#include "ncgen_batch.h"

#if defined(NCGEN_LANES)
#include "ncgen_rows.h"
#else
#define NCGEN_LANES 1
#endif

#ifdef _OPENMP
#include <omp.h>
#endif

int ncgen_batch_lanes(void)
{
    return NCGEN_LANES;
}

int ncgen_batch_threads(void)
{
#ifdef _OPENMP
    return 1;
#else
    return 0;
#endif
}

size_t ncgen_batch_workspace(const ncgen_model *model, int size)
{
#if NCGEN_LANES > 1
    return NCGEN_LANES * (2 * (size_t)model->n_coordinates + (size_t)model->n_parameters + (size_t)size);
#else
    (void)model, (void)size;
    return 0;
#endif
}

/* The states from `first` on, as many as there are lanes. */
static int block(const ncgen_model *model, ncgen_position_kernel *position, ncgen_velocity_kernel *velocity,
                 const ncgen_states *states, long first, int size, double *out, ncgen_real *work)
{
    const int n = model->n_coordinates;
    const double *q_row = states->q + first * n, *qd_row = states->qd ? states->qd + first * n : NULL;
    const double *t_row = states->t + first * states->t_stride, *p_row = states->p + first * states->p_stride;
    double *row = out + (size_t)first * (size_t)size;
#if NCGEN_LANES > 1
    const long left = states->count - first;
    const int count = left < NCGEN_LANES ? (int)left : NCGEN_LANES;
    ncgen_real *q = work, *qd = q + n, *p = qd + n, *result = p + model->n_parameters;
    ncgen_real t;
    ncgen_spread(1, count, states->t_stride, t_row, &t);
    ncgen_spread(n, count, n, q_row, q);
    if (qd_row)
        ncgen_spread(n, count, n, qd_row, qd);
    ncgen_spread(model->n_parameters, count, states->p_stride, p_row, p);
    const int status = position ? position(t, q, p, result) : velocity(t, q, qd, p, result);
    ncgen_collect(size, count, result, row);
    return status;
#else
    (void)work;
    return position ? position(*t_row, q_row, p_row, row) : velocity(*t_row, q_row, qd_row, p_row, row);
#endif
}

int ncgen_batch_kernel(const ncgen_model *model, ncgen_position_kernel *position, ncgen_velocity_kernel *velocity,
                       const ncgen_states *states, int size, double *out, int threads, double *workspace)
{
    const long blocks = (states->count + NCGEN_LANES - 1) / NCGEN_LANES;
    int worst = NCGEN_OK;
    (void)threads;
#ifdef _OPENMP
#pragma omp parallel num_threads(threads) reduction(max : worst)
#endif
    {
        ncgen_real *work = (ncgen_real *)workspace;
#ifdef _OPENMP
        work += (size_t)omp_get_thread_num() * (ncgen_batch_workspace(model, size) / NCGEN_LANES);
#pragma omp for schedule(static)
#endif
        for (long b = 0; b < blocks; ++b) {
            const int status = block(model, position, velocity, states, b * NCGEN_LANES, size, out, work);
            worst = status > worst ? status : worst;
        }
    }
    return worst;
}
