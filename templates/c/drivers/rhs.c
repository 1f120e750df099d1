static int rhs_driver(double t, const double *restrict x, const double *restrict u, const double *restrict c,
                     double *restrict out, double *restrict w)
{
    partition parts;
    int status = close_loops(t, x, u, c, w);
    if (status == 0) {
        status = accelerate(t, u, c, N + 1, &parts, out + N, w);
    }
    for (int k = 0; k < N; k++) {
        out[k] = w[AT_X + N + k];
    }
    return status;
}
