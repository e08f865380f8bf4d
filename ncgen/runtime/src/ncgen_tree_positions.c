/* ncgen_tree_positions.c: positions of an open tree of bodies from the measured coordinates of its joints, in closed form.
 *
 * Every link is that of the first position of the run, turned and moved: by its parent, and by what its joint has done since. Where the
 * first position satisfies the constraints so does every other, whatever the lengths are.
 */
#include "ncgen_tree_positions.h"
#include "ncgen_tree_bodies.h"

/* sum += turn x, where the columns of a rotation stand one after the other. */
static inline void add_turned(const ncgen_real *turn, const ncgen_real *x, ncgen_real *sum)
{
    for (int k = 0; k < 3; ++k)
        ncgen_add_times(x[k], turn + 3 * k, sum);
}

/* A rotation about a unit axis (Rodrigues) after the one before; rest: 1 - cosine, to all digits. */
static inline void turn_on(const ncgen_real *axis, ncgen_real sine, ncgen_real rest, ncgen_real *turn)
{
    const ncgen_real x = rest * axis[0], y = rest * axis[1], z = rest * axis[2];
    const ncgen_real xy = x * axis[1], xz = x * axis[2], yz = y * axis[2];
    const ncgen_real a = sine * axis[0], b = sine * axis[1], c = sine * axis[2];
    const ncgen_real columns[9] = {1 - (y * axis[1] + z * axis[2]), xy + c, xz - b, xy - c, 1 - (x * axis[0] + z * axis[2]), yz + a,
                                   xz + b, yz - a, 1 - (x * axis[0] + y * axis[1])};
    ncgen_real before[9];
    for (int i = 0; i < 9; ++i)
        before[i] = turn[i];
    for (int k = 0; k < 3; ++k)
        for (int i = 0; i < 3; ++i)
            turn[3 * k + i] = before[i] * columns[3 * k] + before[3 + i] * columns[3 * k + 1] + before[6 + i] * columns[3 * k + 2];
}

/* Levers of all elements in the first position. */
static void keep_levers(ncgen_tree_work *w)
{
    const ncgen_tree_element *e = w->element;
    for (const ncgen_tree_link *own = w->link, *end = own + w->tree->n_links; own < end; ++own)
        for (const ncgen_tree_element *last = e + own->n_elements; e < last; ++e)
            for (int i = 0; i < 3; ++i)
                e->lane[(FIRST + i) * NCGEN_LINK_LANES] = w->first[e->c[i]] - e->is_point * w->first[own->reference[i]];
}

int ncgen_tree_keep_first(const ncgen_run *r, ncgen_tree_work *w, const ncgen_real *q)
{
    const ncgen_tree *tree = w->tree;
    ncgen_copy(r->n, q, w->first);
    ncgen_copy(tree->n_fixed, w->values + r->n, w->first + r->n);
    for (int link = 0; link < tree->n_links; ++link) {
        int turning = 0;
        for (int k = tree->screw_start[link]; k < tree->screw_start[link + 1]; ++k) {
            const ncgen_tree_screw *screw = w->screw + k;
            ncgen_real *axis = w->axes + 4 * k, square;
            for (int i = 0; i < 3; ++i)
                axis[i] = screw->weight * w->first[screw->c[i]];
            for (int s = screw->first_term; s < screw->end_term; ++s)
                for (int i = 0; i < 3; ++i)
                    axis[i] += tree->weights[s] * w->first[tree->terms[3 * s + i]];
            square = ncgen_dot3(axis, axis);
            if (!(square > 0) || (screw->coordinate < 0 && screw->leader < 0))
                return 0;
            axis[3] = NCGEN_SQRT(square);
            for (int i = 0; i < 3; ++i)
                axis[i] /= axis[3];
            turning += screw->turns;
        }
        if (turning > 1)
            return 0;
    }
    keep_levers(w);
    return 1;
}

/* How far every joint has come since the first position: for a screw the amount, and of a turn sine and 1 - cosine. */
static void find_travels(ncgen_tree_work *w, const ncgen_real *q)
{
    const int n_screws = w->tree->n_screws;
    ncgen_real *travel = w->travel, *half = travel + n_screws, *sine = half + n_screws, *cosine = sine + n_screws;
    for (int k = 0; k < n_screws; ++k) {
        const ncgen_tree_screw *screw = w->screw + k;
        if (screw->leader >= 0)
            travel[k] = screw->ratio * travel[screw->leader];
        else
            travel[k] = (q[screw->coordinate] - w->first[screw->coordinate]) * screw->slowness;
        half[k] = travel[k] * w->axes[4 * k + 3] / 2;
    }
    ncgen_sincos(n_screws, half, sine, cosine);
    for (int k = 0; k < n_screws; ++k) {
        cosine[k] *= 2 * sine[k];
        sine[k] *= 2 * sine[k];
    }
}

/* Measured coordinates, and fixed components. */
static void place_measured(const ncgen_run *r, ncgen_tree_work *w, const ncgen_real *q)
{
    const ncgen_tree *tree = w->tree;
    for (int i = 0; i < tree->n_measured; ++i) {
        const int c = tree->measured[2 * i], k = tree->measured[2 * i + 1];
        const int is_own = w->screw[k].coordinate == c && w->screw[k].leader < 0;
        w->placed[c] = is_own ? q[c] : w->first[c] + tree->ratios[i] * w->travel[k];
    }
    ncgen_copy(tree->n_fixed, w->first + r->n, w->placed + r->n);
}

/* How a link stands: columns of its rotation from the first position, and its reference point behind them; in place of its parent's. */
static inline void place_link(const ncgen_tree_work *w, int link, ncgen_real *turn)
{
    const ncgen_tree *tree = w->tree;
    const int n_screws = tree->n_screws;
    const ncgen_tree_link *own = w->link + link, *parent = w->link + own->parent;
    const ncgen_real *rest = w->travel + 2 * n_screws, *sine = rest + n_screws;
    ncgen_real offset[3], moved[3] = {0, 0, 0}, turned[9];
    for (int i = 0; i < 3; ++i)
        offset[i] = w->first[own->reference[i]] - (own->parent < 0 ? 0 : w->first[parent->reference[i]]);
    add_turned(turn, offset, moved);
    for (int i = 0; i < 9; ++i)
        turned[i] = turn[i];
    for (int k = tree->screw_start[link]; k < tree->screw_start[link + 1]; ++k)
        if (w->screw[k].turns)
            turn_on(w->axes + 4 * k, sine[k], rest[k], turned);
        else {
            const ncgen_real amount = w->travel[k] * w->axes[4 * k + 3];
            const ncgen_real along[3] = {amount * w->axes[4 * k], amount * w->axes[4 * k + 1], amount * w->axes[4 * k + 2]};
            add_turned(turn, along, moved);
        }
    for (int i = 0; i < 9; ++i)
        turn[i] = turned[i];
    ncgen_add_times(1, moved, turn + 9);
}

void ncgen_tree_place_all(const ncgen_run *r, ncgen_tree_work *w, const ncgen_real *q)
{
    static const ncgen_real unturned[12] = {1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0};
    const ncgen_tree *tree = w->tree;
    ncgen_real turn[12];
    find_travels(w, q);
    for (int link = 0; link < tree->n_links; ++link) {
        const int parent = tree->parent[link];
        if (link == 0 || parent != link - 1)
            for (int i = 0; i < 12; ++i)
                turn[i] = parent < 0 ? unturned[i] : ncgen_turn_lane(w, parent)[i * NCGEN_LINK_LANES];
        place_link(w, link, turn);
        for (int i = 0; i < 12; ++i)
            ncgen_turn_lane(w, link)[i * NCGEN_LINK_LANES] = turn[i];
    }
    ncgen_tree_turn_elements(w);
    ncgen_tree_take(r, w, w->placed);
    place_measured(r, w, q);
}
