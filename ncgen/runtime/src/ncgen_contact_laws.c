/* ncgen_contact_laws.c: impulses of contacts that obey the laws of impact.
 *
 * What sticks, slides and opens is tried, or determined by projections in turn where that would be too much; then impulses follow from linear
 * equations, those of least energy where they are not determined.
 */
#include "ncgen_contact_laws.h"
#include "ncgen_least.h"

enum { MOST_SWEEPS = 20000, MOST_TRIED = 4 };

/* Relative to what is added up: an impulse is inside its disc; impulses that a sweep leaves; what the laws may miss. */
static const ncgen_scalar inside = R(1.0e-7), at_rounding = R(1.0e-15), slack = R(1.0e-10);

ncgen_contact ncgen_contact_of(const int *places, const ncgen_scalar *coefficients, int number)
{
    const int *place = places + 3 * number;
    const ncgen_scalar *own = coefficients + 3 * number;
    const ncgen_contact contact = {place[0], place[1], place[2], own[0], own[1], own[2]};
    return contact;
}

static ncgen_contact contact_of(const ncgen_laws *l, int number)
{
    return ncgen_contact_of(l->places, l->coefficients, number);
}

static ncgen_real largest_of(int count, const ncgen_real *x)
{
    ncgen_real most = 0;
    for (int k = 0; k < count; ++k)
        most = NCGEN_ABS(x[k]) > most ? NCGEN_ABS(x[k]) : most;
    return most;
}

/* Linear equations ------------------------------------------------------------------------------------------------ */

/* Units of impulses in which every contact alone changes its velocities by one. */
static void find_scales(ncgen_laws *l)
{
    for (int k = 0; k < l->rows; ++k)
        l->scales[k] = 1;
    for (int b = l->from; b < l->to; ++b) {
        const ncgen_contact c = contact_of(l, b);
        ncgen_real most = 0;
        for (int k = c.gap; k <= c.gap + c.directions; ++k)
            most = l->G[k * l->rows + k] > most ? l->G[k * l->rows + k] : most;
        for (int k = c.gap; most > 0 && k <= c.gap + c.directions; ++k)
            l->scales[k] = 1 / NCGEN_SQRT(most);
    }
}

/* A row of G as an equation: what the impulses change of this velocity is minus its bias. */
static void keep_velocity(ncgen_laws *l, int row)
{
    for (int k = 0; k < l->rows; ++k)
        l->matrix[row * l->rows + k] = l->scales[row] * l->G[row * l->rows + k] * l->scales[k];
    l->right[row] = -l->scales[row] * l->bias[row];
}

/* Impulses of the linear equations that follow from what each contact does. */
static void solve(ncgen_laws *l, ncgen_real *impulses)
{
    const ncgen_manner *manners = l->manners;
    const int rows = l->rows;
    for (int k = 0; k < rows * rows; ++k)
        l->matrix[k] = k % (rows + 1) == 0;
    for (int k = 0; k < rows; ++k)
        l->right[k] = l->least[k] / l->scales[k];
    for (int b = l->from; b < l->to; ++b) {
        const ncgen_contact c = contact_of(l, b);
        const int gap = c.gap;
        if (manners[b].closed > 0)
            keep_velocity(l, gap);
        for (int k = 0; k < c.directions; ++k) {
            const int row = gap + 1 + k;
            if (manners[b].slides > 0)
                l->matrix[row * rows + gap] = c.friction * manners[b].direction[k] * l->scales[gap] / l->scales[row];
            else if (manners[b].closed > 0 || l->least[gap] > 0)
                keep_velocity(l, row);
        }
    }
    ncgen_copy(rows * rows, l->matrix, l->spare);
    ncgen_least_squares(rows, l->spare, l->v, l->right, impulses);
    for (int k = 0; k < rows; ++k)
        impulses[k] *= l->scales[k];
}

static void find_velocities(ncgen_laws *l, const ncgen_real *impulses)
{
    for (int k = 0; k < l->rows; ++k)
        l->velocities[k] = l->bias[k] + ncgen_dot(l->rows, l->G + k * l->rows, impulses);
}

/* Do impulses obey the laws, but for rounding? */
static int obey(ncgen_laws *l, const ncgen_real *impulses)
{
    ncgen_real sums = 0;
    find_velocities(l, impulses);
    for (int k = 0; k < l->rows; ++k) {
        ncgen_real sum = 0;
        for (int j = 0; j < l->rows; ++j)
            sum += NCGEN_ABS(l->G[k * l->rows + j] * impulses[j]);
        sums = sum > sums ? sum : sums;
    }
    const ncgen_real small = slack * (largest_of(l->rows, l->bias) + sums), size = slack * largest_of(l->rows, impulses);
    for (int b = l->from; b < l->to; ++b) {
        const ncgen_contact c = contact_of(l, b);
        const int gap = c.gap, n = c.directions;
        const ncgen_real *push = impulses + gap + 1, *w = l->velocities + gap + 1, limit = c.friction * impulses[gap];
        if (!(l->velocities[gap] >= -small && impulses[gap] >= l->least[gap] - size))
            return 0;
        if (impulses[gap] > l->least[gap] + size && l->velocities[gap] > small)
            return 0;
        if (n && !(ncgen_norm(n, push) <= limit + size))
            return 0;
        const ncgen_real speed = ncgen_norm(n, w);
        ncgen_real off[2] = {0, 0};
        for (int k = 0; k < n && speed > small; ++k)
            off[k] = push[k] + limit * w[k] / speed;
        if (ncgen_norm(n, off) > 10 * size)
            return 0;
    }
    return 1;
}

/* What contacts do ------------------------------------------------------------------------------------------------- */

/* All that contacts may do together, where each slides in one direction at most. */
static int try_all(ncgen_laws *l, ncgen_real *impulses)
{
    ncgen_manner *manners = l->manners;
    long cases = 1;
    for (int b = l->from; b < l->to; ++b)
        cases *= 2 + 4 * contact_of(l, b).directions;
    for (long number = 0; number < cases; ++number) {
        long rest = number;
        for (int b = l->to - 1; b >= l->from; --b) {
            const int ways = 1 + 2 * contact_of(l, b).directions, own = (int)(rest % (2 * ways));
            rest /= 2 * ways;
            manners[b].closed = own < ways;
            manners[b].slides = own % ways > 0;
            manners[b].direction[0] = own % ways == 1 ? 1 : -1;
        }
        solve(l, impulses);
        if (obey(l, impulses))
            return 1;
    }
    return 0;
}

/* One contact after the other: what it needs alone, then across it no more than friction gives. */
static void project(ncgen_laws *l, ncgen_contact c, ncgen_real *impulses)
{
    const int gap = c.gap, rows = l->rows;
    const ncgen_real needed = impulses[gap] - (ncgen_dot(rows, l->G + gap * rows, impulses) + l->bias[gap]) / l->G[gap * rows + gap];
    ncgen_real push[2] = {0, 0}, size = 0;
    impulses[gap] = needed > l->least[gap] ? needed : l->least[gap];
    for (int k = gap + 1; k <= gap + c.directions; ++k)
        size = l->G[k * rows + k] > size ? l->G[k * rows + k] : size;
    for (int k = 0; k < c.directions; ++k) {
        const int row = gap + 1 + k;
        push[k] = impulses[row] - (ncgen_dot(rows, l->G + row * rows, impulses) + l->bias[row]) / size;
    }
    const ncgen_real whole = ncgen_norm(2, push), radius = c.friction * impulses[gap];
    for (int k = 0; k < c.directions; ++k)
        impulses[gap + 1 + k] = whole > radius ? push[k] * (radius / whole) : push[k];
}

/* What a contact with these impulses does. */
static ncgen_manner manner_of(const ncgen_laws *l, ncgen_contact c, const ncgen_real *impulses)
{
    const int gap = c.gap, n = c.directions;
    const ncgen_real *w = l->velocities + gap + 1, speed = ncgen_norm(n, w), limit = c.friction * impulses[gap];
    ncgen_manner does = {(ncgen_real)(impulses[gap] > l->least[gap]), 0, {0, 0}};
    does.slides = n && speed > 0 && !(ncgen_norm(n, impulses + gap + 1) < limit * (1 - inside));
    for (int k = 0; does.slides > 0 && k < n; ++k)
        does.direction[k] = w[k] / speed;
    return does;
}

static int project_all(ncgen_laws *l, ncgen_real *impulses)
{
    ncgen_copy(l->rows, l->least, impulses);
    for (int sweep = 0; sweep < MOST_SWEEPS; ++sweep) {
        ncgen_copy(l->rows, impulses, l->before);
        for (int b = l->from; b < l->to; ++b)
            project(l, contact_of(l, b), impulses);
        for (int k = 0; k < l->rows; ++k)
            l->before[k] -= impulses[k];
        if (largest_of(l->rows, l->before) <= at_rounding * largest_of(l->rows, impulses))
            break;
    }
    ncgen_copy(l->rows, impulses, l->before);
    find_velocities(l, impulses);
    for (int b = l->from; b < l->to; ++b)
        l->manners[b] = manner_of(l, contact_of(l, b), impulses);
    solve(l, impulses);
    if (obey(l, impulses))
        return 1;
    ncgen_copy(l->rows, l->before, impulses);
    return obey(l, impulses);
}

/* Contacts without friction ---------------------------------------------------------------------------------------- */

/* Impulses of those that may push, as they need them; returns the first one of them that would have to pull, with impulses up to where
 * it begins to, or -1. */
static int push_as_needed(ncgen_laws *l, const ncgen_real *takes, ncgen_real *impulses)
{
    const int rows = l->rows;
    ncgen_real *right = l->velocities, *tried = l->before, share = 1;
    int first = -1;
    for (int k = 0; k < rows; ++k) {
        right[k] = takes[k] > 0 ? l->right[k] : 0;
        for (int j = 0; j < rows; ++j)
            l->spare[k * rows + j] = takes[k] > 0 && takes[j] > 0 ? l->matrix[k * rows + j] : 0;
    }
    ncgen_least_squares(rows, l->spare, l->v, right, tried);
    for (int k = 0; k < rows; ++k) {
        const ncgen_real way = impulses[k] - tried[k];
        if (!(takes[k] > 0) || tried[k] > 0)
            continue;
        const ncgen_real until = way > 0 ? impulses[k] / way : 0;
        if (first < 0 || until < share) {
            share = until;
            first = k;
        }
    }
    for (int k = 0; k < rows; ++k)
        impulses[k] += share * (tried[k] - impulses[k]);
    return first;
}

/* The one of those that do not push which lacks most velocity, or -1. */
static int most_lacking(const ncgen_laws *l, const ncgen_real *takes, const ncgen_real *impulses)
{
    ncgen_real most = 100 * at_rounding * largest_of(l->rows, l->right);
    int best = -1;
    for (int k = 0; k < l->rows; ++k) {
        const ncgen_real lacking = l->right[k] - ncgen_dot(l->rows, l->matrix + k * l->rows, impulses);
        if (!(takes[k] > 0) && !(takes[k] < 0) && lacking > most) {
            most = lacking;
            best = k;
        }
    }
    return best;
}

void ncgen_push_only(ncgen_laws *l, ncgen_real *impulses)
{
    const int rows = l->rows;
    ncgen_real *takes = l->least; /* 1: pushes; -1: would at once have to pull */
    for (int k = 0; k < rows; ++k)
        keep_velocity(l, k);
    ncgen_copy(rows * rows, l->matrix, l->spare);
    ncgen_least_squares(rows, l->spare, l->v, l->right, l->before);
    for (int k = 0; k < rows; ++k) { /* without what no impulses reach */
        l->right[k] = ncgen_dot(rows, l->matrix + k * rows, l->before);
        takes[k] = impulses[k] = 0;
    }
    for (int next = most_lacking(l, takes, impulses), turn = 0; next >= 0 && turn < MOST_SWEEPS; ++turn) {
        takes[next] = 1;
        int pulls = push_as_needed(l, takes, impulses);
        const int moves = pulls != next;
        for (; pulls >= 0; pulls = push_as_needed(l, takes, impulses))
            takes[pulls] = impulses[pulls] = 0;
        for (int k = 0; k < rows; ++k)
            takes[k] = takes[k] > 0 || (!moves && takes[k] < 0) ? takes[k] : 0;
        takes[next] = moves ? takes[next] : -1;
        next = most_lacking(l, takes, impulses);
    }
    for (int k = 0; k < rows; ++k)
        impulses[k] *= l->scales[k];
}

/* Contacts with friction -------------------------------------------------------------------------------------------- */

/* Impulses that obey the laws without restitution; whether there are any. */
static int follow(ncgen_laws *l, ncgen_real *impulses)
{
    int one_direction = l->to - l->from <= MOST_TRIED;
    for (int b = l->from; b < l->to; ++b)
        one_direction = one_direction && contact_of(l, b).directions <= 1;
    return one_direction ? try_all(l, impulses) : project_all(l, impulses);
}

int ncgen_push_with_friction(ncgen_laws *l, const ncgen_real *velocities, ncgen_real *first, ncgen_real *impulses)
{
    int again = 0;
    ncgen_copy(l->rows, velocities, l->bias);
    for (int b = l->from; b < l->to; ++b) {
        const ncgen_contact c = contact_of(l, b);
        again |= c.poisson && c.restitution > 0;
        for (int k = 0; !c.poisson && k <= c.directions; ++k)
            l->bias[c.gap + k] *= 1 + (k ? c.tangential : c.restitution);
    }
    for (int k = 0; k < l->rows; ++k)
        l->least[k] = impulses[k] = 0;
    if (!follow(l, impulses))
        return 0;
    if (!again)
        return 1;
    ncgen_copy(l->rows, impulses, first);
    for (int k = 0; k < l->rows; ++k)
        l->bias[k] += ncgen_dot(l->rows, l->G + k * l->rows, first);
    for (int b = l->from; b < l->to; ++b)
        if (contact_of(l, b).poisson)
            l->least[contact_of(l, b).gap] = contact_of(l, b).restitution * first[contact_of(l, b).gap];
    const int status = follow(l, impulses);
    for (int k = 0; k < l->rows; ++k)
        impulses[k] += first[k];
    return status;
}

void ncgen_lay_out_laws(int count, int rows, const int *places, const ncgen_scalar *coefficients, const ncgen_real *G, ncgen_space *space,
    ncgen_laws *l)
{
    ncgen_real **vectors[] = {&l->bias, &l->least, &l->velocities, &l->right, &l->scales, &l->before};
    l->places = places;
    l->coefficients = coefficients;
    l->from = 0;
    l->to = count;
    l->rows = rows;
    l->G = G;
    for (size_t k = 0; k < sizeof vectors / sizeof *vectors; ++k)
        *vectors[k] = ncgen_take(space, rows);
    l->matrix = ncgen_take(space, rows * rows);
    l->spare = ncgen_take(space, rows * rows);
    l->v = ncgen_take(space, rows * rows);
    l->manners = (ncgen_manner *)ncgen_take(space, 4 * count);
    find_scales(l);
}
