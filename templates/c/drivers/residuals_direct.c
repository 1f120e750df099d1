/* Residuals r1 = M a + h + C_q^T l, r2 = C_q a + gamma, r3 = C_q v + C_t along (dq, dv) in w + AT_DQ, from
   their Jacobians, evaluated once. */
static void prepare_residuals(double t, const double *restrict u, const double *restrict c, double *restrict w)
{
    (void)residual_jacobian_block(t, w + AT_X, u, c, w + AT_RESIDUAL, w);
}

static void multiply_add(int rows, int columns, const double *restrict a, const double *restrict x, double *restrict y)
{
    for (int i = 0; i < rows; i++) {
        for (int k = 0; k < columns; k++) {
            y[i] += a[i * columns + k] * x[k];
        }
    }
}

EOMGEN_SHARED void rate_along(double t, const double *restrict u, const double *restrict c, double *restrict w)
{
    const double *const dq = w + AT_DQ;
    double *const r3 = w + AT_ALONG + N + M;
    (void)t, (void)u, (void)c;
    for (int i = 0; i < M; i++) {
        r3[i] = 0.0;
    }
    multiply_add(M, NQ, w + AT_RESIDUAL + (N + M) * (NQ + N), dq, r3);
}

static void residuals_along(double t, const double *restrict u, const double *restrict c, double *restrict w)
{
    const double *const dq = w + AT_DQ, *const dv = w + AT_DV, *const r1_q = w + AT_RESIDUAL, *const r2_q = r1_q + N * (NQ + N);
    double *const r1 = w + AT_ALONG, *const r2 = r1 + N;
    (void)t, (void)u, (void)c;
    for (int i = 0; i < N + M; i++) {
        r1[i] = 0.0;
    }
    multiply_add(N, NQ, r1_q, dq, r1);
    multiply_add(N, N, r1_q + N * NQ, dv, r1);
    multiply_add(M, NQ, r2_q, dq, r2);
    multiply_add(M, N, r2_q + M * NQ, dv, r2);
}
