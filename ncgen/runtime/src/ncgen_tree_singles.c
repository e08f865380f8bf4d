/* ncgen_tree_singles.c: mass of an open tree's bodies that is not the same along all axes. */
#include "ncgen_tree_singles.h"

/* The velocity of one coordinate of an element, which may stand with another link, over a link's twist: six numbers. */
static void coordinate_row(const ncgen_tree_work *w, const ncgen_tree_link *own, int element, int axis, ncgen_real *row)
{
    const ncgen_tree_element *e = w->element + element;
    ncgen_real unit[3] = {0, 0, 0}, lever[3];
    unit[axis] = 1;
    for (int i = 0; i < 3; ++i)
        lever[i] = w->values[e->c[i]] - e->is_point * own->lane[(ORIGIN + i) * NCGEN_LINK_LANES];
    ncgen_cross(lever, unit, row);
    for (int i = 0; i < 3; ++i)
        row[3 + i] = e->is_point * unit[i];
}

void ncgen_tree_add_singles(ncgen_tree_work *w)
{
    const ncgen_tree *tree = w->tree;
    for (int link = 0; link < tree->n_links; ++link)
        for (int s = tree->single_start[link]; s < tree->single_start[link + 1]; ++s) {
            const int *entry = tree->singles + 5 * s;
            const int is_diagonal = entry[0] == entry[2] && entry[1] == entry[3];
            ncgen_real a[6], b[6];
            coordinate_row(w, w->link + link, entry[0], entry[1], a);
            coordinate_row(w, w->link + link, entry[2], entry[3], b);
            ncgen_add_product(tree->single_shares[s] * w->mass[entry[4]] * (is_diagonal ? 1 : 2), a, b, w->link[link].inertia);
        }
}

/* An element as a link carries it: where it is, how it is accelerated without the joints, and what this takes. */
typedef struct carried {
    int element; /* -1: none */
    ncgen_real lever[3], acceleration[3], force[3];
} carried;

static void leave(const ncgen_tree_work *w, ncgen_tree_link *own, const carried *at)
{
    if (at->element < 0)
        return;
    ncgen_real wrench[6];
    ncgen_get6(own->lane, WRENCH, wrench);
    ncgen_add_cross(at->force, at->lever, wrench);
    ncgen_add_times(-w->element[at->element].is_point, at->force, wrench + 3);
    ncgen_put6(wrench, own->lane, WRENCH);
}

static void come_to(const ncgen_tree_work *w, ncgen_tree_link *own, int element, carried *at)
{
    if (at->element == element)
        return;
    leave(w, own, at);
    const ncgen_tree_element *e = w->element + element;
    ncgen_real speed[3], twist[3], change[6];
    ncgen_get3(own->lane, TWIST, twist);
    ncgen_get6(own->lane, CHANGE, change);
    at->element = element;
    for (int i = 0; i < 3; ++i) {
        at->lever[i] = w->values[e->c[i]] - e->is_point * own->lane[(ORIGIN + i) * NCGEN_LINK_LANES];
        at->acceleration[i] = e->is_point * change[3 + i];
        at->force[i] = 0;
    }
    ncgen_add_cross(change, at->lever, at->acceleration);
    ncgen_cross(twist, at->lever, speed);
    ncgen_add_cross(twist, speed, at->acceleration);
}

void ncgen_tree_push_singles(ncgen_tree_work *w)
{
    const ncgen_tree *tree = w->tree;
    for (int link = 0; link < tree->n_links; ++link) {
        ncgen_tree_link *own = w->link + link;
        carried a = NCGEN_ALL_ZERO, b = NCGEN_ALL_ZERO;
        a.element = b.element = -1;
        for (int s = tree->single_start[link]; s < tree->single_start[link + 1]; ++s) {
            const int *entry = tree->singles + 5 * s;
            const ncgen_real mass = tree->single_shares[s] * w->mass[entry[4]];
            come_to(w, own, entry[0], &a);
            come_to(w, own, entry[2], &b);
            a.force[entry[1]] += mass * b.acceleration[entry[3]];
            if (entry[0] != entry[2] || entry[1] != entry[3])
                b.force[entry[3]] += mass * a.acceleration[entry[1]];
        }
        leave(w, own, &a);
        leave(w, own, &b);
    }
}
