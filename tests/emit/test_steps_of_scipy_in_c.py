"""Steps of the methods in plain C beside SciPy's: every coefficient, the size of the next step, values between."""

from __future__ import annotations

import subprocess

import numpy as np
import pytest
from scipy.integrate import DOP853, RK23, RK45, Radau, solve_ivp

from eomgen.compilation.compiler import find_compiler
from eomgen.emit.sources import read_template
from eomgen.layer import read_layer

STEPS = 8
PROGRAM = r"""
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include "eomgen_steppers.h"

enum { N = 3, STEPS = 8 };

static int slope(double t, const double *x, const double *u, const double *c, double *out, double *w)
{
    (void)u, (void)c, (void)w;
    out[0] = sin(x[1]) + cos(t), out[1] = -0.3 * x[0] * x[2], out[2] = exp(-t) - x[2] * x[0] + x[1];
    return 0;
}
static int jacobian(double t, const double *x, const double *u, const double *c, double *out, double *w)
{
    (void)t, (void)u, (void)c, (void)w;
    const double rows[9] = {0.0, cos(x[1]), 0.0, -0.3 * x[2], 0.0, -0.3 * x[0], -x[2], 1.0, -x[0]};
    for (int k = 0; k < 9; k++) {
        out[k] = rows[k];
    }
    return 0;
}
static int series(double t, const double *x, const double *u, const double *c, int order, double *out, double *w)
{ /* x0' = x0^2, x1' = -x1, x2' = 1: x0^(m + 1), (-1)^m x1 / m!, 1 */
    (void)t, (void)u, (void)c, (void)w;
    double power = x[0], term = x[1];
    for (int m = 0; m <= order; m++) {
        out[m * N] = power, out[m * N + 1] = term, out[m * N + 2] = m == 0 ? x[2] : m == 1 ? 1.0 : 0.0;
        power *= x[0], term *= -1.0 / (m + 1);
    }
    return 0;
}

static int cube(double t, const double *x, const double *u, const double *c, int order, double *out, double *w)
{ /* x0' = x1, x1' = -x0^3, x2' = 0, by Cauchy products */
    (void)t, (void)u, (void)c, (void)w;
    double square[24];
    out[0] = x[0], out[1] = x[1];
    for (int m = 0; m <= order; m++) {
        double third = 0.0;
        square[m] = 0.0, out[m * N + 2] = m == 0 ? x[2] : 0.0;
        for (int k = 0; k <= m; k++) {
            square[m] += out[k * N] * out[(m - k) * N];
        }
        for (int k = 0; k <= m; k++) {
            third += square[k] * out[(m - k) * N];
        }
        if (m < order) {
            out[(m + 1) * N] = out[m * N + 1] / (m + 1), out[(m + 1) * N + 1] = -third / (m + 1);
        }
    }
    return 0;
}

static void travel(const eomgen_method *method, eomgen_series known, const double *start, double rtol, double end)
{
    double *const memory = calloc(4096, sizeof(double)), atol[N] = {1e-9, 2e-9, 3e-9}, x[N];
    eomgen_run run = {.rhs = slope, .jacobian = jacobian, .n = N, .rtol = rtol, .max_step = INFINITY, .t_bound = end,
        .direction = 1.0, .atol = atol, .until_callback = -1, .hold = NAN, .series = &known};
    double *place = memory, **const parts[] = {&run.y, &run.y_old, &run.f, &run.failure_state, &run.next, &run.K};
    for (int k = 0; k < 6; k++, place += N) {
        *parts[k] = place;
    }
    run.F = run.K + method->rows_K * N + eomgen_further(method, N, &known);
    for (int i = 0; i < N; i++) {
        run.y[i] = start[i];
    }
    eomgen_start(method, &run);
    for (int k = 0; k < STEPS && run.t < run.t_bound && eomgen_step(method, &run) == 0; k++) {
        printf("%.17g %.17g %.17g %.17g %.17g", run.t, run.y[0], run.y[1], run.y[2], run.h_abs);
        for (int j = 1; j < 5; j++) {
            eomgen_between(method, &run, run.t_old + 0.25 * j * run.step, x);
            printf(" %.17g %.17g %.17g", x[0], x[1], x[2]);
        }
        printf("\n");
    }
    printf("%ld\n", run.evaluations);
    free(memory);
}

int main(void)
{
    const eomgen_method *const methods[4] = {&eomgen_dop853, &eomgen_rk45, &eomgen_rk23, &eomgen_radau};
    const double start[N] = {0.5, 1.0, -0.3}, still[N] = {0.0, 1.0, 0.0};
    for (int i = 0; i < 4; i++) {
        travel(methods[i], (eomgen_series){23, 0, series}, start, 1e-6, 8.0);
    }
    travel(&eomgen_taylor, (eomgen_series){23, 0, series}, start, 1e-10, 1.5);
    travel(&eomgen_taylor, (eomgen_series){23, 0, cube}, still, 1e-6, 2.0);
    return 0;
}
"""


def slope(t: float, x: np.ndarray) -> np.ndarray:
    return np.array([np.sin(x[1]) + np.cos(t), -0.3 * x[0] * x[2], np.exp(-t) - x[2] * x[0] + x[1]])


def jacobian(t: float, x: np.ndarray) -> np.ndarray:
    return np.array([[0.0, np.cos(x[1]), 0.0], [-0.3 * x[2], 0.0, -0.3 * x[0]], [-x[2], 1.0, -x[0]]])


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> list[np.ndarray]:
    """Of each method: rows of time, state, size of the next step, and the state at four times in the step."""
    folder = tmp_path_factory.mktemp("steps")
    texts = {**read_layer(), "program.c": PROGRAM}
    texts |= {name: read_template(f"c/{name}") for name in ("eomgen.h", "eomgen_real.h")}
    for name, text in texts.items():
        (folder / name).write_text(text, encoding="utf-8")
    flags = ["-std=c99", "-O1", "-Wall", "-Wextra", "-Werror", "-ffp-contract=off"]
    command = [*find_compiler(None).command, *flags, "eomgen_steppers.c", "program.c", "-o", "program", "-lm"]
    built = subprocess.run(command, cwd=folder, capture_output=True, text=True)
    assert built.returncode == 0, built.stderr
    done = subprocess.run([folder / "program"], capture_output=True, text=True, check=True)
    found: list[list[list[float]]] = [[]]
    for line in done.stdout.splitlines():
        row = [float(word) for word in line.split()]
        if len(row) == 1:
            found.append([])
        else:
            found[-1].append(row)
    return [np.array(rows) for rows in found[:-1]]


@pytest.mark.parametrize(("place", "method"), list(enumerate([DOP853, RK45, RK23, Radau])))
def test_steps_are_those_of_scipy(runs: list[np.ndarray], place: int, method: type) -> None:
    more = {"jac": jacobian} if method is Radau else {}
    solver = method(slope, 0.0, [0.5, 1.0, -0.3], 8.0, rtol=1e-6, atol=np.array([1e-9, 2e-9, 3e-9]), **more)
    assert len(runs[place]) == STEPS
    for row in runs[place]:
        solver.step()
        inside = solver.t_old + 0.25 * np.arange(1, 5) * (solver.t - solver.t_old)
        np.testing.assert_allclose(row[4], solver.h_abs, rtol=1e-6)  # from an estimate in which digits cancel
        expected = [solver.t, *solver.y, *solver.dense_output()(inside).T.ravel()]
        np.testing.assert_allclose(np.delete(row, 4), expected, rtol=1e-9, atol=1e-9)


def test_taylors_method_keeps_its_tolerance(runs: list[np.ndarray]) -> None:
    """x0 = 1 / (2 - t), x1 = exp(-t), x2 = t - 0.3: at the ends of the steps and between."""
    rows, before = runs[4], 0.0
    assert rows[-1, 0] == 1.5
    assert len(rows) <= STEPS
    for row in rows:
        times = np.array([row[0], *(before + 0.25 * np.arange(1, 5) * (row[0] - before))])
        states = np.vstack([row[1:4], row[5:].reshape(4, 3)])
        expected = np.column_stack([1.0 / (2.0 - times), np.exp(-times), times - 0.3])
        np.testing.assert_allclose(states, expected, rtol=1e-9, atol=1e-9)
        np.testing.assert_allclose(row[14:], row[1:4], rtol=1e-14)  # the polynomial ends where the step does
        before = row[0]


def test_taylors_steps_are_judged_by_their_ends(runs: list[np.ndarray]) -> None:
    """x'' = -x^3 from x = 0, where only every fourth term is there: the last two tell nothing of the next."""
    row = runs[5][-1]
    judge = solve_ivp(lambda t, x: [x[1], -(x[0] ** 3)], (0.0, 2.0), [0.0, 1.0], "DOP853", rtol=1e-12, atol=1e-13)
    assert row[0] == 2.0
    np.testing.assert_allclose(row[1:3], judge.y[:, -1], atol=1e-4)
