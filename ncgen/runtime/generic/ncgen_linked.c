/* ncgen_linked.c: a mechanism of linked kernels: its model, the same with drives, its state, and its motion from call to call. */
#include "ncgen_linked.h"
#include "ncgen_breaks.h"
#include "ncgen_events.h"
#include "ncgen_state.h"

enum { HEAD = 28, FIRST_FUNCTION = 16, MOST_STEPS = 1000000, AXES = 3 };
enum { PHI, PHI_Q, NU, GAMMA, MASS, FORCE, ENERGY, SWITCHES, CONDITIONS, SLOPES, RATES, VALUES };
enum { COUNT = 10, MOST, ACTIONS, LAW, SET_NUMBERS, DEGREE, ACTION_SIZE = 4 };
enum { TIME, WORK, POWER, NEXT_STEP, STATE };

/* A model, its dynamics and how it is eliminated: without drives, and with them. */
typedef struct variant {
    ncgen_model model;
    ncgen_elimination elimination;
    ncgen_dynamics dynamics;
    ncgen_driven driven;
} variant;

static variant own, with_drives;
static ncgen_options options;
static ncgen_breaks breaks;
static ncgen_event watched;
static ncgen_events events;
static ncgen_passage passage;
static const int *drive_places;
static int n, m, n_drives, has_breaks, is_conservative;
static ncgen_real *state, *parameters, *drives, *pulled, *multipliers;
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

void ncgen_linked_set_pull(int acts)
{
    own.dynamics.external = with_drives.dynamics.external = acts ? pull : NULL;
    own.dynamics.conservative = with_drives.dynamics.conservative = is_conservative && !acts;
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
    watched.coordinates = taken(&at, events.count);
    events.actions = (const ncgen_action *)(const void *)taken(&at, ACTION_SIZE * events.n_actions);
    events.conditions = watched.function = at_velocity(integers, CONDITIONS);
    events.slopes = at_velocity(integers, SLOPES);
    events.rates = (ncgen_forced_kernel *)(size_t)number_of(integers, RATES);
    events.values = at_velocity(integers, VALUES);
    watched.degree = integers[DEGREE];
}

/* Models, eliminations and dynamics from the integers. */
static void read_integers(const int *integers)
{
    const int *at = integers + HEAD;
    const variant none = {0};
    own = with_drives = none;
    n = integers[0];
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
    v->dynamics.n_dependent = integers[3] > 0 ? integers[3] + v->model.n_rows - m : 0;
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
    ncgen_linked_set_pull(1);
    const size_t most = ncgen_driven_workspace(&with_drives.driven), usual = ncgen_driven_workspace(&own.driven);
    ncgen_linked_set_pull(0);
    return most > usual ? most : usual;
}

/* Signs and counts in the state, samples of the conditions, workspace. */
static int of_events(const int *integers)
{
    const int count = events.count, samples = (watched.degree + 3) * 2 * count;
    return count > 0 ? 2 * count + 1 + samples + NCGEN_EVENTS_WORKSPACE(count, events.most, n, integers[SET_NUMBERS]) : 0;
}

/* Of everything that is kept between calls. */
static int kept(const int *integers)
{
    const int size = STATE + 3 * n + m + integers[2] + 4 * n_drives + AXES * (n + 2) + 2 + m + n_drives;
    return size + 2 * (4 * integers[7] + integers[8]) + of_events(integers);
}

static size_t integers_of_run(void)
{
    const int of_all = 4 * n + 3 * (m + n_drives) + NCGEN_EVENTS_INTEGERS(events.count) + 3 * events.count + 1;
    return ((size_t)of_all * sizeof(int) + sizeof(ncgen_real) - 1) / sizeof(ncgen_real);
}

static int size_of_state(void)
{
    return STATE + 3 * n + m + (events.count > 0 ? 2 * events.count + 1 : 0);
}

/* Where the events' own numbers are. */
static void place_events(const int *integers, const ncgen_real *numbers)
{
    const int count = events.count;
    const ncgen_real *own_numbers = numbers + 1 + n + m + n_drives + 2 * n + integers[2];
    int *whole = own.driven.integers + 4 * n + 3 * (m + n_drives);
    if (count == 0)
        return;
    events.noise = own_numbers[0];
    watched.nodes = own_numbers + 1;
    watched.inverse = watched.nodes + watched.degree + 1;
    watched.signs = passage.signs = whole;
    passage.happened = whole + count;
    passage.due = whole + 2 * count;
    watched.crossed = passage.due + NCGEN_EVENTS_INTEGERS(count);
    passage.stopped = watched.crossed + count;
    watched.samples = multipliers + m + n_drives;
    passage.workspace = watched.samples + (watched.degree + 3) * 2 * count;
}

size_t ncgen_linked_size(const int *integers)
{
    const size_t workspace = read_all(integers);
    return workspace + integers_of_run() + (size_t)kept(integers);
}

ncgen_real *ncgen_linked_begin(const int *integers, const ncgen_real *numbers, ncgen_real *room)
{
    const size_t workspace = read_all(integers);
    own.dynamics.column_sizes = with_drives.dynamics.column_sizes = numbers + 1;
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
    breaks.workspace = multipliers + m + n_drives + (events.count > 0 ? of_events(integers) - 2 * events.count - 1 : 0);
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

/* Sides of conditions, counts and the end, from the state or to it. */
static void pass_events(int to_state)
{
    ncgen_real *own_numbers = state + STATE + 3 * n + m;
    int *whole = passage.signs;
    for (int k = 0; k < (events.count > 0 ? 2 * events.count + 1 : 0); ++k) {
        int *one = k < 2 * events.count ? whole + k : passage.stopped;
        if (to_state)
            own_numbers[k] = *one;
        else
            *one = (int)own_numbers[k];
    }
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
    const int status = ncgen_multipliers(&v->driven, parameters, moment, multipliers);
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
    int status = ncgen_project_moment(&v->driven, parameters, &moment);
    if (status == NCGEN_OK && events.count > 0 && !is_driven)
        status = ncgen_begin_events(&v->driven, &events, parameters, &moment, &passage);
    return status == NCGEN_OK ? keep(v, &moment) : status;
}

int ncgen_linked_evaluate(void)
{
    ncgen_moment moment = present();
    choose_method(0, 1, 1);
    const int status = ncgen_evaluate_moment(&own.driven, parameters, &moment);
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
