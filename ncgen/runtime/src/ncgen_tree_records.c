/* ncgen_tree_records.c: the tables of an open tree as records, which every evaluation reads one after the other, and the masses in them. */
#include "ncgen_tree_records.h"

static ncgen_real *take_records(ncgen_space *space, int count, size_t size)
{
    return ncgen_take(space, count * (int)(size / sizeof(ncgen_real)));
}

static void lay_out_loops(ncgen_run *r, ncgen_tree_work *w)
{
    const int count = w->tree->n_opposed;
    w->are_there = w->n_independent = w->most_independent = 0;
    w->least_share = 1;
    w->n_rows = w->tree->n_closing;
    w->left = ncgen_take(&r->space, (w->tree->n_screws + w->tree->n_groups) * count);
    for (int i = 0; w->left && i < (w->tree->n_screws + w->tree->n_groups) * count; ++i)
        w->left[i] = 0;
    w->weights = ncgen_take(&r->space, w->tree->n_screws + w->tree->n_groups);
    w->square = ncgen_take(&r->space, count * count);
    w->own = ncgen_take(&r->space, count);
    w->missing = ncgen_take(&r->space, count);
    w->still = ncgen_take(&r->space, r->n);
    w->room = ncgen_take(&r->space, r->n + 1);
    w->order = (int *)take_records(&r->space, count, sizeof(ncgen_real));
}

void ncgen_tree_layout(ncgen_run *r, ncgen_tree_work *w)
{
    const ncgen_tree *tree = r->dynamics->tree;
    ncgen_space *space = &r->space;
    const int n_all = r->n + tree->n_fixed, n_values = ncgen_nonzeros(&r->model->phi_q_pattern);
    ncgen_real *links = take_records(space, tree->n_links + 1, sizeof(ncgen_tree_link));
    w->tree = tree;
    w->mass_is_there = w->is_factored = w->is_regular = w->are_there = 0;
    w->link = links ? (ncgen_tree_link *)links + 1 : NULL;
    w->element = (ncgen_tree_element *)take_records(space, tree->n_elements, sizeof(ncgen_tree_element));
    w->member = (ncgen_tree_member *)take_records(space, tree->member_start[tree->n_links], sizeof(ncgen_tree_member));
    w->screw = (ncgen_tree_screw *)take_records(space, tree->n_screws, sizeof(ncgen_tree_screw));
    w->values = ncgen_take(space, n_all);
    w->moved = ncgen_take(space, n_all);
    w->force = ncgen_take(space, n_all);
    w->mass = ncgen_take(space, ncgen_nonzeros(&r->model->mass_pattern));
    w->masses = ncgen_take(space, tree->mass_start[tree->n_links]);
    w->levers = ncgen_take(space, 3 * tree->most_members);
    w->joined = tree->n_groups ? ncgen_take(space, 6 * (tree->n_links + tree->n_groups)) : NULL;
    w->group = ncgen_take(space, 2 * tree->n_groups);
    w->bias = ncgen_take(space, r->n);
    w->step = ncgen_take(space, r->n + tree->n_copies);
    w->jacobian = ncgen_take(space, n_values);
    w->scaled = ncgen_take(space, n_values);
    w->gram = ncgen_take(space, tree->most_rows * tree->most_rows);
    w->right = ncgen_take(space, 2 * tree->most_rows);
    w->closed_form = NCGEN_UNKNOWN;
    w->first = ncgen_take(space, n_all);
    w->placed = ncgen_take(space, n_all);
    w->axes = ncgen_take(space, 4 * tree->n_screws);
    w->travel = ncgen_take(space, tree->n_screws);
    w->turns = ncgen_take(space, 12 * tree->n_links);
    w->gamma = ncgen_take(space, r->m);
    if (tree->n_closing)
        lay_out_loops(r, w);
}

static void begin_link(ncgen_tree_work *w, int link)
{
    const ncgen_tree *tree = w->tree;
    ncgen_tree_link *own = w->link + link;
    own->parent = tree->parent[link];
    for (int i = 0; i < 3; ++i)
        own->reference[i] = tree->reference[3 * link + i];
    own->n_elements = tree->element_start[link + 1] - tree->element_start[link];
    own->n_screws = tree->screw_start[link + 1] - tree->screw_start[link];
    own->n_members = tree->member_start[link + 1] - tree->member_start[link];
    own->group = tree->coupling[link];
    const int k = tree->screw_start[link];
    own->is_hinge = own->n_screws == 1 && own->group < 0 && tree->turns[k] && tree->meter[k] >= 0;
}

static void begin_screw(ncgen_tree_work *w, int k)
{
    const ncgen_tree *tree = w->tree;
    ncgen_tree_screw *own = w->screw + k;
    own->turns = tree->turns[k];
    own->is_carried = tree->is_carried[k] ? 1 : 0;
    own->first_term = tree->term_start[k] + 1;
    own->end_term = tree->term_start[k + 1];
    own->leader = tree->leader[k];
    own->coordinate = tree->meter[k] >= 0 ? tree->measured[2 * tree->meter[k]] : -1;
    own->ratio = tree->ratio[k];
    own->slowness = tree->meter[k] >= 0 ? 1 / tree->ratios[tree->meter[k]] : 1;
    own->weight = tree->weights[tree->term_start[k]];
    for (int i = 0; i < 3; ++i)
        own->c[i] = tree->terms[3 * tree->term_start[k] + i];
}

/* What no evaluation changes. */
static void begin(const ncgen_run *r, ncgen_tree_work *w)
{
    static const ncgen_tree_link ground = {.parent = -1};
    const ncgen_tree *tree = w->tree;
    w->link[-1] = ground;
    for (int link = 0; link < tree->n_links; ++link)
        begin_link(w, link);
    for (int e = 0; e < tree->n_elements; ++e) {
        for (int i = 0; i < 3; ++i)
            w->element[e].c[i] = tree->elements[3 * e + i];
        w->element[e].is_point = tree->is_point[e];
        w->element[e].heaviness = tree->heaviness[e];
    }
    for (int a = 0; a < tree->member_start[tree->n_links]; ++a) {
        for (int i = 0; i < 3; ++i)
            w->member[a].c[i] = tree->members[3 * a + i];
        w->member[a].is_point = tree->member_is_point[a];
    }
    for (int k = 0; k < tree->n_screws; ++k)
        begin_screw(w, k);
    for (int i = 0; i < tree->n_fixed; ++i) {
        w->values[r->n + i] = tree->fixed[i];
        w->force[r->n + i] = 0;
    }
}

/* The masses of a link's members; the number behind the last of them stands for the reference point. */
static void weigh(ncgen_tree_work *w, int link)
{
    const ncgen_tree *tree = w->tree;
    const int count = w->link[link].n_members;
    const ncgen_tree_member *members = w->member + tree->member_start[link];
    ncgen_real *total = w->masses + tree->mass_start[link], *shares = total + 1, *square = shares + count;
    for (int i = 0; i < 1 + count + count * count; ++i)
        total[i] = 0;
    for (int s = tree->pair_start[link]; s < tree->pair_start[link + 1]; ++s) {
        const int a = tree->pairs[3 * s], b = tree->pairs[3 * s + 1];
        const ncgen_real mass = tree->pair_shares[s] * w->mass[tree->pairs[3 * s + 2]];
        const ncgen_scalar a_is_point = a < count ? members[a].is_point : 1, b_is_point = b < count ? members[b].is_point : 1;
        if (a < count)
            shares[a] += mass * b_is_point;
        if (b < count && b != a)
            shares[b] += mass * a_is_point;
        if (a < count && b < count)
            square[a * count + b] = square[b * count + a] = mass;
        *total += (a == b ? 1 : 2) * mass * a_is_point * b_is_point;
    }
}

void ncgen_tree_mass_at(const ncgen_run *r, ncgen_tree_work *w, ncgen_scalar t, const ncgen_real *q)
{
    const ncgen_tree *tree = w->tree;
    if (w->mass_is_there && (!r->model->mass || r->model->mass_is_constant))
        return;
    if (!w->mass_is_there)
        begin(r, w);
    if (r->model->mass)
        r->model->mass(t, q, r->p, w->mass);
    for (int link = 0; link < tree->n_links; ++link)
        weigh(w, link);
    for (int k = 0; k < tree->n_screws; ++k)
        w->screw[k].rotor = 0;
    for (int i = 0; i < tree->n_rotors; ++i)
        w->screw[tree->rotors[2 * i]].rotor += tree->gears[i] * w->mass[tree->rotors[2 * i + 1]];
    w->mass_is_there = 1;
    w->is_factored = 0;
}
