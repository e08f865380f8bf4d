/* ncgen_tree_records.c: the tables of an open tree as records, which every evaluation reads one after the other, and the masses in them. */
#include "ncgen_tree_records.h"

/* Room that begins with a line of the cache, whatever stands in it. */
static void *take_lines(ncgen_space *space, int count)
{
    enum { LINE = 64 };
    char *part = (char *)ncgen_take(space, count + LINE / (int)sizeof(ncgen_real));
    return part ? part + (LINE - (size_t)part % LINE) % LINE : NULL;
}

static ncgen_real *take_records(ncgen_space *space, int count, size_t size)
{
    return (ncgen_real *)take_lines(space, count * (int)(size / sizeof(ncgen_real)));
}

/* The slot of a member of a link's body: that of an element that stands with the link, or of the next other one. */
static int slot_of(const ncgen_tree *tree, int link, int member, int n_own, int *n_others)
{
    const int *c = tree->members + 3 * member;
    for (int e = tree->element_start[link]; e < tree->element_start[link + 1]; ++e) {
        const int *own = tree->elements + 3 * e;
        if (c[0] == own[0] && c[1] == own[1] && c[2] == own[2])
            return e - tree->element_start[link];
    }
    return n_own + (*n_others)++;
}

/* How many slots the block from a link on has, and of them for elements that stand with its links. */
static int count_slots(const ncgen_tree *tree, int first, int *n_own)
{
    int most = 0;
    *n_own = 0;
    for (int link = first; link < first + NCGEN_LINK_LANES && link < tree->n_links; ++link) {
        const int count = tree->element_start[link + 1] - tree->element_start[link];
        int n_others = 0;
        for (int a = tree->member_start[link]; a < tree->member_start[link + 1]; ++a)
            (void)slot_of(tree, link, a, 0, &n_others);
        *n_own = count > *n_own ? count : *n_own;
        most = n_others > most ? n_others : most;
    }
    return *n_own + most;
}

static ncgen_link_lanes *take_lanes(ncgen_space *space, int count)
{
    return (ncgen_link_lanes *)take_lines(space, count * NCGEN_LINK_LANES);
}

/* Slots of what belongs to no element: measured coordinates. */
static int count_last_slots(const ncgen_tree *tree)
{
    return 1 + tree->n_measured / (3 * NCGEN_LINK_LANES);
}

static void lay_out_blocks(ncgen_run *r, ncgen_tree_work *w)
{
    const ncgen_tree *tree = w->tree;
    const int count = (tree->n_links + NCGEN_LINK_LANES - 1) / NCGEN_LINK_LANES;
    int n_slots = 0, n_masses = 0, n_own;
    for (int b = 0; b < count; ++b) {
        const int own = count_slots(tree, b * NCGEN_LINK_LANES, &n_own);
        n_slots += own;
        n_masses += own * (own + 1);
    }
    w->n_blocks = count;
    w->block = (ncgen_tree_block *)take_records(&r->space, count, sizeof(ncgen_tree_block));
    w->numbers = take_lanes(&r->space, (count + 1) * BLOCK_NUMBERS);
    w->masses = take_lanes(&r->space, n_masses);
    w->slot = (ncgen_tree_slot *)take_lanes(&r->space, (n_slots + count_last_slots(tree)) * SLOT_NUMBERS);
    w->where = (int *)ncgen_take(&r->space, r->n);
    w->other_at = (int *)ncgen_take(&r->space, 3 * tree->member_start[tree->n_links]);
    w->other = (int *)ncgen_take(&r->space, 3 * tree->member_start[tree->n_links]);
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
    w->room = ncgen_take(&r->space, 2 * r->n + 2);
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
    lay_out_blocks(r, w);
    w->link = links ? (ncgen_tree_link *)links + 1 : NULL;
    w->element = (ncgen_tree_element *)take_records(space, tree->n_elements, sizeof(ncgen_tree_element));
    w->member = (ncgen_tree_member *)take_records(space, tree->member_start[tree->n_links], sizeof(ncgen_tree_member));
    w->screw = (ncgen_tree_screw *)take_records(space, tree->n_screws, sizeof(ncgen_tree_screw));
    w->values = ncgen_take(space, n_all);
    w->moved = ncgen_take(space, n_all);
    w->force = ncgen_take(space, n_all);
    w->mass = ncgen_take(space, ncgen_nonzeros(&r->model->mass_pattern));
    w->joined = tree->n_groups ? ncgen_take(space, 6 * (tree->n_links + tree->n_groups)) : NULL;
    w->group = ncgen_take(space, 2 * tree->n_groups);
    w->bias = ncgen_take(space, n_all);
    w->step = ncgen_take(space, r->n + tree->n_copies);
    w->jacobian = ncgen_take(space, n_values);
    w->scaled = ncgen_take(space, n_values);
    w->gram = ncgen_take(space, tree->most_rows * tree->most_rows);
    w->right = ncgen_take(space, 2 * tree->most_rows);
    w->closed_form = NCGEN_UNKNOWN;
    w->first = ncgen_take(space, n_all);
    w->placed = ncgen_take(space, n_all);
    w->axes = ncgen_take(space, 4 * tree->n_screws);
    w->travel = ncgen_take(space, 4 * tree->n_screws);
    w->turns = take_lanes(space, 12 * w->n_blocks);
    w->gamma = ncgen_take(space, r->m);
    if (tree->n_closing)
        lay_out_loops(r, w);
}

static void clear(ncgen_real *x, size_t count)
{
    for (size_t i = 0; i < count; ++i)
        x[i] = 0;
}

/* Blocks and slots, in which nothing stands yet: the number of slots. */
static int begin_blocks(ncgen_tree_work *w)
{
    int n_slots = 0, n_masses = 0;
    for (int b = 0; b < w->n_blocks; ++b) {
        ncgen_tree_block *own = w->block + b;
        own->numbers = w->numbers + (size_t)b * BLOCK_NUMBERS;
        own->slot = w->slot + n_slots;
        own->masses = w->masses + n_masses;
        own->n_slots = count_slots(w->tree, b * NCGEN_LINK_LANES, &own->n_own);
        n_slots += own->n_slots;
        n_masses += own->n_slots * (own->n_slots + 1);
    }
    const size_t last = (size_t)(n_slots + count_last_slots(w->tree));
    clear((ncgen_real *)w->numbers, (size_t)(w->n_blocks + 1) * BLOCK_NUMBERS * NCGEN_LINK_LANES);
    clear((ncgen_real *)w->slot, last * SLOT_NUMBERS * NCGEN_LINK_LANES);
    clear((ncgen_real *)w->masses, (size_t)n_masses * NCGEN_LINK_LANES);
    w->n_others = 0;
    return n_slots;
}

/* The number of an element's component among those of the slots; lane: of its link. */
static int place_in_slots(const ncgen_tree_slot *first, const ncgen_tree_slot *slot, int component, int lane)
{
    return ((int)(slot - first) * SLOT_NUMBERS + VALUE + component) * NCGEN_LINK_LANES + lane;
}

static void begin_link(const ncgen_run *r, ncgen_tree_work *w, int link)
{
    const ncgen_tree *tree = w->tree;
    const int lane = link % NCGEN_LINK_LANES;
    const ncgen_tree_block *block = w->block + link / NCGEN_LINK_LANES;
    ncgen_tree_link *own = w->link + link;
    own->parent = tree->parent[link];
    for (int i = 0; i < 3; ++i)
        own->reference[i] = tree->reference[3 * link + i];
    own->n_elements = tree->element_start[link + 1] - tree->element_start[link];
    own->n_screws = tree->screw_start[link + 1] - tree->screw_start[link];
    own->n_members = tree->member_start[link + 1] - tree->member_start[link];
    own->group = tree->coupling[link];
    own->lane = (ncgen_real *)block->numbers + lane;
    own->has_sum = tree->single_start[link + 1] > tree->single_start[link];
    if (own->parent >= 0 && own->parent != link - 1)
        w->link[own->parent].has_sum = 1;
    const int k = tree->screw_start[link];
    own->is_hinge = own->n_screws == 1 && own->group < 0 && tree->turns[k] && tree->meter[k] >= 0;
    for (int e = 0; e < own->n_elements; ++e) {
        ncgen_tree_element *element = w->element + tree->element_start[link] + e;
        ncgen_real *numbers = (ncgen_real *)block->slot[e].numbers + lane;
        const int at = tree->element_start[link] + e;
        for (int i = 0; i < 3; ++i) {
            const int c = element->c[i] = tree->elements[3 * at + i];
            if (c < r->n)
                w->where[c] = place_in_slots(w->slot, block->slot + e, i, lane);
            else
                numbers[(VALUE + i) * NCGEN_LINK_LANES] = tree->fixed[c - r->n];
        }
        element->is_point = numbers[IS_POINT * NCGEN_LINK_LANES] = tree->is_point[at];
        element->heaviness = tree->heaviness[at];
        element->lane = numbers;
    }
}

/* Members of a link's body, some of which stand with other links. */
static void begin_members(ncgen_tree_work *w, int link)
{
    const ncgen_tree *tree = w->tree;
    const ncgen_tree_block *block = w->block + link / NCGEN_LINK_LANES;
    int n_others = 0;
    for (int a = tree->member_start[link]; a < tree->member_start[link + 1]; ++a) {
        ncgen_tree_member *member = w->member + a;
        member->is_point = tree->member_is_point[a];
        member->slot = slot_of(tree, link, a, block->n_own, &n_others);
        if (member->slot < block->n_own)
            continue;
        ncgen_tree_slot *slot = block->slot + member->slot;
        ((ncgen_real *)(slot->numbers + IS_POINT))[link % NCGEN_LINK_LANES] = member->is_point;
        for (int i = 0; i < 3; ++i, ++w->n_others) {
            w->other_at[w->n_others] = place_in_slots(w->slot, slot, i, link % NCGEN_LINK_LANES);
            w->other[w->n_others] = tree->members[3 * a + i];
        }
    }
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
    static const ncgen_tree_link nothing = NCGEN_ALL_ZERO;
    const ncgen_tree *tree = w->tree;
    const ncgen_tree_slot *last = w->slot + begin_blocks(w);
    w->link[-1] = nothing;
    w->link[-1].parent = -1;
    w->link[-1].lane = (ncgen_real *)(w->numbers + (size_t)w->n_blocks * BLOCK_NUMBERS);
    for (int i = 0; i < r->n; ++i)
        w->where[i] = place_in_slots(w->slot, last + count_last_slots(tree) - 1, 2, NCGEN_LINK_LANES - 1);
    for (int j = 0; j < tree->n_measured; ++j) {
        const int vector = j / NCGEN_LINK_LANES;
        w->where[tree->measured[2 * j]] = place_in_slots(w->slot, last + vector / 3, vector % 3, j % NCGEN_LINK_LANES);
    }
    for (int link = 0; link < tree->n_links; ++link) {
        begin_link(r, w, link);
        begin_members(w, link);
    }
    for (int k = 0; k < tree->n_screws; ++k)
        begin_screw(w, k);
    for (int i = 0; i < tree->n_fixed; ++i) {
        w->values[r->n + i] = tree->fixed[i];
        w->force[r->n + i] = w->bias[r->n + i] = 0;
    }
    w->is_measured_in_order = tree->n_measured == tree->n_screws;
    for (int i = 0; i < tree->n_measured; ++i)
        w->is_measured_in_order = w->is_measured_in_order && tree->measured[2 * i + 1] == i;
}

/* The masses of a link's members; the number behind the last of them stands for the reference point. */
static void weigh(ncgen_tree_work *w, int link)
{
    const ncgen_tree *tree = w->tree;
    const ncgen_tree_link *own = w->link + link;
    const ncgen_tree_block *block = w->block + link / NCGEN_LINK_LANES;
    const int count = own->n_members, n_slots = block->n_slots;
    const ncgen_tree_member *members = w->member + tree->member_start[link];
    ncgen_real *shares = (ncgen_real *)block->masses + link % NCGEN_LINK_LANES, *square = shares + n_slots * NCGEN_LINK_LANES;
    ncgen_real *total = own->lane + MASS * NCGEN_LINK_LANES;
    *total = 0;
    for (int i = 0; i < n_slots * (n_slots + 1); ++i)
        shares[i * NCGEN_LINK_LANES] = 0;
    for (int s = tree->pair_start[link]; s < tree->pair_start[link + 1]; ++s) {
        const int a = tree->pairs[3 * s], b = tree->pairs[3 * s + 1];
        const ncgen_real mass = tree->pair_shares[s] * w->mass[tree->pairs[3 * s + 2]];
        const ncgen_scalar a_is_point = a < count ? members[a].is_point : 1, b_is_point = b < count ? members[b].is_point : 1;
        if (a < count)
            shares[members[a].slot * NCGEN_LINK_LANES] += mass * b_is_point;
        if (b < count && b != a)
            shares[members[b].slot * NCGEN_LINK_LANES] += mass * a_is_point;
        if (a < count && b < count) {
            square[(members[a].slot * n_slots + members[b].slot) * NCGEN_LINK_LANES] = mass;
            square[(members[b].slot * n_slots + members[a].slot) * NCGEN_LINK_LANES] = mass;
        }
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
