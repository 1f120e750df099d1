"""Sparse factors of the implicit stepper in plain C, clean under the sanitizers: solutions put into the equations."""

from __future__ import annotations

import subprocess
from pathlib import Path

import numpy as np
import pytest

from eomgen.compilation.compiler import find_compiler
from eomgen.emit.sources import read_template
from eomgen.layer import read_layer

PROGRAM = r"""
#include <stdio.h>
#include "eomgen_steppers.c"

enum { MOST = 130 };
static double J[MOST * MOST], plain[MOST * MOST], re[MOST * MOST], im[MOST * MOST];

int main(void)
{
    int n;
    double g, x, y;
    while (scanf("%d %lf %lf %lf", &n, &g, &x, &y) == 4) {
        double r[MOST], s[MOST], p[MOST];
        for (int i = 0; i < n * n; i++) {
            if (scanf("%lf", J + i) != 1) {
                return 1;
            }
        }
        for (int i = 0; i < n; i++) {
            p[i] = r[i] = 1.0 + i % 7, s[i] = 2.0 - i % 5;
        }
        const int filled = sparse_look(n, J, (double)n * n * n / 3.0, plain, re, im);
        int status = filled > 0 ? sparse_factor(n, filled, J, g, plain, im + filled) : -1;
        if (status == 0) {
            status = sparse_factor_complex(n, filled, J, x, y, plain, re, im, im + filled);
        }
        if (status == 0) {
            int room[MOST];
            status = sparse_is_sound(n, filled, plain, room) ? 0 : 3;
            sparse_solve(n, filled, plain, p, im + filled);
            sparse_solve_complex(n, filled, plain, re, im, r, s, im + filled);
        }
        printf("%d %d", filled, status);
        for (int i = 0; i < n; i++) {
            printf(" %.17g %.17g %.17g", p[i], r[i], s[i]);
        }
        printf("\n");
    }
    return 0;
}
"""


@pytest.fixture(scope="module")
def solver(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("sparse")
    texts = {**read_layer(), "program.c": PROGRAM}
    texts |= {name: read_template(f"c/{name}") for name in ("eomgen.h", "eomgen_real.h")}
    for name, text in texts.items():
        (folder / name).write_text(text, encoding="utf-8")
    flags = ["-std=c99", "-O1", "-g", "-Wall", "-Wextra", "-Werror", "-ffp-contract=off"]
    sanitizers = ["-fsanitize=address,undefined", "-fno-sanitize-recover=all"]
    command = [*find_compiler(None).command, *flags, *sanitizers, "program.c", "-o", "program", "-lm"]
    built = subprocess.run(command, cwd=folder, capture_output=True, text=True)
    if "sanit" in built.stderr and "cannot find" in built.stderr:
        pytest.skip("no sanitizers here")
    assert built.returncode == 0, built.stderr
    return folder / "program"


def solve(solver: Path, J: np.ndarray, g: float, z: complex) -> tuple[int, int, np.ndarray]:
    """Numbers of the factors, status, and the solutions of (g - J) p = a and (z - J) (r + i s) = a + i b."""
    words = [str(len(J)), repr(g), repr(z.real), repr(z.imag), *map(repr, J.ravel().tolist())]
    done = subprocess.run([solver], input=" ".join(words), capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    filled, status, *numbers = done.stdout.split()
    return int(filled), int(status), np.array(numbers, dtype=float).reshape(-1, 3)


def arrow(n: int, border: int, rng: np.random.Generator) -> np.ndarray:
    """Blocks of three on the diagonal, and full rows and columns at the end, as of soil under a vehicle."""
    J = np.zeros((n, n))
    for k in range(0, n - border, 3):
        size = min(3, n - border - k)
        J[k : k + size, k : k + size] = rng.normal(size=(size, size))
    J[-border:], J[:, -border:] = rng.normal(size=(border, n)), rng.normal(size=(n, border))
    return J


@pytest.mark.parametrize("n", [60, 63, 64, 65, 127, 128])
@pytest.mark.parametrize("kind", ["arrow", "band", "scattered"])
def test_solutions_fulfil_the_equations(solver: Path, kind: str, n: int) -> None:
    rng = np.random.default_rng(n)
    J = arrow(n, 5, rng)
    if kind == "band":
        J = np.triu(np.tril(rng.normal(size=(n, n)), 2), -2)
        mixed = rng.permutation(n)
        J = J[np.ix_(mixed, mixed)]
    elif kind == "scattered":
        J = rng.normal(size=(n, n)) * (rng.uniform(size=(n, n)) < 1.0 / n)
    g, z, i = 30.0, 20.0 - 25.0j, np.arange(n)
    filled, status, found = solve(solver, J, g, z)
    assert (n < filled < n * n / 2, status) == (True, 0)
    np.testing.assert_allclose((g * np.eye(n) - J) @ found[:, 0], 1.0 + i % 7, rtol=1e-12)
    right = 1.0 + i % 7 + 1j * (2.0 - i % 5)
    np.testing.assert_allclose((z * np.eye(n) - J) @ (found[:, 1] + 1j * found[:, 2]), right, rtol=1e-12, atol=1e-12)


def test_an_arrow_does_not_fill(solver: Path) -> None:
    """Whichever end of it points where: the border is eliminated last."""
    n, rng = 120, np.random.default_rng(0)
    J = arrow(n, 3, rng)[::-1, ::-1]
    filled, _, _ = solve(solver, J, 30.0, 20.0 - 25.0j)
    assert filled == np.count_nonzero(J)


def test_a_pivot_that_rounding_makes_is_told(solver: Path) -> None:
    """g - J with a diagonal of nothing, which exchanges of rows would solve: dense factors take over."""
    n = 60
    J = np.diag(np.ones(n - 1), 1) + np.diag(np.ones(n - 1), -1) + 30.0 * np.eye(n)
    _, status, _ = solve(solver, J, 30.0, 20.0 - 25.0j)
    assert status == 1


@pytest.mark.parametrize(("n", "share"), [(47, 0.02), (60, 1.0)])
def test_small_and_full_ones_stay_dense(solver: Path, n: int, share: float) -> None:
    rng = np.random.default_rng(1)
    J = rng.normal(size=(n, n)) * (rng.uniform(size=(n, n)) < share)
    assert solve(solver, J, 30.0, 20.0 - 25.0j)[:2] == (0, -1)
