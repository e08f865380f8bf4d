/* ncgen_linked.c: a mechanism of linked kernels: its model, the same with drives, its state, and its motion from call to call. */
#include "ncgen_linked.h"
#include "ncgen_breaks.h"
#include "ncgen_events.h"
#include "ncgen_held.h"
#include "ncgen_linked_model.h"
#include "ncgen_state.h"

enum { MOST_STEPS = 1000000, AXES = 3 };
enum { TIME, WORK, POWER, NEXT_STEP, STATE };

static ncgen_linked_model here;
static ncgen_options options;
static ncgen_breaks breaks;
static ncgen_passage passage;
static ncgen_real *state, *parameters, *drives, *pulled, *multipliers, *friction_forces;
static const ncgen_real *described;

/* Rows of drives ------------------------------------------------------------------------------------------------- */

static void clear(int count, ncgen_real *out)
{
    for (int i = 0; i < count; ++i)
        out[i] = 0;
}

static int driven_phi(ncgen_real t, const ncgen_real *q, const ncgen_real *p, ncgen_real *out)
{
    for (int k = 0; k < here.n_drives; ++k)
        out[here.m + k] = q[here.drive_places[k]] - drives[k];
    return here.own.model.phi ? here.own.model.phi(t, q, p, out) : NCGEN_OK;
}

static int driven_phi_q(ncgen_real t, const ncgen_real *q, const ncgen_real *p, ncgen_real *out)
{
    const int used = ncgen_nonzeros(&here.own.model.phi_q_pattern);
    for (int k = 0; k < here.n_drives; ++k)
        out[used + k] = 1;
    return here.own.model.phi_q ? here.own.model.phi_q(t, q, p, out) : NCGEN_OK;
}

static int driven_nu(ncgen_real t, const ncgen_real *q, const ncgen_real *p, ncgen_real *out)
{
    clear(here.m, out);
    ncgen_copy(here.n_drives, drives + here.n_drives, out + here.m);
    return here.own.model.nu ? here.own.model.nu(t, q, p, out) : NCGEN_OK;
}

static int driven_gamma(ncgen_real t, const ncgen_real *q, const ncgen_real *qd, const ncgen_real *p, ncgen_real *out)
{
    ncgen_copy(here.n_drives, drives + 2 * here.n_drives, out + here.m);
    return here.own.model.gamma ? here.own.model.gamma(t, q, qd, p, out) : NCGEN_OK;
}

/* A force from outside ------------------------------------------------------------------------------------------- */

static int pull(ncgen_real t, const ncgen_real *q, const ncgen_real *qd, const ncgen_real *p, ncgen_real *out)
{
    const ncgen_real *force = pulled + AXES * here.n, *target = force + AXES, stiffness = target[AXES], damping = target[AXES + 1];
    (void)t;
    (void)p;
    clear(here.n, out);
    for (int k = 0; k < AXES; ++k) {
        const ncgen_real *row = pulled + k * here.n;
        const ncgen_real along = force[k] + stiffness * (target[k] - ncgen_dot(here.n, row, q)) - damping * ncgen_dot(here.n, row, qd);
        for (int i = 0; i < here.n; ++i)
            out[i] += along * row[i];
    }
    return NCGEN_OK;
}

/* The same, and friction that follows loads. */
static int pull_and_friction(ncgen_real t, const ncgen_real *q, const ncgen_real *qd, const ncgen_real *p, ncgen_real *out)
{
    int status = pull(t, q, qd, p, out);
    if (status == NCGEN_OK)
        status = here.friction(t, q, qd, p, friction_forces);
    for (int i = 0; i < here.n; ++i)
        out[i] += friction_forces[i];
    return status;
}

void ncgen_linked_set_pull(int acts)
{
    here.own.dynamics.external = here.with_drives.dynamics.external = here.held.dynamics.external = acts ? pull : NULL;
    if (here.events.rubs)
        here.held.dynamics.external = acts ? pull_and_friction : here.friction;
    here.own.dynamics.conservative = here.with_drives.dynamics.conservative = here.held.dynamics.conservative = here.is_conservative && !acts;
}

ncgen_real *ncgen_linked_pull(void)
{
    return pulled;
}

/* Everything that is kept ---------------------------------------------------------------------------------------- */

static void describe(ncgen_linked_variant *v, const int *integers)
{
    v->dynamics.n_dependent = v == &here.held ? -1 : integers[3] > 0 ? integers[3] + v->model.n_rows - here.m : 0;
    v->dynamics.singular_mass = integers[4];
    v->dynamics.elimination = &v->elimination;
    v->driven.model = &v->model;
    v->driven.dynamics = &v->dynamics;
    v->driven.options = &options;
}

static void choose_method(ncgen_scalar step, ncgen_scalar rtol, ncgen_scalar atol)
{
    options = ncgen_options_of_calls(step, rtol, atol);
    options.max_steps = MOST_STEPS;
    options.event = here.events.count > 0 ? &here.watched : NULL;
}

/* Everything but the workspace of a run, whose length is returned, and its integers. */
static size_t read_all(const int *integers)
{
    ncgen_linked_read(integers, &here);
    here.with_drives.model.phi = driven_phi;
    here.with_drives.model.phi_q = driven_phi_q;
    here.with_drives.model.nu = driven_nu;
    here.with_drives.model.gamma = driven_gamma;
    choose_method(0, 1, 1);
    describe(&here.own, integers);
    describe(&here.with_drives, integers);
    describe(&here.held, integers);
    ncgen_linked_set_pull(1);
    size_t most = ncgen_driven_workspace(&here.with_drives.driven);
    const size_t usual = ncgen_driven_workspace(&here.own.driven), holding = here.m_held > 0 ? ncgen_driven_workspace(&here.held.driven) : 0;
    ncgen_linked_set_pull(0);
    most = most > usual ? most : usual;
    return most > holding ? most : holding;
}

/* Of all variants. */
static int most_rows(void)
{
    return here.m_held > here.m + here.n_drives ? here.m_held : here.m + here.n_drives;
}

/* Of events in the state: signs, counts, the end, and the numbers of p that are the motion's own. */
static int events_in_state(void)
{
    return here.events.count > 0 ? 2 * here.events.count + 1 + here.n_own : 0;
}

/* Samples of the conditions, workspace. */
static int of_events(const int *integers)
{
    const int count = here.events.count, all = count + here.events.n_loads, samples = (here.watched.degree + 3) * 2 * all;
    const int values = here.n_values + (here.n + 1) * here.events.n_sliding, others = 3 * here.n + 2 * all + 4 * here.events.n_holds;
    return count > 0 ? samples + NCGEN_EVENTS_WORKSPACE(count, here.events.most, here.n, values) + others : 0;
}

/* Of everything that is kept between calls. */
static int kept(const int *integers)
{
    const int size = STATE + 3 * here.n + here.m + integers[2] + 4 * here.n_drives + AXES * (here.n + 2) + 2 + most_rows();
    return size + 2 * (4 * integers[7] + integers[8]) + of_events(integers) + events_in_state();
}

static size_t integers_of_run(void)
{
    const int all = here.events.count + here.events.n_loads, of_conditions = 3 * all + NCGEN_EVENTS_INTEGERS(here.events.count) + here.events.count + 1;
    const int of_all = of_conditions + NCGEN_HELD_INTEGERS(here.events.n_holds);
    return ((size_t)(4 * here.n + 3 * most_rows() + of_all) * sizeof(int) + sizeof(ncgen_real) - 1) / sizeof(ncgen_real);
}

static int size_of_state(void)
{
    return STATE + 3 * here.n + here.m + events_in_state();
}

/* Where the events' own numbers are. */
static void place_events(const int *integers, const ncgen_real *numbers)
{
    const int count = here.events.count, all = count + here.events.n_loads;
    const ncgen_real *own_numbers = numbers + 1 + here.n + here.m + here.n_drives + 2 * here.n + integers[2];
    int *whole = here.own.driven.integers + 4 * here.n + 3 * most_rows();
    if (count == 0)
        return;
    here.events.noise = own_numbers[0];
    here.watched.nodes = own_numbers + 1;
    here.watched.inverse = here.watched.nodes + here.watched.degree + 1;
    here.held.dynamics.row_sizes = here.watched.inverse + (here.watched.degree + 1) * (here.watched.degree + 1);
    passage.happened = whole;
    passage.stopped = whole + count;
    passage.due = passage.stopped + 1;
    here.watched.signs = passage.signs = passage.due + NCGEN_EVENTS_INTEGERS(count);
    here.watched.crossed = passage.signs + all;
    passage.directions = here.watched.crossed + all;
    passage.flags = passage.directions + all;
    here.watched.samples = multipliers + most_rows();
    passage.room = here.watched.samples + (here.watched.degree + 3) * 2 * all;
    friction_forces = passage.room + 2 * here.n + 2 * all;
    passage.ways = friction_forces + here.n;
    passage.workspace = passage.ways + 4 * here.events.n_holds;
}

size_t ncgen_linked_size(const int *integers)
{
    const size_t workspace = read_all(integers);
    return workspace + integers_of_run() + (size_t)kept(integers);
}

ncgen_real *ncgen_linked_begin(const int *integers, const ncgen_real *numbers, ncgen_real *room)
{
    const size_t workspace = read_all(integers);
    here.own.dynamics.column_sizes = here.with_drives.dynamics.column_sizes = here.held.dynamics.column_sizes = numbers + 1;
    here.own.dynamics.row_sizes = here.with_drives.dynamics.row_sizes = numbers + 1 + here.n;
    here.own.driven.workspace = here.with_drives.driven.workspace = room;
    here.own.driven.integers = here.with_drives.driven.integers = (int *)(void *)(room + workspace);
    state = room + workspace + integers_of_run();
    parameters = state + size_of_state();
    drives = parameters + integers[2];
    pulled = drives + 4 * here.n_drives;
    multipliers = pulled + AXES * (here.n + 2) + 2;
    clear(kept(integers), state);
    place_events(integers, numbers);
    described = numbers + 1 + here.n + here.m + here.n_drives;
    ncgen_copy(integers[2], described + 2 * here.n, parameters);
    breaks.switches = here.switches;
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
    ncgen_real *own_numbers = state + STATE + 3 * here.n + here.m;
    for (int k = 0; k < (here.events.count > 0 ? 2 * here.events.count + 1 : 0); ++k) {
        int *one = k < here.events.count ? passage.signs + k : k < 2 * here.events.count ? passage.happened + k - here.events.count : passage.stopped;
        if (to_state)
            own_numbers[k] = *one;
        else
            *one = (int)own_numbers[k];
    }
    for (int k = 0; k < here.n_own; ++k) {
        ncgen_real *inside = own_numbers + 2 * here.events.count + 1 + k, *outside = parameters + here.own_places[k];
        if (to_state)
            *inside = *outside;
        else
            *outside = *inside;
    }
}

/* The mechanism with what is held. */
static const ncgen_driven *entered(ncgen_entered *in)
{
    if (!here.events.n_holds)
        return &here.own.driven;
    ncgen_enter_held(&here.own.driven, &here.events, parameters, NULL, in);
    return &in->driven;
}

static ncgen_moment present(void)
{
    pass_events(0);
    const ncgen_moment moment = {state[TIME], state[NEXT_STEP], state[WORK], state[POWER], state + STATE, state + STATE + here.n, state + STATE + 2 * here.n};
    return moment;
}

/* The state of a moment, with its multipliers. */
static int keep(const ncgen_linked_variant *v, const ncgen_moment *moment)
{
    ncgen_entered in;
    const int status = ncgen_multipliers(v == &here.own ? entered(&in) : &v->driven, parameters, moment, multipliers);
    pass_events(1);
    state[TIME] = moment->t;
    state[WORK] = moment->work;
    state[POWER] = moment->power;
    state[NEXT_STEP] = moment->h;
    ncgen_copy(here.m, multipliers, state + STATE + 3 * here.n);
    for (int k = 0; k < here.n_drives; ++k)
        drives[3 * here.n_drives + k] = v == &here.own ? 0 : -multipliers[here.m + k];
    return status;
}

int ncgen_linked_project_state(int is_driven)
{
    const ncgen_linked_variant *v = is_driven ? &here.with_drives : &here.own;
    ncgen_moment moment = present();
    choose_method(0, R(1.0e-8), R(1.0e-8));
    for (int k = 0; k < here.events.n_holds && !is_driven; ++k)
        parameters[here.events.holds[k].on] = 0; /* the motion begins anew */
    int status = ncgen_project_moment(&v->driven, parameters, &moment);
    if (status == NCGEN_OK && here.events.count > 0 && !is_driven)
        status = ncgen_begin_events(&v->driven, &here.events, parameters, &moment, &passage);
    return status == NCGEN_OK ? keep(v, &moment) : status;
}

int ncgen_linked_evaluate(void)
{
    ncgen_moment moment = present();
    choose_method(0, 1, 1);
    ncgen_entered in;
    const int status = ncgen_evaluate_moment(entered(&in), parameters, &moment);
    return status == NCGEN_OK ? keep(&here.own, &moment) : status;
}

int ncgen_linked_start(void)
{
    clear(size_of_state(), state);
    ncgen_copy(2 * here.n, described, state + STATE);
    return ncgen_linked_project_state(0);
}

int ncgen_linked_advance(ncgen_scalar t_end, ncgen_scalar step, ncgen_scalar rtol, ncgen_scalar atol, int one)
{
    ncgen_moment moment = present();
    ncgen_statistics statistics;
    choose_method(step, rtol, atol);
    const int status = here.events.count > 0 ? ncgen_advance_through_events(&here.own.driven, here.switches ? &breaks : NULL, &here.events, parameters, &moment,
                                                                  t_end, one, &passage, &statistics)
                       : here.switches  ? ncgen_advance_over_breaks(&here.own.driven, &breaks, parameters, &moment, t_end, &statistics)
                                        : ncgen_advance(&here.own.driven, parameters, &moment, t_end, &statistics);
    if (step > 0)
        moment.h = state[NEXT_STEP];
    return status == NCGEN_OK ? keep(&here.own, &moment) : status;
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
