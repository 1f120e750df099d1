"""Trajectories side by side in plain C against closed forms: forced oscillators, each with its own stiffness."""

from __future__ import annotations

import subprocess

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from eomgen.compilation.compiler import find_compiler
from eomgen.emit.sources import read_template
from eomgen.layer import read_layer

COUNT, SLOPE, LATE = 7, 0.6, 0.4
TIMES = np.linspace(0.0, 3.0, 13)
METHODS = {"dop853": 1e-8, "rk45": 1e-8, "rk23": 1e-6, "taylor": 1e-10}

#: x'' = -k x + u in two lanes and as a series.
LANES = r"""
#define EOMGEN_WIDTH 2
#include "eomgen_real.h"
flag swing_lanes(real t, const real *x, const real *u, const real *c, real *out, real *w);
flag swing_lanes(real t, const real *x, const real *u, const real *c, real *out, real *w)
{
    (void)t, (void)w;
    out[0] = x[1], out[1] = u[0] - c[0] * x[0];
    return (flag){ 0 };
}
flag swing_terms(real t, const real *x, const real *u, const real *c, int order, real *out, real *w);
flag swing_terms(real t, const real *x, const real *u, const real *c, int order, real *out, real *w)
{
    (void)t, (void)w;
    out[0] = x[0], out[1] = x[1];
    for (int m = 0; m < order; m++) {
        out[2 * m + 2] = out[2 * m + 1] / (m + 1.0);
        out[2 * m + 3] = ((m == 0 ? u[0] : same(0.0)) - c[0] * out[2 * m]) / (m + 1.0);
    }
    return (flag){ 0 };
}
"""
PROGRAM = r"""
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "eomgen_ensembles.h"

enum { N = 2, COUNT = 7, EVAL = 13 };
typedef long lanes_flag __attribute__((vector_size(16)));
extern lanes_flag swing_lanes(void), swing_terms(void);

static int swing(double t, const double *x, const double *u, const double *c, double *out, double *w)
{
    (void)t, (void)w;
    out[0] = x[1], out[1] = u[0] - c[0] * x[0];
    return 0;
}
static int keep(const double *p, double *c)
{
    c[0] = p[0];
    return 0;
}

int main(void)
{
    static const eomgen_series series = {23, 0, NULL};
    static const eomgen_model model = {
        .n_p = 1, .n_u = 1, .n_const = 1, .n_work = 2, .precompute = keep, .series = &series};
    const eomgen_method *const methods[4] = {&eomgen_dop853, &eomgen_rk45, &eomgen_rk23, &eomgen_taylor};
    const double rtol[4] = {1e-8, 1e-8, 1e-6, 1e-10}, atol[N] = {1e-9, 1e-9};
    double p[COUNT], x0[COUNT * N], u[COUNT], t_eval[EVAL], samples[COUNT * EVAL * N], x[COUNT * N], t[COUNT];
    double failure_time[COUNT];
    int status[COUNT], failure[COUNT];
    int64_t steps[COUNT], rejected[COUNT], evaluations[COUNT];
    const double times[3] = {0.0, 0.4, 10.0}, values[3] = {0.0, 0.0, 0.6 * 9.6};
    const eomgen_signal ramp = {3, 1, times, values, NULL};
    for (int k = 0; k < COUNT; k++) {
        p[k] = 2.0 + 5.0 * k, u[k] = 0.3 * k, x0[N * k] = 1.0 - 0.2 * k, x0[N * k + 1] = 0.5 * k;
    }
    for (int j = 0; j < EVAL; j++) {
        t_eval[j] = 3.0 * j / (EVAL - 1);
    }
    for (int run = 0; run < 7; run++) {
        const int i = run % 4, forced = run >= 4; /* the ramp in all but Taylor's method, from a corner at 0.4 */
        const double free_nodes[2] = {0.0, 3.0}, forced_nodes[3] = {0.0, 0.4, 3.0};
        eomgen_ensemble e = {.method = methods[i], .model = &model, .rhs = swing, .series = &series,
            .lane_rhs = (void (*)(void))swing_lanes, .lane_series = (void (*)(void))swing_terms, .lane_width = 2,
            .n = N, .count = COUNT, .x0 = x0, .p = p, .u = u, .p_stride = 1, .u_stride = 1,
            .nodes = forced ? forced_nodes : free_nodes, .n_nodes = forced ? 3 : 2, .rtol = rtol[i],
            .max_step = INFINITY, .atol = atol, .max_steps = 100000, .t_eval = t_eval, .n_eval = EVAL,
            .samples = samples, .x = x, .t = t,
            .status = status, .steps = steps, .rejected = rejected, .evaluations = evaluations, .failure = failure,
            .failure_time = failure_time};
        eomgen_thread own = {.signals = forced ? &ramp : NULL};
        own.memory = calloc((size_t)eomgen_ensemble_memory(&e, &own) + 8, sizeof(double));
        eomgen_ensemble_work(&e, &own);
        for (int k = 0; k < COUNT; k++) {
            printf("%d %d %ld", run, status[k], (long)steps[k]);
            for (int j = 0; j < EVAL * N; j++) {
                printf(" %.17g", samples[k * EVAL * N + j]);
            }
            printf("\n");
        }
        free(own.memory);
    }
    return 0;
}
"""


@pytest.fixture(scope="module")
def rows(tmp_path_factory: pytest.TempPathFactory) -> np.ndarray:
    """Of each run and trajectory: run, status, steps, the states at all times."""
    folder = tmp_path_factory.mktemp("ensembles")
    headers = ("eomgen.h", "eomgen_real.h", "eomgen_processor.h", "eomgen_contraction.h")
    texts = {**read_layer(), "program.c": PROGRAM, "lanes.c": LANES}
    texts |= {name: read_template(f"c/{name}") for name in headers}
    for name, one in texts.items():
        (folder / name).write_text(one, encoding="utf-8")
    flags = ["-std=c99", "-O1", "-ffp-contract=off", "-DEOMGEN_LANES=2"]
    files = ["eomgen_steppers.c", "eomgen_ensembles.c", "eomgen_runs2.c", "lanes.c", "program.c"]
    command = [*find_compiler(None).command, *flags, *files, "-o", "program", "-lm"]
    built = subprocess.run(command, cwd=folder, capture_output=True, text=True)
    assert built.returncode == 0, built.stderr
    done = subprocess.run([folder / "program"], capture_output=True, text=True, check=True, timeout=600)
    return np.array([[float(word) for word in line.split()] for line in done.stdout.splitlines()])


def swings(k: int, forced: bool) -> np.ndarray:
    """x and x' at all times: about u / k, or pushed by a ramp from a time on."""
    stiffness, x, v = 2.0 + 5.0 * k, 1.0 - 0.2 * k, 0.5 * k
    w, rest = np.sqrt(stiffness), 0.0 if forced else 0.3 * k / stiffness
    c, s = np.cos(w * TIMES), np.sin(w * TIMES)
    places, speeds = rest + (x - rest) * c + v / w * s, -(x - rest) * w * s + v * c
    if forced:
        late = np.maximum(TIMES - LATE, 0.0)
        places = places + SLOPE / stiffness * (late - np.sin(w * late) / w)
        speeds = speeds + SLOPE / stiffness * (1.0 - np.cos(w * late)) * (TIMES > LATE)
    return np.stack([places, speeds], axis=1)


@pytest.mark.parametrize("run", range(7), ids=[*METHODS, *(f"{name}, forced" for name in list(METHODS)[:3])])
def test_every_lane_has_its_own_closed_form(rows: np.ndarray, run: int) -> None:
    method = list(METHODS)[run % 4]
    found = rows[rows[:, 0] == run]
    assert len(found) == COUNT
    for k, row in enumerate(found):
        assert row[1] == 0.0
        np.testing.assert_allclose(row[3:].reshape(-1, 2), swings(k, run >= 4), atol=60 * METHODS[method])


@pytest.mark.parametrize("run", range(3), ids=list(METHODS)[:3])
def test_lanes_take_about_as_many_steps_as_scipy(rows: np.ndarray, run: int) -> None:
    """Theirs are a ninth shorter, so that fewer are rejected."""
    name = list(METHODS)[run]
    for k, row in enumerate(rows[rows[:, 0] == run]):
        judge = solve_ivp(
            lambda t, x, k=k: [x[1], 0.3 * k - (2.0 + 5.0 * k) * x[0]], (0.0, 3.0), [1.0 - 0.2 * k, 0.5 * k],
            name.upper(), rtol=METHODS[name], atol=1e-9,
        )  # fmt: skip
        steps = len(judge.t) - 1
        assert 0.95 * steps <= row[2] <= 1.2 * steps + 2


def test_taylors_steps_in_lanes_are_few(rows: np.ndarray) -> None:
    """Terms (w h)^p / p! of order 16 come down to 1e-10 at w h = 1.6, and h is a tenth shorter for safety."""
    for k, row in enumerate(rows[rows[:, 0] == 3]):
        assert row[2] <= 3.0 * np.sqrt(2.0 + 5.0 * k) / 1.2 + 1
