/* ncgen_explicit.c: Runge-Kutta methods: Dormand-Prince 5(4) and 8(5,3) with error control and dense output, and the
 * classical one with a fixed step.
 *
 * Coefficients: Hairer, Norsett and Wanner, Solving Ordinary Differential Equations I, II.5 and their program DOP853.
 */
#include "ncgen_internal.h"

#define Q(a, b) ((ncgen_scalar)(a##.0L) / (ncgen_scalar)(b##.0L))

enum {
    WIDTH = 16,
    REPEAT_LIMIT = 8
};

/* A step y_new = y + h sum(a[stages][j] k_j), and k_stages = yd at its end. */
typedef struct tableau {
    int stages, order; /* order of the error estimate */
    const ncgen_scalar *c;
    const ncgen_scalar (*a)[WIDTH];
} tableau;

static const ncgen_scalar dopri_c[7] = {Q(0, 1), Q(1, 5), Q(3, 10), Q(4, 5), Q(8, 9), Q(1, 1), Q(1, 1)};

static const ncgen_scalar dopri_a[7][WIDTH] = {
    {Q(0, 1)},
    {Q(1, 5)},
    {Q(3, 40), Q(9, 40)},
    {Q(44, 45), -Q(56, 15), Q(32, 9)},
    {Q(19372, 6561), -Q(25360, 2187), Q(64448, 6561), -Q(212, 729)},
    {Q(9017, 3168), -Q(355, 33), Q(46732, 5247), Q(49, 176), -Q(5103, 18656)},
    {Q(35, 384), Q(0, 1), Q(500, 1113), Q(125, 192), -Q(2187, 6784), Q(11, 84)},
};

/* Difference of the fifth- and fourth-order weights. */
static const ncgen_scalar dopri_error[7] = {
    -Q(71, 57600), Q(0, 1), Q(71, 16695), -Q(71, 1920), Q(17253, 339200), -Q(22, 525), Q(1, 40)};

/* Weights of the interpolant: b_i(s) = s (c0 + s (c1 + s (c2 + s c3))) (Shampine 1986). */
static const ncgen_scalar dopri_dense[7][4] = {
    {R(1.0), -Q(8048581381, 2820520608), Q(8663915743, 2820520608), -Q(12715105075, 11282082432)},
    {R(0.0), R(0.0), R(0.0), R(0.0)},
    {R(0.0), Q(131558114200, 32700410799), -Q(68118460800, 10900136933), Q(87487479700, 32700410799)},
    {R(0.0), -Q(1754552775, 470086768), Q(14199869525, 1410260304), -Q(10690763975, 1880347072)},
    {R(0.0), Q(127303824393, 49829197408), -Q(318862633887, 49829197408), Q(701980252875, 199316789632)},
    {R(0.0), -Q(282668133, 205662961), Q(2019193451, 616988883), -Q(1453857185, 822651844)},
    {R(0.0), Q(40617522, 29380423), -Q(110615467, 29380423), Q(69997945, 29380423)},
};

static const ncgen_scalar dop853_a[16][16] = {
    {R(0.0)},
    {R(5.26001519587677318785587544488e-2)},
    {R(1.97250569845378994544595329183e-2), R(5.91751709536136983633785987549e-2)},
    {R(2.95875854768068491816892993775e-2), R(0.0), R(8.87627564304205475450678981324e-2)},
    {R(2.41365134159266685502369798665e-1), R(0.0), -R(8.84549479328286085344864962717e-1),
     R(9.24834003261792003115737966543e-1)},
    {R(3.7037037037037037037037037037e-2), R(0.0), R(0.0), R(1.70828608729473871279604482173e-1),
     R(1.25467687566822425016691814123e-1)},
    {R(3.7109375e-2), R(0.0), R(0.0), R(1.70252211019544039314978060272e-1), R(6.02165389804559606850219397283e-2),
     -R(1.7578125e-2)},
    {R(3.70920001185047927108779319836e-2), R(0.0), R(0.0), R(1.70383925712239993810214054705e-1),
     R(1.07262030446373284651809199168e-1), -R(1.53194377486244017527936158236e-2), R(8.27378916381402288758473766002e-3)},
    {R(6.24110958716075717114429577812e-1), R(0.0), R(0.0), -R(3.36089262944694129406857109825),
     -R(8.68219346841726006818189891453e-1), R(2.75920996994467083049415600797e1), R(2.01540675504778934086186788979e1),
     -R(4.34898841810699588477366255144e1)},
    {R(4.77662536438264365890433908527e-1), R(0.0), R(0.0), -R(2.48811461997166764192642586468),
     -R(5.90290826836842996371446475743e-1), R(2.12300514481811942347288949897e1), R(1.52792336328824235832596922938e1),
     -R(3.32882109689848629194453265587e1), -R(2.03312017085086261358222928593e-2)},
    {-R(9.3714243008598732571704021658e-1), R(0.0), R(0.0), R(5.18637242884406370830023853209),
     R(1.09143734899672957818500254654), -R(8.14978701074692612513997267357), -R(1.85200656599969598641566180701e1),
     R(2.27394870993505042818970056734e1), R(2.49360555267965238987089396762), -R(3.0467644718982195003823669022)},
    {R(2.27331014751653820792359768449), R(0.0), R(0.0), -R(1.05344954667372501984066689879e1),
     -R(2.00087205822486249909675718444), -R(1.79589318631187989172765950534e1), R(2.79488845294199600508499808837e1),
     -R(2.85899827713502369474065508674), -R(8.87285693353062954433549289258), R(1.23605671757943030647266201528e1),
     R(6.43392746015763530355970484046e-1)},
    {R(5.42937341165687622380535766363e-2), R(0.0), R(0.0), R(0.0), R(0.0), R(4.45031289275240888144113950566),
     R(1.89151789931450038304281599044), -R(5.8012039600105847814672114227), R(3.1116436695781989440891606237e-1),
     -R(1.52160949662516078556178806805e-1), R(2.01365400804030348374776537501e-1), R(4.47106157277725905176885569043e-2)},
    {R(5.61675022830479523392909219681e-2), R(0.0), R(0.0), R(0.0), R(0.0), R(0.0), R(2.53500210216624811088794765333e-1),
     -R(2.46239037470802489917441475441e-1), -R(1.24191423263816360469010140626e-1), R(1.5329179827876569731206322685e-1),
     R(8.20105229563468988491666602057e-3), R(7.56789766054569976138603589584e-3), -R(8.298e-3)},
    {R(3.18346481635021405060768473261e-2), R(0.0), R(0.0), R(0.0), R(0.0), R(2.83009096723667755288322961402e-2),
     R(5.35419883074385676223797384372e-2), -R(5.49237485713909884646569340306e-2), R(0.0), R(0.0),
     -R(1.08347328697249322858509316994e-4), R(3.82571090835658412954920192323e-4), -R(3.40465008687404560802977114492e-4),
     R(1.41312443674632500278074618366e-1)},
    {-R(4.28896301583791923408573538692e-1), R(0.0), R(0.0), R(0.0), R(0.0), -R(4.69762141536116384314449447206),
     R(7.68342119606259904184240953878), R(4.06898981839711007970213554331), R(3.56727187455281109270669543021e-1), R(0.0),
     R(0.0), R(0.0), -R(1.39902416515901462129418009734e-3), R(2.9475147891527723389556272149),
     -R(9.15095847217987001081870187138)},
};

static const ncgen_scalar dop853_c[16] = {
    R(0.0), R(0.526001519587677318785587544488e-01), R(0.789002279381515978178381316732e-01),
     R(0.118350341907227396726757197510), R(0.281649658092772603273242802490), R(0.333333333333333333333333333333), R(0.25),
     R(0.307692307692307692307692307692), R(0.651282051282051282051282051282), R(0.6), R(0.857142857142857142857142857142),
     R(1.0), R(1.0), R(0.1), R(0.2), R(0.777777777777777777777777777778)};

/* The estimates of orders 5 and 3; the latter is what is taken away from the weights. */
static const ncgen_scalar dop853_e5[12] = {
    R(0.1312004499419488073250102996e-1), R(0.0), R(0.0), R(0.0), R(0.0), -R(0.1225156446376204440720569753e1),
     -R(0.4957589496572501915214079952), R(0.1664377182454986536961530415e1), -R(0.3503288487499736816886487290),
     R(0.3341791187130174790297318841), R(0.8192320648511571246570742613e-1), -R(0.2235530786388629525884427845e-1)};

static const ncgen_scalar dop853_e3[12] = {
    R(0.244094488188976377952755905512), R(0.0), R(0.0), R(0.0), R(0.0), R(0.0), R(0.0), R(0.0),
     R(0.733846688281611857341361741547), R(0.0), R(0.0), R(0.220588235294117647058823529412e-1)};

/* Higher coefficients of the interpolant. */
static const ncgen_scalar dop853_d[4][16] = {
    {-R(0.84289382761090128651353491142e1), R(0.0), R(0.0), R(0.0), R(0.0), R(0.56671495351937776962531783590),
     -R(0.30689499459498916912797304727e1), R(0.23846676565120698287728149680e1), R(0.21170345824450282767155149946e1),
     -R(0.87139158377797299206789907490), R(0.22404374302607882758541771650e1), R(0.63157877876946881815570249290),
     -R(0.88990336451333310820698117400e-1), R(0.18148505520854727256656404962e2), -R(0.91946323924783554000451984436e1),
     -R(0.44360363875948939664310572000e1)},
    {R(0.10427508642579134603413151009e2), R(0.0), R(0.0), R(0.0), R(0.0), R(0.24228349177525818288430175319e3),
     R(0.16520045171727028198505394887e3), -R(0.37454675472269020279518312152e3), -R(0.22113666853125306036270938578e2),
     R(0.77334326684722638389603898808e1), -R(0.30674084731089398182061213626e2), -R(0.93321305264302278729567221706e1),
     R(0.15697238121770843886131091075e2), -R(0.31139403219565177677282850411e2), -R(0.93529243588444783865713862664e1),
     R(0.35816841486394083752465898540e2)},
    {R(0.19985053242002433820987653617e2), R(0.0), R(0.0), R(0.0), R(0.0), -R(0.38703730874935176555105901742e3),
     -R(0.18917813819516756882830838328e3), R(0.52780815920542364900561016686e3), -R(0.11573902539959630126141871134e2),
     R(0.68812326946963000169666922661e1), -R(0.10006050966910838403183860980e1), R(0.77771377980534432092869265740),
     -R(0.27782057523535084065932004339e1), -R(0.60196695231264120758267380846e2), R(0.84320405506677161018159903784e2),
     R(0.11992291136182789328035130030e2)},
    {-R(0.25693933462703749003312586129e2), R(0.0), R(0.0), R(0.0), R(0.0), -R(0.15418974869023643374053993627e3),
     -R(0.23152937917604549567536039109e3), R(0.35763911791061412378285349910e3), R(0.93405324183624310003907691704e2),
     -R(0.37458323136451633156875139351e2), R(0.10409964950896230045147246184e3), R(0.29840293426660503123344363579e2),
     -R(0.43533456590011143754432175058e2), R(0.96324553959188282948394950600e2), -R(0.39177261675615439165231486172e2),
     -R(0.14972683625798562581422125276e3)},
};

static const ncgen_scalar rk4_c[5] = {Q(0, 1), Q(1, 2), Q(1, 2), Q(1, 1), Q(1, 1)};

static const ncgen_scalar rk4_a[5][WIDTH] = {
    {Q(0, 1)}, {Q(1, 2)}, {Q(0, 1), Q(1, 2)}, {Q(0, 1), Q(0, 1), Q(1, 1)}, {Q(1, 6), Q(1, 3), Q(1, 3), Q(1, 6)}};

static const tableau tableaus[3] = {{6, 4, dopri_c, dopri_a}, {4, 0, rk4_c, rk4_a}, {12, 7, dop853_c, dop853_a}};

void ncgen_explicit_layout(ncgen_run *r, ncgen_stepping *w)
{
    w->new_y = ncgen_take(&r->space, r->ny);
    w->at = ncgen_take(&r->space, r->ny);
    w->slopes = ncgen_take(&r->space, (r->options->method == NCGEN_DOP853 ? 16 : 7) * r->ny);
    w->interpolant = ncgen_take(&r->space, r->options->method == NCGEN_DOP853 ? 7 * r->ny : 0);
    w->interpolated = 0;
}

static ncgen_real *slope(const ncgen_run *r, const ncgen_stepping *w, int stage)
{
    return w->slopes + (size_t)stage * (size_t)r->ny;
}

/* sum = sum over the stages of weight times slope. */
static void combine(const ncgen_run *r, const ncgen_stepping *w, int stages, const ncgen_scalar *weights,
                    ncgen_real *NCGEN_RESTRICT sum)
{
    for (int i = 0; i < r->ny; ++i)
        sum[i] = 0;
    for (int j = 0; j < stages; ++j) {
        const ncgen_scalar weight = weights[j];
        const ncgen_real *NCGEN_RESTRICT k = slope(r, w, j);
        if (!(NCGEN_ABS(weight) > 0))
            continue;
        for (int i = 0; i < r->ny; ++i)
            sum[i] += weight * k[i];
    }
}

static void advance(const ncgen_run *r, const ncgen_stepping *w, ncgen_scalar h, int stages, const ncgen_scalar *weights,
                    ncgen_real *y_new)
{
    combine(r, w, stages, weights, y_new);
    for (int i = 0; i < r->ny; ++i)
        y_new[i] = r->y[i] + h * y_new[i];
}

/* One trial step: new_y, and the slope there. */
static int trial_step(ncgen_run *r, ncgen_stepping *w, const tableau *method, ncgen_scalar t, ncgen_scalar h)
{
    const int last = method->stages;
    for (int s = 1; s <= last; ++s) {
        advance(r, w, h, s, method->a[s], w->new_y);
        int status = s == last && r->settle ? r->settle(r, t + h, w->new_y) : NCGEN_OK;
        if (status == NCGEN_OK)
            status = r->derivative(r, t + method->c[s] * h, w->new_y, slope(r, w, s));
        if (status != NCGEN_OK)
            return status;
    }
    w->interpolated = 0;
    return NCGEN_OK;
}

static ncgen_real tolerated(const ncgen_run *r, ncgen_real a, ncgen_real b)
{
    const ncgen_real u = NCGEN_ABS(a), v = NCGEN_ABS(b);
    return r->options->atol + r->options->rtol * (u > v ? u : v);
}

ncgen_real ncgen_weighted_square(const ncgen_run *r, const ncgen_real *x, const ncgen_real *a, const ncgen_real *b)
{
    ncgen_real sum = 0;
    for (int i = 0; i < r->weighed; ++i) {
        const ncgen_real scaled = x[i] / tolerated(r, a[i], b[i]);
        sum += scaled * scaled;
    }
    return sum / (ncgen_scalar)r->weighed;
}

static ncgen_real error_of(ncgen_run *r, ncgen_stepping *w, ncgen_scalar h)
{
    if (r->options->method == NCGEN_DOPRI5) {
        combine(r, w, 7, dopri_error, w->at);
        return h * NCGEN_SQRT(ncgen_weighted_square(r, w->at, r->y, w->new_y));
    }
    combine(r, w, 12, dop853_e5, w->at);
    const ncgen_real fifth = ncgen_weighted_square(r, w->at, r->y, w->new_y);
    ncgen_scalar third_weights[12];
    for (int j = 0; j < 12; ++j)
        third_weights[j] = dop853_a[12][j] - dop853_e3[j];
    combine(r, w, 12, third_weights, w->at);
    const ncgen_real third = ncgen_weighted_square(r, w->at, r->y, w->new_y);
    const ncgen_real both = fifth + R(0.01) * third;
    return both > 0 ? h * fifth / NCGEN_SQRT(both) : both;
}

/* A first step from the sizes of y, yd and an estimate of ydd (Hairer, Norsett & Wanner, II.4). */
ncgen_scalar ncgen_first_step(ncgen_run *r, ncgen_stepping *w, int order, ncgen_scalar t, ncgen_scalar span)
{
    const ncgen_real d0 = NCGEN_SQRT(ncgen_weighted_square(r, r->y, r->y, r->y));
    const ncgen_real d1 = NCGEN_SQRT(ncgen_weighted_square(r, slope(r, w, 0), r->y, r->y));
    ncgen_real guess = d0 < R(1.0e-5) || d1 < R(1.0e-5) ? R(1.0e-6) : R(0.01) * d0 / d1;
    if (guess > span)
        guess = span;
    for (int i = 0; i < r->ny; ++i)
        w->new_y[i] = r->y[i] + guess * slope(r, w, 0)[i];
    if (r->derivative(r, t + guess, w->new_y, slope(r, w, 1)) != NCGEN_OK)
        return guess * R(0.01);
    for (int i = 0; i < r->ny; ++i)
        w->at[i] = slope(r, w, 1)[i] - slope(r, w, 0)[i];
    const ncgen_real d2 = NCGEN_SQRT(ncgen_weighted_square(r, w->at, r->y, r->y)) / guess;
    const ncgen_real largest = d1 > d2 ? d1 : d2;
    const ncgen_scalar root = 1 / (ncgen_scalar)(order + 1);
    ncgen_real better = largest <= R(1.0e-15) ? guess * R(1.0e-3) : NCGEN_POW(R(0.01) / largest, root);
    if (better > R(100.0) * guess)
        better = R(100.0) * guess;
    return better < span ? better : span;
}

/* DOP853's interpolant needs three stages more and seven coefficients; made once a step, when first asked for. */
static int prepare_interpolant(ncgen_run *r, ncgen_stepping *w, ncgen_scalar t, ncgen_scalar h)
{
    for (int s = 13; s < 16; ++s) {
        advance(r, w, h, s, dop853_a[s], w->at);
        const int status = r->derivative(r, t + dop853_c[s] * h, w->at, slope(r, w, s));
        if (status != NCGEN_OK)
            return status;
    }
    ncgen_real *f = w->interpolant;
    const ncgen_real *first = slope(r, w, 0), *last = slope(r, w, 12);
    const int ny = r->ny;
    for (int i = 0; i < ny; ++i) {
        const ncgen_real change = w->new_y[i] - r->y[i];
        f[i] = change;
        f[ny + i] = h * first[i] - change;
        f[2 * ny + i] = 2 * change - h * (first[i] + last[i]);
    }
    for (int k = 0; k < 4; ++k) {
        combine(r, w, 16, dop853_d[k], f + (size_t)(3 + k) * (size_t)ny);
        for (int i = 0; i < ny; ++i)
            f[(size_t)(3 + k) * (size_t)ny + (size_t)i] *= h;
    }
    return NCGEN_OK;
}

/* w->at: the state at t + s h, inside a step whose end is new_y. */
static int interpolate(ncgen_run *r, ncgen_stepping *w, ncgen_scalar t, ncgen_scalar h, ncgen_scalar s)
{
    if (r->options->method == NCGEN_DOPRI5) {
        ncgen_scalar weights[7];
        for (int j = 0; j < 7; ++j) {
            const ncgen_scalar *c = dopri_dense[j];
            weights[j] = s * (c[0] + s * (c[1] + s * (c[2] + s * c[3])));
        }
        advance(r, w, h, 7, weights, w->at);
    } else if (r->options->method == NCGEN_DOP853) {
        if (!w->interpolated) {
            const int status = prepare_interpolant(r, w, t, h);
            if (status != NCGEN_OK)
                return status;
            w->interpolated = 1;
        }
        for (int i = 0; i < r->ny; ++i) {
            ncgen_real sum = 0;
            for (int k = 6; k >= 0; --k)
                sum = (sum + w->interpolant[(size_t)k * (size_t)r->ny + (size_t)i]) * (k % 2 ? 1 - s : s);
            w->at[i] = r->y[i] + sum;
        }
    } else {
        ncgen_interpolate_cubic(r, w, slope(r, w, 0), slope(r, w, 4), h, s);
    }
    return NCGEN_OK;
}

static int finish_step(ncgen_run *r, ncgen_stepping *w, const tableau *method, ncgen_scalar t, ncgen_scalar t_new)
{
    const int status = ncgen_grid_step(r, w, t, t_new);
    ncgen_copy(r->ny, slope(r, w, method->stages), slope(r, w, 0));
    return status;
}

static int run_adaptive(ncgen_run *r, ncgen_stepping *w, const tableau *method)
{
    const ncgen_scalar end = r->times[r->n_times - 1];
    const ncgen_scalar power = -1 / (ncgen_scalar)(method->order + 1);
    ncgen_scalar t = r->times[0];
    ncgen_scalar h = ncgen_first_step(r, w, method->order, t, end - t);
    int repeats = 0, rejected = 0;
    while (t < end) {
        if (r->options->max_steps && r->statistics->steps >= r->options->max_steps)
            return NCGEN_NOT_CONVERGED;
        if (r->options->max_step > 0 && h > r->options->max_step)
            h = r->options->max_step;
        const int last = t + h >= end;
        if (last)
            h = end - t;
        if (!(t + h > t))
            return NCGEN_NOT_CONVERGED;
        int status = trial_step(r, w, method, t, h);
        const ncgen_real error = status == NCGEN_OK ? error_of(r, w, h) : 0;
        if (status != NCGEN_OK || !(error < R(1.0e30))) {
            if (++repeats > REPEAT_LIMIT)
                return status != NCGEN_OK ? status : NCGEN_NOT_CONVERGED;
            r->statistics->repeated += 1;
            r->careful = repeats > 1; /* again: it may be rounding */
            h *= R(0.25);
            continue;
        }
        ncgen_real factor = error > 0 ? R(0.9) * NCGEN_POW(error, power) : R(10.0);
        if (!(error < R(1.0))) {
            r->statistics->rejected += 1;
            r->careful = rejected; /* again: it may be rounding */
            rejected = 1;
            h *= factor > R(0.2) ? factor : R(0.2);
            continue;
        }
        if (factor > R(10.0))
            factor = R(10.0);
        if (rejected && factor > R(1.0))
            factor = R(1.0);
        repeats = rejected = 0;
        const ncgen_scalar t_new = last ? end : t + h;
        status = finish_step(r, w, method, t, t_new);
        if (r->statistics->stopped || (status != NCGEN_OK && t_new < end))
            return status;
        t = t_new;
        h *= factor;
    }
    return NCGEN_OK;
}

static int run_fixed(ncgen_run *r, ncgen_stepping *w, const tableau *method)
{
    for (int row = 1; row < r->n_times; ++row) {
        const ncgen_scalar span = r->times[row] - r->times[row - 1];
        const ncgen_scalar count = ncgen_step_count(r, span);
        for (ncgen_scalar i = 0; i < count; i += 1) {
            const ncgen_scalar t = r->times[row - 1] + i * (span / count);
            const int last = i + 1 >= count;
            const ncgen_scalar t_new = last ? r->times[row] : r->times[row - 1] + (i + 1) * (span / count);
            int status = trial_step(r, w, method, t, t_new - t);
            if (status != NCGEN_OK)
                return status;
            status = finish_step(r, w, method, t, t_new);
            if (r->statistics->stopped)
                return status;
            if (status != NCGEN_OK && !(last && row + 1 == r->n_times))
                return status;
        }
    }
    return NCGEN_OK;
}

int ncgen_explicit(ncgen_run *r, ncgen_stepping *w)
{
    const tableau *method = &tableaus[r->options->method];
    int status = r->derivative(r, r->times[0], r->y, slope(r, w, 0));
    if (status == NCGEN_OK)
        (void)ncgen_accept(r, r->times[0], r->y);
    w->interpolate = interpolate;
    if (status == NCGEN_OK)
        status = ncgen_grid_begin(r, w);
    if (status != NCGEN_OK)
        return status;
    return r->options->method == NCGEN_RK4 ? run_fixed(r, w, method) : run_adaptive(r, w, method);
}
