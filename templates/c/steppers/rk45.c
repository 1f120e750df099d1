/* RK45: J. Dormand, P. Prince, A family of embedded Runge-Kutta formulae, 1980; dense output of order 4 by L. Shampine,
   Some practical Runge-Kutta formulas, 1986; as SciPy has them. */
ATTEMPT(rk45)
{
    STAGE(1, 0.2, 0.2 * k(0))
    STAGE(2, 0.3, 0.075 * k(0) + 0.225 * k(1))
    STAGE(3, 0.8, 0.9777777777777777 * k(0) - 3.7333333333333334 * k(1) + 3.5555555555555554 * k(2))
    STAGE(4, 0.8888888888888888, 2.9525986892242035 * k(0) - 11.595793324188385 * k(1) + 9.822892851699436 * k(2) -
        0.2908093278463649 * k(3))
    STAGE(5, 1.0, 2.8462752525252526 * k(0) - 10.757575757575758 * k(1) + 8.906422717743473 * k(2) +
        0.2784090909090909 * k(3) - 0.2735313036020583 * k(4))
    STAGE(6, 1.0, 0.09114583333333333 * k(0) + 0.44923629829290207 * k(2) + 0.6510416666666666 * k(3) -
        0.322376179245283 * k(4) + 0.13095238095238096 * k(5))
    LAST_STAGE(6)
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
