"""The loop of a trajectory in plain C: no Python, no allocation, clean under the sanitizers, in threads at once."""

from __future__ import annotations

import subprocess
from pathlib import Path

import numpy as np
import pytest

from eomgen.compilation.compiler import find_compiler
from eomgen.emit.sources import read_template
from eomgen.layer import read_layer

QUATERNION = r"""
#include <math.h>
#include <pthread.h>
#include <stdio.h>
#include "eomgen_loop.h"

static int fall(double t, const double *x, const double *u, const double *c, double *out, double *w)
{
    (void)w;
    out[0] = x[1], out[1] = -c[0] + u[0];
    return t < 0.0;
}
static int height(double t, const double *x, const double *u, const double *c, double *out, double *w)
{
    (void)t, (void)u, (void)c, (void)w;
    out[0] = x[0];
    return 0;
}
static int rebound(double t, const double *x, const double *u, const double *c, double *out, double *w)
{
    (void)t, (void)u, (void)w;
    out[0] = -c[1] * x[1];
    return 0;
}

typedef struct { const eomgen_method *method; double end, restitution; int status; long bounces; double x[2]; } job;

static void *trajectory(void *given)
{
    job *const task = given;
    const eomgen_method *const method = task->method;
    const double c[2] = {9.81, task->restitution}, atol[2] = {1e-12, 1e-12}, t_eval[1] = {task->end};
    const double times[3] = {0.0, 0.5, 1.0}, values[3] = {0.0, 0.0, 0.0};
    const eomgen_signal signal = {3, 0, times, values, NULL};
    double u[1] = {0.0}, memory[2 * (4 + 16 + 7)] = {1.0, 0.0}, T[1], X[2], notes[40 * 4], numbers[15 + 2 + 8];
    double nodes[3] = {0.5, 1.0, task->end};
    long count[1] = {0};
    const long most[1] = {0};
    const int direction[1] = {-1}, action[1] = {EOMGEN_RESET}, zero[1] = {0}, one[1] = {1};
    int leaving[1], whose[2], fired[1], touch[1];
    double reset[1];
    eomgen_run run = {.rhs = fall, .c = c, .u = u, .signals = &signal, .n_u = 1, .w = NULL, .n = 2, .rtol = 1e-10,
        .max_step = INFINITY, .t_bound = task->end, .direction = 1.0, .atol = atol};
    run.y = memory, run.y_old = memory + 2, run.f = memory + 4, run.failure_state = memory + 6, run.K = memory + 8;
    run.F = run.K + 2 * 16;
    eomgen_events events = {.n = 1, .n_model = 1, .values = height, .direction = direction, .most = most,
        .action = action, .resets = rebound, .n_resets = 1, .reset_of = zero, .reset_x = one,
        .values_reset = reset, .g = numbers,
        .g_new = numbers + 1, .slope = numbers + 2, .slope_new = numbers + 3, .size = numbers + 4, .trial = numbers + 5,
        .latest = numbers + 6, .bracket = numbers + 7, .y = numbers + 15, .count = count, .leaving = leaving,
        .whose = whose, .fired = fired, .touch = touch, .crowd = 12};
    eomgen_journey journey = {.nodes = nodes, .n_nodes = 3, .t_eval = t_eval, .n_eval = 1, .events = &events,
        .span = task->end, .room = 1, .times = T, .states = X, .notes_room = 40, .notes = notes};
    do {
        task->status = eomgen_travel(method, &run, &journey);
        journey.n_notes = 0;
    } while (task->status == EOMGEN_FULL);
    task->bounces = count[0], task->x[0] = run.y[0], task->x[1] = run.y[1];
    return NULL;
}

int main(void)
{
    const eomgen_method *const methods[3] = {&eomgen_dop853, &eomgen_rk45, &eomgen_rk23};
    job jobs[4];
    pthread_t threads[4];
    for (int i = 0; i < 4; i++) {
        jobs[i] = (job){methods[i % 3], i < 3 ? 4.0 : 20.0, 0.9, 0, 0, {0.0, 0.0}};
        pthread_create(threads + i, NULL, trajectory, jobs + i);
    }
    for (int i = 0; i < 4; i++) {
        pthread_join(threads[i], NULL);
        printf("%d %ld %.17g %.17g\n", jobs[i].status, jobs[i].bounces, jobs[i].x[0], jobs[i].x[1]);
    }
    return 0;
}
"""


def test_bounces_without_python(tmp_path: Path) -> None:
    texts = {**read_layer(), "ball.c": QUATERNION}
    texts |= {name: read_template(f"c/{name}") for name in ("eomgen.h", "eomgen_real.h")}
    for name, text in texts.items():
        (tmp_path / name).write_text(text, encoding="utf-8")
    flags = ["-std=c99", "-D_POSIX_C_SOURCE=200809L", "-O1", "-g", "-Wall", "-Wextra", "-Werror", "-ffp-contract=off"]
    sanitizers = ["-fsanitize=address,undefined", "-fno-sanitize-recover=all"]
    command = [*find_compiler(None).command, *flags, *sanitizers, "eomgen_steppers.c", "ball.c", "-o", "ball"]
    built = subprocess.run([*command, "-lm", "-pthread"], cwd=tmp_path, capture_output=True, text=True)
    if "sanit" in built.stderr and "cannot find" in built.stderr:
        pytest.skip("no sanitizers here")
    assert built.returncode == 0, built.stderr
    done = subprocess.run([tmp_path / "ball"], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    rows = [[float(word) for word in line.split()] for line in done.stdout.splitlines()]
    fall, speed = np.sqrt(2 / 9.81), np.sqrt(2 * 9.81)
    hits = fall + np.concatenate([[0.0], np.cumsum(2 * speed * 0.9 ** np.arange(1, 20) / 9.81)])
    k = int((hits < 4.0).sum())
    after, up = 4.0 - hits[k - 1], speed * 0.9**k
    for status, count, h, v in rows[:3]:
        assert (status, count) == (1, k)
        assert h == pytest.approx(up * after - 9.81 * after**2 / 2, abs=1e-8)
        assert v == pytest.approx(up - 9.81 * after, abs=1e-8)
    assert rows[3][0] == -102  # Zeno
