/* ncgen_generic.c: the kernels in loops over the terms of a table. */
#include "ncgen_generic.h"

enum { MOST_SCALARS = 10, PHI = 0, NU, GAMMA, KINETIC, POTENTIAL, POWER, ALONG, HEAD = 4 };

/* A term that was read: its type, its row, where the linear forms of its scalars are, and what it contributes. */
typedef struct term {
    const ncgen_type *type;
    int row;
    const ncgen_real *forms[MOST_SCALARS];
    ncgen_real out[ALONG + MOST_SCALARS + MOST_SCALARS * MOST_SCALARS];
} term;

static const ncgen_real *constants_of(const ncgen_real *at, const ncgen_type *type, const ncgen_real **forms)
{
    at += 2;
    for (int k = 0; k < type->n_scalars; ++k) {
        forms[k] = at;
        at += 2 + 2 * (int)at[1];
    }
    return at;
}

/* The term at a place of the table, evaluated; returns the place of the next one. qd: NULL for rates of zero */
static const ncgen_real *evaluate(const ncgen_real *at, ncgen_real t, const ncgen_real *q, const ncgen_real *qd, term *it)
{
    ncgen_real x[MOST_SCALARS], v[MOST_SCALARS];
    it->type = ncgen_types + (int)at[0];
    it->row = (int)at[1];
    const ncgen_real *data = constants_of(at, it->type, it->forms);
    for (int k = 0; k < it->type->n_scalars; ++k) {
        const ncgen_real *form = it->forms[k];
        x[k] = form[0];
        v[k] = 0;
        for (int i = 0; i < (int)form[1]; ++i) {
            const int place = (int)form[3 + 2 * i];
            x[k] += form[2 + 2 * i] * q[place];
            v[k] += qd ? form[2 + 2 * i] * qd[place] : 0;
        }
    }
    it->type->evaluate(t, x, v, data, it->out);
    return data + it->type->n_data;
}

static const ncgen_real *skip(const ncgen_real *at)
{
    const ncgen_real *forms[MOST_SCALARS];
    const ncgen_type *type = ncgen_types + (int)at[0];
    return constants_of(at, type, forms) + type->n_data;
}

/* Behind the terms of the rows. */
static const ncgen_real *others(const ncgen_real *table)
{
    const ncgen_real *at = table + HEAD;
    for (int k = 0; k < (int)table[3]; ++k)
        at = skip(at);
    return at;
}

static void clear(long count, ncgen_real *out)
{
    for (long i = 0; i < count; ++i)
        out[i] = 0;
}

/* out += what a term has along its scalars, by the chain rule. */
static void add_along(const term *it, ncgen_real *out)
{
    for (int k = 0; k < it->type->n_scalars; ++k)
        for (int i = 0; i < (int)it->forms[k][1]; ++i)
            out[(int)it->forms[k][3 + 2 * i]] += it->forms[k][2 + 2 * i] * it->out[ALONG + k];
}

/* One number of every term of the rows. */
static int by_row(ncgen_real t, const ncgen_real *q, const ncgen_real *qd, const ncgen_real *table, int which, ncgen_real *out)
{
    const ncgen_real *at = table + HEAD;
    term it;
    clear((long)table[1], out);
    for (int k = 0; k < (int)table[3]; ++k) {
        at = evaluate(at, t, q, qd, &it);
        out[it.row] += it.out[which];
    }
    return NCGEN_OK;
}

int ncgen_generic_phi(ncgen_real t, const ncgen_real *q, const ncgen_real *table, ncgen_real *phi)
{
    return by_row(t, q, NULL, table, PHI, phi);
}

int ncgen_generic_nu(ncgen_real t, const ncgen_real *q, const ncgen_real *table, ncgen_real *nu)
{
    return by_row(t, q, NULL, table, NU, nu);
}

int ncgen_generic_gamma(ncgen_real t, const ncgen_real *q, const ncgen_real *qd, const ncgen_real *table, ncgen_real *gamma)
{
    return by_row(t, q, qd, table, GAMMA, gamma);
}

int ncgen_generic_phi_q(ncgen_real t, const ncgen_real *q, const ncgen_real *table, ncgen_real *phi_q)
{
    const ncgen_real *at = table + HEAD;
    const int n = (int)table[0];
    term it;
    clear((long)table[0] * (long)table[1], phi_q);
    for (int k = 0; k < (int)table[3]; ++k) {
        at = evaluate(at, t, q, NULL, &it);
        add_along(&it, phi_q + (size_t)it.row * (size_t)n);
    }
    return NCGEN_OK;
}

/* mass += what a term has between all pairs of its scalars. */
static void add_mass(const term *it, int n, ncgen_real *mass)
{
    const int count = it->type->n_scalars;
    const ncgen_real *between = it->out + ALONG + count;
    for (int k = 0; k < count; ++k)
        for (int i = 0; i < (int)it->forms[k][1]; ++i)
            for (int l = 0; l < count; ++l)
                for (int j = 0; j < (int)it->forms[l][1]; ++j)
                    mass[(size_t)it->forms[k][3 + 2 * i] * (size_t)n + (size_t)it->forms[l][3 + 2 * j]] +=
                        it->forms[k][2 + 2 * i] * it->forms[l][2 + 2 * j] * between[k * count + l];
}

int ncgen_generic_mass(ncgen_real t, const ncgen_real *q, const ncgen_real *table, ncgen_real *mass)
{
    const ncgen_real *at = others(table);
    const int n = (int)table[0];
    term it;
    clear((long)n * n, mass);
    for (int k = (int)table[3]; k < (int)table[2]; ++k)
        if (ncgen_types[(int)at[0]].has_mass) {
            at = evaluate(at, t, q, NULL, &it);
            add_mass(&it, n, mass);
        } else {
            at = skip(at);
        }
    return NCGEN_OK;
}

int ncgen_generic_force(ncgen_real t, const ncgen_real *q, const ncgen_real *qd, const ncgen_real *table, ncgen_real *force)
{
    const ncgen_real *at = others(table);
    term it;
    clear((long)table[0], force);
    for (int k = (int)table[3]; k < (int)table[2]; ++k) {
        at = evaluate(at, t, q, qd, &it);
        add_along(&it, force);
    }
    return NCGEN_OK;
}

int ncgen_generic_energy(ncgen_real t, const ncgen_real *q, const ncgen_real *qd, const ncgen_real *table, ncgen_real *energy)
{
    const ncgen_real *at = others(table);
    term it;
    clear(3, energy);
    for (int k = (int)table[3]; k < (int)table[2]; ++k) {
        at = evaluate(at, t, q, qd, &it);
        for (int i = 0; i < 3; ++i)
            energy[i] += it.out[KINETIC + i];
    }
    return NCGEN_OK;
}

/* Is a number a whole one from `least` to below `end`? */
static int is_whole(ncgen_real x, long least, long end)
{
    return x >= (ncgen_real)least && x < (ncgen_real)end && x == (ncgen_real)(long)x;
}

/* The length of a term, of which `rest` numbers are there; 0 where it is not a term. */
static long length_of(const ncgen_real *at, long rest, int n, int m, int is_row)
{
    if (rest < 2 || !is_whole(at[0], 0, ncgen_n_types) || !(is_row ? is_whole(at[1], 0, m) : at[1] == -1))
        return 0;
    const ncgen_type *type = ncgen_types + (int)at[0];
    long used = 2;
    for (int k = 0; k < type->n_scalars; ++k) {
        if (used + 2 > rest || !is_whole(at[used + 1], 0, (rest - used) / 2))
            return 0;
        const int pairs = (int)at[used + 1];
        for (int i = 0; i < pairs; ++i)
            if (!is_whole(at[used + 3 + 2 * i], 0, n))
                return 0;
        used += 2 + 2 * pairs;
    }
    return used + type->n_data <= rest ? used + type->n_data : 0;
}

int ncgen_generic_is_table(const ncgen_real *table, long length)
{
    const long most = 10000;
    if (length < HEAD || !is_whole(table[0], 0, most) || !is_whole(table[1], 0, most) || !is_whole(table[2], 0, length) ||
        !is_whole(table[3], 0, (long)table[2] + 1))
        return 0;
    long used = HEAD;
    for (int k = 0; k < (int)table[2]; ++k) {
        const long own = length_of(table + used, length - used, (int)table[0], (int)table[1], k < (int)table[3]);
        if (!own)
            return 0;
        used += own;
    }
    return used == length;
}

/* A dense pattern; returns the integers behind it. */
static int *fill_pattern(int rows, int columns, int *integers, ncgen_pattern *pattern)
{
    int *indices = integers + rows + 1;
    for (int i = 0; i <= rows; ++i)
        integers[i] = i * columns;
    for (int i = 0; i < rows * columns; ++i)
        indices[i] = i % columns;
    *pattern = (ncgen_pattern){rows, columns, integers, indices};
    return indices + rows * columns;
}

void ncgen_generic_describe(const ncgen_real *table, int *integers, ncgen_model *model)
{
    const int n = (int)table[0], m = (int)table[1];
    *model = (ncgen_model){
        .abi_version = NCGEN_ABI_VERSION,
        .struct_size = (unsigned)sizeof(ncgen_model),
        .real_size = (unsigned)sizeof(ncgen_real),
        .name = "table",
        .fingerprint = "",
        .n_coordinates = n,
        .n_rows = m,
        .phi = ncgen_generic_phi,
        .phi_q = ncgen_generic_phi_q,
        .nu = ncgen_generic_nu,
        .gamma = ncgen_generic_gamma,
        .mass = ncgen_generic_mass,
        .force = ncgen_generic_force,
        .energy = ncgen_generic_energy,
    };
    integers = fill_pattern(m, n, integers, &model->phi_q_pattern);
    fill_pattern(n, n, integers, &model->mass_pattern);
}
