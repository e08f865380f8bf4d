/* ncgen_tree_bodies.c: see ncgen_tree_bodies.h. A number here is one of every link of a block. */
#include "ncgen_tree_bodies.h"

typedef ncgen_link_lanes lanes;

/* Between the order of the coordinates and that of the slots ------------------------------------------------------------ */

/* Moves are no arithmetic, and instructions that gather numbers take longer than one after the other. */
NCGEN_SHORT_LOOPS void ncgen_tree_put(const ncgen_run *r, const ncgen_tree_work *w, int place, const ncgen_real *x)
{
    ncgen_real *to = (ncgen_real *)w->slot + place * NCGEN_LINK_LANES;
    const int n = r->n, *where = w->where;
    int i = 0;
    for (; i + 4 <= n; i += 4) {
        const ncgen_real a = x[i], b = x[i + 1], c = x[i + 2], d = x[i + 3];
        to[where[i]] = a;
        to[where[i + 1]] = b;
        to[where[i + 2]] = c;
        to[where[i + 3]] = d;
    }
    for (; i < n; ++i)
        to[where[i]] = x[i];
}

NCGEN_SHORT_LOOPS void ncgen_tree_take(const ncgen_run *r, const ncgen_tree_work *w, ncgen_real *x)
{
    const ncgen_real *from = (const ncgen_real *)w->slot + MOVED * NCGEN_LINK_LANES;
    const int n = r->n, *where = w->where;
    int i = 0;
    for (; i + 4 <= n; i += 4) {
        const ncgen_real a = from[where[i]], b = from[where[i + 1]], c = from[where[i + 2]], d = from[where[i + 3]];
        x[i] = a;
        x[i + 1] = b;
        x[i + 2] = c;
        x[i + 3] = d;
    }
    for (; i < n; ++i)
        x[i] = from[where[i]];
}

void ncgen_tree_measure_rates(ncgen_tree_work *w)
{
    const ncgen_tree *tree = w->tree;
    ncgen_real *slots = (ncgen_real *)w->slot + MOVED * NCGEN_LINK_LANES;
    for (int i = 0; i < tree->n_measured; ++i)
        slots[w->where[tree->measured[2 * i]]] = tree->ratios[i] * w->screw[tree->measured[2 * i + 1]].rate;
}

void ncgen_tree_measure_pushes(ncgen_tree_work *w)
{
    const ncgen_tree *tree = w->tree;
    ncgen_real *slots = (ncgen_real *)w->slot + MOVED * NCGEN_LINK_LANES;
    for (int i = 0; i < tree->n_measured; ++i)
        slots[w->where[tree->measured[2 * i]]] = tree->ratios[i] * w->screw[tree->measured[2 * i + 1]].push;
}

/* Vectors of all lanes -------------------------------------------------------------------------------------------------- */

static inline void cross(const lanes *a, const lanes *b, lanes *out)
{
    out[0] = a[1] * b[2] - a[2] * b[1];
    out[1] = a[2] * b[0] - a[0] * b[2];
    out[2] = a[0] * b[1] - a[1] * b[0];
}

static inline void add_cross(const lanes *a, const lanes *b, lanes *out)
{
    out[0] += a[1] * b[2] - a[2] * b[1];
    out[1] += a[2] * b[0] - a[0] * b[2];
    out[2] += a[0] * b[1] - a[1] * b[0];
}

static inline void set(int count, const lanes *from, lanes *to)
{
    for (int i = 0; i < count; ++i)
        to[i] = from[i];
}

/* A symmetric matrix times a vector. */
static inline void turned(const lanes *s, const lanes *a, lanes *out)
{
    out[0] = s[0] * a[0] + s[3] * a[1] + s[4] * a[2];
    out[1] = s[3] * a[0] + s[1] * a[1] + s[5] * a[2];
    out[2] = s[4] * a[0] + s[5] * a[1] + s[2] * a[2];
}

/* Bodies ---------------------------------------------------------------------------------------------------------------- */

static inline void find_levers(const ncgen_tree_block *b)
{
    lanes origin[3];
    set(3, b->numbers + ORIGIN, origin);
    for (ncgen_tree_slot *s = b->slot, *end = s + b->n_slots; s < end; ++s) {
        const lanes is_point = s->numbers[IS_POINT];
        const lanes x = s->numbers[VALUE], y = s->numbers[VALUE + 1], z = s->numbers[VALUE + 2];
        s->numbers[LEVER] = x - is_point * origin[0];
        s->numbers[LEVER + 1] = y - is_point * origin[1];
        s->numbers[LEVER + 2] = z - is_point * origin[2];
    }
}

/* A member whose masses with all members move as u, in P as xx, yy, zz, xy, xz, yz and in h behind it. */
static inline void add_member(const lanes *x, const lanes *u, lanes share, lanes *second)
{
    second[0] += x[0] * u[0];
    second[1] += x[1] * u[1];
    second[2] += x[2] * u[2];
    second[3] += x[0] * u[1];
    second[4] += x[0] * u[2];
    second[5] += x[1] * u[2];
    for (int i = 0; i < 3; ++i)
        second[6 + i] += share * x[i];
}

/* What the masses of a slot with three, or four, slots move as. */
static inline void add_of_three(const lanes *masses, const lanes *a, const lanes *b, const lanes *c, lanes *u)
{
    for (int i = 0; i < 3; ++i)
        u[i] = masses[0] * a[i] + masses[1] * b[i] + masses[2] * c[i];
}

static inline void add_of_four(const lanes *masses, const lanes *a, const lanes *b, const lanes *c, const lanes *d, lanes *u)
{
    for (int i = 0; i < 3; ++i)
        u[i] = masses[0] * a[i] + masses[1] * b[i] + masses[2] * c[i] + masses[3] * d[i];
}

/* P and h of bodies of three members, as most are, ... */
static inline void find_moments_of_three(const ncgen_tree_block *block, lanes *second)
{
    const lanes *masses = block->masses;
    lanes a[3], b[3], c[3], u[3];
    set(3, block->slot[0].numbers + LEVER, a);
    set(3, block->slot[1].numbers + LEVER, b);
    set(3, block->slot[2].numbers + LEVER, c);
    add_of_three(masses + 3, a, b, c, u);
    add_member(a, u, masses[0], second);
    add_of_three(masses + 6, a, b, c, u);
    add_member(b, u, masses[1], second);
    add_of_three(masses + 9, a, b, c, u);
    add_member(c, u, masses[2], second);
}

/* ... of four, ... */
static inline void find_moments_of_four(const ncgen_tree_block *block, lanes *second)
{
    const lanes *masses = block->masses;
    lanes a[3], b[3], c[3], d[3], u[3];
    set(3, block->slot[0].numbers + LEVER, a);
    set(3, block->slot[1].numbers + LEVER, b);
    set(3, block->slot[2].numbers + LEVER, c);
    set(3, block->slot[3].numbers + LEVER, d);
    add_of_four(masses + 4, a, b, c, d, u);
    add_member(a, u, masses[0], second);
    add_of_four(masses + 8, a, b, c, d, u);
    add_member(b, u, masses[1], second);
    add_of_four(masses + 12, a, b, c, d, u);
    add_member(c, u, masses[2], second);
    add_of_four(masses + 16, a, b, c, d, u);
    add_member(d, u, masses[3], second);
}

/* ... and of any number. */
static inline void find_moments_of_many(const ncgen_tree_block *block, lanes *second)
{
    const int count = block->n_slots;
    const lanes *masses = block->masses + count;
    for (int a = 0; a < count; ++a) {
        lanes u[3] = {block->masses[a] * 0, block->masses[a] * 0, block->masses[a] * 0};
        for (int b = 0; b < count; ++b)
            for (int i = 0; i < 3; ++i)
                u[i] += masses[a * count + b] * block->slot[b].numbers[LEVER + i];
        add_member(block->slot[a].numbers + LEVER, u, block->masses[a], second);
    }
}

/* Numbers of all coordinates, and of those that bodies have in common, into a place of the slots. */
static void put_all(const ncgen_run *r, const ncgen_tree_work *w, int place, const ncgen_real *x)
{
    ncgen_real *to = (ncgen_real *)w->slot + place * NCGEN_LINK_LANES;
    ncgen_tree_put(r, w, place, x);
    for (int i = 0; i < w->n_others; ++i)
        to[w->other_at[i]] = x[w->other[i]];
}

void ncgen_tree_place_bodies(const ncgen_run *r, ncgen_tree_work *w)
{
    static const lanes nothing = {0};
    put_all(r, w, VALUE, w->values);
    for (const ncgen_tree_block *b = w->block, *end = b + w->n_blocks; b < end; ++b) {
        lanes second[9];
        for (int i = 0; i < 9; ++i)
            second[i] = nothing;
        find_levers(b);
        if (b->n_slots == 3)
            find_moments_of_three(b, second);
        else if (b->n_slots == 4)
            find_moments_of_four(b, second);
        else
            find_moments_of_many(b, second);
        set(9, second, b->numbers + MOMENTS);
    }
}

/* What moves with links ------------------------------------------------------------------------------------------------- */

/* Velocities of elements by six numbers of every link. */
static inline void spread(const ncgen_tree_block *b, const lanes *twist)
{
    for (ncgen_tree_slot *s = b->slot, *end = s + b->n_own; s < end; ++s) {
        lanes velocity[3];
        cross(twist, s->numbers + LEVER, velocity);
        for (int i = 0; i < 3; ++i)
            s->numbers[MOVED + i] = velocity[i] + s->numbers[IS_POINT] * twist[3 + i];
    }
}

void ncgen_tree_spread_twists(ncgen_tree_work *w)
{
    static const lanes nothing = {0};
    for (const ncgen_tree_block *b = w->block, *end = b + w->n_blocks; b < end; ++b) {
        lanes twist[6];
        set(6, b->numbers + TWIST, twist);
        spread(b, twist);
        for (int i = 0; i < 6; ++i)
            b->numbers[WRENCH + i] = nothing;
    }
}

void ncgen_tree_spread_added(ncgen_tree_work *w)
{
    for (const ncgen_tree_block *b = w->block, *end = b + w->n_blocks; b < end; ++b) {
        lanes added[6];
        set(6, b->numbers + WRENCH, added);
        spread(b, added);
    }
}

/* The negative of I a + h x v + (P w) x w, and of a x h + m v + w x (w x h). */
static inline void set_wrench(const ncgen_tree_block *b, const lanes *turning)
{
    const lanes *second = b->numbers + MOMENTS, *first = second + 6, *change = b->numbers + CHANGE, *lift = change + 3;
    const lanes trace = second[0] + second[1] + second[2], mass = b->numbers[MASS];
    lanes wrench[6], spun[3], moved[3];
    turned(second, change, wrench); /* I a = tr(P) a - P a */
    for (int i = 0; i < 3; ++i)
        wrench[i] -= trace * change[i];
    add_cross(lift, first, wrench);
    turned(second, turning, spun);
    add_cross(turning, spun, wrench);
    cross(first, change, wrench + 3);
    for (int i = 0; i < 3; ++i)
        wrench[3 + i] -= mass * lift[i];
    cross(first, turning, moved);
    add_cross(turning, moved, wrench + 3);
    set(6, wrench, b->numbers + WRENCH);
}

void ncgen_tree_set_wrenches(ncgen_tree_work *w)
{
    for (const ncgen_tree_block *b = w->block, *end = b + w->n_blocks; b < end; ++b) {
        lanes twist[6];
        set(6, b->numbers + TWIST, twist);
        spread(b, twist);
        set_wrench(b, twist);
    }
}

void ncgen_tree_add_forces(ncgen_tree_work *w, int to_wrenches)
{
    static const lanes nothing = {0};
    for (const ncgen_tree_block *b = w->block, *end = b + w->n_blocks; b < end; ++b) {
        lanes wrench[6];
        for (int i = 0; i < 6; ++i)
            wrench[i] = to_wrenches ? b->numbers[WRENCH + i] : nothing;
        for (const ncgen_tree_slot *s = b->slot, *last = s + b->n_own; s < last; ++s) {
            add_cross(s->numbers + LEVER, s->numbers + FORCE, wrench);
            for (int i = 0; i < 3; ++i)
                wrench[3 + i] += s->numbers[IS_POINT] * s->numbers[FORCE + i];
        }
        set(6, wrench, b->numbers + WRENCH);
    }
}

/* A point's velocity is that of the reference point, x, and the rest. So a member a has the momentum m_a x + u, where u is that of the
 * rests by the masses between members. */
static inline void set_momentum(const ncgen_tree_block *block)
{
    static const lanes nothing = {0};
    const int count = block->n_slots;
    const lanes *first = block->numbers + MOMENTS + 6, *masses = block->masses + count;
    lanes x[3], wrench[6];
    set(3, block->numbers + CHANGE, x);
    cross(first, x, wrench);
    for (int i = 0; i < 3; ++i)
        wrench[3 + i] = block->numbers[MASS] * x[i];
    for (ncgen_tree_slot *s = block->slot, *end = s + count; s < end; ++s)
        for (int i = 0; i < 3; ++i)
            s->numbers[FORCE + i] -= s->numbers[IS_POINT] * x[i];
    for (int a = 0; a < count; ++a, masses += count) {
        lanes u[3] = {nothing, nothing, nothing};
        for (int b = 0; b < count; ++b)
            for (int i = 0; i < 3; ++i)
                u[i] += masses[b] * block->slot[b].numbers[FORCE + i];
        add_cross(block->slot[a].numbers + LEVER, u, wrench);
        for (int i = 0; i < 3; ++i)
            wrench[3 + i] += block->masses[a] * block->slot[a].numbers[FORCE + i];
    }
    set(6, wrench, block->numbers + WRENCH);
}

void ncgen_tree_set_momenta(const ncgen_run *r, ncgen_tree_work *w)
{
    put_all(r, w, FORCE, w->bias);
    for (const ncgen_tree_link *own = w->link, *end = own + w->tree->n_links; own < end; ++own) {
        const ncgen_real x[3] = {w->bias[own->reference[0]], w->bias[own->reference[1]], w->bias[own->reference[2]]};
        ncgen_put3(x, own->lane, CHANGE);
    }
    for (const ncgen_tree_block *b = w->block, *end = b + w->n_blocks; b < end; ++b)
        set_momentum(b);
}

void ncgen_tree_spread_changes(ncgen_tree_work *w)
{
    for (const ncgen_tree_block *b = w->block, *end = b + w->n_blocks; b < end; ++b) {
        lanes twist[3], change[6];
        set(3, b->numbers + TWIST, twist);
        for (int i = 0; i < 6; ++i)
            change[i] = b->numbers[CHANGE + i] + b->numbers[WRENCH + i];
        for (ncgen_tree_slot *s = b->slot, *last = s + b->n_own; s < last; ++s) {
            lanes lever[3], speed[3], acceleration[3];
            set(3, s->numbers + LEVER, lever);
            cross(twist, lever, speed);
            cross(change, lever, acceleration);
            add_cross(twist, speed, acceleration);
            for (int i = 0; i < 3; ++i)
                s->numbers[MOVED + i] = acceleration[i] + s->numbers[IS_POINT] * change[3 + i];
        }
    }
}

void ncgen_tree_turn_elements(ncgen_tree_work *w)
{
    for (int i = 0; i < w->n_blocks; ++i) {
        lanes turn[12];
        set(12, w->turns + 12 * i, turn);
        for (ncgen_tree_slot *s = w->block[i].slot, *end = s + w->block[i].n_own; s < end; ++s) {
            const lanes x = s->numbers[FIRST], y = s->numbers[FIRST + 1], z = s->numbers[FIRST + 2];
            for (int k = 0; k < 3; ++k)
                s->numbers[MOVED + k] = s->numbers[IS_POINT] * turn[9 + k] + turn[k] * x + turn[3 + k] * y + turn[6 + k] * z;
        }
    }
}
