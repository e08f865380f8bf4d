/* ncgen_tree_rates.c: rates of the joints of an open tree from velocities of coordinates. */
#include "ncgen_tree_rates.h"
#include "ncgen_positive.h"

enum { MOST_SCREWS = 6 };

static int fit_rates(const ncgen_run *r, const ncgen_tree_link *own, const ncgen_tree_place *at, const ncgen_real *qd,
                     const ncgen_real *twist)
{
    const int count = own->n_screws;
    ncgen_real square[MOST_SCREWS * MOST_SCREWS] = {0}, right[MOST_SCREWS] = {0}, column[3 * MOST_SCREWS];
    for (const ncgen_tree_element *e = at->element; e < at->element + own->n_elements; ++e) {
        ncgen_real rest[3];
        if (!(e->heaviness > 0))
            continue;
        ncgen_carried(e, twist, rest);
        for (int i = 0; i < 3; ++i)
            rest[i] = (e->c[i] < r->n ? qd[e->c[i]] : 0) - rest[i];
        for (int a = 0; a < count; ++a) {
            ncgen_real unit[6] = {0, 0, 0, 0, 0, 0};
            ncgen_set3(at->screw[a].axis, unit + (at->screw[a].turns ? 0 : 3));
            ncgen_carried(e, unit, column + 3 * a);
            right[a] += e->heaviness * ncgen_dot3(column + 3 * a, rest);
            for (int b = 0; b <= a; ++b)
                square[a * count + b] += e->heaviness * ncgen_dot3(column + 3 * a, column + 3 * b);
        }
    }
    const int status = ncgen_solve_positive(count, square, right);
    for (int a = 0; a < count; ++a)
        at->screw[a].rate = right[a];
    return status;
}

int ncgen_tree_find_rates(const ncgen_run *r, ncgen_tree_work *w, const ncgen_tree_link *own, const ncgen_tree_place *at,
                          const ncgen_real *qd, const ncgen_real *twist)
{
    const ncgen_tree_screw *end = at->screw + own->n_screws;
    int is_measured = 1;
    for (const ncgen_tree_screw *screw = at->screw; screw < end; ++screw)
        is_measured &= screw->coordinate >= 0 || screw->leader >= 0;
    const int status = is_measured ? NCGEN_OK : fit_rates(r, own, at, qd, twist);
    for (ncgen_tree_screw *screw = at->screw; screw < end; ++screw)
        if (screw->leader >= 0)
            screw->rate = screw->ratio * w->screw[screw->leader].rate;
        else if (screw->coordinate >= 0)
            screw->rate = qd[screw->coordinate] * screw->slowness;
    return status;
}
