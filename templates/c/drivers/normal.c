/* Steps along dC/dq of the holonomic rows, where q' is given: for what no velocity changes, as the length of Euler
   parameters of which e^T e - 1 stands as a constraint. */
#define NORMAL_STEPS

/* dC/dq at q, scaled as residuals, and the factor of its products. */
static int form_normal(double t, const double *restrict q, const double *restrict u, const double *restrict c, double *w)
{
    double *const rows = w + AT_GRADIENT, *const G = w + AT_NORMAL;
    double largest = 0.0;
    (void)coordinate_slopes_block(t, q, u, c, rows, w);
    for (int i = 0; i < MH; i++) {
        for (int k = 0; k < NQ; k++) {
            rows[i * NQ + k] /= w[AT_SCALES + N + i];
        }
        for (int j = 0; j <= i; j++) {
            G[i * M + j] = 0.0;
            for (int k = 0; k < NQ; k++) {
                G[i * M + j] += rows[i * NQ + k] * rows[j * NQ + k];
            }
        }
        largest = fmax(largest, G[i * M + i]);
    }
    for (int i = 0; i < MH; i++) {
        G[i * M + i] += largest > CONSTRAINTS_UNMOVED * CONSTRAINTS_UNMOVED ? CONSTRAINTS_TIKHONOV * largest : 1.0;
    }
    return cholesky(MH, G);
}

/* change -= the least one of q that changes the scaled residual by r + J d, which the best velocities d leave of r. The
   d of correct_change ends where something is left, of the size of its term. */
static void add_left(const double *restrict G, const double *restrict r, double *restrict d, double *restrict change,
                     double *restrict w)
{
    const double *const J = w + AT_J;
    double *const e = w + AT_E;
    for (int pass = 0; pass < 3; pass++) {
        for (int i = 0; i < MH; i++) {
            e[i] = r[i];
            for (int k = 0; k < N; k++) {
                e[i] += J[i * N + k] * d[k];
            }
        }
        cholesky_solve(MH, pass < 2 ? G : w + AT_NORMAL, e);
        for (int i = 0; i < MH; i++) {
            for (int k = 0; k < N && pass < 2; k++) {
                d[k] -= J[i * N + k] * e[i];
            }
            for (int k = 0; k < NQ && pass == 2; k++) {
                change[k] -= w[AT_GRADIENT + i * NQ + k] * e[i];
            }
        }
    }
}

/* Moves q towards the constraints by what no velocity changes, at C and J in w. */
static int mend(double t, double *restrict q, const double *restrict u, const double *restrict c, double *restrict w)
{
    double *const change = w + AT_MENDED;
    double r[M + 1], d[N] = {0.0};
    (void)memset(change, 0, NQ * sizeof *change);
    for (int i = 0; i < MH; i++) {
        r[i] = -w[AT_POSITION + i] / w[AT_SCALES + N + i];
    }
    int status = factor_gram(MH, w + AT_J, CONSTRAINTS_GENTLE, w + AT_G);
    status = status == 0 ? correct_change(MH, w + AT_G, r, d, w) : status;
    status = status == 0 ? form_normal(t, q, u, c, w) : status;
    if (status == 0) {
        add_left(w + AT_G, r, d, change, w);
        const double part = damping(change, NQ);
        for (int k = 0; k < NQ; k++) {
            q[k] -= part * change[k];
        }
    }
    return status;
}
