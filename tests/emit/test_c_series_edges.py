"""The exported series at the ends of its orders, under the sanitizers: it writes within its rows, and it ends."""

from __future__ import annotations

import subprocess
from pathlib import Path
from typing import Any

import pytest

import eomgen as eg
from eomgen.compilation.compiler import find_compiler
from eomgen.emit import emit_c
from eomgen.pipeline import build

PROGRAM = r"""
#include <limits.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "pushed.h"

#define WIDTH 2
typedef double real __attribute__((vector_size(8 * WIDTH)));
typedef long long flag __attribute__((vector_size(8 * WIDTH)));
typedef flag (*lane_series)(real, const real *, const real *, const real *, int, real *, real *);

static const int orders[] = { INT_MIN, -1, 0, 1, 2, 3, 22, 23, 24, 25, 1000000000, INT_MAX };

static int fail(const char *what, int order)
{
    printf("%s at order %d\n", what, order);
    return 1;
}

int main(void)
{
    const eomgen_model *const m = eomgen_model_table();
    enum { N = 4 };
    const double x[N] = { 0.3, 0.2, -1.0, 0.5 }, u[1] = { 0.0 };
    double *const c = calloc((size_t)m->n_const + 1, sizeof *c);
    m->precompute(u, c);
    for (int k = 0; k < m->n_kernels; k++) { /* NULL: not wanted */
        if (m->kernels[k].call(0.0, x, u, c, NULL, NULL) != 0) { return fail("a kernel without out", 0); }
    }
    for (size_t i = 0; i < sizeof orders / sizeof *orders; i++) {
        const int order = orders[i], taken = order >= 0 && order <= m->series->most;
        const size_t rows = taken ? (size_t)order + 1 : 1;
        double *const out = malloc(rows * N * sizeof *out), *const w = calloc((size_t)m->series->n_work, sizeof *w);
        const int status = m->series->expand(0.3, x, u, c, order, out, w);
        if (status != (taken ? 0 : EOMGEN_BAD_ARGUMENT)) { return fail("status", order); }
        if (taken && memcmp(out, x, sizeof x) != 0) { return fail("row 0", order); }
        free(out), free(w);
        for (int k = 0; m->lanes[k] != NULL; k++) {
            if (m->lanes[k]->width != WIDTH) { continue; }
            const lane_series expand = (lane_series)m->lanes[k]->expand;
            const size_t size = sizeof(real), work = (size_t)m->series->n_work;
            real *const lx = calloc(N, size), *const lc = calloc((size_t)m->n_const + 1, size);
            real *const lout = malloc(rows * N * size), *const lw = calloc(work, size);
            for (int j = 0; j < N; j++) { lx[j] = (real){ x[j], x[j] }; }
            const flag lost = expand((real){ 0.3, 0.3 }, lx, lc, lc, order, lout, lw);
            if ((lost[0] != 0 || lost[1] != 0) == taken) { return fail("lanes", order); }
            if (taken && lout[N - 1][1] != x[N - 1]) { return fail("row 0 in lanes", order); }
            free(lx), free(lc), free(lout), free(lw);
        }
    }
    free(c);
    puts("done");
    return 0;
}
"""


def pushed() -> eg.Model:
    m = eg.Model("pushed", gravity=(0, -9.81, 0))
    arm = m.body("arm", mass=1.0, com=(0.5, 0, 0), inertia={"zz": 0.1})
    tip = m.body("tip", mass=0.5, com=(0.2, 0, 0), inertia={"zz": 0.02})
    m.revolute("A", m.ground, arm)
    m.revolute("B", arm.at(1, 0, 0), tip)
    m.torque("push", "A", "sin(2*t)*exp(-t)/(2 + t*t)")
    return m


@pytest.mark.parametrize("level", ["-O0", "-O2"])
def test_every_order_is_within_the_rows_or_refused(tmp_path: Path, libraries: Any, level: str) -> None:
    libraries.write({**emit_c(build(pushed().derive(), "c", ["rhs", "jacobian"])), "edges.c": PROGRAM}, tmp_path)
    sanitizers = ["-fsanitize=address,undefined", "-fno-sanitize-recover=all"]
    files = sorted(str(path) for path in tmp_path.glob("*.c"))
    flags = ["-std=gnu11", "-g", level, "-DEOMGEN_LANES=2", "-Wall", "-Wextra"]
    command = [*find_compiler(None).command, *flags, *sanitizers, *files, "-o", "edges", "-lm"]
    built = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert built.returncode == 0, built.stderr[:4000]
    ran = subprocess.run(["./edges"], cwd=tmp_path, capture_output=True, text=True, check=False, timeout=600)
    assert (ran.returncode, ran.stdout) == (0, "done\n"), (ran.stdout + ran.stderr)[:4000]
