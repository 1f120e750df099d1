/* The noise of each row: EXACT times a power, 1 or 2, of the largest scaled velocity that it knows, and of r if given. */
static void find_noise(const double *restrict v, const double *restrict r, int order, double *restrict noise)
{
    for (int i = 0; i < M; i++) {
        double fastest = r == NULL ? 0.0 : fabs(r[i]);
        for (int k = ROW_START[i]; k < ROW_START[i + 1]; k++) {
            fastest = fmax(fastest, fabs(v[ROW_VELOCITY[k]]));
        }
        noise[i] = CONSTRAINTS_EXACT * (order == 2 ? fastest * fastest : fastest);
    }
}

/* The root mean square of the noise of rows over a combination z of them. */
static double noise_along(int rows, const double *restrict z, const double *restrict noise)
{
    double total = 0.0, squares = 0.0;
    for (int i = 0; i < rows; i++) {
        squares += z[i] * z[i];
        total += z[i] * z[i] * (noise[i] / CONSTRAINTS_EXACT) * (noise[i] / CONSTRAINTS_EXACT);
    }
    return squares > 0.0 ? CONSTRAINTS_EXACT * sqrt(total / squares) : HUGE_VAL;
}

/* The nearest x with J x + r = 0, in the first rows of J, by passes x -= J^T G^-1 (J x + r). Where weak rows keep
   something, the term in G is lowered below them, unless it is rounding: noise / s^order along a singular value s, with
   noise = EXACT V^order of the velocities V that a row knows (eomgen/numeric/gram.py says why). Leaves G as it was, with
   the term CONSTRAINTS_GENTLE. */
static int correct_linear(int rows, double *restrict G, const double *restrict r, double *restrict x,
                          const double *restrict noise, int order, double *restrict w)
{
    const double *const J = w + AT_J;
    double *const e = w + AT_E, *const z = e + M, relative = CONSTRAINTS_GENTLE, before = HUGE_VAL;
    int status = 0;
    for (int pass = 0; pass < 50 && status == 0; pass++) {
        double longest = 0.0, square = 0.0, size;
        int left = 0;
        for (int i = 0; i < rows; i++) {
            double total = fabs(r[i]);
            e[i] = r[i];
            for (int k = 0; k < N; k++) {
                const double term = J[i * N + k] * x[k];
                e[i] += term;
                total += fabs(term);
            }
            left = left || fabs(e[i]) > ROUNDING_SUMMED * total;
            longest = fmax(longest, fabs(e[i]));
            square += e[i] * e[i];
            z[i] = e[i];
        }
        if (!left) {
            break;
        }
        cholesky_solve(rows, G, z);
        if (longest > CONSTRAINTS_FAST * before) {
            const double weak = weakness(rows, J, z, &size);
            if (!(sqrt(square) * (order == 2 ? weak : sqrt(weak)) > noise_along(rows, z, noise) * sqrt(size))) {
                break;
            }
            if (relative > CONSTRAINTS_TIKHONOV) {
                relative = fmax(CONSTRAINTS_TIKHONOV, fmin(0.1 * relative, CONSTRAINTS_BELOW * weak));
                status = factor_gram(rows, J, relative, G);
                for (int i = 0; i < rows; i++) {
                    z[i] = e[i];
                }
                cholesky_solve(rows, G, z);
            } else if (longest > 0.5 * before) {
                break;
            }
        }
        for (int i = 0; i < rows; i++) {
            for (int k = 0; k < N; k++) {
                x[k] -= J[i * N + k] * z[i];
            }
        }
        before = longest;
    }
    if (relative < CONSTRAINTS_GENTLE && status == 0) {
        status = factor_gram(rows, J, CONSTRAINTS_GENTLE, G);
    }
    return status;
}
