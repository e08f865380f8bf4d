/* ncgen_enclosure.c: functions between bounds, and operations on them.
 *
 * Sums and products are those of the polynomials; what a product has beyond the degree is added to the error. Of other functions y = f(u)
 * the polynomial is the one through their values. Its error is bounded by what is left when it is put into an equation of y that has
 * sums and products only: u - v y of a quotient, u - y^2 of a root, and y' - f'(u) u' of others, whose error is zero at x = 0, a place
 * of the values, and grows along one unit to either side.
 */
#include "ncgen_enclosure.h"

enum { MOST = NCGEN_ENCLOSURE_DEGREE + 1, TWICE = 2 * NCGEN_ENCLOSURE_DEGREE + 1 };

/* -- polynomials -------------------------------------------------------------------------------------------------------------------- */

void ncgen_enclosure_values(const ncgen_enclosing *with, const ncgen_scalar *c, ncgen_scalar *values)
{
    const int n = with->degree;
    for (int k = 0; k <= n; ++k) {
        values[k] = c[0];
        for (int j = 1, place = k; j <= n; ++j, place = (place + k) % (2 * n))
            values[k] += c[j] * with->cosines[place];
    }
}

void ncgen_enclosure_through(const ncgen_enclosing *with, const ncgen_scalar *values, ncgen_scalar *c)
{
    const int n = with->degree;
    for (int j = 0; j <= n; ++j) {
        c[j] = (values[0] + (j % 2 ? -values[n] : values[n])) / 2;
        for (int k = 1, place = j; k < n; ++k, place = (place + j) % (2 * n))
            c[j] += values[k] * with->cosines[place];
        c[j] *= (j == 0 || j == n ? R(1.0) : R(2.0)) / (ncgen_scalar)n;
    }
}

ncgen_scalar ncgen_enclosure_at(int degree, const ncgen_scalar *c, ncgen_scalar x)
{
    ncgen_scalar next = 0, after = 0; /* Clenshaw's rule */
    for (int j = degree; j > 0; --j) {
        const ncgen_scalar here = c[j] + 2 * x * next - after;
        after = next;
        next = here;
    }
    return c[0] + x * next - after;
}

/* The sum of the sizes of coefficients from `first` on: a bound of what they are together. */
static ncgen_scalar total(const ncgen_scalar *c, int first, int degree)
{
    ncgen_scalar sum = 0;
    for (int k = first; k <= degree; ++k)
        sum += NCGEN_ABS(c[k]);
    return sum;
}

/* d (2 degree + 1) += factor a b */
static void add_product(int degree, ncgen_scalar factor, const ncgen_scalar *a, const ncgen_scalar *b, ncgen_scalar *d)
{
    for (int i = 0; i <= degree; ++i)
        for (int j = 0; j <= degree; ++j) {
            const ncgen_scalar half = factor * a[i] * b[j] / 2;
            d[i + j] += half;
            d[i > j ? i - j : j - i] += half;
        }
}

/* d (2 degree + 1) = c */
static void widened(int degree, const ncgen_scalar *c, ncgen_scalar *d)
{
    for (int k = 0; k <= 2 * degree; ++k)
        d[k] = k <= degree ? c[k] : 0;
}

static void differentiate(int degree, const ncgen_scalar *c, ncgen_scalar *d)
{
    d[degree] = 0;
    for (int k = degree; k > 0; --k)
        d[k - 1] = (k < degree ? d[k + 1] : 0) + 2 * (ncgen_scalar)k * c[k];
    d[0] /= 2;
}

/* -- bounds ------------------------------------------------------------------------------------------------------------------------- */

static ncgen_scalar largest(ncgen_scalar a, ncgen_scalar b)
{
    return a > b ? a : b;
}

/* How far it may be from its coefficient 0. */
static ncgen_scalar radius(const ncgen_enclosing *with, const ncgen_enclosure *u)
{
    return total(u->c, 1, with->degree) + u->error;
}

ncgen_scalar ncgen_enclosure_size(const ncgen_enclosing *with, const ncgen_enclosure *u)
{
    return total(u->c, 0, with->degree) + u->error;
}

/* The least size that it may have: positive where it has one sign. */
static ncgen_scalar least(const ncgen_enclosing *with, const ncgen_enclosure *u)
{
    return NCGEN_ABS(u->c[0]) - radius(with, u);
}

static void between(const ncgen_enclosing *with, ncgen_scalar low, ncgen_scalar high, ncgen_enclosure *w)
{
    ncgen_enclose_number(with, low + (high - low) / 2, w);
    w->error = (high - low) / 2 + with->rounding * largest(NCGEN_ABS(low), NCGEN_ABS(high));
}

static void nothing_known(const ncgen_enclosing *with, ncgen_enclosure *w)
{
    ncgen_enclose_number(with, 0, w);
    w->error = NCGEN_UNBOUNDED;
}

void ncgen_enclose_number(const ncgen_enclosing *with, ncgen_scalar x, ncgen_enclosure *w)
{
    for (int k = 0; k <= with->degree; ++k)
        w->c[k] = 0;
    w->c[0] = x;
    w->error = 0;
}

/* -- operations --------------------------------------------------------------------------------------------------------------------- */

static void add(const ncgen_enclosing *with, const ncgen_enclosure *u, ncgen_scalar factor, const ncgen_enclosure *v, ncgen_enclosure *w)
{
    for (int k = 0; k <= with->degree; ++k)
        w->c[k] = u->c[k] + factor * v->c[k];
    w->error = u->error + v->error + with->rounding * (ncgen_enclosure_size(with, u) + ncgen_enclosure_size(with, v));
}

static void scale(const ncgen_enclosing *with, const ncgen_enclosure *u, ncgen_scalar factor, ncgen_enclosure *w)
{
    for (int k = 0; k <= with->degree; ++k)
        w->c[k] = factor * u->c[k];
    w->error = NCGEN_ABS(factor) * u->error;
}

static void multiply(const ncgen_enclosing *with, const ncgen_enclosure *u, const ncgen_enclosure *v, ncgen_enclosure *w)
{
    const int n = with->degree;
    const ncgen_scalar size_u = total(u->c, 0, n), size_v = total(v->c, 0, n);
    ncgen_scalar d[TWICE] = {0};
    add_product(n, 1, u->c, v->c, d);
    for (int k = 0; k <= n; ++k)
        w->c[k] = d[k];
    w->error = total(d, n + 1, 2 * n) + size_u * v->error + size_v * u->error + u->error * v->error + with->rounding * size_u * size_v;
}

static void divide(const ncgen_enclosing *with, const ncgen_enclosure *u, const ncgen_enclosure *v, ncgen_enclosure *w)
{
    const int n = with->degree;
    const ncgen_scalar low = least(with, v);
    ncgen_scalar a[MOST], b[MOST], d[TWICE];
    ncgen_enclosure_values(with, u->c, a);
    ncgen_enclosure_values(with, v->c, b);
    for (int k = 0; k <= n; ++k)
        a[k] /= b[k];
    ncgen_enclosure_through(with, a, w->c);
    widened(n, u->c, d);
    add_product(n, -1, v->c, w->c, d);
    const ncgen_scalar size = total(w->c, 0, n), own = total(d, 0, 2 * n) / low;
    w->error = own + (u->error + (size + own) * v->error) / low + with->rounding * size * (1 + total(v->c, 0, n) / low);
    if (!(low > 0))
        nothing_known(with, w);
}

static void take_root(const ncgen_enclosing *with, const ncgen_enclosure *u, ncgen_enclosure *w)
{
    const int n = with->degree;
    const ncgen_scalar low = least(with, u), high = u->c[0] + radius(with, u);
    ncgen_scalar a[MOST], d[TWICE];
    if (!(low > 0 && u->c[0] > 0)) { /* from zero on, where it is anything */
        between(with, 0, NCGEN_SQRT(high), w);
        return;
    }
    ncgen_enclosure_values(with, u->c, a);
    for (int k = 0; k <= n; ++k)
        a[k] = NCGEN_SQRT(a[k]);
    ncgen_enclosure_through(with, a, w->c);
    widened(n, u->c, d);
    add_product(n, -1, w->c, w->c, d);
    w->error = (total(d, 0, 2 * n) + u->error / 2 + with->rounding * high) / NCGEN_SQRT(low);
    if (!(w->c[0] - total(w->c, 1, n) > 0)) /* else the sum of the root and its polynomial is larger than the root */
        between(with, NCGEN_SQRT(low), NCGEN_SQRT(high), w);
}

/* Sine, or cosine: their polynomials together leave what is left of y' = z u', z' = -y u', and errors of the two only turn. */
static void wave(const ncgen_enclosing *with, const ncgen_enclosure *u, int is_cosine, ncgen_enclosure *w)
{
    const int n = with->degree;
    ncgen_scalar a[MOST] = {0}, b[MOST] = {0}, cosine[MOST], derivative[MOST], own[MOST], d[TWICE], e[TWICE];
    ncgen_enclosure_values(with, u->c, a);
    for (int k = 0; k <= n; ++k) {
        b[k] = NCGEN_COS(a[k]);
        a[k] = NCGEN_SIN(a[k]);
    }
    ncgen_enclosure_through(with, a, w->c);
    ncgen_enclosure_through(with, b, cosine);
    differentiate(n, u->c, derivative);
    differentiate(n, w->c, own);
    widened(n, own, d);
    add_product(n, -1, cosine, derivative, d);
    differentiate(n, cosine, own);
    widened(n, own, e);
    add_product(n, 1, w->c, derivative, e);
    const ncgen_scalar left = total(d, 0, 2 * n) + total(e, 0, 2 * n);
    for (int k = 0; k <= n && is_cosine; ++k)
        w->c[k] = cosine[k];
    w->error = left + u->error + with->rounding * (1 + total(u->c, 0, n));
    if (!(w->error < 1))
        between(with, -1, 1, w);
}

static void exponential(const ncgen_enclosing *with, const ncgen_enclosure *u, ncgen_enclosure *w)
{
    const int n = with->degree;
    ncgen_scalar a[MOST], derivative[MOST], own[MOST], d[TWICE];
    ncgen_enclosure_values(with, u->c, a);
    for (int k = 0; k <= n; ++k)
        a[k] = NCGEN_EXP(a[k]);
    ncgen_enclosure_through(with, a, w->c);
    differentiate(n, u->c, derivative);
    differentiate(n, w->c, own);
    widened(n, own, d);
    add_product(n, -1, w->c, derivative, d);
    const ncgen_scalar wide = radius(with, u), most = NCGEN_EXP(u->c[0] + wide);
    w->error = total(d, 0, 2 * n) * NCGEN_EXP(2 * wide) + most * (u->error + with->rounding * (1 + total(u->c, 0, n)));
}

static void logarithm(const ncgen_enclosing *with, const ncgen_enclosure *u, ncgen_enclosure *w)
{
    const int n = with->degree;
    const ncgen_scalar low = least(with, u);
    ncgen_scalar a[MOST], derivative[MOST], own[MOST], d[TWICE];
    ncgen_enclosure_values(with, u->c, a);
    for (int k = 0; k <= n; ++k)
        a[k] = NCGEN_LOG(a[k]);
    ncgen_enclosure_through(with, a, w->c);
    differentiate(n, u->c, derivative);
    differentiate(n, w->c, own);
    widened(n, derivative, d);
    add_product(n, -1, u->c, own, d);
    const ncgen_scalar size = total(w->c, 0, n);
    w->error = (total(d, 0, 2 * n) + u->error + with->rounding * total(u->c, 0, n) * (1 + size)) / low + with->rounding * size;
    if (!(low > 0 && u->c[0] > 0))
        nothing_known(with, w);
}

/* The angle whose sine and cosine u and v are, times anything: y' = (v u' - u v') / (u^2 + v^2), where it does not jump by 2 pi. */
static void angle(const ncgen_enclosing *with, const ncgen_enclosure *u, const ncgen_enclosure *v, ncgen_enclosure *w)
{
    const int n = with->degree;
    const ncgen_scalar pi = R(3.14159265358979323846), low_u = least(with, u), low_v = least(with, v);
    ncgen_scalar a[MOST], b[MOST], own[MOST], derivative[MOST], d[TWICE];
    ncgen_enclosure square, other;
    multiply(with, u, u, &square);
    multiply(with, v, v, &other);
    add(with, &square, 1, &other, w);
    square = *w;
    const ncgen_scalar low = largest(least(with, &square), (low_u > 0 ? low_u * low_u : 0) + (low_v > 0 ? low_v * low_v : 0));
    if (!(low > 0 && (low_u > 0 || (low_v > 0 && v->c[0] > 0)))) {
        between(with, -pi, pi, w);
        return;
    }
    ncgen_enclosure_values(with, u->c, a);
    ncgen_enclosure_values(with, v->c, b);
    for (int k = 0; k <= n; ++k)
        a[k] = NCGEN_ATAN2(a[k], b[k]);
    ncgen_enclosure_through(with, a, w->c);
    differentiate(n, w->c, own);
    for (int k = 0; k <= 2 * n; ++k)
        d[k] = 0;
    add_product(n, -1, square.c, own, d);
    differentiate(n, u->c, derivative);
    add_product(n, 1, v->c, derivative, d);
    differentiate(n, v->c, derivative);
    add_product(n, -1, u->c, derivative, d);
    const ncgen_scalar left = total(d, 0, 2 * n) + square.error * total(own, 0, n);
    w->error = left / low + (u->error + v->error) / NCGEN_SQRT(low) + with->rounding * total(w->c, 0, n);
    if (!(w->error < pi))
        between(with, -pi, pi, w);
}

static void take_size(const ncgen_enclosing *with, const ncgen_enclosure *u, ncgen_enclosure *w)
{
    if (least(with, u) > 0)
        scale(with, u, u->c[0] > 0 ? R(1.0) : R(-1.0), w);
    else
        between(with, 0, NCGEN_ABS(u->c[0]) + radius(with, u), w);
}

static void take_sign(const ncgen_enclosing *with, const ncgen_enclosure *u, ncgen_enclosure *w)
{
    if (least(with, u) > 0)
        ncgen_enclose_number(with, u->c[0] > 0 ? R(1.0) : R(-1.0), w);
    else
        between(with, -1, 1, w);
}

/* -- lookups ------------------------------------------------------------------------------------------------------------------------ */

/* The polynomial of one row, its origin first, by Horner's rule. */
static void along_row(const ncgen_enclosing *with, const ncgen_enclosure *u, const ncgen_scalar *row, int degree, ncgen_enclosure *w)
{
    ncgen_enclosure s = *u, product;
    s.c[0] -= row[0];
    s.error += with->rounding * (NCGEN_ABS(u->c[0]) + NCGEN_ABS(row[0]));
    ncgen_enclose_number(with, row[1 + degree], w);
    for (int k = degree; k > 0; --k) {
        multiply(with, w, &s, &product);
        *w = product;
        w->c[0] += row[k];
        w->error += with->rounding * NCGEN_ABS(row[k]);
    }
}

/* A table of polynomials: a piece begins at every knot, and one goes before the first, unless it repeats itself. */
typedef struct table {
    int count, degree;
    ncgen_scalar period;
    const ncgen_scalar *knots, *rows;
} table;

/* Widen low .. high to what the pieces are on the part from `from` to `to` of the table. */
static void widen(const ncgen_enclosing *with, const table *f, ncgen_scalar from, ncgen_scalar to, int *is_set, ncgen_scalar *low,
                  ncgen_scalar *high)
{
    for (int k = f->period > 0 ? 1 : 0; k < f->count + !(f->period > 0); ++k) {
        ncgen_enclosure part, here;
        const ncgen_scalar first = k > 0 ? largest(from, f->knots[k - 1]) : from;
        const ncgen_scalar last = k < f->count && to > f->knots[k] ? f->knots[k] : to;
        if (!(first <= last))
            continue;
        between(with, first, last, &part);
        along_row(with, &part, f->rows + (size_t)k * (size_t)(f->degree + 2), f->degree, &here);
        const ncgen_scalar off = radius(with, &here);
        *low = !*is_set || here.c[0] - off < *low ? here.c[0] - off : *low;
        *high = !*is_set || here.c[0] + off > *high ? here.c[0] + off : *high;
        *is_set = 1;
    }
}

/* pieces: how many knots, the degree, the period, the knots, the rows. Where it goes over a knot: between the bounds of the pieces there. */
static void lookup(const ncgen_enclosing *with, const ncgen_enclosure *u, const ncgen_scalar *pieces, ncgen_enclosure *w)
{
    const int count = (int)pieces[0];
    const table f = {count, (int)pieces[1], pieces[2], pieces + 3, pieces + 3 + count};
    const ncgen_scalar wide = radius(with, u), slack = with->rounding * (NCGEN_ABS(u->c[0]) + wide);
    ncgen_enclosure x = *u;
    ncgen_scalar low = 0, high = 0;
    int is_set = 0;
    if (f.period > 0)
        x.c[0] -= f.period * NCGEN_FLOOR((x.c[0] - f.knots[0]) / f.period);
    const ncgen_scalar from = x.c[0] - wide, to = x.c[0] + wide;
    for (int k = f.period > 0 ? 1 : 0; k < count + !(f.period > 0); ++k)
        if ((k == 0 || from >= f.knots[k - 1] - slack) && (k == count || to <= f.knots[k] + slack)) {
            along_row(with, &x, f.rows + (size_t)k * (size_t)(f.degree + 2), f.degree, w);
            return;
        }
    if (!(wide < NCGEN_UNBOUNDED)) {
        nothing_known(with, w);
        return;
    }
    for (int turn = f.period > 0 ? -1 : 0; turn <= (f.period > 0 ? 1 : 0); ++turn)
        widen(with, &f, from + (ncgen_scalar)turn * f.period, to + (ncgen_scalar)turn * f.period, &is_set, &low, &high);
    between(with, low, high, w);
}

void ncgen_enclose(const ncgen_enclosing *with, int operation, const ncgen_enclosure *u, const ncgen_enclosure *v,
                   const ncgen_scalar *pieces, ncgen_enclosure *w)
{
    switch (operation) {
    case NCGEN_FORMULA_ADD: add(with, u, 1, v, w); break;
    case NCGEN_FORMULA_SUBTRACT: add(with, u, -1, v, w); break;
    case NCGEN_FORMULA_MULTIPLY: multiply(with, u, v, w); break;
    case NCGEN_FORMULA_DIVIDE: divide(with, u, v, w); break;
    case NCGEN_FORMULA_NEGATE: scale(with, u, -1, w); break;
    case NCGEN_FORMULA_SQRT: take_root(with, u, w); break;
    case NCGEN_FORMULA_SIN: wave(with, u, 0, w); break;
    case NCGEN_FORMULA_COS: wave(with, u, 1, w); break;
    case NCGEN_FORMULA_EXP: exponential(with, u, w); break;
    case NCGEN_FORMULA_LOG: logarithm(with, u, w); break;
    case NCGEN_FORMULA_ATAN2: angle(with, u, v, w); break;
    case NCGEN_FORMULA_ABS: take_size(with, u, w); break;
    case NCGEN_FORMULA_SIGN: take_sign(with, u, w); break;
    case NCGEN_FORMULA_LOOKUP: lookup(with, u, pieces, w); break;
    default: nothing_known(with, w);
    }
    if (!(w->error < NCGEN_UNBOUNDED))
        nothing_known(with, w);
}
