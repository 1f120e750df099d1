#include "pendulum.h"

#include <math.h>
#include <stddef.h>

#define KERNEL(name)                                                                                                   \
    static int pendulum_##name(double t, const double *restrict x, const double *restrict u, const double *restrict c, \
                               double *restrict out, double *restrict w)
#define UNUSED ((void)t, (void)x, (void)u, (void)c, (void)w)

int pendulum_precompute(const double *restrict p, double *restrict c)
{
    for (int i = 0; i < 3; i++) {
        c[i] = p[i];
        if (!isfinite(p[i])) return 1;
    }
    c[3] = p[0] * p[1] * p[1];
    c[4] = p[0] * p[1] * p[2];
    return 0;
}

KERNEL(rhs)
{
    UNUSED;
    if (!out) return 0;
    out[0] = x[1];
    out[1] = (u[0] - c[4] * sin(x[0])) / c[3];
    return 0;
}

KERNEL(rhs_long) /* the same, through work it fills: shows up shared work arrays */
{
    if (!out) return 0;
    for (int i = 0; i < PENDULUM_N_WORK; i++) w[i] = x[0];
    double sum = 0;
    for (int i = 0; i < PENDULUM_N_WORK; i++) sum += w[i] - x[0];
    pendulum_rhs(t, x, u, c, out, w);
    out[0] += sum;
    return 0;
}

KERNEL(mass_matrix)
{
    UNUSED;
    if (!out) return 0;
    out[0] = c[3];
    return 0;
}

KERNEL(energy)
{
    UNUSED;
    if (!out) return 0;
    out[0] = 0.5 * c[3] * x[1] * x[1];
    out[1] = -c[4] * cos(x[0]);
    return 0;
}

KERNEL(inverse_dynamics)
{
    UNUSED;
    if (!out) return 0;
    out[0] = c[3] * x[2] + c[4] * sin(x[0]) - u[0] + 0 * x[1];
    return 0;
}

KERNEL(layout) /* (3, 2) numbers that tell time and place: 10 i + j + 100 t + 1000 x0 */
{
    UNUSED;
    if (!out) return 0;
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 2; j++) out[2 * i + j] = 10 * i + j + 100 * t + 1000 * x[0];
    return 0;
}

KERNEL(failing) /* status -1 for x0 > 100, 2 for x0 > 1 */
{
    UNUSED;
    if (!out) return 0;
    out[0] = x[0];
    out[1] = x[1];
    return x[0] > 100 ? -1 : x[0] > 1 ? 2 : 0;
}

KERNEL(empty)
{
    UNUSED;
    (void)out;
    return 0;
}

static const eomgen_kernel kernels[] = {
    {"rhs", pendulum_rhs, 2, 2},         {"rhs_long", pendulum_rhs_long, 2, 2},
    {"mass_matrix", pendulum_mass_matrix, 1, 1}, {"energy", pendulum_energy, 2, 2},
    {"inverse_dynamics", pendulum_inverse_dynamics, 3, 1}, {"layout", pendulum_layout, 2, 6},
    {"failing", pendulum_failing, 2, 2}, {"empty", pendulum_empty, 0, 0},
};

static const char *const metadata[] = {
    "{\"abi\": 1, \"name\": \"pendulum\", \"n_q\": 1, \"n_v\": 1, \"p_values\": [2.0, 0.5, 9.81], \"u_values\": [0.0],",
    " \"p_names\": [\"m\", \"l\", \"g\"], \"u_names\": [\"tau\"],"
    " \"operations\": {\"rhs\": {\"multiplications\": 1}, \"rhs_long\": {\"multiplications\": 1000000}}}", NULL,
};

static const eomgen_model model = {
    4, "pendulum", 3, 1, 5, PENDULUM_N_WORK, (int)(sizeof kernels / sizeof kernels[0]), kernels, pendulum_precompute, metadata,
    NULL, 0, NULL,
};

const eomgen_model *eomgen_model_table(void)
{
    return &model;
}
