/* ncgen_linked.c: a mechanism of linked kernels: its model, the same with drives, its state, and its motion from call to call. */
#include "ncgen_linked.h"
#include "ncgen_breaks.h"
#include "ncgen_events.h"
#include "ncgen_held.h"
#include "ncgen_state.h"

enum { HEAD = 43, FIRST_FUNCTION = 24, MOST_STEPS = 1000000, AXES = 3 };
enum { PHI, PHI_Q, NU, GAMMA, MASS, FORCE, ENERGY, SWITCHES, CONDITIONS, SLOPES, RATES, VALUES };
enum { HELD_PHI = 12, HELD_PHI_Q, HELD_NU, HELD_GAMMA, HELD_CONDITIONS, FRICTION, SLIDING };
enum { COUNT = 10, MOST, ACTIONS, LAW, SET_NUMBERS, DEGREE, N_EVENTS, HOLDS, LOADS, OWN, HELD_ROWS, FOLLOWS_LOADS, RUBBINGS, VELOCITIES };
enum { ACTION_SIZE = 4, HOLD_SIZE = 7, RUBBING_SIZE = 11 };
enum { TIME, WORK, POWER, NEXT_STEP, STATE };

/* A model, its dynamics and how it is eliminated: without drives, with them, and with what is held. */
typedef struct variant {
    ncgen_model model;
    ncgen_elimination elimination;
    ncgen_dynamics dynamics;
    ncgen_driven driven;
} variant;

static variant own, with_drives, held;
static ncgen_options options;
static ncgen_breaks breaks;
static ncgen_event watched;
static ncgen_events events;
static ncgen_passage passage;
static const int *drive_places, *own_places;
static int n, m, n_drives, n_own, m_held, has_breaks, is_conservative;
static ncgen_real *state, *parameters, *drives, *pulled, *multipliers;
static ncgen_velocity_kernel *friction; /* that follows loads; NULL: there is none */
static ncgen_real *friction_forces;
static const ncgen_real *described;

static int number_of(const int *integers, int which)
{
    return integers[FIRST_FUNCTION + which];
}

static ncgen_position_kernel *at_position(const int *integers, int which)
{
    return (ncgen_position_kernel *)(size_t)number_of(integers, which);
}

static ncgen_velocity_kernel *at_velocity(const int *integers, int which)
{
    return (ncgen_velocity_kernel *)(size_t)number_of(integers, which);
}

/* Rows of drives ------------------------------------------------------------------------------------------------- */

static void clear(int count, ncgen_real *out)
{
    for (int i = 0; i < count; ++i)
        out[i] = 0;
}

static int driven_phi(ncgen_real t, const ncgen_real *q, const ncgen_real *p, ncgen_real *out)
{
    for (int k = 0; k < n_drives; ++k)
        out[m + k] = q[drive_places[k]] - drives[k];
    return own.model.phi ? own.model.phi(t, q, p, out) : NCGEN_OK;
}

static int driven_phi_q(ncgen_real t, const ncgen_real *q, const ncgen_real *p, ncgen_real *out)
{
    const int used = ncgen_nonzeros(&own.model.phi_q_pattern);
    for (int k = 0; k < n_drives; ++k)
        out[used + k] = 1;
    return own.model.phi_q ? own.model.phi_q(t, q, p, out) : NCGEN_OK;
}

static int driven_nu(ncgen_real t, const ncgen_real *q, const ncgen_real *p, ncgen_real *out)
{
    clear(m, out);
    ncgen_copy(n_drives, drives + n_drives, out + m);
    return own.model.nu ? own.model.nu(t, q, p, out) : NCGEN_OK;
}

static int driven_gamma(ncgen_real t, const ncgen_real *q, const ncgen_real *qd, const ncgen_real *p, ncgen_real *out)
{
    ncgen_copy(n_drives, drives + 2 * n_drives, out + m);
    return own.model.gamma ? own.model.gamma(t, q, qd, p, out) : NCGEN_OK;
}

/* A force from outside ------------------------------------------------------------------------------------------- */

static int pull(ncgen_real t, const ncgen_real *q, const ncgen_real *qd, const ncgen_real *p, ncgen_real *out)
{
    const ncgen_real *force = pulled + AXES * n, *target = force + AXES, stiffness = target[AXES], damping = target[AXES + 1];
    (void)t;
    (void)p;
    clear(n, out);
    for (int k = 0; k < AXES; ++k) {
        const ncgen_real *row = pulled + k * n;
        const ncgen_real along = force[k] + stiffness * (target[k] - ncgen_dot(n, row, q)) - damping * ncgen_dot(n, row, qd);
        for (int i = 0; i < n; ++i)
            out[i] += along * row[i];
    }
    return NCGEN_OK;
}

/* The same, and friction that follows loads. */
static int pull_and_friction(ncgen_real t, const ncgen_real *q, const ncgen_real *qd, const ncgen_real *p, ncgen_real *out)
{
    int status = pull(t, q, qd, p, out);
    if (status == NCGEN_OK)
        status = friction(t, q, qd, p, friction_forces);
    for (int i = 0; i < n; ++i)
        out[i] += friction_forces[i];
    return status;
}

void ncgen_linked_set_pull(int acts)
{
    own.dynamics.external = with_drives.dynamics.external = held.dynamics.external = acts ? pull : NULL;
    if (events.rubs)
        held.dynamics.external = acts ? pull_and_friction : friction;
    own.dynamics.conservative = with_drives.dynamics.conservative = held.dynamics.conservative = is_conservative && !acts;
}

ncgen_real *ncgen_linked_pull(void)
{
    return pulled;
}

/* The description ------------------------------------------------------------------------------------------------ */

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
static void read_held(const int *integers, const int *at)
{
    ncgen_model *model = &held.model;
    *model = own.model;
    const ncgen_pattern phi_q = {m_held, n, taken(&at, m_held + 1), taken(&at, 0)};
    (void)taken(&at, ncgen_nonzeros(&phi_q));
    model->n_rows = m_held;
    model->phi_q_pattern = phi_q;
    model->phi = at_position(integers, HELD_PHI);
    model->phi_q = at_position(integers, HELD_PHI_Q);
    model->nu = at_position(integers, HELD_NU);
    model->gamma = at_velocity(integers, HELD_GAMMA);
    read_elimination(&at, n + m_held, &held.elimination);
    events.held_model = model;
    events.held_dynamics = &held.dynamics;
    events.held_conditions = at_velocity(integers, HELD_CONDITIONS);
    friction = at_velocity(integers, FRICTION);
    events.rubs = friction != NULL;
    events.follows_loads = integers[FOLLOWS_LOADS];
}

/* at: where directions begin among the integers */
static void read_events(const int *integers, const int *at)
{
    const ncgen_events no_events = {0};
    const ncgen_event nothing = {0};
    events = no_events;
    watched = nothing;
    events.count = watched.count = integers[COUNT];
    events.most = integers[MOST];
    events.n_actions = integers[ACTIONS];
    events.law = integers[LAW];
    events.directions = watched.directions = taken(&at, events.count);
    watched.coordinates = taken(&at, events.count + integers[LOADS]);
    watched.sampled = taken(&at, events.count);
    events.actions = (const ncgen_action *)(const void *)taken(&at, ACTION_SIZE * events.n_actions);
    events.conditions = watched.function = at_velocity(integers, CONDITIONS);
    events.slopes = at_velocity(integers, SLOPES);
    events.rates = (ncgen_forced_kernel *)(size_t)number_of(integers, RATES);
    events.values = at_velocity(integers, VALUES);
    watched.degree = integers[DEGREE];
    events.n_velocities = events.count - integers[N_EVENTS];
    events.n_holds = integers[HOLDS];
    events.n_loads = integers[LOADS];
    events.holds = (const ncgen_hold *)(const void *)taken(&at, HOLD_SIZE * events.n_holds);
    events.n_rubbings = integers[RUBBINGS];
    events.n_sliding = integers[VELOCITIES];
    events.rubbings = (const ncgen_rubbing *)(const void *)taken(&at, RUBBING_SIZE * events.n_rubbings);
    events.sliding = at_velocity(integers, SLIDING);
    own_places = taken(&at, n_own);
    if (events.n_holds > 0)
        read_held(integers, at);
}


/* Models, eliminations and dynamics from the integers. */
static void read_integers(const int *integers)
{
    const int *at = integers + HEAD;
    const variant none = {0};
    own = with_drives = held = none;
    n = integers[0];
    n_own = integers[OWN];
    m_held = integers[HELD_ROWS];
    m = integers[1];
    is_conservative = integers[5];
    n_drives = integers[6];
    const ncgen_pattern phi_q = {m + n_drives, n, taken(&at, m + n_drives + 1), taken(&at, 0)};
    (void)taken(&at, ncgen_nonzeros(&phi_q));
    const ncgen_pattern mass = {n, n, taken(&at, n + 1), taken(&at, 0)};
    (void)taken(&at, ncgen_nonzeros(&mass));
    ncgen_model *model = &own.model;
    model->n_coordinates = n;
    model->n_rows = m;
    model->n_parameters = integers[2];
    model->phi_q_pattern = phi_q;
    model->phi_q_pattern.rows = m;
    model->mass_pattern = mass;
    model->phi = at_position(integers, PHI);
    model->phi_q = at_position(integers, PHI_Q);
    model->nu = at_position(integers, NU);
    model->gamma = at_velocity(integers, GAMMA);
    model->mass = at_position(integers, MASS);
    model->force = at_velocity(integers, FORCE);
    model->energy = at_velocity(integers, ENERGY);
    with_drives.model = own.model;
    model = &with_drives.model;
    model->n_rows = m + n_drives;
    model->phi_q_pattern.rows = m + n_drives;
    model->phi = driven_phi;
    model->phi_q = driven_phi_q;
    model->nu = driven_nu;
    model->gamma = driven_gamma;
    drive_places = phi_q.indices + phi_q.indptr[m];
    read_elimination(&at, n + m, &own.elimination);
    read_elimination(&at, n + m + n_drives, &with_drives.elimination);
    read_events(integers, at);
}

static void describe(variant *v, const int *integers)
{
    v->dynamics.n_dependent = v == &held ? -1 : integers[3] > 0 ? integers[3] + v->model.n_rows - m : 0;
    v->dynamics.singular_mass = integers[4];
    v->dynamics.elimination = &v->elimination;
    v->driven.model = &v->model;
    v->driven.dynamics = &v->dynamics;
    v->driven.options = &options;
}

static void choose_method(ncgen_scalar step, ncgen_scalar rtol, ncgen_scalar atol)
{
    const ncgen_options none = {0};
    options = none;
    options.method = step > 0 ? NCGEN_RK4 : NCGEN_DOP853;
    options.formalism = NCGEN_LAGRANGE;
    options.project = 1;
    options.rtol = rtol;
    options.atol = atol;
    options.max_step = step;
    options.max_steps = MOST_STEPS;
    options.tolerance = 5000 * ncgen_rounding();
    options.event = events.count > 0 ? &watched : NULL;
}

/* Everything but the workspace of a run, whose length is returned, and its integers. */
static size_t read_all(const int *integers)
{
    read_integers(integers);
    choose_method(0, 1, 1);
    describe(&own, integers);
    describe(&with_drives, integers);
    describe(&held, integers);
    ncgen_linked_set_pull(1);
    size_t most = ncgen_driven_workspace(&with_drives.driven);
    const size_t usual = ncgen_driven_workspace(&own.driven), holding = m_held > 0 ? ncgen_driven_workspace(&held.driven) : 0;
    ncgen_linked_set_pull(0);
    most = most > usual ? most : usual;
    return most > holding ? most : holding;
}

/* Of all variants. */
static int most_rows(void)
{
    return m_held > m + n_drives ? m_held : m + n_drives;
}

/* Of events in the state: signs, counts, the end, and the numbers of p that are the motion's own. */
static int events_in_state(void)
{
    return events.count > 0 ? 2 * events.count + 1 + n_own : 0;
}

/* Samples of the conditions, workspace. */
static int of_events(const int *integers)
{
    const int count = events.count, all = count + events.n_loads, samples = (watched.degree + 3) * 2 * all;
    const int values = integers[SET_NUMBERS] + (n + 1) * events.n_sliding;
    return count > 0 ? samples + NCGEN_EVENTS_WORKSPACE(count, events.most, n, values) + 3 * n + 2 * all + 2 * events.n_holds : 0;
}

/* Of everything that is kept between calls. */
static int kept(const int *integers)
{
    const int size = STATE + 3 * n + m + integers[2] + 4 * n_drives + AXES * (n + 2) + 2 + most_rows();
    return size + 2 * (4 * integers[7] + integers[8]) + of_events(integers) + events_in_state();
}

static size_t integers_of_run(void)
{
    const int all = events.count + events.n_loads, of_conditions = 3 * all + NCGEN_EVENTS_INTEGERS(events.count) + events.count + 1;
    const int of_all = of_conditions + NCGEN_HELD_INTEGERS(events.n_holds);
    return ((size_t)(4 * n + 3 * most_rows() + of_all) * sizeof(int) + sizeof(ncgen_real) - 1) / sizeof(ncgen_real);
}

static int size_of_state(void)
{
    return STATE + 3 * n + m + events_in_state();
}

/* Where the events' own numbers are. */
static void place_events(const int *integers, const ncgen_real *numbers)
{
    const int count = events.count, all = count + events.n_loads;
    const ncgen_real *own_numbers = numbers + 1 + n + m + n_drives + 2 * n + integers[2];
    int *whole = own.driven.integers + 4 * n + 3 * most_rows();
    if (count == 0)
        return;
    events.noise = own_numbers[0];
    watched.nodes = own_numbers + 1;
    watched.inverse = watched.nodes + watched.degree + 1;
    held.dynamics.row_sizes = watched.inverse + (watched.degree + 1) * (watched.degree + 1);
    passage.happened = whole;
    passage.stopped = whole + count;
    passage.due = passage.stopped + 1;
    watched.signs = passage.signs = passage.due + NCGEN_EVENTS_INTEGERS(count);
    watched.crossed = passage.signs + all;
    passage.directions = watched.crossed + all;
    passage.flags = passage.directions + all;
    watched.samples = multipliers + most_rows();
    passage.room = watched.samples + (watched.degree + 3) * 2 * all;
    friction_forces = passage.room + 2 * n + 2 * all;
    passage.ways = friction_forces + n;
    passage.workspace = passage.ways + 2 * events.n_holds;
}

size_t ncgen_linked_size(const int *integers)
{
    const size_t workspace = read_all(integers);
    return workspace + integers_of_run() + (size_t)kept(integers);
}

ncgen_real *ncgen_linked_begin(const int *integers, const ncgen_real *numbers, ncgen_real *room)
{
    const size_t workspace = read_all(integers);
    own.dynamics.column_sizes = with_drives.dynamics.column_sizes = held.dynamics.column_sizes = numbers + 1;
    own.dynamics.row_sizes = with_drives.dynamics.row_sizes = numbers + 1 + n;
    own.driven.workspace = with_drives.driven.workspace = room;
    own.driven.integers = with_drives.driven.integers = (int *)(void *)(room + workspace);
    state = room + workspace + integers_of_run();
    parameters = state + size_of_state();
    drives = parameters + integers[2];
    pulled = drives + 4 * n_drives;
    multipliers = pulled + AXES * (n + 2) + 2;
    clear(kept(integers), state);
    place_events(integers, numbers);
    described = numbers + 1 + n + m + n_drives;
    ncgen_copy(integers[2], described + 2 * n, parameters);
    has_breaks = number_of(integers, SWITCHES) > 0;
    breaks.switches = (int (*)(ncgen_real, const ncgen_real *, ncgen_real *))(size_t)number_of(integers, SWITCHES);
    breaks.lines = integers[7];
    breaks.curves = integers[8];
    breaks.jumps = integers[9];
    breaks.interval = numbers[0];
    breaks.workspace = multipliers + most_rows() + of_events(integers);
    return state;
}

ncgen_real *ncgen_linked_parameters(void)
{
    return parameters;
}

ncgen_real *ncgen_linked_drives(void)
{
    return drives;
}

/* Motion --------------------------------------------------------------------------------------------------------- */

/* Sides of conditions, counts and the end, and the motion's own numbers of p, from the state or to it. */
static void pass_events(int to_state)
{
    ncgen_real *own_numbers = state + STATE + 3 * n + m;
    for (int k = 0; k < (events.count > 0 ? 2 * events.count + 1 : 0); ++k) {
        int *one = k < events.count ? passage.signs + k : k < 2 * events.count ? passage.happened + k - events.count : passage.stopped;
        if (to_state)
            own_numbers[k] = *one;
        else
            *one = (int)own_numbers[k];
    }
    for (int k = 0; k < n_own; ++k) {
        ncgen_real *inside = own_numbers + 2 * events.count + 1 + k, *outside = parameters + own_places[k];
        if (to_state)
            *inside = *outside;
        else
            *outside = *inside;
    }
}

/* The mechanism with what is held. */
static const ncgen_driven *entered(ncgen_entered *in)
{
    if (!events.n_holds)
        return &own.driven;
    ncgen_enter_held(&own.driven, &events, parameters, NULL, in);
    return &in->driven;
}

static ncgen_moment present(void)
{
    pass_events(0);
    const ncgen_moment moment = {state[TIME], state[NEXT_STEP], state[WORK], state[POWER], state + STATE, state + STATE + n, state + STATE + 2 * n};
    return moment;
}

/* The state of a moment, with its multipliers. */
static int keep(const variant *v, const ncgen_moment *moment)
{
    ncgen_entered in;
    const int status = ncgen_multipliers(v == &own ? entered(&in) : &v->driven, parameters, moment, multipliers);
    pass_events(1);
    state[TIME] = moment->t;
    state[WORK] = moment->work;
    state[POWER] = moment->power;
    state[NEXT_STEP] = moment->h;
    ncgen_copy(m, multipliers, state + STATE + 3 * n);
    for (int k = 0; k < n_drives; ++k)
        drives[3 * n_drives + k] = v == &own ? 0 : -multipliers[m + k];
    return status;
}

int ncgen_linked_project_state(int is_driven)
{
    const variant *v = is_driven ? &with_drives : &own;
    ncgen_moment moment = present();
    choose_method(0, 1, 1);
    for (int k = 0; k < events.n_holds && !is_driven; ++k)
        parameters[events.holds[k].on] = 0; /* the motion begins anew */
    int status = ncgen_project_moment(&v->driven, parameters, &moment);
    if (status == NCGEN_OK && events.count > 0 && !is_driven)
        status = ncgen_begin_events(&v->driven, &events, parameters, &moment, &passage);
    return status == NCGEN_OK ? keep(v, &moment) : status;
}

int ncgen_linked_evaluate(void)
{
    ncgen_moment moment = present();
    choose_method(0, 1, 1);
    ncgen_entered in;
    const int status = ncgen_evaluate_moment(entered(&in), parameters, &moment);
    return status == NCGEN_OK ? keep(&own, &moment) : status;
}

int ncgen_linked_start(void)
{
    clear(size_of_state(), state);
    ncgen_copy(2 * n, described, state + STATE);
    return ncgen_linked_project_state(0);
}

int ncgen_linked_advance(ncgen_scalar t_end, ncgen_scalar step, ncgen_scalar rtol, ncgen_scalar atol, int one)
{
    ncgen_moment moment = present();
    ncgen_statistics statistics;
    choose_method(step, rtol, atol);
    const int status = events.count > 0 ? ncgen_advance_through_events(&own.driven, has_breaks ? &breaks : NULL, &events, parameters, &moment,
                                                                  t_end, one, &passage, &statistics)
                       : has_breaks     ? ncgen_advance_over_breaks(&own.driven, &breaks, parameters, &moment, t_end, &statistics)
                                        : ncgen_advance(&own.driven, parameters, &moment, t_end, &statistics);
    if (step > 0)
        moment.h = state[NEXT_STEP];
    return status == NCGEN_OK ? keep(&own, &moment) : status;
}

#if defined(__wasm__)
/* Angles beyond NCGEN_FAR are left to the host's functions: those of a C library would be an eighth of the file. */
__attribute__((import_module("Math"), import_name("sin"))) double ncgen_host_sin(double x);
__attribute__((import_module("Math"), import_name("cos"))) double ncgen_host_cos(double x);

double sin(double x)
{
    return ncgen_host_sin(x);
}

double cos(double x)
{
    return ncgen_host_cos(x);
}
#endif

void ncgen_linked_sincos(ncgen_real x, ncgen_real *sine, ncgen_real *cosine)
{
    ncgen_sincos(1, &x, sine, cosine);
}

ncgen_real ncgen_linked_pieces(ncgen_real x, const ncgen_scalar *knots, const ncgen_scalar *rows, int count, int degree, ncgen_scalar period)
{
    return NCGEN_PIECES(x, knots, rows, count, degree, period);
}
