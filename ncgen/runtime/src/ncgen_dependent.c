/* ncgen_dependent.c: elimination of the dependent coordinates of a choice. */
#include "ncgen_dependent.h"
#include "ncgen_lu.h"

/* Two negative eigenvalues of B add more than this to the trace of 1 - B. */
static const ncgen_scalar two_negative = R(1.5);

/* As long as 1 - B changes a probe by less than this share, it has no eigenvalue beyond 1: then the mean change would be 1. */
static const ncgen_scalar small_change = R(0.2);

/* The dependent columns of a choice over its kept rows, from the nonzeros of Phi_q. */
static void write_columns(const ncgen_run *r, const ncgen_dependent *w, const ncgen_partition *d, ncgen_real *matrix)
{
    const ncgen_pattern *pattern = &r->model->phi_q_pattern;
    const int size = d->n_dependent;
    for (int i = 0; i < size; ++i) {
        ncgen_real *row = matrix + (size_t)i * (size_t)size, *full = w->full;
        for (int c = 0; c < r->n; ++c)
            full[c] = 0;
        for (int k = pattern->indptr[d->rows[i]]; k < pattern->indptr[d->rows[i] + 1]; ++k)
            full[pattern->indices[k]] = w->jacobian[k];
        for (int c = 0; c < size; ++c)
            row[c] = full[d->dependent[c]];
    }
}

/* Are the columns B here so near to those at the start, A, that A^-1 B has no negative eigenvalue? What it makes of one vector whose numbers
 * are all about as large tells it. */
static int is_near_start(const ncgen_run *r, const ncgen_dependent *w, const ncgen_choice *choice)
{
    const ncgen_partition *d = &choice->of;
    const ncgen_scalar *sizes = r->dynamics->column_sizes;
    const int size = d->n_dependent;
    ncgen_real *probe = w->full, *right = w->columns, *x = w->columns + size, change = 0;
    for (int i = 0; i < r->n; ++i)
        probe[i] = 0;
    for (int i = 0; i < size; ++i)
        probe[d->dependent[i]] = sizes[d->dependent[i]] * (i % 2 ? -1 - (ncgen_scalar)(i % 7) / 7 : 1 + (ncgen_scalar)(i % 5) / 5);
    for (int i = 0; i < size; ++i)
        right[i] = ncgen_row_times(&r->model->phi_q_pattern, w->jacobian, probe, d->rows[i]);
    ncgen_lu_solve(size, choice->start_lu, choice->start_order, right, x);
    for (int i = 0; i < size; ++i) {
        const ncgen_real moved = (x[i] - probe[d->dependent[i]]) / sizes[d->dependent[i]];
        change += moved * moved;
    }
    return change < small_change * small_change;
}

/* A^-1 B in w->columns, for the columns A at the start of the step and B here. */
static void divide_by_start(const ncgen_run *r, const ncgen_dependent *w, const ncgen_choice *choice)
{
    const int size = choice->of.n_dependent;
    ncgen_real *right = w->full, *x = w->solution;
    write_columns(r, w, &choice->of, w->columns);
    for (int c = 0; c < size; ++c) {
        ncgen_real *column = w->columns + c;
        for (int i = 0; i < size; ++i)
            right[i] = column[(size_t)i * (size_t)size];
        ncgen_lu_solve(size, choice->start_lu, choice->start_order, right, x);
        for (int i = 0; i < size; ++i)
            column[(size_t)i * (size_t)size] = x[i];
    }
}

/* Is the position whose columns have been factored beyond one where several singular values of them vanish at once, perhaps on another branch?
 *
 * Where one passes 0 the determinant changes its sign, but where several do that tells nothing. With the columns A at the start of the step and
 * B here, A + s (B - A) is singular for an s between 0 and 1 where A^-1 B has a negative eigenvalue e. Those that do not pass 0 are near 1, or
 * come nearer to 0: for them 0 <= (1 - e)^2 <= 1 - e, so if the sum of the squares is larger one has passed. */
int ncgen_dependent_has_passed(const ncgen_run *r, const ncgen_dependent *w, const ncgen_choice *choice)
{
    const int size = choice->of.n_dependent;
    if (choice->orientation == 0 || !choice->has_start || is_near_start(r, w, choice))
        return 0;
    divide_by_start(r, w, choice);
    ncgen_real sum = 0, squares = 0;
    for (int i = 0; i < size; ++i)
        w->columns[(size_t)i * (size_t)(size + 1)] -= 1;
    for (int i = 0; i < size; ++i) {
        sum -= w->columns[(size_t)i * (size_t)(size + 1)];
        for (int j = 0; j < size; ++j)
            squares += w->columns[(size_t)i * (size_t)size + (size_t)j] * w->columns[(size_t)j * (size_t)size + (size_t)i];
    }
    return !(sum < two_negative || squares <= sum);
}

/* What later positions of the step that begins are compared with: the columns that have been factored. */
void ncgen_dependent_note_start(const ncgen_dependent *w, ncgen_choice *choice)
{
    const int size = choice->of.n_dependent;
    choice->has_start = choice->orientation != 0;
    if (choice->first_orientation == 0)
        choice->first_orientation = choice->orientation;
    if (!choice->has_start)
        return;
    ncgen_copy(size * size, w->lu, choice->start_lu);
    for (int i = 0; i < size; ++i)
        choice->start_order[i] = w->order[i];
}

/* Phi_q at (t, q), and the factors of the dependent columns of a choice over its kept rows. Where their determinant has another sign than at the
 * start they have been singular in between. */
int ncgen_dependent_factor(ncgen_run *r, ncgen_dependent *w, ncgen_scalar t, ncgen_choice *choice)
{
    int status = ncgen_phi_q(r, t, r->q, w->jacobian);
    w->factored = &choice->of;
    choice->orientation = 0;
    if (status != NCGEN_OK)
        return status;
    write_columns(r, w, &choice->of, w->lu);
    status = ncgen_lu_factor(choice->of.n_dependent, w->lu, w->order, &choice->orientation);
    if (status != NCGEN_OK)
        choice->orientation = 0;
    choice->has_turned = choice->orientation * choice->first_orientation < 0;
    return status;
}

/* x of A x = right over kept rows; right is indexed like the model's rows. */
void ncgen_dependent_solve(const ncgen_dependent *w, const ncgen_real *right, ncgen_real *x)
{
    const int size = w->factored->n_dependent;
    for (int i = 0; i < size; ++i) {
        const ncgen_real *row = w->lu + (size_t)i * (size_t)size;
        ncgen_real sum = right[w->factored->rows[w->order[i]]];
        for (int c = 0; c < i; ++c)
            sum -= row[c] * x[c];
        x[i] = sum;
    }
    for (int i = size - 1; i >= 0; --i) {
        const ncgen_real *row = w->lu + (size_t)i * (size_t)size;
        for (int c = i + 1; c < size; ++c)
            x[i] -= row[c] * x[c];
        x[i] /= row[i];
    }
}

/* lam of A' lam = right over the dependent coordinates, written to the model's rows; rows that are not kept get zero. */
void ncgen_dependent_multipliers(const ncgen_run *r, const ncgen_dependent *w, const ncgen_real *right, ncgen_real *lam)
{
    const int size = w->factored->n_dependent;
    ncgen_real *x = w->solution;
    for (int i = 0; i < size; ++i) {
        ncgen_real sum = right[w->factored->dependent[i]];
        for (int c = 0; c < i; ++c)
            sum -= w->lu[(size_t)c * (size_t)size + (size_t)i] * x[c];
        x[i] = sum / w->lu[(size_t)i * (size_t)size + (size_t)i];
    }
    for (int i = size - 1; i >= 0; --i)
        for (int c = i + 1; c < size; ++c)
            x[i] -= w->lu[(size_t)c * (size_t)size + (size_t)i] * x[c];
    for (int i = 0; i < r->model->n_rows; ++i)
        lam[i] = 0;
    for (int i = 0; i < size; ++i)
        lam[w->factored->rows[w->order[i]]] = x[i];
}

/* For at most d dependent coordinates. */
void ncgen_dependent_layout(ncgen_run *r, ncgen_dependent *w, int d)
{
    ncgen_space *space = &r->space;
    w->jacobian = ncgen_take(space, ncgen_nonzeros(&r->model->phi_q_pattern));
    w->lu = ncgen_take(space, d * d);
    w->columns = ncgen_take(space, d > 1 ? d * d : 2);
    w->full = ncgen_take(space, r->n);
    w->solution = ncgen_take(space, d);
    w->order = r->integers;
}

/* The number of a choice among those of a run, each with room for d dependent coordinates. */
void ncgen_dependent_start_layout(ncgen_run *r, ncgen_choice *choice, int number, int d)
{
    choice->start_order = r->integers ? r->integers + r->n + number * r->m : NULL;
    choice->start_lu = ncgen_take(&r->space, d * d);
}

void ncgen_dependent_begin(ncgen_choice *choice)
{
    choice->amplification = 0;
    choice->orientation = choice->first_orientation = choice->has_start = choice->has_turned = 0;
}
