/* RK45: J. Dormand, P. Prince, A family of embedded Runge-Kutta formulae, 1980; dense output of order 4 by L. Shampine,
   Some practical Runge-Kutta formulas, 1986; as SciPy has them. */
static void rk45_attempt(RUN *run, real h)
{
    const int n = run->n;
    const real t = run->t;
    real *const K = run->K, *const y = run->y;
    const real *const y0 = run->y_old;
    EACH(AT(y) = AT(y0) + h * (0.2 * ROW(0)))
    EVALUATE(run, t + 0.2 * h, y, K + n);
    EACH(AT(y) = AT(y0) + h * (0.075 * ROW(0) + 0.225 * ROW(1)))
    EVALUATE(run, t + 0.3 * h, y, K + 2 * n);
    EACH(AT(y) = AT(y0) + h * (0.9777777777777777 * ROW(0) - 3.7333333333333334 * ROW(1) + 3.5555555555555554 *
        ROW(2)))
    EVALUATE(run, t + 0.8 * h, y, K + 3 * n);
    EACH(AT(y) = AT(y0) + h * (2.9525986892242035 * ROW(0) - 11.595793324188385 * ROW(1) + 9.822892851699436 * ROW(2)
        - 0.2908093278463649 * ROW(3)))
    EVALUATE(run, t + 0.8888888888888888 * h, y, K + 4 * n);
    EACH(AT(y) = AT(y0) + h * (2.8462752525252526 * ROW(0) - 10.757575757575758 * ROW(1) + 8.906422717743473 * ROW(2)
        + 0.2784090909090909 * ROW(3) - 0.2735313036020583 * ROW(4)))
    EVALUATE(run, t + 1.0 * h, y, K + 5 * n);
    EACH(AT(y) = AT(y0) + h * (0.09114583333333333 * ROW(0) + 0.44923629829290207 * ROW(2) + 0.6510416666666666 *
        ROW(3) - 0.322376179245283 * ROW(4) + 0.13095238095238096 * ROW(5)))
    EVALUATE(run, t + h, y, run->f);
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
