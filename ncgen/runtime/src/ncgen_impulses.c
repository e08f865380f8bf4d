/* ncgen_impulses.c: laws of impact of several contacts at one instant.
 *
 * What sticks, slides and opens is tried, or found by projections in turn where that would be too much; then impulses follow from linear
 * equations, those of least energy where they are not determined.
 */
#include "ncgen_impulses.h"
#include "ncgen_least.h"

enum { MOST_SWEEPS = 20000, MOST_TRIED = 4 };

/* Relative to what is added up: an impulse is inside its disc; impulses that a sweep leaves; what the laws may miss; a velocity that is
 * none; energy that an impact may give. */
static const ncgen_scalar inside = R(1.0e-7), at_rounding = R(1.0e-15), slack = R(1.0e-10), nothing = R(1.0e-12), gain = R(1.0e-9);

/* A contact: the place of its gap among the velocities, with those of its directions of sliding behind it, and coefficients. */
typedef struct contact {
    int gap, directions, poisson;
    ncgen_scalar restitution, friction, tangential;
} contact;

static contact contact_of(const ncgen_impact *i, int number)
{
    const int *place = i->places + 3 * number;
    const ncgen_scalar *own = i->coefficients + 3 * number;
    const contact found = {place[0], place[1], place[2], own[0], own[1], own[2]};
    return found;
}

/* What a contact does: 1 where its gap stays closed, 1 where it slides, and in which direction. */
typedef struct manner {
    ncgen_real closed, slides, direction[2];
} manner;

/* The laws without restitution: velocities G L + bias, impulses along gaps of at least `least`. */
typedef struct laws {
    const ncgen_impact *impact;
    int from, to, rows; /* the contacts that are meant */
    const ncgen_real *G;
    manner *manners;
    ncgen_real *bias, *least, *velocities, *right, *scales, *before, *matrix, *spare, *v;
} laws;

static ncgen_real size_of(int count, const ncgen_real *x)
{
    return NCGEN_SQRT(ncgen_dot(count, x, x));
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
static void find_scales(laws *l)
{
    for (int k = 0; k < l->rows; ++k)
        l->scales[k] = 1;
    for (int b = l->from; b < l->to; ++b) {
        const contact c = contact_of(l->impact, b);
        ncgen_real most = 0;
        for (int k = c.gap; k <= c.gap + c.directions; ++k)
            most = l->G[k * l->rows + k] > most ? l->G[k * l->rows + k] : most;
        for (int k = c.gap; most > 0 && k <= c.gap + c.directions; ++k)
            l->scales[k] = 1 / NCGEN_SQRT(most);
    }
}

/* A row of G as an equation: what the impulses change of this velocity is minus its bias. */
static void keep_velocity(laws *l, int row)
{
    for (int k = 0; k < l->rows; ++k)
        l->matrix[row * l->rows + k] = l->scales[row] * l->G[row * l->rows + k] * l->scales[k];
    l->right[row] = -l->scales[row] * l->bias[row];
}

/* Impulses of the linear equations that follow from what each contact does. */
static void solve(laws *l, ncgen_real *impulses)
{
    const manner *manners = l->manners;
    const int rows = l->rows;
    for (int k = 0; k < rows * rows; ++k)
        l->matrix[k] = k % (rows + 1) == 0;
    for (int k = 0; k < rows; ++k)
        l->right[k] = l->least[k] / l->scales[k];
    for (int b = l->from; b < l->to; ++b) {
        const contact c = contact_of(l->impact, b);
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

static void find_velocities(laws *l, const ncgen_real *impulses)
{
    for (int k = 0; k < l->rows; ++k)
        l->velocities[k] = l->bias[k] + ncgen_dot(l->rows, l->G + k * l->rows, impulses);
}

/* Do impulses obey the laws, but for rounding? */
static int obey(laws *l, const ncgen_real *impulses)
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
        const contact c = contact_of(l->impact, b);
        const int gap = c.gap, n = c.directions;
        const ncgen_real *push = impulses + gap + 1, *w = l->velocities + gap + 1, limit = c.friction * impulses[gap];
        if (!(l->velocities[gap] >= -small && impulses[gap] >= l->least[gap] - size))
            return 0;
        if (impulses[gap] > l->least[gap] + size && l->velocities[gap] > small)
            return 0;
        if (n && !(size_of(n, push) <= limit + size))
            return 0;
        const ncgen_real speed = size_of(n, w);
        ncgen_real off[2] = {0, 0};
        for (int k = 0; k < n && speed > small; ++k)
            off[k] = push[k] + limit * w[k] / speed;
        if (size_of(n, off) > 10 * size)
            return 0;
    }
    return 1;
}

/* What contacts do ------------------------------------------------------------------------------------------------- */

/* All that contacts may do together, where each slides in one direction at most. */
static int try_all(laws *l, ncgen_real *impulses)
{
    manner *manners = l->manners;
    long cases = 1;
    for (int b = l->from; b < l->to; ++b)
        cases *= 2 + 4 * contact_of(l->impact, b).directions;
    for (long number = 0; number < cases; ++number) {
        long rest = number;
        for (int b = l->to - 1; b >= l->from; --b) {
            const int ways = 1 + 2 * contact_of(l->impact, b).directions, own = (int)(rest % (2 * ways));
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
static void project(laws *l, contact c, ncgen_real *impulses)
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
    const ncgen_real whole = size_of(2, push), radius = c.friction * impulses[gap];
    for (int k = 0; k < c.directions; ++k)
        impulses[gap + 1 + k] = whole > radius ? push[k] * (radius / whole) : push[k];
}

/* What a contact with these impulses does. */
static manner manner_of(const laws *l, contact c, const ncgen_real *impulses)
{
    const int gap = c.gap, n = c.directions;
    const ncgen_real *w = l->velocities + gap + 1, speed = size_of(n, w), limit = c.friction * impulses[gap];
    manner does = {impulses[gap] > l->least[gap], 0, {0, 0}};
    does.slides = n && speed > 0 && !(size_of(n, impulses + gap + 1) < limit * (1 - inside));
    for (int k = 0; does.slides > 0 && k < n; ++k)
        does.direction[k] = w[k] / speed;
    return does;
}

static int project_all(laws *l, ncgen_real *impulses)
{
    ncgen_copy(l->rows, l->least, impulses);
    for (int sweep = 0; sweep < MOST_SWEEPS; ++sweep) {
        ncgen_copy(l->rows, impulses, l->before);
        for (int b = l->from; b < l->to; ++b)
            project(l, contact_of(l->impact, b), impulses);
        for (int k = 0; k < l->rows; ++k)
            l->before[k] -= impulses[k];
        if (largest_of(l->rows, l->before) <= at_rounding * largest_of(l->rows, impulses))
            break;
    }
    ncgen_copy(l->rows, impulses, l->before);
    find_velocities(l, impulses);
    for (int b = l->from; b < l->to; ++b)
        l->manners[b] = manner_of(l, contact_of(l->impact, b), impulses);
    solve(l, impulses);
    if (obey(l, impulses))
        return 1;
    ncgen_copy(l->rows, l->before, impulses);
    return obey(l, impulses);
}

/* Contacts without friction ---------------------------------------------------------------------------------------- */

/* Impulses of those that may push, as they need them; returns the first one of them that would have to pull, with impulses up to where
 * it begins to, or -1. */
static int push_as_needed(laws *l, const ncgen_real *takes, ncgen_real *impulses)
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
static int most_lacking(const laws *l, const ncgen_real *takes, const ncgen_real *impulses)
{
    ncgen_real most = 100 * at_rounding * largest_of(l->rows, l->right);
    int found = -1;
    for (int k = 0; k < l->rows; ++k) {
        const ncgen_real lacking = l->right[k] - ncgen_dot(l->rows, l->matrix + k * l->rows, impulses);
        if (!(takes[k] > 0) && !(takes[k] < 0) && lacking > most) {
            most = lacking;
            found = k;
        }
    }
    return found;
}

/* Impulses that are not negative, with the least energy of what the laws miss (Lawson and Hanson 1974): gaps that depend on each other may
 * ask for more than there is. */
static void push_only(laws *l, ncgen_real *impulses)
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
static int follow(laws *l, ncgen_real *impulses)
{
    int one_direction = l->to - l->from <= MOST_TRIED;
    for (int b = l->from; b < l->to; ++b)
        one_direction = one_direction && contact_of(l->impact, b).directions <= 1;
    return one_direction ? try_all(l, impulses) : project_all(l, impulses);
}

/* The impulses of contacts, of which one alone may be meant, for the velocities before. */
static int push_with_friction(laws *l, const ncgen_real *velocities, ncgen_real *first, ncgen_real *impulses)
{
    int again = 0;
    ncgen_copy(l->rows, velocities, l->bias);
    for (int b = l->from; b < l->to; ++b) {
        const contact c = contact_of(l->impact, b);
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
        if (contact_of(l->impact, b).poisson)
            l->least[contact_of(l->impact, b).gap] = contact_of(l->impact, b).restitution * first[contact_of(l->impact, b).gap];
    const int found = follow(l, impulses);
    for (int k = 0; k < l->rows; ++k)
        impulses[k] += first[k];
    return found;
}

/* Impacts ------------------------------------------------------------------------------------------------------------ */

static const ncgen_real *row_of(const ncgen_impact *i, int row)
{
    return i->G + row * i->rows;
}

/* Does an impulse of one contact change a velocity of another one? */
static int are_coupled(const ncgen_impact *i)
{
    for (int a = 0; a < i->count; ++a)
        for (int b = 0; b < i->count; ++b)
            for (int k = contact_of(i, a).gap; a != b && k <= contact_of(i, a).gap + contact_of(i, a).directions; ++k)
                for (int j = contact_of(i, b).gap; j <= contact_of(i, b).gap + contact_of(i, b).directions; ++j)
                    if (NCGEN_ABS(row_of(i, k)[j]) > nothing * NCGEN_SQRT(row_of(i, k)[k] * row_of(i, j)[j]))
                        return 1;
    return 0;
}

/* The contact that closes fastest, or -1. */
static int fastest(const ncgen_impact *i)
{
    int found = -1;
    for (int b = 0; b < i->count; ++b) {
        const int gap = contact_of(i, b).gap;
        if (i->velocities[gap] < -nothing * i->terms[gap] && (found < 0 || i->velocities[gap] < i->velocities[contact_of(i, found).gap]))
            found = b;
    }
    return found;
}

/* Velocities after impulses of some contacts, and what these take. */
static void push(const ncgen_impact *i, int first, int count, const ncgen_real *impulses)
{
    for (int b = first; b < first + count; ++b)
        for (int k = contact_of(i, b).gap; k <= contact_of(i, b).gap + contact_of(i, b).directions; ++k)
            i->lost[b] -= impulses[k] * (i->velocities[k] + ncgen_dot(i->rows, row_of(i, k), impulses) / 2);
    for (int k = 0; k < i->rows; ++k) {
        i->velocities[k] += ncgen_dot(i->rows, row_of(i, k), impulses);
        i->impulses[k] += impulses[k];
    }
}

static int hit_in_turn(ncgen_impact *i, laws *l, ncgen_real *first, ncgen_real *impulses)
{
    for (int turn = 0; turn < NCGEN_MOST_TURNS; ++turn) {
        const int b = fastest(i);
        if (b < 0)
            return NCGEN_OK;
        const contact c = contact_of(i, b);
        const int gap = c.gap;
        l->from = b;
        l->to = b + 1;
        for (int k = 0; k < i->rows; ++k)
            impulses[k] = 0;
        if (!c.directions)
            impulses[gap] = -(1 + c.restitution) * i->velocities[gap] / row_of(i, gap)[gap];
        else if (!push_with_friction(l, i->velocities, first, impulses)) {
            i->which = b;
            return NCGEN_NO_IMPULSES;
        }
        push(i, b, 1, impulses);
        for (int k = 0; i->turns && k < 3; ++k)
            i->pushes[3 * turn + k] = k <= c.directions ? impulses[gap + k] : 0;
        if (i->turns)
            i->turns[turn] = b;
        i->n_turns = turn + 1;
    }
    return fastest(i) < 0 ? NCGEN_OK : NCGEN_ENDLESS;
}

static int hit_together(ncgen_impact *i, laws *l, ncgen_real *first, ncgen_real *impulses)
{
    int rubs = 0;
    for (int b = 0; b < i->count; ++b)
        rubs |= contact_of(i, b).directions > 0;
    if (rubs && !push_with_friction(l, i->velocities, first, impulses))
        return NCGEN_NO_IMPULSES;
    if (!rubs) {
        for (int b = 0; b < i->count; ++b)
            l->bias[contact_of(i, b).gap] = (1 + contact_of(i, b).restitution) * i->velocities[contact_of(i, b).gap];
        push_only(l, impulses);
    }
    push(i, 0, i->count, impulses);
    return NCGEN_OK;
}

/* Whether friction holds each, and whether they gave energy. */
static int finish(ncgen_impact *i)
{
    ncgen_real lost = 0, sizes = 0;
    for (int b = 0; b < i->count; ++b) {
        const contact c = contact_of(i, b);
        const int gap = c.gap, n = c.directions;
        ncgen_real most = 0;
        for (int k = gap; k <= gap + n; ++k) {
            ncgen_real sum = 0;
            for (int j = 0; j < i->rows; ++j)
                sum += NCGEN_ABS(row_of(i, k)[j] * i->impulses[j]);
            most = sum > most ? sum : most;
        }
        i->sticks[b] = n && i->impulses[gap] > 0 && size_of(n, i->impulses + gap + 1) < c.friction * i->impulses[gap] &&
                       size_of(n, i->velocities + gap + 1) <= nothing * most;
        lost += i->lost[b];
        sizes += NCGEN_ABS(i->lost[b]);
    }
    return lost < -gain * (sizes + i->energy) ? NCGEN_GAIN : NCGEN_OK;
}

size_t ncgen_impact_workspace(int rows)
{
    return NCGEN_IMPACT_WORKSPACE((size_t)rows);
}

int ncgen_impact_of_gaps(ncgen_impact *i)
{
    const int rows = i->rows;
    ncgen_space space = {i->workspace, 0};
    laws l = {i, 0, i->count, rows, i->G, NULL, NULL, NULL, NULL, NULL, NULL, NULL, NULL, NULL, NULL};
    ncgen_real **vectors[] = {&l.bias, &l.least, &l.velocities, &l.right, &l.scales, &l.before};
    for (size_t k = 0; k < sizeof vectors / sizeof *vectors; ++k)
        *vectors[k] = ncgen_take(&space, rows);
    l.matrix = ncgen_take(&space, rows * rows);
    l.spare = ncgen_take(&space, rows * rows);
    l.v = ncgen_take(&space, rows * rows);
    l.manners = (manner *)ncgen_take(&space, 4 * i->count);
    ncgen_real *first = ncgen_take(&space, rows), *impulses = ncgen_take(&space, rows);
    for (int k = 0; k < rows; ++k)
        i->impulses[k] = impulses[k] = 0;
    for (int b = 0; b < i->count; ++b) {
        i->lost[b] = 0;
        i->sticks[b] = 0;
        const int gap = contact_of(i, b).gap;
        if (!(row_of(i, gap)[gap] > 0)) {
            i->which = b;
            return NCGEN_SINGULAR;
        }
    }
    i->n_turns = 0;
    i->which = -1;
    i->closes = fastest(i) >= 0;
    if (!i->closes)
        return NCGEN_OK;
    if (i->law == NCGEN_NO_LAW && are_coupled(i))
        return NCGEN_NO_ORDER;
    find_scales(&l);
    const int status = i->law == NCGEN_IN_TURN ? hit_in_turn(i, &l, first, impulses) : hit_together(i, &l, first, impulses);
    return status == NCGEN_OK ? finish(i) : status;
}
