"""Lanes of the generated C: every lane has the bits of the plain function, whatever the other lanes hold."""

import importlib.util
import subprocess
from pathlib import Path

import numpy as np
import pytest

from eomgen.emit import emit_c
from eomgen.emit.c_lanes import LANES

LEFT_ALONE = 6  # EOMGEN_LEFT_ALONE
ALL = ("-UEOMGEN_LANES", "-DEOMGEN_WITHOUT_SERIES", "-O2")  # every width that the machine has
KERNELS = [*LANES, "project"]  # what is compared; the others have no lanes, and take the compiler longer


def every_operation(systems):
    path = Path(__file__).parent / "test_c_straight.py"
    spec = importlib.util.spec_from_file_location("eomgen_test_operations", path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module.every_operation(systems)


def bits(array):
    """Numbers as they are stored; all NaN alike."""
    array = np.array(array, dtype=float)
    array[np.isnan(array)] = np.nan
    return array.view(np.int64)


def plain(library, kernel, t, x, u, c):
    """The plain function of every column -> statuses, results."""
    library.u, library.c = np.array([*u, 0.0]), np.array(c)
    return library(kernel, x, t)


def compare_lanes(library, kernel, t, x, u, c):
    """All widths; the columns of x, u and c are the states."""
    k = x.shape[1]
    expected = [plain(library, kernel, t[j], x[:, j], u[:, j], c[:, j]) for j in range(k)]
    for width in library.lanes:
        for first in range(0, k - width + 1, width):
            here = slice(first, first + width)
            status, out = library.side_by_side(width, kernel, t[here], x[:, here], u[:, here], c[:, here])
            for lane, (code, single) in enumerate(expected[here]):
                assert status[lane] == code, (kernel, width, x[:, first + lane])
                if code == 0:
                    np.testing.assert_array_equal(bits(out[:, lane]), bits(single), err_msg=f"{kernel} {width}")


def constants(library, p):
    """The constants of every column of parameters."""
    columns = []
    for column in p.T:
        library.set_parameters(column)
        columns.append(library.c.copy())
    return np.array(columns).T


def states(rng, system, library, kernel, k):
    x = rng.uniform(-3.0, 3.0, (library.entries[kernel].n_in, k))
    u = rng.uniform(-1.0, 1.0, (len(system.u), k))
    p = system.p[:, None] * rng.uniform(0.5, 2.0, (len(system.p), k))
    return rng.uniform(0.0, 2.0, k), x, u, constants(library, p)


def test_lanes_have_the_bits_of_the_plain_functions(systems, compiled):
    rng = np.random.default_rng(1)
    for system in (systems.chain(3), systems.chain(7, [-1, 0, 1, 1, 0, 4, 4])):
        library = compiled(system, *ALL, kernels=KERNELS)
        assert {2} <= set(library.lanes) <= {2, 4, 8}
        for kernel in set(LANES) & set(library.entries):
            compare_lanes(library, kernel, *states(rng, system, library, kernel, 24))


def test_pieces_have_lanes_too(systems, compiled):
    system = systems.chain(3)
    library = compiled(system, *ALL, limits=systems.Limits(statements=20), kernels=["rhs"])
    rng = np.random.default_rng(2)
    compare_lanes(library, "rhs", *states(rng, system, library, "rhs", 16))


def test_every_operation_in_lanes(systems, compiled):
    system = every_operation(systems)
    library = compiled(system, *ALL, kernels=["outputs"])
    inputs = [0.0, -0.0, 0.4, -0.4, 1.0, -1.0, 2.5, -3.0, 2e6, -1e300, 5e-324, np.nan, np.inf, -np.inf]
    pairs = np.array([[x, y] for x in inputs for y in inputs]).T
    for cut in (0, 1, 2, 3):  # so that values meet other neighbours
        x = np.vstack([pairs[:, cut:], np.zeros((2, pairs.shape[1] - cut))])
        k = x.shape[1]
        entry = library.entries["outputs"]
        for width in library.lanes:
            for first in range(0, k - width + 1, width):
                here = slice(first, first + width)
                empty = np.zeros((len(library.c), width))
                _, out = library.side_by_side(
                    width, "outputs", np.zeros(width), x[:, here], np.zeros((1, width)), empty
                )
                for lane in range(width):
                    single = np.full(entry.n_out, np.nan)
                    _, single = library("outputs", x[:, first + lane])
                    np.testing.assert_array_equal(bits(out[:, lane]), bits(single), err_msg=str(x[:2, first + lane]))


def test_a_lane_that_fails_leaves_the_others_alone(systems, compiled):
    system = systems.chain(3)
    library = compiled(system, *ALL, kernels=KERNELS)
    rng = np.random.default_rng(3)
    t, x, u, c = states(rng, system, library, "rhs", 8)
    masses = np.repeat(system.p[:, None], 8, axis=1)
    x[1, 2], x[0, 5] = np.nan, np.inf
    masses[:, 6] = 0.0  # no inertia behind any motion
    c = constants(library, masses)
    codes = [plain(library, "rhs", t[j], x[:, j], u[:, j], c[:, j])[0] for j in range(8)]
    assert codes == [0, 0, 1, 0, 0, 1, 2, 0]
    compare_lanes(library, "rhs", t, x, u, c)


def compare_loops(library, x, t, u, c):
    """All widths; returns how many states were left to the plain function."""
    left = 0
    expected = [plain(library, "rhs", t[j], x[:, j], u[:, j], c[:, j]) for j in range(x.shape[1])]
    for width in library.lanes:
        for first in range(0, x.shape[1] - width + 1, width):
            here = slice(first, first + width)
            status, out = library.side_by_side(width, "rhs", t[here], x[:, here], u[:, here], c[:, here])
            for lane, (code, single) in enumerate(expected[here]):
                left += status[lane] == LEFT_ALONE
                if status[lane] != LEFT_ALONE:
                    assert status[lane] == code
                    np.testing.assert_array_equal(bits(out[:, lane]), bits(single), err_msg=f"{width}")
    return left


@pytest.mark.parametrize("far", [0.0, 1e-9, 1e-3, 0.02])
def test_loops_have_the_bits_of_the_plain_function_and_leave_what_needs_pivoting(systems, compiled, far):
    """States on the constraints, off them, far away, not finite and at a dead centre of the preferred coordinate."""
    rng = np.random.default_rng(4)
    for system in (systems.slider_crank(), systems.slider_crank(copies=2, name="crank_2")):
        library = compiled(system, *ALL, kernels=KERNELS)
        n, k = system.n, 24
        closed = library.fine("project", np.concatenate([system.q, np.ones(n)]))
        x = closed[:, None] + far * rng.standard_normal((2 * n, k))
        t, u = np.zeros(k), np.tile(system.u[:, None], k)
        c = constants(library, np.tile(system.p[:, None], k))
        assert compare_loops(library, x, t, u, c) == 0
        x[0, 3], x[n, 10], x[0, 17] = np.nan, np.inf, 40.0
        assert compare_loops(library, x, t, u, c) >= len(library.lanes)


def test_a_loop_at_a_dead_centre_is_left_to_the_plain_function(systems, compiled):
    """The slider is preferred, and stands still where crank and rod are in line."""
    system = systems.slider_crank(preferred=(2,), name="crank_s")
    library = compiled(system, *ALL, kernels=KERNELS)
    n = system.n
    r, l = (float(system.values()[name]) for name in ("l1", "l2"))
    dead = library.fine("project", np.array([0.0, 0.0, r + l, 5.0, -5.0 * r / l, 0.0]))
    other = library.fine("project", np.concatenate([system.q, np.ones(n)]))
    x = np.tile(other[:, None], 8)
    x[:, 5] = dead
    t, u = np.zeros(8), np.tile(system.u[:, None], 8)
    c = constants(library, np.tile(system.p[:, None], 8))
    assert compare_loops(library, x, t, u, c) == len(library.lanes)


MAIN = """
#include <stdio.h>
#include <stdlib.h>
#include "eomgen.h"
static double *room(int n, int width)
{
    double *a = aligned_alloc(64, ((sizeof(double) * (size_t)(n * width)) + 63) / 64 * 64);
    for (int i = 0; i < n * width; i++) { a[i] = 0.1 + 0.01 * i; }
    return a;
}
int main(void)
{
    const eomgen_model *m = eomgen_model_table();
    const double p[] = { %s, 0.0 };
    double *c1 = malloc(sizeof(double) * (size_t)(m->n_const + 1));
    if (m->precompute(p, c1) != 0) { return 1; }
    int called = 0;
    for (const eomgen_lanes *const *l = m->lanes; *l != NULL; l++) {
        const int W = (*l)->width;
        if (!(*l)->usable()) { continue; }
        double *c = room(m->n_const + 1, W), *u = room(m->n_u + 1, W), *w = room(m->n_work + 1, W), *t = room(1, W);
        for (int i = 0; i < m->n_const * W; i++) { c[i] = c1[i / W]; }
        for (int k = 0; k < m->n_kernels; k++) {
            if ((*l)->kernels[k] == NULL) { continue; }
            double *x = room(m->kernels[k].n_in, W), *out = room(m->kernels[k].n_out, W);
            int status[8];
            if ((*l)->kernels[k](t, x, u, c, out, w, status) != 0) { printf("%%s\\n", m->kernels[k].name); return 1; }
            x[0] = 1e9;
            (void)(*l)->kernels[k](t, x, u, c, out, w, status);
            free(x); free(out);
            called++;
        }
        free(c); free(u); free(w); free(t);
    }
    free(c1);
    return called >= 6 ? 0 : 1;
}
"""


@pytest.mark.parametrize("cut", [20, 1500])
def test_lanes_are_clean_under_the_sanitizers(systems, libraries, tmp_path, cut):
    system = systems.chain(3, limits=systems.Limits(statements=cut))
    libraries.write(emit_c(system.program(kernels=KERNELS)), tmp_path)
    (tmp_path / "main.c").write_text(MAIN % ", ".join(map(repr, map(float, system.p))))
    sources = [str(path) for path in tmp_path.glob("*.c")]
    # -O0: the instrumented text takes the compiler a quarter of the time, and nothing wrong is optimized away
    flags = [
        "-UEOMGEN_LANES",
        "-DEOMGEN_WITHOUT_SERIES",
        "-g",
        "-O0",
        "-D_ISOC11_SOURCE",
        "-fsanitize=address,undefined",
    ]
    flags += ["-fno-sanitize-recover=all"]
    command = ["gcc", *libraries.STRICT, *flags, *sources, "-o", str(tmp_path / "main"), "-lm"]
    subprocess.run(command, check=True, timeout=600)
    done = subprocess.run([str(tmp_path / "main")], capture_output=True, text=True, check=False, timeout=600)
    assert done.returncode == 0, done.stdout + done.stderr


def test_without_vector_types_there_are_no_lanes_and_the_same_functions(systems, compiled):
    """What a compiler that is not GCC or Clang makes of the text."""
    system = systems.chain(3)
    few = ["rhs"]
    library = compiled(system, "-UEOMGEN_LANES", "-DEOMGEN_PORTABLE", kernels=few)
    other = compiled(system, kernels=few)
    assert not library.lanes
    x = np.linspace(-2.0, 2.0, 6)
    np.testing.assert_allclose(library.fine("rhs", x), other.fine("rhs", x), rtol=1e-13)
