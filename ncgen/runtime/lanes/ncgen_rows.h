/* ncgen_rows.h: states that lie in rows, brought into lanes and back, a square of numbers at a time. */
#ifndef NCGEN_ROWS_H
#define NCGEN_ROWS_H

#include "ncgen.h"

#include <string.h>

/* Rows and columns of a square exchanged: halves, then quarters, then (of eight) neighbours. */
static inline __attribute__((always_inline)) void ncgen_transpose(ncgen_real *x)
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

/* Where the square that begins with number i of `width` lies: the last one overlaps the one before. */
static inline int ncgen_square(int i, int width)
{
    return i + NCGEN_LANES <= width ? i : width - NCGEN_LANES;
}

/* A square of numbers, from the first of each row on, into lanes. */
static inline __attribute__((always_inline)) void ncgen_read_square(const double *const *row, int at, ncgen_real *lanes)
{
    ncgen_real square[NCGEN_LANES];
#pragma GCC unroll 8
    for (int lane = 0; lane < NCGEN_LANES; ++lane)
        memcpy(&square[lane], row[lane] + at, sizeof(ncgen_real));
    ncgen_transpose(square);
#pragma GCC unroll 8
    for (int k = 0; k < NCGEN_LANES; ++k)
        lanes[k] = square[k];
}

/* Numbers that are needed soon are called from memory while something else is computed. */
static inline void ncgen_prefetch(long count, const double *numbers)
{
    for (long i = 0; i < count; i += 8) /* a line of the cache */
        __builtin_prefetch(numbers + i);
}

/* Rows of `width` numbers, one for each lane, into lanes; lanes beyond `count` repeat the last row. */
static inline void ncgen_spread(int width, int count, long stride, const double *rows, ncgen_real *lanes)
{
    const double *row[NCGEN_LANES];
    for (int i = 0; i < width && stride == 0; ++i)
        lanes[i] = NCGEN_SPLAT(rows[i]);
    if (stride == 0)
        return;
    for (int lane = 0; lane < NCGEN_LANES; ++lane)
        row[lane] = rows + (lane < count ? lane : count - 1) * stride;
    for (int i = 0; i < width && width >= NCGEN_LANES; i += NCGEN_LANES) {
        const int at = ncgen_square(i, width);
        ncgen_read_square(row, at, lanes + at);
    }
    if (0 < width && width < NCGEN_LANES) {
        /* Rows shorter than a square are read together with what follows them, the last ones from a copy. */
        double copy[NCGEN_LANES][NCGEN_LANES];
        const double *end = row[NCGEN_LANES - 1] + width;
        ncgen_real square[NCGEN_LANES];
        for (int lane = 0; lane < NCGEN_LANES; ++lane)
            if (end - row[lane] < NCGEN_LANES) {
                for (int i = 0; i < NCGEN_LANES; ++i)
                    copy[lane][i] = i < width ? row[lane][i] : 0.0;
                row[lane] = copy[lane];
            }
        ncgen_read_square(row, 0, square);
        for (int i = 0; i < width; ++i)
            lanes[i] = square[i];
    }
}

/* Lanes into rows of `width` numbers, at least as many as there are lanes. */
static inline void ncgen_collect_squares(int width, long stride, const ncgen_real *lanes, double *rows)
{
    for (int i = 0; i < width; i += NCGEN_LANES) {
        const int at = ncgen_square(i, width);
        ncgen_real square[NCGEN_LANES];
#pragma GCC unroll 8
        for (int k = 0; k < NCGEN_LANES; ++k)
            square[k] = lanes[at + k];
        ncgen_transpose(square);
#pragma GCC unroll 8
        for (int lane = 0; lane < NCGEN_LANES; ++lane)
            memcpy(rows + lane * stride + at, &square[lane], sizeof(ncgen_real));
    }
}

/* Lanes into shorter rows: each is written as a whole square's row, and the next one covers what was too much. */
static inline void ncgen_collect_short(int width, const ncgen_real *lanes, double *rows)
{
    ncgen_real square[NCGEN_LANES];
#pragma GCC unroll 8
    for (int k = 0; k < NCGEN_LANES; ++k)
        square[k] = lanes[k < width ? k : 0];
    ncgen_transpose(square);
#pragma GCC unroll 8
    for (int lane = 0; lane < NCGEN_LANES; ++lane) {
        double *row = rows + (long)lane * width;
        if ((NCGEN_LANES - lane) * width >= NCGEN_LANES)
            memcpy(row, &square[lane], sizeof(ncgen_real));
        else
#pragma GCC unroll 8
            for (int i = 0; i < NCGEN_LANES; ++i)
                if (i < width)
                    row[i] = square[lane][i];
    }
}

/* Lanes into `width` numbers of each row; from the beginning of one row to that of the next there are `stride`. */
static inline void ncgen_collect_part(int width, int count, long stride, const ncgen_real *lanes, double *rows)
{
    if (count == NCGEN_LANES && width >= NCGEN_LANES)
        ncgen_collect_squares(width, stride, lanes, rows);
    else if (count == NCGEN_LANES && width == stride)
        ncgen_collect_short(width, lanes, rows);
    else
        for (int lane = 0; lane < count; ++lane)
            for (int i = 0; i < width; ++i)
                rows[lane * stride + i] = lanes[i][lane];
}

/* Lanes into rows of `width` numbers. */
static inline void ncgen_collect(int width, int count, const ncgen_real *lanes, double *rows)
{
    ncgen_collect_part(width, count, width, lanes, rows);
}

#endif
