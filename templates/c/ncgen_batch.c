/* ncgen_batch.c: kernels of many states, a block of NCGEN_LANES states at a time. */
#include "ncgen_batch.h"

#include <string.h>

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
    return NCGEN_LANES * (2 * (size_t)model->n_coordinates + (size_t)model->n_parameters + (size_t)size);
}

/* Rows and columns of a square exchanged: halves, then quarters, then (of eight) neighbours. */
static inline __attribute__((always_inline)) void transpose(ncgen_real *x)
{
#if NCGEN_LANES == 8
#pragma GCC unroll 8
    for (int i = 0; i < 4; ++i) {
        const ncgen_real a = x[i], b = x[i + 4];
        x[i] = __builtin_shufflevector(a, b, 0, 1, 2, 3, 8, 9, 10, 11);
        x[i + 4] = __builtin_shufflevector(a, b, 4, 5, 6, 7, 12, 13, 14, 15);
    }
#pragma GCC unroll 8
    for (int i = 0; i < 8; ++i)
        if (!(i & 2)) {
            const ncgen_real a = x[i], b = x[i + 2];
            x[i] = __builtin_shufflevector(a, b, 0, 1, 8, 9, 4, 5, 12, 13);
            x[i + 2] = __builtin_shufflevector(a, b, 2, 3, 10, 11, 6, 7, 14, 15);
        }
#pragma GCC unroll 8
    for (int i = 0; i < 8; i += 2) {
        const ncgen_real a = x[i], b = x[i + 1];
        x[i] = __builtin_shufflevector(a, b, 0, 8, 2, 10, 4, 12, 6, 14);
        x[i + 1] = __builtin_shufflevector(a, b, 1, 9, 3, 11, 5, 13, 7, 15);
    }
#else
    for (int i = 0; i < 2; ++i) {
        const ncgen_real a = x[i], b = x[i + 2];
        x[i] = __builtin_shufflevector(a, b, 0, 1, 4, 5);
        x[i + 2] = __builtin_shufflevector(a, b, 2, 3, 6, 7);
    }
    for (int i = 0; i < 4; i += 2) {
        const ncgen_real a = x[i], b = x[i + 1];
        x[i] = __builtin_shufflevector(a, b, 0, 4, 2, 6);
        x[i + 1] = __builtin_shufflevector(a, b, 1, 5, 3, 7);
    }
#endif
}

/* Rows of `width` numbers, one for each lane, into lanes; lanes beyond `count` repeat the last row. */
static void spread(int width, int count, long stride, const double *rows, ncgen_real *lanes)
{
    const double *row[NCGEN_LANES];
    int i = 0;
    for (int lane = 0; lane < NCGEN_LANES; ++lane)
        row[lane] = rows + (lane < count ? lane : count - 1) * stride;
    for (; i + NCGEN_LANES <= width; i += NCGEN_LANES) {
        ncgen_real square[NCGEN_LANES];
#pragma GCC unroll 8
        for (int lane = 0; lane < NCGEN_LANES; ++lane)
            memcpy(&square[lane], row[lane] + i, sizeof(ncgen_real));
        transpose(square);
#pragma GCC unroll 8
        for (int k = 0; k < NCGEN_LANES; ++k)
            lanes[i + k] = square[k];
    }
    for (; i < width; ++i)
        for (int lane = 0; lane < NCGEN_LANES; ++lane)
            ((double *)&lanes[i])[lane] = row[lane][i];
}

/* Lanes into rows of `width` numbers. */
static void collect(int width, int count, const ncgen_real *lanes, double *rows)
{
    int i = 0;
    for (; count == NCGEN_LANES && i + NCGEN_LANES <= width; i += NCGEN_LANES) {
        ncgen_real square[NCGEN_LANES];
#pragma GCC unroll 8
        for (int k = 0; k < NCGEN_LANES; ++k)
            square[k] = lanes[i + k];
        transpose(square);
#pragma GCC unroll 8
        for (int lane = 0; lane < NCGEN_LANES; ++lane)
            memcpy(rows + (long)lane * width + i, &square[lane], sizeof(ncgen_real));
    }
    for (; i < width; ++i)
        for (int lane = 0; lane < count; ++lane)
            rows[(long)lane * width + i] = ((const double *)&lanes[i])[lane];
}

/* The states from `first` on, as many as there are lanes. */
static int block(const ncgen_model *model, ncgen_position_kernel *position, ncgen_velocity_kernel *velocity,
                 const ncgen_states *states, long first, int size, double *out, ncgen_real *work)
{
    const int n = model->n_coordinates;
    const long left = states->count - first;
    const int count = left < NCGEN_LANES ? (int)left : NCGEN_LANES;
    ncgen_real *q = work, *qd = q + n, *p = qd + n, *result = p + model->n_parameters;
    ncgen_real t;
    spread(1, count, states->t_stride, states->t + first * states->t_stride, &t);
    spread(n, count, n, states->q + first * n, q);
    if (states->qd)
        spread(n, count, n, states->qd + first * n, qd);
    spread(model->n_parameters, count, states->p_stride, states->p + first * states->p_stride, p);
    const int status = position ? position(t, q, p, result) : velocity(t, q, qd, p, result);
    collect(size, count, result, out + (size_t)first * (size_t)size);
    return status;
}

int ncgen_batch_kernel(const ncgen_model *model, ncgen_position_kernel *position, ncgen_velocity_kernel *velocity,
                       const ncgen_states *states, int size, double *out, int threads, double *workspace)
{
    const long blocks = (states->count + NCGEN_LANES - 1) / NCGEN_LANES;
    const size_t share = ncgen_batch_workspace(model, size) / NCGEN_LANES;
    int worst = NCGEN_OK;
#ifdef _OPENMP
#pragma omp parallel for num_threads(threads) reduction(max : worst) schedule(static)
#else
    (void)threads;
#endif
    for (long b = 0; b < blocks; ++b) {
        ncgen_real *work = (ncgen_real *)workspace;
#ifdef _OPENMP
        work += (size_t)omp_get_thread_num() * share;
#else
        (void)share;
#endif
        const int status = block(model, position, velocity, states, b * NCGEN_LANES, size, out, work);
        worst = status > worst ? status : worst;
    }
    return worst;
}
