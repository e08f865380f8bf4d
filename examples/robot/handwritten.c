/* handwritten.c: constraints of the robot as one would write them by hand, to compare generated code with.
 *
 * A table with one line per row and a switch over the paper's row codes. Rows are scaled and ordered like ncgen's, and
 * the Jacobian is written in the same compressed rows, so that a clock compares like with like.
 */
#include <math.h>
#include <string.h>

enum {
    ROWS = 31,
    COORDINATES = 45, /* the paper's q, eq. 9 */
    NONZEROS = 216
};

/* code: as in Tables 3 and 5; element: where its points and vectors start in the full q; psi: where its angle is
 * size: 1000-1003 the length L, angles 1/(la lb); other: 1000-1003 the cosine, angles the sign of n over its length */
typedef struct row {
    int code;
    int element[5];
    int psi;
    double size, other;
} row;

static const row table[ROWS] = {
    {1000, {0, 3}, 0, 0.7001587891328652, 0.0},
    {1000, {3, 15}, 0, 0.3956854937952616, 0.0},
    {1000, {15, 0}, 0, 0.7483446933065003, 0.0},
    {1001, {12}, 0, 1.0, 0.0},
    {1002, {12, 0, 3}, 0, 0.7001587891328652, 0.0},
    {1002, {12, 3, 15}, 0, 0.3956854937952616, 0.0},
    {1003, {6, 12}, 0, 1.0, 0.0},
    {1002, {6, 0, 3}, 0, 0.7001587891328652, -0.9544977658963307},
    {1000, {3, 18}, 0, 1.0964, 0.0},
    {1002, {12, 3, 18}, 0, 1.0964, 0.0},
    {1000, {15, 21}, 0, 1.0964, 0.0},
    {1002, {12, 15, 21}, 0, 1.0964, 0.0},
    {1000, {18, 21}, 0, 0.3956854937952616, 0.0},
    {1000, {21, 24}, 0, 0.5120205074018032, 0.0},
    {1000, {24, 18}, 0, 0.2724919998825655, 0.0},
    {1002, {12, 18, 21}, 0, 0.3956854937952616, 0.0},
    {1002, {12, 18, 24}, 0, 0.2724919998825655, 0.0},
    {1000, {24, 27}, 0, 1.300058002552194, 0.0},
    {1002, {12, 24, 27}, 0, 1.300058002552194, 0.0},
    {1002, {30, 24, 27}, 0, 1.300058002552194, 0.0},
    {1001, {30}, 0, 1.0, 0.0},
    {1000, {27, 33}, 0, 0.22970000000000002, 0.0},
    {1002, {30, 27, 33}, 0, 0.22970000000000002, 0.0},
    {1002, {36, 27, 33}, 0, 0.22970000000000002, 0.0},
    {1001, {36}, 0, 1.0, 0.0},
    {1012, {9, 12, 6}, 39, 1.0, 1.0},
    {1014, {6, 18, 3, 12}, 40, 0.9120758847136081, -1.0},
    {1010, {18, 24, 27, 24, 12}, 41, 2.822822138105743, 1.0},
    {1013, {12, 30, 27, 24}, 42, 1.0, 0.7691964497252134},
    {1010, {24, 27, 33, 27, 30}, 43, 3.3487002600139895, 1.0},
    {1013, {30, 36, 33, 27}, 44, 1.0, 4.3535045711797995},
};

/* The Jacobian's nonzeros: row r has the columns of the full q from column[first[r]] on. */
static const int first[ROWS + 1] = {
    0, 3, 9, 12, 15, 21, 30, 31, 32, 38, 47, 53, 62, 68, 74, 80, 89, 98, 104, 113, 122, 125, 131, 140, 149, 152, 155, 164,
    177, 190, 203, 216
};

static const int column[NONZEROS] = {
    3, 4, 5, 3, 4, 5, 15, 16, 17, 15, 16, 17, 12, 13, 14, 3, 4, 5, 12, 13, 14, 3, 4, 5, 12, 13, 14, 15, 16, 17, 14, 5, 3, 4,
    5, 18, 19, 20, 3, 4, 5, 12, 13, 14, 18, 19, 20, 15, 16, 17, 21, 22, 23, 12, 13, 14, 15, 16, 17, 21, 22, 23, 18, 19, 20,
    21, 22, 23, 21, 22, 23, 24, 25, 26, 18, 19, 20, 24, 25, 26, 12, 13, 14, 18, 19, 20, 21, 22, 23, 12, 13, 14, 18, 19, 20,
    24, 25, 26, 24, 25, 26, 27, 28, 29, 12, 13, 14, 24, 25, 26, 27, 28, 29, 24, 25, 26, 27, 28, 29, 30, 31, 32, 30, 31, 32,
    27, 28, 29, 33, 34, 35, 27, 28, 29, 30, 31, 32, 33, 34, 35, 27, 28, 29, 33, 34, 35, 36, 37, 38, 36, 37, 38, 12, 13, 39,
    3, 4, 5, 12, 13, 18, 19, 20, 40, 12, 13, 14, 18, 19, 20, 24, 25, 26, 27, 28, 29, 41, 12, 13, 14, 24, 25, 26, 27, 28, 29,
    30, 31, 32, 42, 24, 25, 26, 27, 28, 29, 30, 31, 32, 33, 34, 35, 43, 27, 28, 29, 30, 31, 32, 33, 34, 35, 36, 37, 38, 44
};

int handwritten_phi(double t, const double *q, const double *p, double *phi);
int handwritten_phi_q(double t, const double *q, const double *p, double *values);
int handwritten_gamma(double t, const double *q, const double *qd, const double *p, double *gamma);

/* The full q: r1, u1 and u2 do not move. */
static void complete(const double *q, double *x)
{
    static const double fixed[12] = {0, 0, 0, 0, 0, 0, 0, 0, 1, 0, 1, 0};
    memcpy(x, fixed, sizeof fixed);
    memcpy(x + 3, q, 3 * sizeof *q);
    memcpy(x + 12, q + 3, 33 * sizeof *q);
}

static void complete_rates(const double *qd, double *v)
{
    memset(v, 0, 12 * sizeof *v);
    memcpy(v + 3, qd, 3 * sizeof *qd);
    memcpy(v + 12, qd + 3, 33 * sizeof *qd);
}

static double dot(const double *a, const double *b)
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static void cross(const double *a, const double *b, double *c)
{
    c[0] = a[1] * b[2] - a[2] * b[1];
    c[1] = a[2] * b[0] - a[0] * b[2];
    c[2] = a[0] * b[1] - a[1] * b[0];
}

static void subtract(const double *a, const double *b, double *c)
{
    for (int k = 0; k < 3; ++k)
        c[k] = a[k] - b[k];
}

/* target += factor * a */
static void add(double factor, const double *a, double *target)
{
    for (int k = 0; k < 3; ++k)
        target[k] += factor * a[k];
}

static void copy(double factor, const double *a, double *b)
{
    for (int k = 0; k < 3; ++k)
        b[k] = factor * a[k];
}

/* a, b and n / |n| of an angle row. */
static void angle_vectors(const row *r, const double *x, double *a, double *b, double *n)
{
    const int *e = r->element;
    switch (r->code) {
    case 1010: /* two segments about a vector */
        subtract(x + e[0], x + e[1], a);
        subtract(x + e[2], x + e[3], b);
        copy(r->other, x + e[4], n);
        break;
    case 1012: /* two vectors about a vector */
        copy(1, x + e[0], a);
        copy(1, x + e[1], b);
        copy(r->other, x + e[2], n);
        break;
    case 1013: /* two vectors about a segment */
        copy(1, x + e[0], a);
        copy(1, x + e[1], b);
        subtract(x + e[2], x + e[3], n);
        copy(r->other, n, n);
        break;
    default: /* 1014: a vector and a segment about a vector */
        copy(1, x + e[0], a);
        subtract(x + e[1], x + e[2], b);
        copy(r->other, x + e[3], n);
    }
}

int handwritten_phi(double t, const double *q, const double *p, double *phi)
{
    double x[COORDINATES], a[3], b[3], n[3], ab[3];
    (void)t;
    (void)p;
    complete(q, x);
    for (int i = 0; i < ROWS; ++i) {
        const row *r = &table[i];
        const int *e = r->element;
        switch (r->code) {
        case 1000:
            subtract(x + e[0], x + e[1], a);
            phi[i] = (dot(a, a) - r->size * r->size) / (2 * r->size);
            break;
        case 1001:
            phi[i] = (dot(x + e[0], x + e[0]) - 1) / 2;
            break;
        case 1002:
            subtract(x + e[1], x + e[2], a);
            phi[i] = dot(x + e[0], a) / r->size - r->other;
            break;
        case 1003:
            phi[i] = dot(x + e[0], x + e[1]) - r->other;
            break;
        default:
            angle_vectors(r, x, a, b, n);
            cross(a, b, ab);
            phi[i] = r->size * (sin(x[r->psi]) * dot(a, b) - cos(x[r->psi]) * dot(ab, n));
        }
    }
    return 0;
}

int handwritten_phi_q(double t, const double *q, const double *p, double *values)
{
    double x[COORDINATES], line[COORDINATES] = {0}, a[3], b[3], n[3], ab[3], bn[3], na[3], ga[3], gb[3];
    (void)t;
    (void)p;
    complete(q, x);
    for (int i = 0; i < ROWS; ++i) {
        const row *r = &table[i];
        const int *e = r->element;
        switch (r->code) {
        case 1000:
            subtract(x + e[0], x + e[1], a);
            copy(1 / r->size, a, line + e[0]);
            copy(-1 / r->size, a, line + e[1]);
            break;
        case 1001:
            copy(1, x + e[0], line + e[0]);
            break;
        case 1002:
            subtract(x + e[1], x + e[2], a);
            copy(1 / r->size, a, line + e[0]);
            copy(1 / r->size, x + e[0], line + e[1]);
            copy(-1 / r->size, x + e[0], line + e[2]);
            break;
        case 1003:
            copy(1, x + e[1], line + e[0]);
            copy(1, x + e[0], line + e[1]);
            break;
        default: {
            angle_vectors(r, x, a, b, n);
            cross(a, b, ab);
            cross(b, n, bn);
            cross(n, a, na);
            const double s = r->size * sin(x[r->psi]), c = r->size * cos(x[r->psi]), gn = -c * r->other;
            for (int k = 0; k < 3; ++k) {
                ga[k] = s * b[k] - c * bn[k];
                gb[k] = s * a[k] - c * na[k];
            }
            line[r->psi] = c * dot(a, b) + s * dot(ab, n);
            switch (r->code) {
            case 1010:
                add(1, ga, line + e[0]);
                add(-1, ga, line + e[1]);
                add(1, gb, line + e[2]);
                add(-1, gb, line + e[3]);
                add(gn, ab, line + e[4]);
                break;
            case 1012:
                add(1, ga, line + e[0]);
                add(1, gb, line + e[1]);
                add(gn, ab, line + e[2]);
                break;
            case 1013:
                add(1, ga, line + e[0]);
                add(1, gb, line + e[1]);
                add(gn, ab, line + e[2]);
                add(-gn, ab, line + e[3]);
                break;
            default:
                add(1, ga, line + e[0]);
                add(1, gb, line + e[1]);
                add(-1, gb, line + e[2]);
                add(gn, ab, line + e[3]);
            }
        }
        }
        for (int k = first[i]; k < first[i + 1]; ++k) {
            values[k] = line[column[k]];
            line[column[k]] = 0;
        }
    }
    return 0;
}

int handwritten_gamma(double t, const double *q, const double *qd, const double *p, double *gamma)
{
    double x[COORDINATES], v[COORDINATES], a[3], b[3], n[3], da[3], db[3], dn[3], ab[3], dab[3], adb[3], dadb[3];
    (void)t;
    (void)p;
    complete(q, x);
    complete_rates(qd, v);
    for (int i = 0; i < ROWS; ++i) {
        const row *r = &table[i];
        const int *e = r->element;
        switch (r->code) {
        case 1000:
            subtract(v + e[0], v + e[1], a);
            gamma[i] = -dot(a, a) / r->size;
            break;
        case 1001:
            gamma[i] = -dot(v + e[0], v + e[0]);
            break;
        case 1002:
            subtract(v + e[1], v + e[2], a);
            gamma[i] = -2 * dot(v + e[0], a) / r->size;
            break;
        case 1003:
            gamma[i] = -2 * dot(v + e[0], v + e[1]);
            break;
        default: {
            const double s = sin(x[r->psi]), c = cos(x[r->psi]), w = v[r->psi];
            angle_vectors(r, x, a, b, n);
            angle_vectors(r, v, da, db, dn);
            cross(a, b, ab);
            cross(da, b, dab);
            cross(a, db, adb);
            add(1, adb, dab);
            cross(da, db, dadb);
            const double d0 = dot(a, b), d1 = dot(da, b) + dot(a, db), d2 = 2 * dot(da, db);
            const double t0 = dot(ab, n), t1 = dot(dab, n) + dot(ab, dn), t2 = 2 * (dot(dadb, n) + dot(dab, dn));
            gamma[i] = -r->size * (s * (d2 - w * w * d0 + 2 * w * t1) + c * (2 * w * d1 - t2 + w * w * t0));
        }
        }
    }
    return 0;
}
