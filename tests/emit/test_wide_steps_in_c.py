"""Steps with four states at a time against the same methods state by state: the same bits, whatever their number."""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest

from eomgen.compilation.compiler import find_compiler
from eomgen.compilation.processor import lane_width
from eomgen.emit.sources import read_template
from eomgen.layer import read_layer

RING = r"""
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "eomgen_steppers.h"

enum { MOST = 23 };
static int n;

/* A ring of states that pull at their neighbours, no two alike. */
static int ring(double t, const double *x, const double *u, const double *c, double *out, double *w)
{
    (void)u, (void)c, (void)w;
    for (int i = 0; i < n; i++) {
        out[i] = sin(x[(i + 1) % n] * (1.0 + 0.1 * i)) - 0.3 * x[i] * x[(i + n - 1) % n] + cos(t * (i + 1));
    }
    return 0;
}

static void travel(const eomgen_method *method, double *row)
{
    double *const memory = calloc(MOST * (5 + 16 + 7) + 8, sizeof(double)), atol[MOST], *place = memory;
    eomgen_run run = {.rhs = ring, .n = n, .rtol = 1e-7, .max_step = INFINITY, .t_bound = 3.0, .direction = 1.0,
        .atol = atol, .until_callback = -1, .hold = NAN};
    double **const parts[] = {&run.y, &run.y_old, &run.f, &run.failure_state, &run.next, &run.K};
    for (int k = 0; k < 6; k++, place += n) {
        *parts[k] = place;
    }
    run.F = run.K + n * method->rows_K;
    for (int i = 0; i < n; i++) {
        atol[i] = 1e-9 * (1 + i % 3), run.y[i] = 0.1 * (i + 1);
    }
    double *const guard = run.F + n * method->rows_F;
    *guard = 42.0;
    eomgen_start(method, &run);
    while (run.t < run.t_bound && eomgen_step(method, &run) == 0) {
        eomgen_between(method, &run, run.t - 0.3 * run.step, row);
    }
    memcpy(row + n, run.y, (size_t)n * sizeof(double));
    row[2 * n] = (double)run.evaluations, row[2 * n + 1] = (double)run.rejected, row[2 * n + 2] = run.h_abs;
    row[2 * n + 3] = *guard;
    free(memory);
}

int main(void)
{
    const eomgen_method *const methods[] = {&eomgen_dop853, &eomgen_rk45, &eomgen_rk23};
    for (int k = 0; k < 3; k++) {
        for (n = 1; n <= MOST; n++) {
            const eomgen_method *const suited = eomgen_suited(methods[k], n);
            double a[2 * MOST + 4], b[2 * MOST + 4];
            travel(methods[k], a);
            travel(suited, b);
            const size_t size = (size_t)(2 * n + 4) * sizeof(double);
            printf("%s %d %d %d %g %g %.17g\n", suited->name, n, suited != methods[k], memcmp(a, b, size) == 0,
                b[2 * n], b[2 * n + 3], b[n]);
        }
    }
    return 0;
}
"""


@pytest.mark.slow
@pytest.mark.parametrize("more", [[], ["-DEOMGEN_PORTABLE"]], ids=["vectors", "portable"])
def test_bits_do_not_depend_on_the_width(tmp_path: Path, more: list[str]) -> None:
    texts = {**read_layer(), "ring.c": RING}
    texts |= {name: read_template(f"c/{name}") for name in ("eomgen.h", "eomgen_real.h", "eomgen_processor.h")}
    for name, text in texts.items():
        (tmp_path / name).write_text(text, encoding="utf-8")
    flags = ["-std=c99", "-O1", "-g", "-Wall", "-Wextra", "-Werror", "-ffp-contract=off", "-fno-math-errno", *more]
    sanitizers = ["-fsanitize=address,undefined", "-fno-sanitize-recover=all"]
    files = ["eomgen_steppers.c", "eomgen_wide_steps.c", "ring.c"]
    command = [*find_compiler(None).command, *flags, *sanitizers, *files, "-o", "ring", "-lm"]
    built = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)
    if "sanit" in built.stderr and "cannot find" in built.stderr:
        pytest.skip("no sanitizers here")
    assert built.returncode == 0, built.stderr
    done = subprocess.run([tmp_path / "ring"], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    rows = [line.split() for line in done.stdout.splitlines()]
    assert len(rows) == 3 * 23
    for name, n, _, same, evaluations, guard, value in rows:
        assert same == "1", (name, n)
        assert float(evaluations) > 50
        assert float(guard) == 42.0  # nothing was written behind the last row
        assert abs(float(value)) < 10.0
    wide = {int(n) for _, n, other, *_ in rows if other == "1"}
    assert wide in (set(), set(range(6, 24)))
    if more:
        assert not wide
    elif lane_width() >= 4:  # this processor has AVX2
        assert wide
