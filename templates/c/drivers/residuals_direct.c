/* Residuals r1 = M a + h + C_q^T l, r2 = C_q a + gamma, r3 = C_q v + C_t along (dq, dv) in w + AT_X + 3 N + M, from
   their Jacobians, evaluated once. */
static void prepare_residuals(double t, const double *restrict u, const double *restrict c, double *restrict w)
{
    (void)residual_jacobian_block(t, w + AT_X, u, c, w + AT_RESIDUAL, w);
}

static void multiply_add(int rows, const double *restrict a, const double *restrict x, double *restrict y)
{
    for (int i = 0; i < rows; i++) {
        for (int k = 0; k < N; k++) {
            y[i] += a[i * N + k] * x[k];
        }
    }
}

EOMGEN_SHARED void rate_along(double t, const double *restrict u, const double *restrict c, double *restrict w)
{
    const double *const dq = w + AT_X + 3 * N + M;
    double *const r3 = w + AT_ALONG + N + M;
    (void)t, (void)u, (void)c;
    for (int i = 0; i < M; i++) {
        r3[i] = 0.0;
    }
    multiply_add(M, w + AT_RESIDUAL + 2 * N * N + 2 * M * N, dq, r3);
}

static void residuals_along(double t, const double *restrict u, const double *restrict c, double *restrict w)
{
    const double *const dq = w + AT_X + 3 * N + M, *const dv = dq + N, *const r1_q = w + AT_RESIDUAL;
    double *const r1 = w + AT_ALONG, *const r2 = r1 + N;
    (void)t, (void)u, (void)c;
    for (int i = 0; i < N + M; i++) {
        r1[i] = 0.0;
    }
    multiply_add(N, r1_q, dq, r1);
    multiply_add(N, r1_q + N * N, dv, r1);
    multiply_add(M, r1_q + 2 * N * N, dq, r2);
    multiply_add(M, r1_q + 2 * N * N + M * N, dv, r2);
}
