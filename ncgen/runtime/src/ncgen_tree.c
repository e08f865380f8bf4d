/* ncgen_tree.c: the motion of an open tree of bodies, in loops over its tables.
 *
 * Everything is along the global axes, of every link about its own reference point, so that inertias of small bodies are not added to those
 * of long levers. A joint takes from the inertia A beyond it what it does not pass on, A - U U'/d with U = A s and d = s'U for its screw s;
 * outward, accelerations follow (Featherstone, Rigid Body Dynamics Algorithms, 2008, section 7.2). Forces and masses are the model's own:
 * with q' = T x the equations are T'M T x' = T'(Q - M b), so that whatever acts on coordinates acts on the tree.
 */
#include "ncgen_tree.h"

enum { MOST_SCREWS = 6 };

/* Places in 21 numbers of an inertia: angular momentum I w + B v, linear momentum B'w + M v; I and M xx, yy, zz, xy, xz, yz. */
enum { TURNING = 0, MIXED = 6, ALONG = 15, INERTIA = 21 };

static const ncgen_real NOTHING[6] = {0, 0, 0, 0, 0, 0};

static void cross(const ncgen_real *a, const ncgen_real *b, ncgen_real *out)
{
    out[0] = a[1] * b[2] - a[2] * b[1];
    out[1] = a[2] * b[0] - a[0] * b[2];
    out[2] = a[0] * b[1] - a[1] * b[0];
}

static void add_cross(const ncgen_real *a, const ncgen_real *b, ncgen_real *out)
{
    out[0] += a[1] * b[2] - a[2] * b[1];
    out[1] += a[2] * b[0] - a[0] * b[2];
    out[2] += a[0] * b[1] - a[1] * b[0];
}

static void add_times(ncgen_real factor, const ncgen_real *a, ncgen_real *out)
{
    out[0] += factor * a[0];
    out[1] += factor * a[1];
    out[2] += factor * a[2];
}

static ncgen_real dot(const ncgen_real *a, const ncgen_real *b)
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/* A symmetric matrix times a vector. */
static void turned(const ncgen_real *s, const ncgen_real *a, ncgen_real *out)
{
    out[0] = s[0] * a[0] + s[3] * a[1] + s[4] * a[2];
    out[1] = s[3] * a[0] + s[1] * a[1] + s[5] * a[2];
    out[2] = s[4] * a[0] + s[5] * a[1] + s[2] * a[2];
}

/* The reference point of a link, from that of its parent. */
static void between(const ncgen_tree_work *w, int link, ncgen_real *d)
{
    const ncgen_tree *tree = w->tree;
    const int *mine = tree->reference + 3 * link, *before = tree->reference + 3 * tree->parent[link];
    for (int i = 0; i < 3; ++i)
        d[i] = w->values[mine[i]] - w->values[before[i]];
}

static const ncgen_real *of_parent(const ncgen_tree_work *w, const ncgen_real *all, int link)
{
    return w->tree->parent[link] < 0 ? NOTHING : all + 6 * w->tree->parent[link];
}

void ncgen_tree_layout(ncgen_run *r, ncgen_tree_work *w)
{
    const ncgen_tree *tree = r->dynamics->tree;
    const ncgen_pattern *mass = &r->model->mass_pattern, *phi_q = &r->model->phi_q_pattern;
    ncgen_space *space = &r->space;
    w->tree = tree;
    w->mass_is_there = 0;
    w->values = ncgen_take(space, r->n + tree->n_fixed);
    w->mass = ncgen_take(space, mass->indptr ? mass->indptr[mass->rows] : 0);
    w->lever = ncgen_take(space, 3 * tree->n_elements);
    w->axis = ncgen_take(space, 3 * tree->n_screws);
    w->twist = ncgen_take(space, 6 * tree->n_links);
    w->change = ncgen_take(space, 6 * tree->n_links);
    w->wrench = ncgen_take(space, 6 * tree->n_links);
    w->inertia = ncgen_take(space, INERTIA * tree->n_links);
    w->momentum = ncgen_take(space, 6 * tree->n_screws);
    w->pivot = ncgen_take(space, tree->n_screws);
    w->push = ncgen_take(space, tree->n_screws);
    w->rate = ncgen_take(space, tree->n_screws);
    w->force = ncgen_take(space, r->n);
    w->bias = ncgen_take(space, r->n);
    w->inertial = ncgen_take(space, r->n);
    w->square = ncgen_take(space, tree->most_rows * tree->most_rows);
    w->right = ncgen_take(space, 2 * tree->most_rows);
    w->jacobian = ncgen_take(space, phi_q->indptr ? phi_q->indptr[phi_q->rows] : 0);
    w->dense = ncgen_take(space, tree->most_rows * tree->most_unknowns);
}

/* Levers and axes at a position. */
static void place(const ncgen_run *r, ncgen_tree_work *w, const ncgen_real *q)
{
    const ncgen_tree *tree = w->tree;
    ncgen_copy(r->n, q, w->values);
    for (int i = 0; i < tree->n_fixed; ++i)
        w->values[r->n + i] = tree->fixed[i];
    for (int link = 0; link < tree->n_links; ++link) {
        const int *origin = tree->reference + 3 * link;
        for (int e = tree->element_start[link]; e < tree->element_start[link + 1]; ++e)
            for (int i = 0; i < 3; ++i)
                w->lever[3 * e + i] = w->values[tree->elements[3 * e + i]] - (tree->is_point[e] ? w->values[origin[i]] : 0);
    }
    for (int k = 0; k < tree->n_screws; ++k) {
        ncgen_real *axis = w->axis + 3 * k;
        axis[0] = axis[1] = axis[2] = 0;
        for (int s = tree->term_start[k]; s < tree->term_start[k + 1]; ++s)
            for (int i = 0; i < 3; ++i)
                axis[i] += tree->weights[s] * w->values[tree->terms[3 * s + i]];
    }
}

/* Velocities ------------------------------------------------------------------------------------------------------ */

/* The velocity of an element that moves with a link. */
static void carried(const ncgen_tree_work *w, int element, const ncgen_real *twist, ncgen_real *velocity)
{
    cross(twist, w->lever + 3 * element, velocity);
    if (w->tree->is_point[element])
        add_times(1, twist + 3, velocity);
}

/* A screw's rate added to a twist. */
static void add_screw(const ncgen_tree_work *w, int screw, ncgen_real rate, ncgen_real *twist)
{
    add_times(rate, w->axis + 3 * screw, twist + (w->tree->turns[screw] ? 0 : 3));
}

/* The velocity of an element at rate 1 of a screw. */
static void moved(const ncgen_tree_work *w, int element, int screw, ncgen_real *velocity)
{
    const ncgen_real *axis = w->axis + 3 * screw;
    if (w->tree->turns[screw])
        cross(axis, w->lever + 3 * element, velocity);
    else
        for (int i = 0; i < 3; ++i)
            velocity[i] = w->tree->is_point[element] ? axis[i] : 0;
}

/* The rates of a link's joint that fit the velocities of its elements best, the twist without them being known. */
static int find_rates(const ncgen_run *r, ncgen_tree_work *w, int link, const ncgen_real *qd, const ncgen_real *twist)
{
    const ncgen_tree *tree = w->tree;
    const int first = tree->screw_start[link], count = tree->screw_start[link + 1] - first;
    ncgen_real square[MOST_SCREWS * MOST_SCREWS] = {0}, right[MOST_SCREWS] = {0}, column[3 * MOST_SCREWS];
    for (int e = tree->element_start[link]; e < tree->element_start[link + 1]; ++e) {
        ncgen_real rest[3];
        carried(w, e, twist, rest);
        for (int i = 0; i < 3; ++i) {
            const int c = tree->elements[3 * e + i];
            rest[i] = (c < r->n ? qd[c] : 0) - rest[i];
        }
        for (int a = 0; a < count; ++a) {
            moved(w, e, first + a, column + 3 * a);
            right[a] += tree->heaviness[e] * dot(column + 3 * a, rest);
            for (int b = 0; b <= a; ++b)
                square[a * count + b] += tree->heaviness[e] * dot(column + 3 * a, column + 3 * b);
        }
    }
    const int status = ncgen_solve_positive(count, square, right);
    ncgen_copy(count, right, w->rate + first);
    return status;
}

/* Twists of all links from velocities of the coordinates; the velocities that the joints allow. */
static int find_twists(const ncgen_run *r, ncgen_tree_work *w, const ncgen_real *qd, ncgen_real *allowed)
{
    const ncgen_tree *tree = w->tree;
    int status = NCGEN_OK;
    for (int link = 0; link < tree->n_links; ++link) {
        const ncgen_real *before = of_parent(w, w->twist, link);
        ncgen_real *twist = w->twist + 6 * link, d[3];
        ncgen_copy(6, before, twist);
        if (tree->parent[link] >= 0) {
            between(w, link, d);
            add_cross(before, d, twist + 3);
        }
        if (find_rates(r, w, link, qd, twist) != NCGEN_OK)
            status = NCGEN_SINGULAR;
        for (int k = tree->screw_start[link]; k < tree->screw_start[link + 1]; ++k)
            add_screw(w, k, w->rate[k], twist);
    }
    for (int link = 0; link < tree->n_links; ++link)
        for (int e = tree->element_start[link]; e < tree->element_start[link + 1]; ++e) {
            ncgen_real velocity[3];
            carried(w, e, w->twist + 6 * link, velocity);
            for (int i = 0; i < 3; ++i)
                if (tree->elements[3 * e + i] < r->n)
                    allowed[tree->elements[3 * e + i]] = velocity[i];
        }
    for (int i = 0; i < tree->n_measured; ++i)
        allowed[tree->measured[2 * i]] = tree->ratios[i] * w->rate[tree->measured[2 * i + 1]];
    return status;
}

/* Accelerations ---------------------------------------------------------------------------------------------------- */

/* What the accelerations of links are without those of the joints. */
static void find_changes(ncgen_tree_work *w)
{
    const ncgen_tree *tree = w->tree;
    for (int link = 0; link < tree->n_links; ++link) {
        const ncgen_real *before = of_parent(w, w->twist, link), *twist = w->twist + 6 * link;
        const ncgen_real *outer = of_parent(w, w->change, link);
        ncgen_real *change = w->change + 6 * link, d[3], turned_axis[3];
        ncgen_copy(6, outer, change);
        if (tree->parent[link] < 0)
            continue;
        between(w, link, d);
        add_cross(outer, d, change + 3);
        for (int i = 0; i < 3; ++i)
            d[i] = twist[3 + i] - before[3 + i];
        add_cross(before, d, change + 3);
        for (int k = tree->screw_start[link]; k < tree->screw_start[link + 1]; ++k)
            if (tree->is_carried[k]) {
                cross(before, w->axis + 3 * k, turned_axis);
                add_times(w->rate[k], turned_axis, change + (tree->turns[k] ? 0 : 3));
            }
    }
}

/* Accelerations of the coordinates from those of the links; measured ones stay out. */
static void spread_changes(const ncgen_run *r, const ncgen_tree_work *w, ncgen_real *accelerations)
{
    const ncgen_tree *tree = w->tree;
    for (int link = 0; link < tree->n_links; ++link)
        for (int e = tree->element_start[link]; e < tree->element_start[link + 1]; ++e) {
            const ncgen_real *twist = w->twist + 6 * link;
            ncgen_real speed[3], found[3];
            cross(twist, w->lever + 3 * e, speed);
            carried(w, e, w->change + 6 * link, found);
            add_cross(twist, speed, found);
            for (int i = 0; i < 3; ++i)
                if (tree->elements[3 * e + i] < r->n)
                    accelerations[tree->elements[3 * e + i]] = found[i];
        }
}

/* Forces along coordinates as wrenches on links, and as pushes of joints. */
static void find_wrenches(const ncgen_run *r, ncgen_tree_work *w, const ncgen_real *force)
{
    const ncgen_tree *tree = w->tree;
    for (int link = 0; link < tree->n_links; ++link) {
        ncgen_real *wrench = w->wrench + 6 * link;
        ncgen_copy(6, NOTHING, wrench);
        for (int e = tree->element_start[link]; e < tree->element_start[link + 1]; ++e) {
            ncgen_real own[3];
            for (int i = 0; i < 3; ++i)
                own[i] = tree->elements[3 * e + i] < r->n ? force[tree->elements[3 * e + i]] : 0;
            add_cross(w->lever + 3 * e, own, wrench);
            if (tree->is_point[e])
                add_times(1, own, wrench + 3);
        }
    }
    for (int k = 0; k < tree->n_screws; ++k)
        w->push[k] = 0;
    for (int i = 0; i < tree->n_measured; ++i)
        w->push[tree->measured[2 * i + 1]] += tree->ratios[i] * force[tree->measured[2 * i]];
}

/* Inertia ---------------------------------------------------------------------------------------------------------- */

/* From a link's reference point to an element of its body, which may stand with another link. */
static void lever_of(const ncgen_tree_work *w, int link, int element, ncgen_real *lever)
{
    const ncgen_tree *tree = w->tree;
    for (int i = 0; i < 3; ++i)
        lever[i] = w->values[tree->elements[3 * element + i]] - (tree->is_point[element] ? w->values[tree->reference[3 * link + i]] : 0);
}

/* The inertia of pairs, whose mass is the same in all directions: I = tr(P) 1 - P, B = h x. */
static void add_pairs(const ncgen_tree_work *w, int link, ncgen_real *inertia)
{
    const ncgen_tree *tree = w->tree;
    ncgen_real second[6] = {0}, first[3] = {0}, mass = 0;
    for (int s = tree->pair_start[link]; s < tree->pair_start[link + 1]; ++s) {
        const int a = tree->pairs[3 * s], b = tree->pairs[3 * s + 1];
        ncgen_real x[3], y[3];
        lever_of(w, link, a, x);
        lever_of(w, link, b, y);
        const ncgen_real m = w->mass[tree->pairs[3 * s + 2]] * (a == b ? R(0.5) : 1);
        for (int i = 0; i < 3; ++i) {
            second[i] += 2 * m * x[i] * y[i];
            first[i] += m * ((tree->is_point[a] ? y[i] : 0) + (tree->is_point[b] ? x[i] : 0));
        }
        second[3] += m * (x[0] * y[1] + x[1] * y[0]);
        second[4] += m * (x[0] * y[2] + x[2] * y[0]);
        second[5] += m * (x[1] * y[2] + x[2] * y[1]);
        if (tree->is_point[a] && tree->is_point[b])
            mass += 2 * m;
    }
    inertia[TURNING] += second[1] + second[2];
    inertia[TURNING + 1] += second[0] + second[2];
    inertia[TURNING + 2] += second[0] + second[1];
    for (int i = 3; i < 6; ++i)
        inertia[TURNING + i] -= second[i];
    inertia[MIXED + 1] -= first[2];
    inertia[MIXED + 2] += first[1];
    inertia[MIXED + 3] += first[2];
    inertia[MIXED + 5] -= first[0];
    inertia[MIXED + 6] -= first[1];
    inertia[MIXED + 7] += first[0];
    for (int i = 0; i < 3; ++i)
        inertia[ALONG + i] += mass;
}

/* factor (a b' + b a') / 2 in an inertia, of six numbers each. */
static void add_product(ncgen_real factor, const ncgen_real *a, const ncgen_real *b, ncgen_real *inertia)
{
    static const int row[6] = {0, 1, 2, 0, 0, 1}, column[6] = {0, 1, 2, 1, 2, 2};
    const ncgen_real half = factor / 2;
    for (int s = 0; s < 6; ++s) {
        const int i = row[s], j = column[s];
        inertia[TURNING + s] += half * (a[i] * b[j] + b[i] * a[j]);
        inertia[ALONG + s] += half * (a[3 + i] * b[3 + j] + b[3 + i] * a[3 + j]);
    }
    for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j)
            inertia[MIXED + 3 * i + j] += half * (a[i] * b[3 + j] + b[i] * a[3 + j]);
}

/* The velocity of one coordinate of an element over a twist: six numbers. */
static void coordinate_row(const ncgen_tree_work *w, int link, int element, int axis, ncgen_real *row)
{
    ncgen_real unit[3] = {0, 0, 0}, lever[3];
    unit[axis] = 1;
    lever_of(w, link, element, lever);
    cross(lever, unit, row);
    for (int i = 0; i < 3; ++i)
        row[3 + i] = w->tree->is_point[element] ? unit[i] : 0;
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
        add_product(w->mass[entry[4]] * (is_diagonal ? 1 : 2), a, b, inertia);
    }
}

/* An inertia about a point that is d away from the one it is about now, added to another one:
 * B + D M, and I - B D + D B' - D M D, where D is d x. */
static void add_shifted(const ncgen_real *inertia, const ncgen_real *d, ncgen_real *sum)
{
    const ncgen_real *B = inertia + MIXED, *M = inertia + ALONG;
    const ncgen_real full[9] = {M[0], M[3], M[4], M[3], M[1], M[5], M[4], M[5], M[2]};
    ncgen_real mixed[9], left[9], right[9];
    for (int j = 0; j < 3; ++j) {
        mixed[j] = B[j] + d[1] * full[6 + j] - d[2] * full[3 + j];
        mixed[3 + j] = B[3 + j] + d[2] * full[j] - d[0] * full[6 + j];
        mixed[6 + j] = B[6 + j] + d[0] * full[3 + j] - d[1] * full[j];
    }
    for (int i = 0; i < 3; ++i) { /* rows of B D and of (B + D M) D: b x d */
        cross(B + 3 * i, d, left + 3 * i);
        cross(mixed + 3 * i, d, right + 3 * i);
    }
    sum[TURNING] += inertia[0] - left[0] - right[0];
    sum[TURNING + 1] += inertia[1] - left[4] - right[4];
    sum[TURNING + 2] += inertia[2] - left[8] - right[8];
    sum[TURNING + 3] += inertia[3] - left[3] - right[1];
    sum[TURNING + 4] += inertia[4] - left[6] - right[2];
    sum[TURNING + 5] += inertia[5] - left[7] - right[5];
    for (int i = 0; i < 9; ++i)
        sum[MIXED + i] += mixed[i];
    for (int i = 0; i < 6; ++i)
        sum[ALONG + i] += M[i];
}

/* Momentum of an inertia for a screw at rate 1. */
static void find_momentum(const ncgen_real *inertia, int turns, const ncgen_real *axis, ncgen_real *momentum)
{
    const ncgen_real *B = inertia + MIXED;
    if (turns) {
        turned(inertia, axis, momentum);
        for (int i = 0; i < 3; ++i)
            momentum[3 + i] = B[i] * axis[0] + B[3 + i] * axis[1] + B[6 + i] * axis[2];
    } else {
        for (int i = 0; i < 3; ++i)
            momentum[i] = dot(B + 3 * i, axis);
        turned(inertia + ALONG, axis, momentum + 3);
    }
}

/* Momenta and pivots of all screws; 0 where one of them moves nothing. */
static int factor(ncgen_tree_work *w)
{
    const ncgen_tree *tree = w->tree;
    int is_regular = 1;
    for (int i = 0; i < INERTIA * tree->n_links; ++i)
        w->inertia[i] = 0;
    for (int k = 0; k < tree->n_screws; ++k)
        w->pivot[k] = 0;
    for (int i = 0; i < tree->n_rotors; ++i)
        w->pivot[tree->rotors[2 * i]] += tree->gears[i] * w->mass[tree->rotors[2 * i + 1]];
    for (int link = tree->n_links - 1; link >= 0; --link) {
        ncgen_real *inertia = w->inertia + INERTIA * link, d[3];
        add_pairs(w, link, inertia);
        add_singles(w, link, inertia);
        for (int k = tree->screw_start[link + 1] - 1; k >= tree->screw_start[link]; --k) {
            ncgen_real *momentum = w->momentum + 6 * k;
            const ncgen_real *axis = w->axis + 3 * k;
            find_momentum(inertia, tree->turns[k], axis, momentum);
            const ncgen_real pivot = w->pivot[k] + dot(axis, momentum + (tree->turns[k] ? 0 : 3));
            is_regular &= pivot > 0;
            w->pivot[k] = 1 / pivot;
            add_product(-w->pivot[k], momentum, momentum, inertia);
        }
        if (tree->parent[link] >= 0) {
            between(w, link, d);
            add_shifted(inertia, d, w->inertia + INERTIA * tree->parent[link]);
        }
    }
    return is_regular;
}

/* What the wrenches and pushes change the joints' rates by, added to `change` of all links; in w->push. */
static void solve(ncgen_tree_work *w, ncgen_real *change)
{
    const ncgen_tree *tree = w->tree;
    for (int link = tree->n_links - 1; link >= 0; --link) {
        ncgen_real *wrench = w->wrench + 6 * link, d[3];
        for (int k = tree->screw_start[link + 1] - 1; k >= tree->screw_start[link]; --k) {
            w->push[k] += dot(w->axis + 3 * k, wrench + (tree->turns[k] ? 0 : 3));
            const ncgen_real share = w->pivot[k] * w->push[k];
            add_times(-share, w->momentum + 6 * k, wrench);
            add_times(-share, w->momentum + 6 * k + 3, wrench + 3);
        }
        if (tree->parent[link] >= 0) {
            ncgen_real *sum = w->wrench + 6 * tree->parent[link];
            between(w, link, d);
            add_cross(d, wrench + 3, sum);
            add_times(1, wrench, sum);
            add_times(1, wrench + 3, sum + 3);
        }
    }
    /* Outward the wrenches are not needed any more, and the accelerations that are due to them take their place. */
    for (int link = 0; link < tree->n_links; ++link) {
        const ncgen_real *before = of_parent(w, w->wrench, link);
        ncgen_real *own = w->wrench + 6 * link, d[3];
        ncgen_copy(6, before, own);
        if (tree->parent[link] >= 0) {
            between(w, link, d);
            add_cross(before, d, own + 3);
        }
        for (int k = tree->screw_start[link]; k < tree->screw_start[link + 1]; ++k) {
            const ncgen_real known = dot(w->momentum + 6 * k, own) + dot(w->momentum + 6 * k + 3, own + 3);
            w->push[k] = w->pivot[k] * (w->push[k] - known);
            add_screw(w, k, w->push[k], own);
        }
        for (int i = 0; i < 6; ++i)
            change[6 * link + i] += own[i];
    }
}

/* M at a position, unless it is constant and known. */
static void mass_at(const ncgen_run *r, ncgen_tree_work *w, ncgen_scalar t, const ncgen_real *q)
{
    if (r->model->mass && !(w->mass_is_there && r->model->mass_is_constant))
        r->model->mass(t, q, r->p, w->mass);
    w->mass_is_there = 1;
}

static ncgen_real growth_of(int is_regular)
{
    return is_regular ? 0 : R(1.0e30);
}

void ncgen_tree_derivative(ncgen_run *r, ncgen_tree_work *w, ncgen_scalar t, const ncgen_real *q, const ncgen_real *qd, ncgen_real *out)
{
    const int n = r->n;
    ncgen_real energy[3] = {0, 0, 0};
    place(r, w, q);
    int is_regular = find_twists(r, w, qd, out) == NCGEN_OK;
    find_changes(w);
    for (int i = 0; i < n; ++i)
        w->bias[i] = w->force[i] = 0;
    spread_changes(r, w, w->bias);
    mass_at(r, w, t, q);
    if (r->model->force && r->model->force(t, q, out, r->p, w->force) != NCGEN_OK)
        is_regular = 0;
    ncgen_times_mass(r, w->mass, w->bias, w->inertial);
    for (int i = 0; i < n; ++i)
        w->force[i] -= w->inertial[i];
    find_wrenches(r, w, w->force);
    is_regular &= factor(w);
    solve(w, w->change);
    spread_changes(r, w, out + n);
    for (int i = 0; i < w->tree->n_measured; ++i)
        out[n + w->tree->measured[2 * i]] = w->tree->ratios[i] * w->push[w->tree->measured[2 * i + 1]];
    if (!r->dynamics->conservative && r->model->energy && r->model->energy(t, q, out, r->p, energy) != NCGEN_OK)
        is_regular = 0;
    out[2 * n] = energy[2];
    out[2 * n + 1] = growth_of(is_regular && ncgen_is_finite(2 * n, out));
}

/* What is left of the velocities, x, has the momentum T'M x over the rates, which changes them by (T'M T)^-1 T'M x. */
void ncgen_tree_velocities(ncgen_run *r, ncgen_tree_work *w, ncgen_scalar t, const ncgen_real *q, const ncgen_real *qd, ncgen_real *out)
{
    const int n = r->n;
    const ncgen_tree *tree = w->tree;
    place(r, w, q);
    int is_regular = find_twists(r, w, qd, out) == NCGEN_OK;
    mass_at(r, w, t, q);
    for (int i = 0; i < n; ++i)
        w->bias[i] = qd[i] - out[i];
    ncgen_times_mass(r, w->mass, w->bias, w->force);
    find_wrenches(r, w, w->force);
    is_regular &= factor(w);
    solve(w, w->twist);
    for (int link = 0; link < tree->n_links; ++link)
        for (int e = tree->element_start[link]; e < tree->element_start[link + 1]; ++e) {
            ncgen_real velocity[3];
            carried(w, e, w->twist + 6 * link, velocity);
            for (int i = 0; i < 3; ++i)
                if (tree->elements[3 * e + i] < n)
                    out[tree->elements[3 * e + i]] = velocity[i];
        }
    for (int i = 0; i < tree->n_measured; ++i)
        out[tree->measured[2 * i]] += tree->ratios[i] * w->push[tree->measured[2 * i + 1]];
    out[n] = growth_of(is_regular && ncgen_is_finite(n, out));
}

/* Positions -------------------------------------------------------------------------------------------------------- */

/* The smallest change, in natural sizes, of a link's coordinates that closes its rows, the others' changes being known. A row that
 * those before it imply is left out. */
static void close_link(const ncgen_run *r, ncgen_tree_work *w, int link, const ncgen_real *phi, ncgen_real *step)
{
    const ncgen_tree *tree = w->tree;
    const ncgen_pattern *phi_q = &r->model->phi_q_pattern;
    const ncgen_scalar *sizes = r->dynamics->column_sizes;
    const int first = tree->row_start[link], count = tree->row_start[link + 1] - first;
    const int begin = tree->unknowns[link], width = tree->unknowns[link + 1] - begin;
    ncgen_real *a = w->square, *right = w->right, *diagonal = w->right + tree->most_rows;
    for (int i = 0; i < count; ++i) {
        const int row = tree->rows[first + i];
        ncgen_real *own = w->dense + i * width;
        for (int j = 0; j < width; ++j)
            own[j] = 0;
        right[i] = -phi[row];
        for (int s = phi_q->indptr[row]; s < phi_q->indptr[row + 1]; ++s) {
            const int c = phi_q->indices[s];
            if (tree->group[c] == link)
                own[tree->place[c]] = w->jacobian[s] * sizes[c];
            else
                right[i] -= w->jacobian[s] * step[c];
        }
        for (int j = 0; j <= i; ++j)
            a[i * count + j] = ncgen_dot(width, own, w->dense + j * width);
        diagonal[i] = a[i * count + i];
    }
    for (int k = 0; k < count; ++k) {
        const int is_implied = !(a[k * count + k] > 1000 * r->rounding * diagonal[k]);
        for (int i = k; is_implied && i < count; ++i)
            a[i * count + k] = 0;
        if (is_implied) {
            a[k * count + k] = 1;
            for (int j = 0; j < k; ++j)
                a[k * count + j] = 0;
            right[k] = 0;
        }
        for (int i = k + 1; i < count; ++i) {
            const ncgen_real share = a[i * count + k] / a[k * count + k];
            for (int j = k + 1; j <= i; ++j)
                a[i * count + j] -= share * a[j * count + k];
        }
    }
    ncgen_solve_positive_again(count, a, right);
    for (int j = 0; j < width; ++j) {
        const int c = tree->order[begin + j];
        step[c] = 0;
        for (int i = 0; i < count; ++i)
            step[c] += w->dense[i * width + j] * right[i];
        step[c] *= sizes[c];
    }
}

void ncgen_tree_closing(ncgen_run *r, ncgen_tree_work *w, ncgen_scalar t, const ncgen_real *q, ncgen_real *out)
{
    ncgen_real *phi = out + r->n;
    ncgen_phi(r, t, q, phi);
    ncgen_phi_q(r, t, q, w->jacobian);
    for (int link = 0; link < w->tree->n_links; ++link)
        close_link(r, w, link, phi, out);
}
