/* ncgen_linked_model.c: whole numbers as a mechanism of linked kernels; ncgen_linked.h has their order. */
#include "ncgen_linked_model.h"
#include "ncgen_state.h"

enum { HEAD = 43, FIRST_FUNCTION = 24 };
enum { PHI, PHI_Q, NU, GAMMA, MASS, FORCE, ENERGY, SWITCHES, CONDITIONS, DERIVATIVES, RATES, VALUES };
enum { HELD_PHI = 12, HELD_PHI_Q, HELD_NU, HELD_GAMMA, HELD_CONDITIONS, FRICTION, SLIDING };
enum { COUNT = 10, MOST, ACTIONS, LAW, SET_NUMBERS, DEGREE, N_EVENTS, HOLDS, LOADS, OWN, HELD_ROWS, FOLLOWS_LOADS, RUBBINGS, VELOCITIES };
enum { ACTION_SIZE = 4, HOLD_SIZE = 7, RUBBING_SIZE = 11 };

static int function_of(const int *integers, int which)
{
    return integers[FIRST_FUNCTION + which];
}

static ncgen_position_kernel *at_position(const int *integers, int which)
{
    return (ncgen_position_kernel *)(size_t)function_of(integers, which);
}

static ncgen_velocity_kernel *at_velocity(const int *integers, int which)
{
    return (ncgen_velocity_kernel *)(size_t)function_of(integers, which);
}

static const int *taken(const int **at, int count)
{
    const int *first = *at;
    *at += count;
    return first;
}

static void read_elimination(const int **at, int size, ncgen_elimination *e)
{
    e->size = size;
    e->nonzeros = *taken(at, 1);
    e->order = taken(at, size);
    e->row_start = taken(at, size + 1);
    e->row_columns = taken(at, e->nonzeros);
    e->row_positions = taken(at, e->nonzeros);
    e->column_start = taken(at, size + 1);
    e->column_rows = taken(at, e->nonzeros);
    e->entry_start = taken(at, size + 1);
    e->entry_columns = taken(at, e->entry_start[size]);
    e->entry_values = taken(at, e->entry_start[size]);
}

/* at: where the pattern of what is held begins among the integers */
static void read_held(ncgen_linked_model *l, const int *integers, const int *at)
{
    ncgen_model *model = &l->held.model;
    *model = l->own.model;
    const ncgen_pattern phi_q = {l->m_held, l->n, taken(&at, l->m_held + 1), taken(&at, 0)};
    (void)taken(&at, ncgen_nonzeros(&phi_q));
    model->n_rows = l->m_held;
    model->phi_q_pattern = phi_q;
    model->phi = at_position(integers, HELD_PHI);
    model->phi_q = at_position(integers, HELD_PHI_Q);
    model->nu = at_position(integers, HELD_NU);
    model->gamma = at_velocity(integers, HELD_GAMMA);
    read_elimination(&at, l->n + l->m_held, &l->held.elimination);
    l->events.held_model = model;
    l->events.held_dynamics = &l->held.dynamics;
    l->events.held_conditions = at_velocity(integers, HELD_CONDITIONS);
    l->friction = at_velocity(integers, FRICTION);
    l->events.rubs = l->friction != NULL;
    l->events.follows_loads = integers[FOLLOWS_LOADS];
}

/* at: where directions begin among the integers */
static void read_events(ncgen_linked_model *l, const int *integers, const int *at)
{
    const ncgen_events no_events = {0};
    const ncgen_event nothing = {0};
    l->events = no_events;
    l->watched = nothing;
    l->events.count = l->watched.count = integers[COUNT];
    l->events.most = integers[MOST];
    l->events.n_actions = integers[ACTIONS];
    l->events.law = integers[LAW];
    l->events.directions = l->watched.directions = taken(&at, l->events.count);
    l->watched.coordinates = taken(&at, l->events.count + integers[LOADS]);
    l->watched.sampled = taken(&at, l->events.count);
    l->events.actions = (const ncgen_action *)(const void *)taken(&at, ACTION_SIZE * l->events.n_actions);
    l->events.conditions = l->watched.function = at_velocity(integers, CONDITIONS);
    l->events.derivatives = at_velocity(integers, DERIVATIVES);
    l->events.rates = (ncgen_forced_kernel *)(size_t)function_of(integers, RATES);
    l->events.values = at_velocity(integers, VALUES);
    l->watched.degree = integers[DEGREE];
    l->n_values = integers[SET_NUMBERS];
    l->events.n_velocities = l->events.count - integers[N_EVENTS];
    l->events.n_holds = integers[HOLDS];
    l->events.n_loads = integers[LOADS];
    l->events.holds = (const ncgen_hold *)(const void *)taken(&at, HOLD_SIZE * l->events.n_holds);
    l->events.n_rubbings = integers[RUBBINGS];
    l->events.n_sliding = integers[VELOCITIES];
    l->events.rubbings = (const ncgen_rubbing *)(const void *)taken(&at, RUBBING_SIZE * l->events.n_rubbings);
    l->events.sliding = at_velocity(integers, SLIDING);
    l->own_places = taken(&at, l->n_own);
    if (l->events.n_holds > 0)
        read_held(l, integers, at);
}

void ncgen_linked_read(const int *integers, ncgen_linked_model *l)
{
    const int *at = integers + HEAD;
    const ncgen_linked_variant none = {0};
    l->own = l->with_drives = l->held = none;
    l->n = integers[0];
    l->n_own = integers[OWN];
    l->m_held = integers[HELD_ROWS];
    l->m = integers[1];
    l->is_conservative = integers[5];
    l->n_drives = integers[6];
    l->switches = (int (*)(ncgen_real, const ncgen_real *, ncgen_real *))(size_t)function_of(integers, SWITCHES);
    const ncgen_pattern phi_q = {l->m + l->n_drives, l->n, taken(&at, l->m + l->n_drives + 1), taken(&at, 0)};
    (void)taken(&at, ncgen_nonzeros(&phi_q));
    const ncgen_pattern mass = {l->n, l->n, taken(&at, l->n + 1), taken(&at, 0)};
    (void)taken(&at, ncgen_nonzeros(&mass));
    ncgen_model *model = &l->own.model;
    model->n_coordinates = l->n;
    model->n_rows = l->m;
    model->n_parameters = integers[2];
    model->phi_q_pattern = phi_q;
    model->phi_q_pattern.rows = l->m;
    model->mass_pattern = mass;
    model->phi = at_position(integers, PHI);
    model->phi_q = at_position(integers, PHI_Q);
    model->nu = at_position(integers, NU);
    model->gamma = at_velocity(integers, GAMMA);
    model->mass = at_position(integers, MASS);
    model->force = at_velocity(integers, FORCE);
    model->energy = at_velocity(integers, ENERGY);
    l->with_drives.model = l->own.model;
    model = &l->with_drives.model;
    model->n_rows = l->m + l->n_drives;
    model->phi_q_pattern.rows = l->m + l->n_drives;
    l->drive_places = phi_q.indices + phi_q.indptr[l->m];
    read_elimination(&at, l->n + l->m, &l->own.elimination);
    read_elimination(&at, l->n + l->m + l->n_drives, &l->with_drives.elimination);
    read_events(l, integers, at);
}
