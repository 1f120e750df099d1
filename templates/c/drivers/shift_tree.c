#define SHIFT_BLOCK(what) what##_shift_block
typedef int block_function(double, const double *restrict, const double *restrict, const double *restrict,
                           double *restrict, double *restrict);

/* dx' for the unit change of each of the inputs or parameters; block: M a + h along such changes. */
static int shift_driver(block_function *block, int columns, double t, const double *restrict x,
                        const double *restrict u, const double *restrict c, double *restrict out, double *restrict w)
{
    double *const seeds = w + AT_DQ, *const r1 = w + AT_SHIFT;
    const int status = tree_accelerate(t, x, u, c, w);
    if (status != 0) {
        return status;
    }
    for (int column = 0; column < columns; column++) {
        for (int k = 0; k < columns; k++) {
            seeds[k] = k == column ? 1.0 : 0.0;
        }
        (void)block(t, w + AT_X, u, c, r1, w);
        tree_solve(N, w + AT_TERMS, r1);
        for (int k = 0; k < NQ; k++) {
            out[k * columns + column] = 0.0;
        }
        for (int k = 0; k < N; k++) {
            out[(NQ + k) * columns + column] = -r1[k];
        }
    }
    return 0;
}
