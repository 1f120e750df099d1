/* DOP853: order 8, error estimates of orders 5 and 3, dense output of order 7. E. Hairer, S. Norsett, G. Wanner, Solving
   Ordinary Differential Equations I, section II.10; coefficients of their DOP853, as SciPy has them. */
static void dop853_attempt(RUN *run, real h)
{
    const int n = run->n;
    const real t = run->t;
    const real *restrict y0 = run->y_old;
    real *restrict y = run->y;
    real *const K = run->K;
    const real *restrict const k0 = K;
    real *const k1 = K + 1 * n;
    real *const k2 = K + 2 * n;
    real *const k3 = K + 3 * n;
    real *const k4 = K + 4 * n;
    real *const k5 = K + 5 * n;
    real *const k6 = K + 6 * n;
    real *const k7 = K + 7 * n;
    real *const k8 = K + 8 * n;
    real *const k9 = K + 9 * n;
    real *const k10 = K + 10 * n;
    real *const k11 = K + 11 * n;
    real *const k12 = K + 12 * n;
    for (int i = 0; i < n; i++) {
        y[i] = y0[i] + h * (0.05260015195876773 * k0[i]);
    }
    EVALUATE(run, t + 0.05260015195876773 * h, y, k1);
    for (int i = 0; i < n; i++) {
        y[i] = y0[i] + h * (0.0197250569845379 * k0[i] + 0.0591751709536137 * k1[i]);
    }
    EVALUATE(run, t + 0.0789002279381516 * h, y, k2);
    for (int i = 0; i < n; i++) {
        y[i] = y0[i] + h * (0.02958758547680685 * k0[i] + 0.08876275643042054 * k2[i]);
    }
    EVALUATE(run, t + 0.1183503419072274 * h, y, k3);
    for (int i = 0; i < n; i++) {
        y[i] = y0[i] + h * (0.2413651341592667 * k0[i] - 0.8845494793282861 * k2[i] + 0.924834003261792 * k3[i]);
    }
    EVALUATE(run, t + 0.2816496580927726 * h, y, k4);
    for (int i = 0; i < n; i++) {
        y[i] = y0[i] + h * (0.037037037037037035 * k0[i] + 0.17082860872947386 * k3[i] + 0.12546768756682242 *
            k4[i]);
    }
    EVALUATE(run, t + 0.3333333333333333 * h, y, k5);
    for (int i = 0; i < n; i++) {
        y[i] = y0[i] + h * (0.037109375 * k0[i] + 0.17025221101954405 * k3[i] + 0.06021653898045596 * k4[i] -
            0.017578125 * k5[i]);
    }
    EVALUATE(run, t + 0.25 * h, y, k6);
    for (int i = 0; i < n; i++) {
        y[i] = y0[i] + h * (0.03709200011850479 * k0[i] + 0.17038392571223998 * k3[i] + 0.10726203044637328 * k4[i]
            - 0.015319437748624402 * k5[i] + 0.008273789163814023 * k6[i]);
    }
    EVALUATE(run, t + 0.3076923076923077 * h, y, k7);
    for (int i = 0; i < n; i++) {
        y[i] = y0[i] + h * (0.6241109587160757 * k0[i] - 3.3608926294469414 * k3[i] - 0.868219346841726 * k4[i] +
            27.59209969944671 * k5[i] + 20.154067550477894 * k6[i] - 43.48988418106996 * k7[i]);
    }
    EVALUATE(run, t + 0.6512820512820513 * h, y, k8);
    for (int i = 0; i < n; i++) {
        y[i] = y0[i] + h * (0.47766253643826434 * k0[i] - 2.4881146199716677 * k3[i] - 0.590290826836843 * k4[i] +
            21.230051448181193 * k5[i] + 15.279233632882423 * k6[i] - 33.28821096898486 * k7[i] -
            0.020331201708508627 * k8[i]);
    }
    EVALUATE(run, t + 0.6 * h, y, k9);
    for (int i = 0; i < n; i++) {
        y[i] = y0[i] + h * (-0.9371424300859873 * k0[i] + 5.186372428844064 * k3[i] + 1.0914373489967295 * k4[i] -
            8.149787010746927 * k5[i] - 18.52006565999696 * k6[i] + 22.739487099350505 * k7[i] + 2.4936055526796523
            * k8[i] - 3.0467644718982196 * k9[i]);
    }
    EVALUATE(run, t + 0.8571428571428571 * h, y, k10);
    for (int i = 0; i < n; i++) {
        y[i] = y0[i] + h * (2.273310147516538 * k0[i] - 10.53449546673725 * k3[i] - 2.0008720582248625 * k4[i] -
            17.9589318631188 * k5[i] + 27.94888452941996 * k6[i] - 2.8589982771350235 * k7[i] - 8.87285693353063 *
            k8[i] + 12.360567175794303 * k9[i] + 0.6433927460157636 * k10[i]);
    }
    EVALUATE(run, t + 1.0 * h, y, k11);
    for (int i = 0; i < n; i++) {
        y[i] = y0[i] + h * (0.054293734116568765 * k0[i] + 4.450312892752409 * k5[i] + 1.8915178993145003 * k6[i] -
            5.801203960010585 * k7[i] + 0.3111643669578199 * k8[i] - 0.1521609496625161 * k9[i] +
            0.20136540080403034 * k10[i] + 0.04471061572777259 * k11[i]);
    }
    EVALUATE(run, t + h, y, k12);
    for (int i = 0; i < n; i++) {
        run->f[i] = k12[i];
    }
}
/* The two estimates combined: |h| e5 / sqrt(e5 + 0.01 e3), root mean square over the states. */
static real dop853_error(const RUN *run, real h)
{
    const int n = run->n;
    const real *const K = run->K;
    real e5 = same(0.0), e3 = same(0.0);
    for (int i = 0; i < n; i++) {
        const real *const k = K + i;
        const real size = larger_of(abs_of(run->y_old[i]), abs_of(run->y[i]));
        const real scale = run->atol[i] + size * run->rtol;
        const real five = (0.01312004499419488 * k[0] - 1.2251564463762044 * k[5 * n] - 0.4957589496572502 * k[6
            * n] + 1.6643771824549864 * k[7 * n] - 0.35032884874997366 * k[8 * n] + 0.3341791187130175 * k[9 * n] +
            0.08192320648511571 * k[10 * n] - 0.022355307863886294 * k[11 * n]) / scale;
        const real three = (-0.18980075407240762 * k[0] + 4.450312892752409 * k[5 * n] + 1.8915178993145003 * k[6
            * n] - 5.801203960010585 * k[7 * n] - 0.4226823213237919 * k[8 * n] - 0.1521609496625161 * k[9 * n] +
            0.20136540080403034 * k[10 * n] + 0.02265179219836082 * k[11 * n]) / scale;
        e5 += five * five, e3 += three * three;
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
    for (int i = 0; i < n; i++) {
        const real *const k = K + i;
        z[i] = run->y_old[i] + h * (0.056167502283047954 * k[0] + 0.25350021021662483 * k[6 * n] -
            0.2462390374708025 * k[7 * n] - 0.12419142326381637 * k[8 * n] + 0.15329179827876568 * k[9 * n] +
            0.00820105229563469 * k[10 * n] + 0.007567897660545699 * k[11 * n] - 0.008298 * k[12 * n]);
    }
    EVALUATE(run, run->t_old + 0.1 * h, z, K + 13 * n);
    for (int i = 0; i < n; i++) {
        const real *const k = K + i;
        z[i] = run->y_old[i] + h * (0.03183464816350214 * k[0] + 0.028300909672366776 * k[5 * n] +
            0.053541988307438566 * k[6 * n] - 0.05492374857139099 * k[7 * n] - 0.00010834732869724932 * k[10 * n] +
            0.0003825710908356584 * k[11 * n] - 0.00034046500868740456 * k[12 * n] + 0.1413124436746325 * k[13 *
            n]);
    }
    EVALUATE(run, run->t_old + 0.2 * h, z, K + 14 * n);
    for (int i = 0; i < n; i++) {
        const real *const k = K + i;
        z[i] = run->y_old[i] + h * (-0.42889630158379194 * k[0] - 4.697621415361164 * k[5 * n] + 7.683421196062599
            * k[6 * n] + 4.06898981839711 * k[7 * n] + 0.3567271874552811 * k[8 * n] - 0.0013990241651590145 * k[12
            * n] + 2.9475147891527724 * k[13 * n] - 9.15095847217987 * k[14 * n]);
    }
    EVALUATE(run, run->t_old + 0.7777777777777778 * h, z, K + 15 * n);
    for (int i = 0; i < n; i++) {
        const real *const k = K + i;
        const real change = run->y[i] - run->y_old[i];
        F[i] = change;
        F[n + i] = h * k[0] - change;
        F[2 * n + i] = 2.0 * change - h * (run->f[i] + k[0]);
        F[3 * n + i] = h * (-8.428938276109013 * k[0] + 0.5667149535193777 * k[5 * n] - 3.0689499459498917 * k[6 *
            n] + 2.38466765651207 * k[7 * n] + 2.117034582445028 * k[8 * n] - 0.871391583777973 * k[9 * n] +
            2.2404374302607883 * k[10 * n] + 0.6315787787694688 * k[11 * n] - 0.08899033645133331 * k[12 * n] +
            18.148505520854727 * k[13 * n] - 9.194632392478356 * k[14 * n] - 4.436036387594894 * k[15 * n]);
        F[4 * n + i] = h * (10.427508642579134 * k[0] + 242.28349177525817 * k[5 * n] + 165.20045171727028 * k[6 *
            n] - 374.5467547226902 * k[7 * n] - 22.113666853125306 * k[8 * n] + 7.733432668472264 * k[9 * n] -
            30.674084731089398 * k[10 * n] - 9.332130526430229 * k[11 * n] + 15.697238121770845 * k[12 * n] -
            31.139403219565178 * k[13 * n] - 9.35292435884448 * k[14 * n] + 35.81684148639408 * k[15 * n]);
        F[5 * n + i] = h * (19.985053242002433 * k[0] - 387.0373087493518 * k[5 * n] - 189.17813819516758 * k[6 *
            n] + 527.8081592054236 * k[7 * n] - 11.57390253995963 * k[8 * n] + 6.8812326946963 * k[9 * n] -
            1.0006050966910838 * k[10 * n] + 0.7777137798053443 * k[11 * n] - 2.778205752353508 * k[12 * n] -
            60.19669523126412 * k[13 * n] + 84.32040550667716 * k[14 * n] + 11.99229113618279 * k[15 * n]);
        F[6 * n + i] = h * (-25.69393346270375 * k[0] - 154.18974869023643 * k[5 * n] - 231.5293791760455 * k[6 *
            n] + 357.6391179106141 * k[7 * n] + 93.40532418362432 * k[8 * n] - 37.45832313645163 * k[9 * n] +
            104.0996495089623 * k[10 * n] + 29.8402934266605 * k[11 * n] - 43.53345659001114 * k[12 * n] +
            96.32455395918828 * k[13 * n] - 39.17726167561544 * k[14 * n] - 149.72683625798564 * k[15 * n]);
    }
}

static void dop853_interpolate(const RUN *run, real t, real *y)
{
    const int n = run->n;
    const real x = (t - run->t_old) / run->step, rest = 1.0 - x;
    for (int i = 0; i < n; i++) {
        const real *const F = run->F + i;
        real sum = F[6 * n] * x;
        sum = (sum + F[5 * n]) * rest;
        sum = (sum + F[4 * n]) * x;
        sum = (sum + F[3 * n]) * rest;
        sum = (sum + F[2 * n]) * x;
        sum = (sum + F[n]) * rest;
        sum = (sum + F[0]) * x;
        y[i] = sum + run->y_old[i];
    }
}

METHOD(dop853, "DOP853", 16, 7, 7)
