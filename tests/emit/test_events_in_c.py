"""Events and tables of the layer in plain C against closed forms and SciPy: directions, touches, times, pieces."""

from __future__ import annotations

import subprocess

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from eomgen.compilation.compiler import find_compiler
from eomgen.emit.sources import read_template
from eomgen.layer import read_layer

DIP = 1e-4  #: how far a value goes beyond zero, for a short while
TIMES, VALUES = [0.0, 0.4, 1.0, 1.7, 2.0], [1.0, -0.5, 0.3, 0.2, 2.0]
PROGRAM = r"""
#include <math.h>
#include <stdio.h>
#include "eomgen_loop.h"

enum { N = 2, EVENTS = 5, ROOM = 64 };

/* x0 = sin t, x1 = t */
static int turn(double t, const double *x, const double *u, const double *c, double *out, double *w)
{
    (void)x, (void)u, (void)c, (void)w;
    out[0] = cos(t), out[1] = 1.0;
    return 0;
}
static int values(double t, const double *x, const double *u, const double *c, double *out, double *w)
{
    (void)t, (void)u, (void)c, (void)w;
    out[0] = out[1] = out[2] = x[0], out[3] = 1.0 - DIP - x[0], out[4] = x[1] - 9.0;
    return 0;
}

static void travel(const eomgen_method *method)
{
    const double atol[N] = {1e-13, 1e-13}, nodes[1] = {12.0};
    double memory[N * 64] = {0.0, 0.0}, T[ROOM], X[ROOM * N], notes[ROOM * (2 + N)], numbers[10 * EVENTS + 8 * EVENTS];
    const int direction[EVENTS] = {1, -1, 0, 0, 0}, action[EVENTS] = {0, 0, 0, 0, 0};
    const long most[EVENTS] = {0, 0, 0, 0, 1};
    long count[EVENTS] = {0};
    int leaving[EVENTS], whose[2 * EVENTS], fired[EVENTS], touch[EVENTS];
    eomgen_run run = {.rhs = turn, .n = N, .rtol = 1e-12, .max_step = INFINITY, .t_bound = 12.0, .direction = 1.0,
        .atol = atol, .until_callback = -1, .hold = NAN};
    double *place = memory, **const parts[] = {&run.y, &run.y_old, &run.f, &run.failure_state, &run.next, &run.K};
    for (int k = 0; k < 6; k++, place += N) {
        *parts[k] = place;
    }
    run.F = run.K + N * method->rows_K;
    eomgen_events events = {.n = EVENTS, .n_model = EVENTS, .values = values, .direction = direction, .most = most,
        .action = action, .count = count, .leaving = leaving, .whose = whose, .fired = fired, .touch = touch,
        .crowd = 12};
    double **const work[] = {&events.g, &events.g_new, &events.slope, &events.slope_new, &events.size, &events.trial,
        &events.latest, &events.y, &events.bracket};
    for (int k = 0; k < 9; k++) {
        *work[k] = numbers + k * EVENTS;
    }
    eomgen_journey journey = {.nodes = nodes, .n_nodes = 1, .t_eval = nodes, .n_eval = 0, .events = &events,
        .span = 12.0, .room = 2, .times = T, .states = X, .notes_room = ROOM, .notes = notes};
    const int status = eomgen_travel(method, &run, &journey);
    for (long k = 0; k < journey.n_notes; k++) {
        const double *const row = notes + k * (2 + N);
        printf("%.17g %.17g %.17g %.17g\n", row[0], row[1], row[2], row[3]);
    }
    printf("%d %.17g %ld\n", status, run.t, run.steps);
}

int main(void)
{
    const double times[] = {TIMES}, values_[] = {VALUES}, pieces[] = {PIECES};
    travel(&eomgen_dop853);
    for (int order = 0; order < 4; order++) {
        const eomgen_signal table = {5, order, times, order == 3 ? pieces : values_, NULL};
        for (int k = -2; k < 45; k++) {
            printf("%.17g ", eomgen_table_value(&table, 0.05 * k, NAN));
        }
        printf("\n");
    }
    return 0;
}
"""


def spline() -> CubicSpline:
    return CubicSpline(TIMES, VALUES)


@pytest.fixture(scope="module")
def lines(tmp_path_factory: pytest.TempPathFactory) -> list[list[float]]:
    folder = tmp_path_factory.mktemp("events")
    pieces = np.vstack([spline().c[::-1].T, [VALUES[-1], 0.0, 0.0, 0.0]]).ravel()
    numbers = {"TIMES": TIMES, "VALUES": VALUES, "PIECES": pieces}
    text = PROGRAM.replace("DIP", repr(DIP))
    for name, given in numbers.items():
        text = text.replace(f"{{{name}}}", "{" + ", ".join(map(repr, map(float, given))) + "}")
    texts = {**read_layer(), "program.c": text}
    texts |= {name: read_template(f"c/{name}") for name in ("eomgen.h", "eomgen_real.h")}
    for name, one in texts.items():
        (folder / name).write_text(one, encoding="utf-8")
    flags = ["-std=c99", "-O1", "-Wall", "-Wextra", "-Werror", "-ffp-contract=off"]
    command = [*find_compiler(None).command, *flags, "eomgen_steppers.c", "program.c", "-o", "program", "-lm"]
    built = subprocess.run(command, cwd=folder, capture_output=True, text=True)
    assert built.returncode == 0, built.stderr
    done = subprocess.run([folder / "program"], capture_output=True, text=True, check=True)
    return [[float(word) for word in line.split()] for line in done.stdout.splitlines()]


def test_zeros_are_found_in_their_directions(lines: list[list[float]]) -> None:
    """sin t rises through 0 at 2 pi and falls at pi; 1 - DIP - sin t is below 0 near pi/2 and 5 pi/2, within a step."""
    *run, end = lines[:-4]
    width = np.arccos(1.0 - DIP)
    assert end[:2] == [2.0, pytest.approx(9.0, abs=1e-12)]  # ended by the event at t = 9
    assert 9.0 / end[2] > 4.0 * width  # the mean step is longer than the dips
    dips = [m * np.pi + side * width for m in (0.5, 2.5) for side in (-1.0, 1.0)]
    expected = {0: [2 * np.pi], 1: [np.pi], 2: [np.pi, 2 * np.pi], 3: dips, 4: [9.0]}
    times = [row[1] for row in run]
    assert times == sorted(times)
    for event, zeros in expected.items():
        found = [row[1] for row in run if row[0] == event and row[1] > 0.0]
        assert found == pytest.approx(zeros, abs=1e-9), event
    for _, t, x, clock in run:
        assert (x, clock) == pytest.approx((np.sin(t), t), abs=1e-10)


def test_tables_are_read_as_scipy_reads_them(lines: list[list[float]]) -> None:
    t = 0.05 * np.arange(-2, 45)
    k = np.clip(np.searchsorted(TIMES, t, side="right") - 1, 0, len(TIMES) - 1)
    held, inside = np.array(VALUES)[k], np.clip(t, TIMES[0], TIMES[-1])
    expected = [held, np.interp(t, TIMES, VALUES), held, spline()(inside)]
    for found, values in zip(lines[-4:], expected, strict=True):
        np.testing.assert_allclose(found, values, rtol=1e-13, atol=1e-14)
