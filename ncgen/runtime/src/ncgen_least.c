/* ncgen_least.c: singular value decomposition by rotations of pairs of columns (Hestenes 1958): a v has orthogonal columns. */
#include "ncgen_least.h"

enum { MOST_SWEEPS = 60 };

/* Singular values below this share of the largest are zero; columns are orthogonal whose cosine is smaller than the second one. */
static const ncgen_scalar no_rank = R(1.0e-12), orthogonal = R(1.0e-15);

static ncgen_real column_dot(int size, const ncgen_real *a, int i, int j)
{
    ncgen_real sum = 0;
    for (int k = 0; k < size; ++k)
        sum += a[k * size + i] * a[k * size + j];
    return sum;
}

static void rotate(int size, ncgen_real *a, int i, int j, ncgen_real c, ncgen_real s)
{
    for (int k = 0; k < size; ++k) {
        const ncgen_real one = a[k * size + i], other = a[k * size + j];
        a[k * size + i] = c * one - s * other;
        a[k * size + j] = s * one + c * other;
    }
}

/* Make two columns of a orthogonal, unless one of them is nothing; returns whether they were not. */
static int make_orthogonal(int size, ncgen_real *a, ncgen_real *v, int i, int j, ncgen_scalar nothing)
{
    const ncgen_real one = column_dot(size, a, i, i), other = column_dot(size, a, j, j), both = column_dot(size, a, i, j);
    if (!(NCGEN_ABS(both) > orthogonal * NCGEN_SQRT(one * other)) || !(one > nothing) || !(other > nothing))
        return 0;
    const ncgen_real half = (other - one) / (2 * both);
    const ncgen_real tangent = (half < 0 ? -1 : 1) / (NCGEN_ABS(half) + NCGEN_SQRT(1 + half * half));
    const ncgen_real cosine = 1 / NCGEN_SQRT(1 + tangent * tangent);
    rotate(size, a, i, j, cosine, cosine * tangent);
    rotate(size, v, i, j, cosine, cosine * tangent);
    return 1;
}

void ncgen_least_squares(int size, ncgen_real *a, ncgen_real *v, const ncgen_real *right, ncgen_real *x)
{
    ncgen_scalar whole = 0, largest = 0;
    for (int i = 0; i < size; ++i) {
        x[i] = 0;
        whole += column_dot(size, a, i, i);
        for (int j = 0; j < size; ++j)
            v[i * size + j] = i == j;
    }
    for (int sweep = 0, some = 1; some && sweep < MOST_SWEEPS; ++sweep) {
        some = 0;
        for (int i = 0; i < size; ++i)
            for (int j = i + 1; j < size; ++j)
                some |= make_orthogonal(size, a, v, i, j, R(1.0e-30) * whole);
    }
    for (int i = 0; i < size; ++i) {
        const ncgen_scalar square = column_dot(size, a, i, i);
        largest = square > largest ? square : largest;
    }
    for (int i = 0; i < size; ++i) {
        const ncgen_real square = column_dot(size, a, i, i);
        if (!(square > no_rank * no_rank * largest))
            continue;
        ncgen_real along = 0;
        for (int k = 0; k < size; ++k)
            along += a[k * size + i] * right[k];
        for (int k = 0; k < size; ++k)
            x[k] += along / square * v[k * size + i];
    }
}
