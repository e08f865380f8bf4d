/* ncgen_reduced.c: the Jacobian of an implicit method in the degrees of freedom of a tree of bodies, over all coordinates.
 *
 * The recursion measures the velocities of joints from those of all coordinates, and forces see nothing else of them: near the velocities
 * that the constraints allow nothing is stiff, and Newton's method needs the change of accelerations along these alone. Differences are exact
 * to half of the digits, which costs Newton's method no iteration, and they need no
 * kernels but those of the motion. A basis of the allowed velocities comes from random vectors, projected by the recursion, by Gaussian
 * elimination with full pivoting: the rows of its pivots are coordinates that are independent here.
 *
 * In loops over tables the unknowns are the velocities of all joints of the tree, whether loops allow them or not. Accelerations are
 * those that loops allow at any velocities, and a damper sees the velocity of its own joint as it is. In the basis of what loops allow, a
 * damper would see how that basis turns within a step, times its own stiffness. A column moves one joint and costs one pass; what the joints
 * have of a change is measured by another one, and where all are measured it is read.
 */
#include "ncgen_reduced.h"
#include "ncgen_constrained.h"

int ncgen_reduced_count(const ncgen_run *r)
{
    const int joints = ncgen_recursive_joints(r);
    return joints ? joints : ncgen_degrees_of_freedom(r);
}

void ncgen_reduced_layout(ncgen_run *r, ncgen_reduced *w, int *integers)
{
    w->is_of_joints = ncgen_recursive_joints(r) > 0;
    w->count = ncgen_reduced_count(r);
    w->basis = ncgen_take(&r->space, w->is_of_joints ? r->n : r->n * w->count);
    w->q = ncgen_take(&r->space, r->n);
    w->driven = ncgen_take(&r->space, w->count);
    w->state = ncgen_take(&r->space, r->ny);
    w->base = ncgen_take(&r->space, r->ny);
    w->rates = ncgen_take(&r->space, r->ny);
    w->chosen = integers;
    w->index = integers ? integers + r->n : NULL;
}

/* The basis ---------------------------------------------------------------------------------------------------- */

/* Velocities that the constraints allow, one a column, without what drivers add to them. */
static void find_allowed(ncgen_run *r, ncgen_reduced *w, ncgen_scalar t)
{
    const int n = r->n;
    const ncgen_scalar *sizes = r->dynamics->column_sizes;
    ncgen_real *given = w->state, *allowed = w->rates, *driven = w->base;
    unsigned seed = 1;
    for (int i = 0; i < n; ++i)
        given[i] = driven[n + i] = 0;
    if (r->model->nu)
        ncgen_recursive_velocities(r, t, w->q, given, driven);
    for (int k = 0; k < w->count; ++k) {
        for (int i = 0; i < n; ++i)
            given[i] = ncgen_next_random(&seed) * sizes[i];
        ncgen_recursive_velocities(r, t, w->q, given, allowed);
        for (int i = 0; i < n; ++i)
            w->basis[k * n + i] = allowed[n + i] - driven[n + i];
    }
}

/* The largest entry, in natural sizes, of a column of the basis in a row that is not chosen. */
static ncgen_real largest_entry(const ncgen_run *r, const ncgen_reduced *w, int column, int *row)
{
    ncgen_real largest = 0;
    for (int i = 0; i < r->n; ++i) {
        const ncgen_real size = NCGEN_ABS(w->basis[column * r->n + i]) / r->dynamics->column_sizes[i];
        if (w->index[i] < 0 && size > largest) {
            largest = size;
            *row = i;
        }
    }
    return largest;
}

static void exchange(const ncgen_run *r, ncgen_reduced *w, int a, int b)
{
    for (int i = 0; i < r->n; ++i) {
        const ncgen_real kept = w->basis[a * r->n + i];
        w->basis[a * r->n + i] = w->basis[b * r->n + i];
        w->basis[b * r->n + i] = kept;
    }
}

/* Gauss-Jordan elimination: column k becomes 1 in its own row and all others 0 there. Columns that those before them imply are left out. */
static void eliminate(const ncgen_run *r, ncgen_reduced *w)
{
    const int n = r->n;
    const ncgen_scalar nothing = NCGEN_SQRT(r->rounding);
    for (int i = 0; i < n; ++i)
        w->index[i] = -1;
    for (int k = 0; k < w->count; ++k) {
        int best = k, row = 0, other = 0;
        ncgen_real largest = 0;
        for (int j = k; j < w->count; ++j) {
            const ncgen_real entry = largest_entry(r, w, j, &other);
            if (entry > largest) {
                largest = entry;
                best = j;
                row = other;
            }
        }
        if (!(largest > nothing)) {
            w->count = k;
            return;
        }
        exchange(r, w, k, best);
        w->chosen[k] = row;
        w->index[row] = k;
        ncgen_real *own = w->basis + k * n;
        const ncgen_real pivot = own[row];
        for (int i = 0; i < n; ++i)
            own[i] /= pivot;
        for (int j = 0; j < w->count; ++j) {
            const ncgen_real share = w->basis[j * n + row];
            for (int i = 0; i < n && j != k && (share > 0 || share < 0); ++i)
                w->basis[j * n + i] -= share * own[i];
        }
    }
}

void ncgen_reduced_measure(ncgen_run *r, const ncgen_reduced *w, const ncgen_real *velocities, ncgen_real *chosen)
{
    ncgen_real *seen = r->constrained->emitted;
    if (w->is_of_joints) {
        ncgen_recursive_measure(r, velocities, chosen);
        return;
    }
    ncgen_recursive_derivative(r, w->t, w->q, velocities, seen);
    for (int k = 0; k < w->count; ++k)
        chosen[k] = seen[r->n + w->chosen[k]] - w->driven[k];
}

void ncgen_reduced_measure_positions(ncgen_run *r, const ncgen_reduced *w, const ncgen_real *change, ncgen_real *chosen)
{
    if (w->is_of_joints)
        ncgen_recursive_measure(r, change, chosen);
    for (int k = 0; !w->is_of_joints && k < w->count; ++k)
        chosen[k] = change[w->chosen[k]];
}

void ncgen_reduced_add(ncgen_run *r, const ncgen_reduced *w, const ncgen_real *chosen, ncgen_real *velocities)
{
    const ncgen_real *moved = w->is_of_joints ? ncgen_recursive_along(r, chosen) : NULL;
    for (int i = 0; moved && i < r->n; ++i)
        velocities[i] += moved[i];
    for (int k = 0; !moved && k < w->count; ++k) {
        const ncgen_real *NCGEN_RESTRICT column = w->basis + (size_t)k * (size_t)r->n, amount = chosen[k];
        for (int i = 0; i < r->n; ++i)
            velocities[i] += amount * column[i];
    }
}

/* What the derivative sees at rest: the drivers' part, which is not that of the projected velocities. */
static void find_driven(ncgen_run *r, ncgen_reduced *w)
{
    for (int k = 0; k < w->count; ++k)
        w->driven[k] = 0;
    if (!r->model->nu || w->is_of_joints)
        return;
    for (int i = 0; i < r->n; ++i)
        w->state[i] = 0;
    ncgen_reduced_measure(r, w, w->state, w->driven);
}

/* Differences -------------------------------------------------------------------------------------------------- */

/* Column k of the basis. */
static const ncgen_real *find_move(ncgen_run *r, ncgen_reduced *w, int k)
{
    if (!w->is_of_joints)
        return w->basis + (size_t)k * (size_t)r->n;
    for (int i = 0; i < w->count; ++i)
        w->driven[i] = i == k ? 1 : 0;
    ncgen_copy(r->n, ncgen_recursive_along(r, w->driven), w->basis);
    return w->basis;
}

/* A column of the Jacobian: the change of the chosen accelerations where the part of y from `first` on moves along column k of the basis,
 * over the length of the move; `size` is the size of that part, in natural sizes. */
static int find_column(ncgen_run *r, ncgen_reduced *w, ncgen_scalar t, const ncgen_real *y, int first, int k, ncgen_real size,
                       ncgen_real *column)
{
    const int n = r->n;
    const ncgen_real *move = find_move(r, w, k);
    const ncgen_real length = NCGEN_SQRT(r->rounding) * size / ncgen_constrained_size(r, move);
    ncgen_copy(r->ny, y, w->state);
    for (int i = 0; i < n; ++i)
        w->state[first + i] += length * move[i];
    const int status = r->derivative(r, t, w->state, w->rates);
    for (int i = 0; i < n; ++i)
        w->rates[i] = (w->rates[i] - w->base[i]) / length;
    ncgen_reduced_measure_positions(r, w, w->rates, w->driven);
    for (int i = 0; i < w->count; ++i)
        column[2 * i * w->count] = w->driven[i];
    return status;
}

int ncgen_reduced_jacobian(ncgen_run *r, ncgen_reduced *w, ncgen_scalar t, const ncgen_real *y, ncgen_real *jacobian)
{
    const int n = r->n;
    w->count = ncgen_reduced_count(r);
    w->t = t;
    ncgen_copy(n, y + n, w->q);
    if (!w->is_of_joints) {
        find_allowed(r, w, t);
        eliminate(r, w);
    }
    ncgen_copy(r->ny, y, w->state);
    int status = r->derivative(r, t, w->state, w->base);
    /* Positions are of size 1; velocities change on the time scale that accelerations have at this size. */
    const ncgen_real speed = ncgen_constrained_size(r, y), fall = NCGEN_SQRT(ncgen_constrained_size(r, w->base));
    const ncgen_real velocity = speed > fall ? speed : fall;
    for (int k = 0; k < w->count && status == NCGEN_OK; ++k)
        status = find_column(r, w, t, y, 0, k, velocity > 0 ? velocity : 1, jacobian + k);
    for (int k = 0; k < w->count && status == NCGEN_OK; ++k)
        status = find_column(r, w, t, y, n, k, 1, jacobian + w->count + k);
    find_driven(r, w);
    ncgen_copy(n, y, r->qd);
    ncgen_copy(n, y + n, r->q);
    return status;
}
