/* Explicit Runge-Kutta methods: one text for a state at a time, for processors with AVX2 (EOMGEN_WIDE), where rows are gone
   through four states at a time, the last four again where n is no multiple, and for lanes, which define RUN and what
   follows it before. No sum is taken in another order, and nothing is contracted but in lanes, so that the bits of the first
   two are the same. */
#ifdef EOMGEN_WIDE
#define EOMGEN_ASKS_PROCESSOR
#endif
#include "eomgen_calls.h"
#include "eomgen_real.h"
#include "eomgen_steppers.h"

#if defined(EOMGEN_WIDE) && !(defined(EOMGEN_VECTORS) && defined(__x86_64__))
const eomgen_method *eomgen_suited(const eomgen_method *method, int n)
{
    (void)n;
    return method;
}
#else
#ifdef EOMGEN_WIDE
#if defined(__clang__)
#pragma clang attribute push(__attribute__((target("avx2"))), apply_to = function)
#else
#pragma GCC target("avx2")
#endif
typedef double now __attribute__((vector_size(32), aligned(8), may_alias));
#define AT(a) (*(now *)((a) + i))
#define EACH(...) \
    for (int i = 0;; i = i + 8 > n ? n - 4 : i + 4) { \
        __VA_ARGS__; \
        if (i == n - 4) { \
            break; \
        } \
    }
#define METHOD(name_, title, K, F, order) \
    static const eomgen_method wide_##name_ = {title, K, F, order, name_##_attempt, name_##_error, name_##_prepare, \
        name_##_interpolate, 0, 0, 0, NULL, NULL};
#else
#define AT(a) (a)[i]
#define EACH(...) \
    for (int i = 0; i < n; i++) { \
        __VA_ARGS__; \
    }
#endif
#define ROW(j) AT(K + (j) * n)

#ifndef RUN
#define RUN eomgen_run
#define EVALUATE eomgen_evaluate
#define root(a) sqrt(a)
#define OVER(a) (a) / AT(scale)
#ifndef EOMGEN_WIDE
typedef real now;
#define METHOD(name_, title, K, F, order) \
    const eomgen_method eomgen_##name_ = {title, K, F, order, EOMGEN_TABLED(name_##_attempt), \
        EOMGEN_TABLED(name_##_error), EOMGEN_TABLED(name_##_prepare), EOMGEN_TABLED(name_##_interpolate), 0, 0, 0, NULL, NULL};
#endif

/* What each state may err by. */
static inline void measure(const eomgen_run *run, double *scale)
{
    for (int i = 0; i < run->n; i++) {
        const double a = fabs(run->y_old[i]), b = fabs(run->y[i]);
        scale[i] = run->atol[i] + (a >= b ? a : b) * run->rtol;
    }
}
#endif

/* A stage: x' at t + at h, of y0 and h times a sum of earlier stages. */
#define STAGE(to, at, ...) \
    EACH(AT(y) = AT(y0) + h * (__VA_ARGS__)) \
    EVALUATE(run, t + (at) * h, y, to);

#if !defined(EOMGEN_DEVICE) || defined(EOMGEN_WANT_DOP853)
/* DOP853: order 8, error estimates of orders 5 and 3, dense output of order 7. E. Hairer, S. Norsett, G. Wanner, Solving
   Ordinary Differential Equations I, section II.10; coefficients of their DOP853, as SciPy has them. */
static void dop853_attempt(RUN *run, real h)
{
    const int n = run->n;
    const real t = run->t;
    real *const K = run->K, *const y = run->y;
    const real *const y0 = run->y_old;
    STAGE(K + n, 0.05260015195876773, 0.05260015195876773 * ROW(0))
    STAGE(K + 2 * n, 0.0789002279381516, 0.0197250569845379 * ROW(0) + 0.0591751709536137 * ROW(1))
    STAGE(K + 3 * n, 0.1183503419072274, 0.02958758547680685 * ROW(0) + 0.08876275643042054 * ROW(2))
    STAGE(K + 4 * n, 0.2816496580927726, 0.2413651341592667 * ROW(0) - 0.8845494793282861 * ROW(2) + 0.924834003261792 *
        ROW(3))
    STAGE(K + 5 * n, 0.3333333333333333, 0.037037037037037035 * ROW(0) + 0.17082860872947386 * ROW(3) +
        0.12546768756682242 * ROW(4))
    STAGE(K + 6 * n, 0.25, 0.037109375 * ROW(0) + 0.17025221101954405 * ROW(3) + 0.06021653898045596 * ROW(4) -
        0.017578125 * ROW(5))
    STAGE(K + 7 * n, 0.3076923076923077, 0.03709200011850479 * ROW(0) + 0.17038392571223998 * ROW(3) +
        0.10726203044637328 * ROW(4) - 0.015319437748624402 * ROW(5) + 0.008273789163814023 * ROW(6))
    STAGE(K + 8 * n, 0.6512820512820513, 0.6241109587160757 * ROW(0) - 3.3608926294469414 * ROW(3) - 0.868219346841726 *
        ROW(4) + 27.59209969944671 * ROW(5) + 20.154067550477894 * ROW(6) - 43.48988418106996 * ROW(7))
    STAGE(K + 9 * n, 0.6, 0.47766253643826434 * ROW(0) - 2.4881146199716677 * ROW(3) - 0.590290826836843 * ROW(4) +
        21.230051448181193 * ROW(5) + 15.279233632882423 * ROW(6) - 33.28821096898486 * ROW(7) - 0.020331201708508627 *
        ROW(8))
    STAGE(K + 10 * n, 0.8571428571428571, -0.9371424300859873 * ROW(0) + 5.186372428844064 * ROW(3) + 1.0914373489967295
        * ROW(4) - 8.149787010746927 * ROW(5) - 18.52006565999696 * ROW(6) + 22.739487099350505 * ROW(7) +
        2.4936055526796523 * ROW(8) - 3.0467644718982196 * ROW(9))
    STAGE(K + 11 * n, 1.0, 2.273310147516538 * ROW(0) - 10.53449546673725 * ROW(3) - 2.0008720582248625 * ROW(4) -
        17.9589318631188 * ROW(5) + 27.94888452941996 * ROW(6) - 2.8589982771350235 * ROW(7) - 8.87285693353063 * ROW(8)
        + 12.360567175794303 * ROW(9) + 0.6433927460157636 * ROW(10))
    STAGE(run->f, 1.0, 0.054293734116568765 * ROW(0) + 4.450312892752409 * ROW(5) + 1.8915178993145003 * ROW(6) -
        5.801203960010585 * ROW(7) + 0.3111643669578199 * ROW(8) - 0.1521609496625161 * ROW(9) + 0.20136540080403034 *
        ROW(10) + 0.04471061572777259 * ROW(11))
}

/* The two estimates combined: |h| e5 / sqrt(e5 + 0.01 e3), root mean square over the states. */
static real dop853_error(const RUN *run, real h)
{
    const int n = run->n;
    const real *const K = run->K;
    real *const five = run->F, *const three = five + n, *const scale = three + n;
    real e5 = same(0.0), e3 = same(0.0);
    measure(run, scale);
    EACH(
        AT(five) = OVER(0.01312004499419488 * ROW(0) - 1.2251564463762044 * ROW(5) - 0.4957589496572502 *
            ROW(6) + 1.6643771824549864 * ROW(7) - 0.35032884874997366 * ROW(8) + 0.3341791187130175 * ROW(9) +
            0.08192320648511571 * ROW(10) - 0.022355307863886294 * ROW(11));
        AT(three) = OVER(-0.18980075407240762 * ROW(0) + 4.450312892752409 * ROW(5) + 1.8915178993145003 *
            ROW(6) - 5.801203960010585 * ROW(7) - 0.4226823213237919 * ROW(8) - 0.1521609496625161 * ROW(9) +
            0.20136540080403034 * ROW(10) + 0.02265179219836082 * ROW(11));
    )
    for (int i = 0; i < n; i++) {
        e5 += five[i] * five[i], e3 += three[i] * three[i];
    }
    const real error = abs_of(h) * e5 / root((e5 + 0.01 * e3) * (double)n);
    return choose((e5 == 0.0) & (e3 == 0.0), same(0.0), error);
}

/* Three more stages and the polynomial's coefficients. */
static void dop853_prepare(RUN *run)
{
    const int n = run->n;
    const real h = run->step, t = run->t_old;
    real *const K = run->K, *const F = run->F, *const y = F;
    const real *const y0 = run->y_old;
    STAGE(K + 12 * n, 0.1, 0.056167502283047954 * ROW(0) + 0.25350021021662483 * ROW(6) - 0.2462390374708025 * ROW(7) -
        0.12419142326381637 * ROW(8) + 0.15329179827876568 * ROW(9) + 0.00820105229563469 * ROW(10) +
        0.007567897660545699 * ROW(11) - 0.008298 * AT(run->f))
    STAGE(K + 13 * n, 0.2, 0.03183464816350214 * ROW(0) + 0.028300909672366776 * ROW(5) + 0.053541988307438566 * ROW(6)
        - 0.05492374857139099 * ROW(7) - 0.00010834732869724932 * ROW(10) + 0.0003825710908356584 * ROW(11) -
        0.00034046500868740456 * AT(run->f) + 0.1413124436746325 * ROW(12))
    STAGE(K + 14 * n, 0.7777777777777778, -0.42889630158379194 * ROW(0) - 4.697621415361164 * ROW(5) + 7.683421196062599
        * ROW(6) + 4.06898981839711 * ROW(7) + 0.3567271874552811 * ROW(8) - 0.0013990241651590145 * AT(run->f) +
        2.9475147891527724 * ROW(12) - 9.15095847217987 * ROW(13))
    EACH(
        const now change = AT(run->y) - AT(run->y_old);
        AT(F) = change;
        AT(F + n) = h * ROW(0) - change;
        AT(F + 2 * n) = 2.0 * change - h * (AT(run->f) + ROW(0));
        AT(F + 3 * n) = h * (-8.428938276109013 * ROW(0) + 0.5667149535193777 * ROW(5) - 3.0689499459498917 * ROW(6) +
            2.38466765651207 * ROW(7) + 2.117034582445028 * ROW(8) - 0.871391583777973 * ROW(9) + 2.2404374302607883 *
            ROW(10) + 0.6315787787694688 * ROW(11) - 0.08899033645133331 * AT(run->f) + 18.148505520854727 * ROW(12) -
            9.194632392478356 * ROW(13) - 4.436036387594894 * ROW(14));
        AT(F + 4 * n) = h * (10.427508642579134 * ROW(0) + 242.28349177525817 * ROW(5) + 165.20045171727028 * ROW(6) -
            374.5467547226902 * ROW(7) - 22.113666853125306 * ROW(8) + 7.733432668472264 * ROW(9) - 30.674084731089398
            * ROW(10) - 9.332130526430229 * ROW(11) + 15.697238121770845 * AT(run->f) - 31.139403219565178 * ROW(12) -
            9.35292435884448 * ROW(13) + 35.81684148639408 * ROW(14));
        AT(F + 5 * n) = h * (19.985053242002433 * ROW(0) - 387.0373087493518 * ROW(5) - 189.17813819516758 * ROW(6) +
            527.8081592054236 * ROW(7) - 11.57390253995963 * ROW(8) + 6.8812326946963 * ROW(9) - 1.0006050966910838 *
            ROW(10) + 0.7777137798053443 * ROW(11) - 2.778205752353508 * AT(run->f) - 60.19669523126412 * ROW(12) +
            84.32040550667716 * ROW(13) + 11.99229113618279 * ROW(14));
        AT(F + 6 * n) = h * (-25.69393346270375 * ROW(0) - 154.18974869023643 * ROW(5) - 231.5293791760455 * ROW(6) +
            357.6391179106141 * ROW(7) + 93.40532418362432 * ROW(8) - 37.45832313645163 * ROW(9) + 104.0996495089623 *
            ROW(10) + 29.8402934266605 * ROW(11) - 43.53345659001114 * AT(run->f) + 96.32455395918828 * ROW(12) -
            39.17726167561544 * ROW(13) - 149.72683625798564 * ROW(14));
    )
}

static void dop853_interpolate(const RUN *run, real t, real *y)
{
    const int n = run->n;
    const real *const F = run->F, *const y0 = run->y_old;
    const real x = (t - run->t_old) / run->step, rest = 1.0 - x;
    EACH(
        now sum = AT(F + 6 * n) * x;
        sum = (sum + AT(F + 5 * n)) * rest;
        sum = (sum + AT(F + 4 * n)) * x;
        sum = (sum + AT(F + 3 * n)) * rest;
        sum = (sum + AT(F + 2 * n)) * x;
        sum = (sum + AT(F + n)) * rest;
        sum = (sum + AT(F)) * x;
        AT(y) = sum + AT(y0);
    )
}

METHOD(dop853, "DOP853", 15, 7, 7)
#endif

#ifndef EOMGEN_DEVICE
/* RK45: J. Dormand, P. Prince, A family of embedded Runge-Kutta formulae, 1980; dense output of order 4 by L. Shampine,
   Some practical Runge-Kutta formulas, 1986; as SciPy has them. */
static void rk45_attempt(RUN *run, real h)
{
    const int n = run->n;
    const real t = run->t;
    real *const K = run->K, *const y = run->y;
    const real *const y0 = run->y_old;
    STAGE(K + n, 0.2, 0.2 * ROW(0))
    STAGE(K + 2 * n, 0.3, 0.075 * ROW(0) + 0.225 * ROW(1))
    STAGE(K + 3 * n, 0.8, 0.9777777777777777 * ROW(0) - 3.7333333333333334 * ROW(1) + 3.5555555555555554 * ROW(2))
    STAGE(K + 4 * n, 0.8888888888888888, 2.9525986892242035 * ROW(0) - 11.595793324188385 * ROW(1) + 9.822892851699436 *
        ROW(2) - 0.2908093278463649 * ROW(3))
    STAGE(K + 5 * n, 1.0, 2.8462752525252526 * ROW(0) - 10.757575757575758 * ROW(1) + 8.906422717743473 * ROW(2) +
        0.2784090909090909 * ROW(3) - 0.2735313036020583 * ROW(4))
    STAGE(run->f, 1.0, 0.09114583333333333 * ROW(0) + 0.44923629829290207 * ROW(2) + 0.6510416666666666 * ROW(3) -
        0.322376179245283 * ROW(4) + 0.13095238095238096 * ROW(5))
}

static real rk45_error(const RUN *run, real h)
{
    const int n = run->n;
    const real *const K = run->K;
    real *const part = run->F, *const scale = run->F + n;
    real sum = same(0.0);
    measure(run, scale);
    EACH(AT(part) = h * OVER(-0.0012326388888888888 * ROW(0) + 0.0042527702905061394 * ROW(2) - 0.03697916666666667 *
        ROW(3) + 0.05086379716981132 * ROW(4) - 0.0419047619047619 * ROW(5) + 0.025 * AT(run->f)))
    for (int i = 0; i < n; i++) {
        sum += part[i] * part[i];
    }
    return root(sum / (double)n);
}

static void rk45_prepare(RUN *run)
{
    const int n = run->n;
    const real *const K = run->K;
    real *const F = run->F;
    EACH(
        AT(F) = 1.0 * ROW(0);
        AT(F + n) = -2.8535800653862835 * ROW(0) + 4.023133379230305 * ROW(2) - 3.7324019615885042 * ROW(3) +
            2.5548038301849423 * ROW(4) - 1.3744241142186024 * ROW(5) + 1.3824689317781436 * AT(run->f);
        AT(F + 2 * n) = 3.0717434641059005 * ROW(0) - 6.249321565289 * ROW(2) + 10.068970589843675 * ROW(3) -
            6.399112377351017 * ROW(4) + 3.272657752246729 * ROW(5) - 3.764937863556287 * AT(run->f);
        AT(F + 3 * n) = -1.1270175653862835 * ROW(0) + 2.675424484351598 * ROW(2) - 5.685526961588504 * ROW(3) +
            3.5219323679207912 * ROW(4) - 1.7672812570757455 * ROW(5) + 2.382468931778144 * AT(run->f);
    )
}

static void rk45_interpolate(const RUN *run, real t, real *y)
{
    const int n = run->n;
    const real *const F = run->F, *const y0 = run->y_old;
    const real h = run->step, x = (t - run->t_old) / h;
    EACH(AT(y) = AT(y0) + h * x * (AT(F) + x * (AT(F + n) + x * (AT(F + 2 * n) + x * AT(F + 3 * n)))))
}

METHOD(rk45, "RK45", 6, 4, 4)
#endif

#if defined(EOMGEN_PLAIN) && !defined(EOMGEN_WIDE) && (!defined(EOMGEN_DEVICE) || defined(EOMGEN_WANT_RK4))
/* RK4 with steps of one size: W. Kutta, Beitrag zur naeherungsweisen Integration totaler Differentialgleichungen, 1901;
   between the steps the cubic through both ends. Its error is not watched: max_step is the step. */
static void rk4_attempt(RUN *run, real h)
{
    const int n = run->n;
    const real t = run->t;
    real *const K = run->K, *const y = run->y;
    const real *const y0 = run->y_old;
    STAGE(K + n, 0.5, 0.5 * ROW(0))
    STAGE(K + 2 * n, 0.5, 0.5 * ROW(1))
    STAGE(K + 3 * n, 1.0, ROW(2))
    EACH(AT(y) = AT(y0) + h / 6.0 * (ROW(0) + 2.0 * (ROW(1) + ROW(2)) + ROW(3)))
    EVALUATE(run, t + h, y, run->f);
}

/* Only a state that is no number is refused. */
static real rk4_error(const RUN *run, real h)
{
    real sum = h * 0.0;
    for (int i = 0; i < run->n; i++) {
        sum += 0.0 * run->f[i];
    }
    return sum;
}

static void rk4_prepare(RUN *run)
{
    const int n = run->n;
    const real h = run->step;
    const real *const K = run->K;
    real *const F = run->F;
    EACH(
        const now change = AT(run->y) - AT(run->y_old), first = h * ROW(0), last = h * AT(run->f);
        AT(F) = first;
        AT(F + n) = 3.0 * change - 2.0 * first - last;
        AT(F + 2 * n) = first + last - 2.0 * change;
    )
}

static void rk4_interpolate(const RUN *run, real t, real *y)
{
    const int n = run->n;
    const real *const F = run->F, *const y0 = run->y_old;
    const real x = (t - run->t_old) / run->step;
    EACH(AT(y) = AT(y0) + x * (AT(F) + x * (AT(F + n) + x * AT(F + 2 * n))))
}

const eomgen_method eomgen_rk4 = {"RK4", 4, 3, 4, EOMGEN_TABLED(rk4_attempt), EOMGEN_TABLED(rk4_error),
    EOMGEN_TABLED(rk4_prepare), EOMGEN_TABLED(rk4_interpolate), 1, 0, 0, NULL, NULL};

int eomgen_march(eomgen_function rhs, int n, double t, double h, const double *x, const double *u, const double *c,
    double *out, double *w, double *k)
{
    return step_by_rk4(rhs, n, t, h, x, u, c, out, w, k);
}
#endif

#ifdef EOMGEN_WIDE
#if defined(__clang__)
#pragma clang attribute pop
#endif

/* States from which on this pays: what a right-hand side has just written one by one is slow to read four at a time. */
enum { WIDE_FROM = 6 };

const eomgen_method *eomgen_suited(const eomgen_method *method, int n)
{
    const eomgen_method *const plain[] = {&eomgen_dop853, &eomgen_rk45};
    const eomgen_method *const wide[] = {&wide_dop853, &wide_rk45};
    for (int k = 0; n >= WIDE_FROM && k < 2; k++) {
        if (method == plain[k] && eomgen_processor() != 0) {
            return wide[k];
        }
    }
    return method;
}
#endif
#endif
