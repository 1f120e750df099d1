/* RK45: J. Dormand, P. Prince, A family of embedded Runge-Kutta formulae, 1980; dense output of order 4 by L. Shampine,
   Some practical Runge-Kutta formulas, 1986; as SciPy has them. */
static void rk45_attempt(RUN *run, real h)
{
    const int n = run->n;
    const real t = run->t;
    const real *restrict y0 = run->y_old;
    real *restrict y = run->y;
    real *const K = run->K;
    const real *restrict const k0 = K;
    real *const k1 = K + n;
    real *const k2 = K + 2 * n;
    real *const k3 = K + 3 * n;
    real *const k4 = K + 4 * n;
    real *const k5 = K + 5 * n;
    real *const k6 = K + 6 * n;
    for (int i = 0; i < n; i++) {
        y[i] = y0[i] + h * (0.2 * k0[i]);
    }
    EVALUATE(run, t + 0.2 * h, y, k1);
    for (int i = 0; i < n; i++) {
        y[i] = y0[i] + h * (0.075 * k0[i] + 0.225 * k1[i]);
    }
    EVALUATE(run, t + 0.3 * h, y, k2);
    for (int i = 0; i < n; i++) {
        y[i] = y0[i] + h * (0.9777777777777777 * k0[i] - 3.7333333333333334 * k1[i] + 3.5555555555555554 * k2[i]);
    }
    EVALUATE(run, t + 0.8 * h, y, k3);
    for (int i = 0; i < n; i++) {
        y[i] = y0[i] + h * (2.9525986892242035 * k0[i] - 11.595793324188385 * k1[i] + 9.822892851699436 * k2[i] -
            0.2908093278463649 * k3[i]);
    }
    EVALUATE(run, t + 0.8888888888888888 * h, y, k4);
    for (int i = 0; i < n; i++) {
        y[i] = y0[i] + h * (2.8462752525252526 * k0[i] - 10.757575757575758 * k1[i] + 8.906422717743473 * k2[i] +
            0.2784090909090909 * k3[i] - 0.2735313036020583 * k4[i]);
    }
    EVALUATE(run, t + 1.0 * h, y, k5);
    for (int i = 0; i < n; i++) {
        y[i] = y0[i] + h * (0.09114583333333333 * k0[i] + 0.44923629829290207 * k2[i] + 0.6510416666666666 * k3[i]
            - 0.322376179245283 * k4[i] + 0.13095238095238096 * k5[i]);
    }
    EVALUATE(run, t + h, y, k6);
    for (int i = 0; i < n; i++) {
        run->f[i] = k6[i];
    }
}

static real rk45_error(const RUN *run, real h)
{
    const int n = run->n;
    real sum = same(0.0);
    for (int i = 0; i < n; i++) {
        const real *const k = run->K + i;
        const real size = larger_of(abs_of(run->y_old[i]), abs_of(run->y[i]));
        const real part = h * (-0.0012326388888888888 * k[0] + 0.0042527702905061394 * k[2 * n] -
            0.03697916666666667 * k[3 * n] + 0.05086379716981132 * k[4 * n] - 0.0419047619047619 * k[5 * n] + 0.025
            * k[6 * n]) / (run->atol[i] + size * run->rtol);
        sum += part * part;
    }
    return root(sum / (double)n);
}

static void rk45_prepare(RUN *run)
{
    const int n = run->n;
    for (int i = 0; i < n; i++) {
        const real *const k = run->K + i;
        run->F[i] = 1.0 * k[0];
        run->F[n + i] = -2.8535800653862835 * k[0] + 4.023133379230305 * k[2 * n] - 3.7324019615885042 * k[3 * n] +
            2.5548038301849423 * k[4 * n] - 1.3744241142186024 * k[5 * n] + 1.3824689317781436 * k[6 * n];
        run->F[2 * n + i] = 3.0717434641059005 * k[0] - 6.249321565289 * k[2 * n] + 10.068970589843675 * k[3 * n] -
            6.399112377351017 * k[4 * n] + 3.272657752246729 * k[5 * n] - 3.764937863556287 * k[6 * n];
        run->F[3 * n + i] = -1.1270175653862835 * k[0] + 2.675424484351598 * k[2 * n] - 5.685526961588504 * k[3 *
            n] + 3.5219323679207912 * k[4 * n] - 1.7672812570757455 * k[5 * n] + 2.382468931778144 * k[6 * n];
    }
}

static void rk45_interpolate(const RUN *run, real t, real *y)
{
    const int n = run->n;
    const real x = (t - run->t_old) / run->step;
    for (int i = 0; i < n; i++) {
        const real *const F = run->F + i;
        y[i] = run->y_old[i] + run->step * x * (F[0] + x * (F[n] + x * (F[2 * n] + x * F[3 * n])));
    }
}

METHOD(rk45, "RK45", 7, 4, 4)
