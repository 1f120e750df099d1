"""The implicit stepper in plain C, clean under the sanitizers: van der Pol's equation at eps = 1e-6."""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest
from scipy.integrate import solve_ivp

from eomgen.compilation.compiler import find_compiler
from eomgen.emit.sources import read_template
from eomgen.layer import read_layer

EPS = 1e-6
PROGRAM = r"""
#include <math.h>
#include <stdio.h>
#include "eomgen_steppers.h"

static int slope(double t, const double *x, const double *u, const double *c, double *out, double *w)
{
    (void)t, (void)u, (void)w;
    out[0] = x[1], out[1] = c[0] > 0.0 ? ((1.0 - x[0] * x[0]) * x[1] - x[0]) / c[0] : -400.0 * x[0] - 0.3 * x[1];
    return 0;
}
static int jacobian(double t, const double *x, const double *u, const double *c, double *out, double *w)
{
    (void)t, (void)u, (void)w;
    out[0] = 0.0, out[1] = 1.0;
    out[2] = c[0] > 0.0 ? (-2.0 * x[0] * x[1] - 1.0) / c[0] : -400.0;
    out[3] = c[0] > 0.0 ? (1.0 - x[0] * x[0]) / c[0] : -0.3;
    return 0;
}

static int travel(double eps)
{
    enum { N = 2, MOST = 64 };
    const eomgen_method *const method = &eomgen_radau;
    const double c[1] = {eps}, atol[N] = {1e-11, 1e-11};
    double memory[N * (4 + MOST) + 8 * N * N + 16 + N] = {2.0, 0.0};
    if (method->rows_K + method->rows_F > MOST || method->squares > 8) {
        return 1;
    }
    eomgen_run run = {.rhs = slope, .jacobian = jacobian, .c = c, .n = N, .rtol = 1e-9, .max_step = INFINITY,
        .t_bound = 2.0, .direction = 1.0, .atol = atol};
    run.y = memory, run.y_old = memory + N, run.f = memory + 2 * N, run.failure_state = memory + 3 * N;
    run.K = memory + 4 * N;
    run.F = run.K + N * method->rows_K + method->squares * N * N + 16 + N;
    eomgen_start(method, &run);
    while (run.t < run.t_bound) {
        if (eomgen_step(method, &run) != 0) {
            return 2;
        }
    }
    printf("%.17g %.17g %ld %ld\n", run.y[0], run.y[1], run.steps, run.evaluations);
    return 0;
}

int main(void)
{
    const int status = travel(1e-6);
    return status != 0 ? status : travel(0.0);
}
"""


def test_van_der_pol_without_python(tmp_path: Path) -> None:
    """Test set of E. Hairer and G. Wanner, y(0) = (2, 0), at t = 2."""
    texts = {**read_layer(), "program.c": PROGRAM}
    texts |= {name: read_template(f"c/{name}") for name in ("eomgen.h", "eomgen_real.h")}
    for name, text in texts.items():
        (tmp_path / name).write_text(text, encoding="utf-8")
    flags = ["-std=c99", "-O1", "-g", "-Wall", "-Wextra", "-Werror", "-ffp-contract=off"]
    sanitizers = ["-fsanitize=address,undefined", "-fno-sanitize-recover=all"]
    command = [*find_compiler(None).command, *flags, *sanitizers, "eomgen_steppers.c", "program.c", "-o", "program"]
    built = subprocess.run([*command, "-lm"], cwd=tmp_path, capture_output=True, text=True)
    if "sanit" in built.stderr and "cannot find" in built.stderr:
        pytest.skip("no sanitizers here")
    assert built.returncode == 0, built.stderr
    done = subprocess.run([tmp_path / "program"], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    *found, steps, evaluations = (float(word) for word in done.stdout.splitlines()[0].split())
    assert found == pytest.approx([1.706167732170456, -0.8928097010248257], rel=1e-10)
    judge = solve_ivp(
        lambda t, x: [x[1], ((1 - x[0] ** 2) * x[1] - x[0]) / EPS], (0.0, 2.0), [2.0, 0.0], "Radau",
        rtol=1e-9, atol=1e-11,
        jac=lambda t, x: [[0.0, 1.0], [(-2 * x[0] * x[1] - 1) / EPS, (1 - x[0] ** 2) / EPS]],
    )  # fmt: skip
    assert steps == pytest.approx(len(judge.t) - 1, rel=0.02)  # Newton's method converges as fast as SciPy's
    assert evaluations == pytest.approx(judge.nfev, rel=0.02)
    *found, steps, evaluations = (float(word) for word in done.stdout.splitlines()[1].split())
    judge = solve_ivp(
        lambda t, x: [x[1], -400.0 * x[0] - 0.3 * x[1]], (0.0, 2.0), [2.0, 0.0], "Radau", rtol=1e-9, atol=1e-11,
        jac=lambda t, x: [[0.0, 1.0], [-400.0, -0.3]],
    )  # fmt: skip
    assert found == pytest.approx(judge.y[:, -1], abs=1e-7)
    assert steps == pytest.approx(len(judge.t) - 1, rel=0.02)
    assert evaluations == pytest.approx(judge.nfev, rel=0.02)
