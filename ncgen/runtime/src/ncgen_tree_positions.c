/* ncgen_tree_positions.c: positions of an open tree of bodies from the measured coordinates of its joints, in closed form.
 *
 * Every link is that of the first position of the run, turned and moved: by its parent, and by what its joint has done since. Where the
 * first position satisfies the constraints so does every other, whatever the lengths are.
 */
#include "ncgen_tree_positions.h"

/* sum += turn x, where the columns of a rotation stand one after the other. */
static inline void add_turned(const ncgen_real *turn, const ncgen_real *x, ncgen_real *sum)
{
    for (int k = 0; k < 3; ++k)
        ncgen_add_times(x[k], turn + 3 * k, sum);
}

/* A rotation about a unit axis (Rodrigues) after the one before. */
static inline void turn_on(const ncgen_real *axis, ncgen_real angle, ncgen_real *turn)
{
    const ncgen_real sine = NCGEN_SIN(angle), half = NCGEN_SIN(angle / 2), rest = 2 * half * half; /* 1 - cosine, to all digits */
    for (int k = 0; k < 3; ++k) {
        ncgen_real across[3], again[3];
        ncgen_cross(axis, turn + 3 * k, across);
        ncgen_cross(axis, across, again);
        ncgen_add_times(sine, across, turn + 3 * k);
        ncgen_add_times(rest, again, turn + 3 * k);
    }
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
    return 1;
}

/* How far every joint has come since the first position, in w->axes[4 k + 3] times that. */
static void find_travels(const ncgen_run *r, ncgen_tree_work *w, const ncgen_real *q)
{
    const ncgen_tree *tree = w->tree;
    for (int k = 0; k < tree->n_screws; ++k) {
        const ncgen_tree_screw *screw = w->screw + k;
        if (screw->leader >= 0)
            w->travel[k] = screw->ratio * w->travel[screw->leader];
        else
            w->travel[k] = (q[screw->coordinate] - w->first[screw->coordinate]) * screw->slowness;
    }
    for (int i = 0; i < tree->n_measured; ++i) {
        const int c = tree->measured[2 * i], k = tree->measured[2 * i + 1];
        const int is_own = w->screw[k].coordinate == c && w->screw[k].leader < 0;
        w->placed[c] = is_own ? q[c] : w->first[c] + tree->ratios[i] * w->travel[k];
    }
    ncgen_copy(tree->n_fixed, w->first + r->n, w->placed + r->n);
}

/* How a link stands: `turn` from its first position, and where its reference point is. */
static void place_link(const ncgen_tree_work *w, int link, ncgen_real *turn, ncgen_real *origin)
{
    static const ncgen_real unturned[12] = {1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0};
    const ncgen_tree *tree = w->tree;
    const int parent = tree->parent[link];
    const ncgen_real *before = parent < 0 ? unturned : w->turns + 12 * parent;
    ncgen_real offset[3];
    for (int i = 0; i < 3; ++i)
        offset[i] = w->first[tree->reference[3 * link + i]] - (parent < 0 ? 0 : w->first[tree->reference[3 * parent + i]]);
    for (int i = 0; i < 9; ++i)
        turn[i] = before[i];
    ncgen_set3(before + 9, origin);
    add_turned(before, offset, origin);
    for (int k = tree->screw_start[link]; k < tree->screw_start[link + 1]; ++k) {
        const ncgen_real amount = w->travel[k] * w->axes[4 * k + 3];
        ncgen_real axis[3] = {0, 0, 0};
        add_turned(before, w->axes + 4 * k, axis);
        if (w->screw[k].turns)
            turn_on(axis, amount, turn);
        else
            ncgen_add_times(amount, axis, origin);
    }
}

void ncgen_tree_place_all(const ncgen_run *r, ncgen_tree_work *w, const ncgen_real *q)
{
    const ncgen_tree *tree = w->tree;
    find_travels(r, w, q);
    const ncgen_tree_element *e = w->element;
    for (int link = 0; link < tree->n_links; ++link) {
        ncgen_real *turn = w->turns + 12 * link, *origin = turn + 9;
        const int *reference = tree->reference + 3 * link;
        place_link(w, link, turn, origin);
        for (const ncgen_tree_element *end = e + w->link[link].n_elements; e < end; ++e) {
            ncgen_real lever[3], at[3];
            for (int i = 0; i < 3; ++i) {
                lever[i] = w->first[e->c[i]] - e->is_point * w->first[reference[i]];
                at[i] = e->is_point * origin[i];
            }
            add_turned(turn, lever, at);
            for (int i = 0; i < 3; ++i)
                w->placed[e->c[i]] = at[i];
        }
    }
}
