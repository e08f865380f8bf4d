/* ncgen_tree_bodies.c: masses and inertias of the bodies of an open tree.
 *
 * Most mass is the same along all axes, M I between two elements, so that an inertia is P = sum of m x y' and h = sum of m x over the
 * members of a body: I = tr(P) 1 - P, B = h x. The reference point, where it is a member, is at x = 0 and counts in h alone.
 */
#include "ncgen_tree_bodies.h"

/* The masses of a link's members; the number behind the last of them stands for the reference point. */
static void weigh(ncgen_tree_work *w, int link)
{
    const ncgen_tree *tree = w->tree;
    const int first = tree->member_start[link], count = tree->member_start[link + 1] - first;
    ncgen_real *total = w->masses + tree->mass_start[link], *shares = total + 1, *square = shares + count;
    for (int i = 0; i < 1 + count + count * count; ++i)
        total[i] = 0;
    for (int s = tree->pair_start[link]; s < tree->pair_start[link + 1]; ++s) {
        const int a = tree->pairs[3 * s], b = tree->pairs[3 * s + 1];
        const ncgen_real mass = w->mass[tree->pairs[3 * s + 2]];
        const ncgen_scalar a_is_point = a < count ? tree->member_is_point[first + a] : 1;
        const ncgen_scalar b_is_point = b < count ? tree->member_is_point[first + b] : 1;
        if (a < count)
            shares[a] += mass * b_is_point;
        if (b < count && b != a)
            shares[b] += mass * a_is_point;
        if (a < count && b < count)
            square[a * count + b] = square[b * count + a] = mass;
        *total += (a == b ? 1 : 2) * mass * a_is_point * b_is_point;
    }
}

void ncgen_tree_weigh(ncgen_tree_work *w)
{
    for (int link = 0; link < w->tree->n_links; ++link)
        weigh(w, link);
    for (int k = 0; k < w->tree->n_screws; ++k)
        w->screw[k].rotor = 0;
    for (int i = 0; i < w->tree->n_rotors; ++i)
        w->screw[w->tree->rotors[2 * i]].rotor += w->tree->gears[i] * w->mass[w->tree->rotors[2 * i + 1]];
}

/* P as xx, yy, zz, xy, xz, yz, and h behind it; x: room for 3 numbers a member. */
static inline void add_up(const ncgen_tree_work *w, int link, const int count, ncgen_real *x, ncgen_real *second)
{
    const ncgen_tree *tree = w->tree;
    const int first = tree->member_start[link];
    const ncgen_real *shares = w->masses + tree->mass_start[link] + 1, *square = shares + count, *origin = w->link[link].origin;
    for (int i = 0; i < 9; ++i)
        second[i] = 0;
    for (int a = 0; a < count; ++a)
        for (int i = 0; i < 3; ++i)
            x[3 * a + i] = w->values[tree->members[3 * (first + a) + i]] - tree->member_is_point[first + a] * origin[i];
    for (int a = 0; a < count; ++a) {
        const ncgen_real *own = x + 3 * a;
        ncgen_real u[3] = {0, 0, 0};
        for (int b = 0; b < count; ++b)
            ncgen_add_times(square[a * count + b], x + 3 * b, u);
        second[0] += own[0] * u[0];
        second[1] += own[1] * u[1];
        second[2] += own[2] * u[2];
        second[3] += own[0] * u[1];
        second[4] += own[0] * u[2];
        second[5] += own[1] * u[2];
        ncgen_add_times(shares[a], own, second + 6);
    }
}

/* The same; most bodies have few members, whose loops the compiler unrolls. */
static inline void find_moments(const ncgen_tree_work *w, int link, ncgen_real *second)
{
    const int count = w->tree->member_start[link + 1] - w->tree->member_start[link];
    ncgen_real few[3 * 4];
    switch (count) {
    case 1:
        add_up(w, link, 1, few, second);
        break;
    case 2:
        add_up(w, link, 2, few, second);
        break;
    case 3:
        add_up(w, link, 3, few, second);
        break;
    case 4:
        add_up(w, link, 4, few, second);
        break;
    default:
        add_up(w, link, count, w->member, second);
    }
}

static inline void set_inertia(const ncgen_real *second, ncgen_real total, ncgen_real *inertia)
{
    const ncgen_real *first = second + 6;
    inertia[TURNING] = second[1] + second[2];
    inertia[TURNING + 1] = second[0] + second[2];
    inertia[TURNING + 2] = second[0] + second[1];
    for (int i = 3; i < 6; ++i)
        inertia[TURNING + i] = -second[i];
    inertia[MIXED] = inertia[MIXED + 4] = inertia[MIXED + 8] = 0;
    inertia[MIXED + 1] = -first[2];
    inertia[MIXED + 2] = first[1];
    inertia[MIXED + 3] = first[2];
    inertia[MIXED + 5] = -first[0];
    inertia[MIXED + 6] = -first[1];
    inertia[MIXED + 7] = first[0];
    for (int i = 0; i < 3; ++i) {
        inertia[ALONG + i] = total;
        inertia[ALONG + 3 + i] = 0;
    }
}

/* From a link's reference point to an element of its body, which may stand with another link. */
static void lever_of(const ncgen_tree_work *w, int link, int element, ncgen_real *lever)
{
    const ncgen_tree *tree = w->tree;
    for (int i = 0; i < 3; ++i)
        lever[i] = w->values[tree->elements[3 * element + i]] - tree->is_point[element] * w->link[link].origin[i];
}

/* The velocity of one coordinate of an element over a twist: six numbers. */
static void coordinate_row(const ncgen_tree_work *w, int link, int element, int axis, ncgen_real *row)
{
    ncgen_real unit[3] = {0, 0, 0}, lever[3];
    unit[axis] = 1;
    lever_of(w, link, element, lever);
    ncgen_cross(lever, unit, row);
    for (int i = 0; i < 3; ++i)
        row[3 + i] = w->tree->is_point[element] * unit[i];
}

static void add_singles(const ncgen_tree_work *w, int link, ncgen_real *inertia)
{
    const ncgen_tree *tree = w->tree;
    for (int s = tree->single_start[link]; s < tree->single_start[link + 1]; ++s) {
        const int *entry = tree->singles + 5 * s;
        const int is_diagonal = entry[0] == entry[2] && entry[1] == entry[3];
        ncgen_real a[6], b[6];
        coordinate_row(w, link, entry[0], entry[1], a);
        coordinate_row(w, link, entry[2], entry[3], b);
        ncgen_add_product(w->mass[entry[4]] * (is_diagonal ? 1 : 2), a, b, inertia);
    }
}

void ncgen_tree_find_inertias(ncgen_tree_work *w)
{
    for (int link = 0; link < w->tree->n_links; ++link) {
        ncgen_real second[9];
        find_moments(w, link, second);
        set_inertia(second, w->masses[w->tree->mass_start[link]], w->link[link].inertia);
        add_singles(w, link, w->link[link].inertia);
        ncgen_copy(6, ncgen_nothing, w->link[link].wrench);
    }
}

/* The negative of I a + h x v + (P w) x w, and of a x h + m v + w x (w x h). */
static inline void set_wrench(const ncgen_real *second, ncgen_real total, ncgen_tree_link *own)
{
    const ncgen_real *first = second + 6, *turning = own->twist, *change = own->change, *lift = change + 3;
    const ncgen_real trace = second[0] + second[1] + second[2];
    ncgen_real *moment = own->wrench, *force = moment + 3, spun[3], moved[3];
    ncgen_turned(second, change, moment); /* I a = tr(P) a - P a */
    ncgen_add_times(-trace, change, moment);
    ncgen_add_cross(lift, first, moment);
    ncgen_turned(second, turning, spun);
    ncgen_add_cross(turning, spun, moment);
    ncgen_cross(first, change, force);
    ncgen_add_times(-total, lift, force);
    ncgen_cross(first, turning, moved);
    ncgen_add_cross(turning, moved, force);
}

void ncgen_tree_find_inertias_and_wrenches(ncgen_tree_work *w)
{
    for (int link = 0; link < w->tree->n_links; ++link) {
        ncgen_tree_link *own = w->link + link;
        const ncgen_real total = w->masses[w->tree->mass_start[link]];
        ncgen_real second[9];
        find_moments(w, link, second);
        set_inertia(second, total, own->inertia);
        set_wrench(second, total, own);
    }
}
