/* Directional derivatives of the derivatives of states and of outputs, by states, inputs and parameters. */
#include <math.h>
#include <string.h>

#include "eomgen_fmu.h"

/* Sums of the columns of a row-major matrix, each times its part of the direction. */
static void add(const double *matrix, int rows, int columns, const double *direction, double *sum)
{
    for (int i = 0; i < rows; i++) {
        for (int k = 0; k < columns; k++) {
            sum[i] += matrix[i * columns + k] * direction[k];
        }
    }
}

static int any(const double *direction, int n)
{
    int found = 0;
    for (int i = 0; i < n; i++) {
        found = found || direction[i] != 0.0;
    }
    return found;
}

/* d(x') along a direction of x, u and p. */
static int of_rates(fmu_instance *f, const double *dx, const double *du, const double *dp, double *sum)
{
    fmu_memory *const m = &f->m;
    int status = 0;
    memset(sum, 0, FMU_N_X * sizeof(double));
    if (any(dx, FMU_N_X)) {
        status = FMU_MODEL(jacobian)(m->t, m->x, m->u, m->c, f->matrix, f->w);
        add(f->matrix, FMU_N_X, FMU_N_X, dx, sum);
    }
#if FMU_N_U
    if (status == 0 && any(du, FMU_N_U)) {
        status = FMU_MODEL(input_jacobian)(m->t, m->x, m->u, m->c, f->matrix, f->w);
        add(f->matrix, FMU_N_X, FMU_N_U, du, sum);
    }
#else
    (void)du;
#endif
#if FMU_N_P
    if (status == 0 && any(dp, FMU_N_P)) {
        status = FMU_MODEL(parameter_jacobian)(m->t, m->x, m->u, m->c, f->matrix, f->w);
        add(f->matrix, FMU_N_X, FMU_N_P, dp, sum);
    }
#else
    (void)dp;
#endif
    return fmu_judge(f, status, "the directional derivatives");
}

#if FMU_HAS_PROJECT
/* Differences of order 6 at the places -3 .. 3 times their spacing, for the closing of loops, whose own derivative is no
   function of the model. */
static double weight_of(int k, double h)
{
    static const double weights[] = {3.0 / 4.0, -3.0 / 20.0, 1.0 / 60.0};
    return (k < 0 ? -weights[-k - 1] : weights[k - 1]) / h;
}

/* Their spacing along a direction; 0 if it is none. */
static double spacing_along(const fmu_memory *m, const double *dx, const double *du, const double *dp)
{
    double size = 0.0;
    for (int i = 0; i < FMU_N_X; i++) {
        size = fmax(size, fabs(dx[i]) / fmax(FMU_NOMINAL[i], fabs(m->x[i])));
    }
    for (int i = 0; i < FMU_N_U; i++) {
        size = fmax(size, fabs(du[i]) / fmax(1.0, fabs(m->u[i])));
    }
    for (int i = 0; i < FMU_N_P; i++) {
        size = fmax(size, fabs(dp[i]) / fmax(fabs(FMU_START_P[i]), fabs(m->p[i]) > 0.0 ? fabs(m->p[i]) : 1.0));
    }
    return size > 0.0 ? 2e-3 / size : 0.0;
}

/* During initialization: dx of all states where those of the exact ones are given and the others follow. */
static int of_start(fmu_instance *f, double *dx, const double *du, const double *dp)
{
    fmu_memory *const m = &f->m;
    double sum[FMU_N_X + 1] = {0.0};
    int status = FMU_OK;
    for (int i = 0; i < FMU_N_X; i++) {
        dx[i] = FMU_INDEPENDENT[i] ? dx[i] : 0.0; /* the value of another is a guess only */
    }
    const double h = spacing_along(m, dx, du, dp);
    f->before = *m;
    for (int k = -3; k <= 3 && h > 0.0 && status == FMU_OK; k++) {
        if (k == 0) {
            continue;
        }
        for (int i = 0; i < FMU_N_X; i++) {
            m->x[i] += k * h * dx[i];
            m->guessed[i] = !FMU_INDEPENDENT[i];
        }
        for (int i = 0; i < FMU_N_U; i++) {
            m->u[i] += k * h * du[i];
        }
        for (int i = 0; i < FMU_N_P; i++) {
            m->p[i] += k * h * dp[i];
        }
        m->constants_known = 0;
        status = fmu_close(f);
        for (int i = 0; i < FMU_N_X; i++) {
            sum[i] += weight_of(k, h) * m->x[i];
        }
        *m = f->before;
    }
    for (int i = 0; i < FMU_N_X; i++) {
        dx[i] = FMU_INDEPENDENT[i] ? dx[i] : sum[i];
    }
    return status;
}
#endif

#if FMU_HAS_OUTPUTS && !FMU_HAS_PROJECT
/* dy by the chain rule: y is a function of q, v, the accelerations, u and p. */
static int of_outputs(fmu_instance *f, const double *dx, const double *du, const double *dp, const double *d_rates, double *sum)
{
    enum { WIDTH = FMU_N_X + FMU_N_V + FMU_N_U + FMU_N_P };
    fmu_memory *const m = &f->m;
    double *const at = f->trial, *const along = f->trial + FMU_N_X + FMU_N_V;
    int status = fmu_rates(f);
    memcpy(at, m->x, FMU_N_X * sizeof(double));
    memcpy(at + FMU_N_X, m->rates + FMU_N_Q, FMU_N_V * sizeof(double));
    memcpy(along, dx, FMU_N_X * sizeof(double));
    memcpy(along + FMU_N_X, d_rates + FMU_N_Q, FMU_N_V * sizeof(double));
    memcpy(along + FMU_N_X + FMU_N_V, du, FMU_N_U * sizeof(double));
    memcpy(along + FMU_N_X + FMU_N_V + FMU_N_U, dp, FMU_N_P * sizeof(double));
    memset(sum, 0, FMU_N_Y * sizeof(double));
    if (status == FMU_OK) {
        status = fmu_judge(f, FMU_MODEL(output_derivatives)(m->t, at, m->u, m->c, f->matrix, f->w), "the directional derivatives");
        add(f->matrix, FMU_N_Y, WIDTH, along, sum);
    }
    return status;
}
#elif FMU_HAS_OUTPUTS
/* dy by differences through the closing of loops. */
static int of_outputs(fmu_instance *f, const double *dx, const double *du, const double *dp, const double *d_rates, double *sum)
{
    fmu_memory *const m = &f->m;
    double *const x = f->trial, *const p = f->values + FMU_N_Y, *const u = p + FMU_N_P, *const y = f->values;
    const double h = spacing_along(m, dx, du, dp);
    (void)d_rates;
    memset(sum, 0, FMU_N_Y * sizeof(double));
    int status = 0;
    for (int k = -3; k <= 3 && h > 0.0 && status == 0; k++) {
        if (k == 0) {
            continue;
        }
        for (int i = 0; i < FMU_N_X; i++) {
            x[i] = m->x[i] + k * h * dx[i];
        }
        for (int i = 0; i < FMU_N_U; i++) {
            u[i] = m->u[i] + k * h * du[i];
        }
        for (int i = 0; i < FMU_N_P; i++) {
            p[i] = m->p[i] + k * h * dp[i];
        }
        status = FMU_MODEL(precompute)(p, f->matrix);
        status = status == 0 ? FMU_MODEL(outputs)(m->t, x, u, f->matrix, y, f->w) : status;
        for (int i = 0; i < FMU_N_Y; i++) {
            sum[i] += weight_of(k, h) * y[i];
        }
    }
    return fmu_judge(f, status, "the directional derivatives");
}
#endif

int fmu_directional(fmu_instance *f, const unsigned *unknowns, size_t n_unknowns, const unsigned *knowns, size_t n_knowns,
    const double *seed, double *result)
{
    double dx[FMU_N_X + 1] = {0.0}, du[FMU_N_U + 1] = {0.0}, dp[FMU_N_P + 1] = {0.0};
    double of_x[FMU_N_X + 1], of_y[FMU_N_Y + 1];
    const int starts = f->m.phase == FMU_INITIALIZING;
    int outputs = 0;
    for (size_t i = 0; i < n_knowns; i++) {
        const unsigned k = knowns[i];
        if (k >= FMU_AT_Y || (k >= FMU_AT_RATES && k < FMU_AT_U)) {
            return fmu_say(f, FMU_ERROR, "value reference %u is neither a state nor an input nor a parameter", k);
        }
        *(k < FMU_AT_RATES ? dx + k : k < FMU_AT_P ? du + (k - FMU_AT_U) : dp + (k - FMU_AT_P)) = seed[i];
    }
    for (size_t i = 0; i < n_unknowns; i++) {
        const unsigned k = unknowns[i];
        if ((k < FMU_AT_RATES && !starts) || (k >= FMU_AT_U && k < FMU_AT_Y) || k >= FMU_AT_TIME) {
            return fmu_say(f, FMU_ERROR, "value reference %u is neither a derivative of a state nor an output", k);
        }
        outputs = outputs || k >= FMU_AT_Y;
    }
    int status = fmu_ready(f);
    status = status == FMU_OK ? fmu_constants(f) : status;
#if FMU_HAS_PROJECT
    status = status == FMU_OK && starts ? of_start(f, dx, du, dp) : status;
#endif
    status = status == FMU_OK ? of_rates(f, dx, du, dp, of_x) : status;
#if FMU_HAS_OUTPUTS
    status = status == FMU_OK && outputs ? of_outputs(f, dx, du, dp, of_x, of_y) : status;
#else
    (void)outputs, of_y[0] = 0.0;
#endif
    for (size_t i = 0; i < n_unknowns && status == FMU_OK; i++) {
        const unsigned k = unknowns[i];
        result[i] = k < FMU_AT_RATES ? dx[k] : k < FMU_AT_U ? of_x[k - FMU_AT_RATES] : of_y[k - FMU_AT_Y];
    }
    return status;
}
