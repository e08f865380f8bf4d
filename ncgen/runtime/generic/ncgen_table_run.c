/* ncgen_table_run.c: one mechanism of a table, its plan of elimination, and its motion from call to call. */
#include "ncgen_table_run.h"
#include "ncgen_driven.h"
#include "ncgen_math.h"

enum { MOST_NUMBERS = 1 << 16, MOST = 240, MOST_PATTERN = 4 * MOST * MOST, MOST_WORKSPACE = 1 << 19 };

/* Pivots below this share of the first one count as zero. */
static const ncgen_scalar RANK_TOLERANCE = 1e-9;

static ncgen_real numbers[MOST_NUMBERS], state[5 * MOST + 4], workspace[MOST_WORKSPACE], square[MOST * MOST];
static ncgen_scalar row_sizes[MOST];
static int pattern[MOST_PATTERN], integers[7 * MOST];
static unsigned char filled[MOST * MOST];
static int order[MOST], row_start[MOST + 1], column_start[MOST + 1], entry_start[MOST + 1];
static int row_columns[MOST * MOST], row_positions[MOST * MOST], column_rows[MOST * MOST], entry_columns[MOST * MOST], entry_values[MOST * MOST];
static ncgen_model model;
static ncgen_elimination plan;
static ncgen_dynamics dynamics;
static ncgen_options options;
static ncgen_statistics statistics;
static ncgen_moment moment;
static int rank;
static const ncgen_driven driven = {&model, &dynamics, &options, workspace, integers};

int ncgen_table_most_numbers(void)
{
    return MOST_NUMBERS;
}

int ncgen_table_most_unknowns(void)
{
    return MOST;
}

ncgen_real *ncgen_table_numbers(void)
{
    return numbers;
}

ncgen_real *ncgen_table_state(void)
{
    return state;
}

int ncgen_table_rank(void)
{
    return rank;
}

/* The rank of rows x columns numbers in `square`, which are overwritten: by elimination from the largest of all, whose row is zero then. */
static int rank_of(int rows, int columns)
{
    ncgen_real first = 0;
    for (int k = 0; k < rows; ++k) {
        int best = 0;
        for (int i = 0; i < rows * columns; ++i)
            best = NCGEN_ABS(square[i]) > NCGEN_ABS(square[best]) ? i : best;
        const int row = best / columns, column = best % columns;
        const ncgen_real pivot = square[best];
        first = k ? first : NCGEN_ABS(pivot);
        if (!(NCGEN_ABS(pivot) > RANK_TOLERANCE * first))
            return k;
        for (int i = 0; i < rows; ++i) {
            const ncgen_real share = square[i * columns + column] / pivot;
            for (int j = 0; j < columns && i != row; ++j)
                square[i * columns + j] -= share * square[row * columns + j];
        }
        for (int j = 0; j < columns; ++j)
            square[row * columns + j] = 0;
    }
    return rows;
}

/* Sizes of the rows, and their rank: what rows change by when coordinates move by their sizes. */
static void find_rows(ncgen_scalar t)
{
    const int n = model.n_coordinates, m = model.n_rows;
    const ncgen_real *sizes = state + 4 * MOST;
    ncgen_generic_phi_q(t, state, numbers, square);
    for (int i = 0; i < m; ++i) {
        ncgen_real sum = 0;
        for (int j = 0; j < n; ++j) {
            square[i * n + j] *= sizes[j];
            sum += square[i * n + j] * square[i * n + j];
        }
        row_sizes[i] = sum > 0 ? NCGEN_SQRT(sum) : 1;
        for (int j = 0; j < n; ++j)
            square[i * n + j] /= row_sizes[i];
    }
    rank = rank_of(m, n);
}

/* Has every motion of the coordinates inertia? */
static int is_definite(ncgen_scalar t)
{
    const int n = model.n_coordinates;
    ncgen_generic_mass(t, state, numbers, square);
    return rank_of(n, n) == n;
}

/* The order of unknowns: coordinates with mass, rows, coordinates without; the mass matrix is in `square`. */
static void find_order(void)
{
    const int n = model.n_coordinates;
    int place = 0;
    for (int i = 0; i < n + model.n_rows; ++i)
        if (i >= n || square[i * n + i] != 0)
            order[place++] = i;
    for (int i = 0; i < n; ++i)
        if (square[i * n + i] == 0)
            order[place++] = i;
}

/* Where the value of a pair of unknowns is in the list [mass, phi_q]; -1: the pair has none. */
static int value_of(int a, int b)
{
    const int n = model.n_coordinates, low = a < b ? a : b, high = a < b ? b : a;
    return high < n ? high * n + low : low < n ? n * n + (high - n) * n + low : -1;
}

/* What is left of the matrix after every step of the elimination. */
static void fill_in(int size)
{
    for (int k = 0; k < size; ++k)
        for (int i = k + 1; i < size; ++i)
            for (int j = k + 1; filled[i * MOST + k] && j <= i; ++j)
                filled[i * MOST + j] |= filled[j * MOST + k];
}

/* Which pairs of unknowns have a number, from the numbers at the start and the layout of rows. */
static void find_filled(ncgen_scalar t)
{
    const int n = model.n_coordinates, size = n + model.n_rows;
    ncgen_generic_mass(t, state, numbers, square);
    find_order();
    for (int i = 0; i < size; ++i)
        for (int j = 0; j <= i; ++j) {
            const int a = order[i], b = order[j];
            filled[i * MOST + j] = a < n && b < n ? square[a * n + b] != 0 || square[b * n + a] != 0 : (a < n) != (b < n);
        }
}

/* The plan by which [A Phi_q'; Phi_q -E] is factored: as far as coordinates and rows are concerned in their own order. */
static void make_plan(ncgen_scalar t)
{
    const int size = model.n_coordinates + model.n_rows;
    int entries = 0, places = 0;
    find_filled(t);
    for (int i = 0; i < size; ++i) {
        entry_start[i] = entries;
        for (int j = 0; j <= i; ++j)
            if (filled[i * MOST + j]) {
                entry_columns[entries] = j;
                entry_values[entries++] = value_of(order[i], order[j]);
            }
    }
    entry_start[size] = entries;
    fill_in(size);
    for (int k = 0; k < size; ++k) {
        column_start[k] = places;
        for (int i = k + 1; i < size; ++i)
            if (filled[i * MOST + k])
                column_rows[places++] = i;
    }
    column_start[size] = places;
    int used = 0, next[MOST];
    for (int k = 0; k < size; ++k)
        next[k] = column_start[k];
    for (int i = 0; i < size; ++i) {
        row_start[i] = used;
        for (int j = 0; j < i; ++j)
            if (filled[i * MOST + j]) {
                row_columns[used] = j;
                row_positions[used++] = next[j]++;
            }
    }
    row_start[size] = used;
    plan = (ncgen_elimination){size,         places,      order,       row_start,     row_columns, row_positions,
                               column_start, column_rows, entry_start, entry_columns, entry_values};
}

/* Energies and multipliers of the moment. */
static int look(void)
{
    ncgen_real *energies = state + 5 * MOST;
    const int status = ncgen_multipliers(&driven, numbers, &moment, state + 3 * MOST);
    ncgen_generic_energy(moment.t, moment.q, moment.qd, numbers, energies);
    energies[2] = moment.power;
    energies[3] = moment.work;
    return status;
}

int ncgen_table_project_state(void)
{
    const int status = ncgen_project_moment(&driven, numbers, &moment);
    moment.h = 0;
    return status == NCGEN_OK ? look() : status;
}

/* Is there a position on all constraints so far from the present one, which stays as it is? */
static int is_consistent_nearby(ncgen_scalar share)
{
    const int n = model.n_coordinates;
    for (int i = 0; i < n; ++i) {
        square[i] = state[i];
        square[n + i] = state[MOST + i];
        state[i] += share * state[4 * MOST + i] * NCGEN_COS((ncgen_real)(i + 1));
    }
    const int status = ncgen_project_moment(&driven, numbers, &moment);
    for (int i = 0; i < n; ++i) {
        state[i] = square[i];
        state[MOST + i] = square[n + i];
    }
    return status == NCGEN_OK;
}

/* Do the other rows imply those that are left out? At a singular position there are some that are not: nearby they cannot be met. */
static int is_implied(void)
{
    return is_consistent_nearby(0.02) || is_consistent_nearby(0.002);
}

int ncgen_table_begin(int length, ncgen_scalar t, ncgen_scalar rtol, ncgen_scalar atol)
{
    if (length < 0 || length > MOST_NUMBERS || !ncgen_generic_is_table(numbers, length))
        return NCGEN_ARGUMENT;
    if (numbers[0] + numbers[1] > MOST || !(numbers[0] > 0))
        return NCGEN_ARGUMENT;
    ncgen_generic_describe(numbers, pattern, &model);
    find_rows(t);
    const int singular = !is_definite(t);
    make_plan(t);
    dynamics = (ncgen_dynamics){.n_dependent = rank < model.n_rows ? rank : 0,
                                .column_sizes = state + 4 * MOST,
                                .row_sizes = row_sizes,
                                .elimination = &plan,
                                .singular_mass = singular};
    options = (ncgen_options){.method = NCGEN_DOP853,
                              .rtol = rtol,
                              .atol = atol,
                              .sizes = NULL,
                              .tolerance = 1e-12,
                              .max_steps = 20000,
                              .formalism = NCGEN_LAGRANGE,
                              .project = 1,
                              .attempts_left = 1};
    moment = (ncgen_moment){.t = t, .q = state, .qd = state + MOST, .qdd = state + 2 * MOST};
    if (ncgen_driven_workspace(&driven) > MOST_WORKSPACE)
        return NCGEN_ARGUMENT;
    const int status = ncgen_table_project_state();
    return status == NCGEN_OK && rank < model.n_rows ? (is_implied() ? ncgen_table_project_state() : NCGEN_SINGULAR) : status;
}

int ncgen_table_advance(ncgen_scalar t_end)
{
    const int status = ncgen_advance(&driven, numbers, &moment, t_end, &statistics);
    return status == NCGEN_OK ? look() : status;
}
