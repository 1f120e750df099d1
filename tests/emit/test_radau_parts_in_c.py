"""The implicit stepper in plain C: a long system whose coordinates hardly drift by themselves, by parts and whole."""

from __future__ import annotations

import subprocess
from pathlib import Path

import numpy as np
from scipy.integrate import solve_ivp

from eomgen.compilation.compiler import find_compiler
from eomgen.emit.sources import read_template
from eomgen.layer import read_layer

Q, V = 15, 17
PROGRAM = r"""
#include <math.h>
#include <stdio.h>
#include <string.h>
#include "eomgen_steppers.h"

enum { Q = 15, V = 17, N = Q + V };

/* q' = E q + S v, v' = K q + D v + sin t - v^3 */
static double entry(int i, int k, double drift)
{
    if (i < Q && k < Q) { return drift * ((i == k ? -3.0 : 0.0) + 0.1 * sin(1.0 + i * k)); }
    if (i < Q) { return (i == k - Q ? 1.0 : 0.0) + 0.1 * sin(2.0 + i * k); }
    if (k < Q) { return (i - Q == k ? -2e4 : 0.0) + 40.0 * cos(1.0 + i * k); }
    return (i == k ? -30.0 - 400.0 * (i % 3) : 0.0) + 0.5 * cos(i * k);
}
static double A[N][N];

static int slope(double t, const double *x, const double *u, const double *c, double *out, double *w)
{
    (void)u, (void)c, (void)w;
    for (int i = 0; i < N; i++) {
        double sum = i < Q ? 0.0 : sin(t) - x[i] * x[i] * x[i];
        for (int k = 0; k < N; k++) { sum += A[i][k] * x[k]; }
        out[i] = sum;
    }
    return 0;
}
static int jacobian(double t, const double *x, const double *u, const double *c, double *out, double *w)
{
    (void)t, (void)u, (void)c, (void)w;
    for (int i = 0; i < N; i++) {
        for (int k = 0; k < N; k++) { out[i * N + k] = A[i][k] - (i >= Q && i == k ? 3.0 * x[i] * x[i] : 0.0); }
    }
    return 0;
}

static int travel(double drift, int n_q)
{
    enum { MOST = 64 };
    static double memory[N * (4 + MOST) + 8 * N * N + 16 + N];
    const eomgen_method *const method = &eomgen_radau;
    const double c[1] = {drift};
    double atol[N];
    memset(memory, 0, sizeof(memory));
    for (int i = 0; i < N; i++) {
        atol[i] = 1e-9, memory[i] = cos(i);
        for (int k = 0; k < N; k++) { A[i][k] = entry(i, k, drift); }
    }
    eomgen_run run = {.rhs = slope, .jacobian = jacobian, .c = c, .n = N, .n_q = n_q, .rtol = 1e-7,
        .max_step = INFINITY, .t_bound = 0.2, .direction = 1.0, .atol = atol};
    run.y = memory, run.y_old = memory + N, run.f = memory + 2 * N, run.failure_state = memory + 3 * N;
    run.K = memory + 4 * N;
    run.F = run.K + N * method->rows_K + method->squares * N * N + 16 + N;
    eomgen_start(method, &run);
    while (run.t < run.t_bound) {
        const int status = eomgen_step(method, &run);
        if (status != 0) { return status; }
    }
    const double *const state = run.K + method->rows_K * N + 4 * N * N;
    printf("%ld %ld %g", run.steps, run.evaluations, state[0]);
    for (int i = 0; i < N; i++) { printf(" %.17g", run.y[i]); }
    printf("\n");
    return 0;
}

int main(void)
{
    const double drift[4] = {0.3, 0.3, 300.0, 300.0};
    for (int i = 0; i < 4; i++) {
        const int status = travel(drift[i], i % 2 == 0 ? Q : 0);
        if (status != 0) { fprintf(stderr, "run %d: %d\n", i, status); return 1; }
    }
    return 0;
}
"""


def _entry(i: int, k: int, drift: float) -> float:
    if i < Q and k < Q:
        return drift * (-3.0 * (i == k) + 0.1 * np.sin(1.0 + i * k))
    if i < Q:
        return (i == k - Q) + 0.1 * np.sin(2.0 + i * k)
    if k < Q:
        return -2e4 * (i - Q == k) + 40.0 * np.cos(1.0 + i * k)
    return (-30.0 - 400.0 * (i % 3)) * (i == k) + 0.5 * np.cos(i * k)


def test_parts_take_the_steps_of_the_whole(tmp_path: Path) -> None:
    """Steps, evaluations and states; where coordinates drift fast the whole is factored; states beside SciPy's."""
    texts = {**read_layer(), "program.c": PROGRAM}
    texts |= {name: read_template(f"c/{name}") for name in ("eomgen.h", "eomgen_real.h")}
    for name, text in texts.items():
        (tmp_path / name).write_text(text, encoding="utf-8")
    flags = ["-std=c99", "-O2", "-Wall", "-Wextra", "-Werror", "-ffp-contract=off", "-fsanitize=address,undefined"]
    command = [*find_compiler(None).command, *flags, "eomgen_steppers.c", "program.c", "-o", "program", "-lm"]
    built = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)
    assert built.returncode == 0, built.stderr
    ran = subprocess.run(["./program"], cwd=tmp_path, capture_output=True, text=True)
    assert ran.returncode == 0, ran.stderr
    parts, whole, *fast = (np.array(line.split(), dtype=float) for line in ran.stdout.splitlines())
    assert parts[2] == 2.0
    assert [row[2] for row in (whole, *fast)] == [0.0, 0.0, 0.0]
    assert abs(parts[0] - whole[0]) <= 1
    assert abs(parts[1] - whole[1]) <= 0.02 * whole[1]
    np.testing.assert_allclose(parts[3:], whole[3:], rtol=1e-6, atol=1e-8)
    np.testing.assert_allclose(fast[0], fast[1])
    J = np.array([[_entry(i, k, 0.3) for k in range(Q + V)] for i in range(Q + V)])

    def slope(t: float, x: np.ndarray) -> np.ndarray:
        return J @ x + np.r_[np.zeros(Q), np.sin(t) - x[Q:] ** 3]

    exact = solve_ivp(slope, (0, 0.2), np.cos(np.arange(Q + V)), "DOP853", rtol=1e-11, atol=1e-13).y[:, -1]
    np.testing.assert_allclose(parts[3:], exact, rtol=1e-5, atol=1e-7)
