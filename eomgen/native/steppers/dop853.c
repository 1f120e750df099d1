/* DOP853: order 8, error estimates of orders 5 and 3, dense output of order 7. E. Hairer, S. Norsett, G. Wanner, Solving
   Ordinary Differential Equations I, section II.10; coefficients of their DOP853, as SciPy has them. */
static void dop853_attempt(RUN *run, real h)
{
    const int n = run->n;
    const real t = run->t;
    real *const K = run->K, *const y = run->y;
    const real *const y0 = run->y_old;
    EACH(AT(y) = AT(y0) + h * (0.05260015195876773 * ROW(0)))
    EVALUATE(run, t + 0.05260015195876773 * h, y, K + n);
    EACH(AT(y) = AT(y0) + h * (0.0197250569845379 * ROW(0) + 0.0591751709536137 * ROW(1)))
    EVALUATE(run, t + 0.0789002279381516 * h, y, K + 2 * n);
    EACH(AT(y) = AT(y0) + h * (0.02958758547680685 * ROW(0) + 0.08876275643042054 * ROW(2)))
    EVALUATE(run, t + 0.1183503419072274 * h, y, K + 3 * n);
    EACH(AT(y) = AT(y0) + h * (0.2413651341592667 * ROW(0) - 0.8845494793282861 * ROW(2) + 0.924834003261792 *
        ROW(3)))
    EVALUATE(run, t + 0.2816496580927726 * h, y, K + 4 * n);
    EACH(AT(y) = AT(y0) + h * (0.037037037037037035 * ROW(0) + 0.17082860872947386 * ROW(3) + 0.12546768756682242 *
        ROW(4)))
    EVALUATE(run, t + 0.3333333333333333 * h, y, K + 5 * n);
    EACH(AT(y) = AT(y0) + h * (0.037109375 * ROW(0) + 0.17025221101954405 * ROW(3) + 0.06021653898045596 * ROW(4) -
        0.017578125 * ROW(5)))
    EVALUATE(run, t + 0.25 * h, y, K + 6 * n);
    EACH(AT(y) = AT(y0) + h * (0.03709200011850479 * ROW(0) + 0.17038392571223998 * ROW(3) + 0.10726203044637328 *
        ROW(4) - 0.015319437748624402 * ROW(5) + 0.008273789163814023 * ROW(6)))
    EVALUATE(run, t + 0.3076923076923077 * h, y, K + 7 * n);
    EACH(AT(y) = AT(y0) + h * (0.6241109587160757 * ROW(0) - 3.3608926294469414 * ROW(3) - 0.868219346841726 * ROW(4)
        + 27.59209969944671 * ROW(5) + 20.154067550477894 * ROW(6) - 43.48988418106996 * ROW(7)))
    EVALUATE(run, t + 0.6512820512820513 * h, y, K + 8 * n);
    EACH(AT(y) = AT(y0) + h * (0.47766253643826434 * ROW(0) - 2.4881146199716677 * ROW(3) - 0.590290826836843 * ROW(4)
        + 21.230051448181193 * ROW(5) + 15.279233632882423 * ROW(6) - 33.28821096898486 * ROW(7) -
        0.020331201708508627 * ROW(8)))
    EVALUATE(run, t + 0.6 * h, y, K + 9 * n);
    EACH(AT(y) = AT(y0) + h * (-0.9371424300859873 * ROW(0) + 5.186372428844064 * ROW(3) + 1.0914373489967295 * ROW(4)
        - 8.149787010746927 * ROW(5) - 18.52006565999696 * ROW(6) + 22.739487099350505 * ROW(7) + 2.4936055526796523 *
        ROW(8) - 3.0467644718982196 * ROW(9)))
    EVALUATE(run, t + 0.8571428571428571 * h, y, K + 10 * n);
    EACH(AT(y) = AT(y0) + h * (2.273310147516538 * ROW(0) - 10.53449546673725 * ROW(3) - 2.0008720582248625 * ROW(4) -
        17.9589318631188 * ROW(5) + 27.94888452941996 * ROW(6) - 2.8589982771350235 * ROW(7) - 8.87285693353063 *
        ROW(8) + 12.360567175794303 * ROW(9) + 0.6433927460157636 * ROW(10)))
    EVALUATE(run, t + 1.0 * h, y, K + 11 * n);
    EACH(AT(y) = AT(y0) + h * (0.054293734116568765 * ROW(0) + 4.450312892752409 * ROW(5) + 1.8915178993145003 *
        ROW(6) - 5.801203960010585 * ROW(7) + 0.3111643669578199 * ROW(8) - 0.1521609496625161 * ROW(9) +
        0.20136540080403034 * ROW(10) + 0.04471061572777259 * ROW(11)))
    EVALUATE(run, t + h, y, run->f);
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
    const real h = run->step;
    real *const K = run->K, *const F = run->F, *const z = F;
    EACH(AT(z) = AT(run->y_old) + h * (0.056167502283047954 * ROW(0) + 0.25350021021662483 * ROW(6) -
        0.2462390374708025 * ROW(7) - 0.12419142326381637 * ROW(8) + 0.15329179827876568 * ROW(9) +
        0.00820105229563469 * ROW(10) + 0.007567897660545699 * ROW(11) - 0.008298 * AT(run->f)))
    EVALUATE(run, run->t_old + 0.1 * h, z, K + 12 * n);
    EACH(AT(z) = AT(run->y_old) + h * (0.03183464816350214 * ROW(0) + 0.028300909672366776 * ROW(5) +
        0.053541988307438566 * ROW(6) - 0.05492374857139099 * ROW(7) - 0.00010834732869724932 * ROW(10) +
        0.0003825710908356584 * ROW(11) - 0.00034046500868740456 * AT(run->f) + 0.1413124436746325 * ROW(12)))
    EVALUATE(run, run->t_old + 0.2 * h, z, K + 13 * n);
    EACH(AT(z) = AT(run->y_old) + h * (-0.42889630158379194 * ROW(0) - 4.697621415361164 * ROW(5) + 7.683421196062599
        * ROW(6) + 4.06898981839711 * ROW(7) + 0.3567271874552811 * ROW(8) - 0.0013990241651590145 * AT(run->f) +
        2.9475147891527724 * ROW(12) - 9.15095847217987 * ROW(13)))
    EVALUATE(run, run->t_old + 0.7777777777777778 * h, z, K + 14 * n);
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
