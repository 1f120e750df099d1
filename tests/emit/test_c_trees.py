"""Trees in C: unrolled and in loops, Jacobians, singular mass matrices; the text itself under strict tools."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from sweeps import part_of

BRANCHED = [-1, 0, 1, 1, 3, 0, 5]


def state(system, seed=1):
    rng = np.random.default_rng(seed)
    return np.concatenate([rng.uniform(-1.0, 1.0, system.n), rng.uniform(-2.0, 2.0, system.n)])


def accelerations(system, x, t):
    q, v = np.split(x, 2)
    M, h = system.evaluate("mass_matrix", q=q), system.evaluate("bias", q=q, v=v, t=t)
    return np.linalg.solve(M, -h)


@pytest.mark.parametrize("unrolled", [0, 24])
@pytest.mark.parametrize("parents", [[-1], [-1, 0], BRANCHED], ids=len)
def test_rhs_equals_a_dense_solve(systems, compiled, parents, unrolled):
    system = systems.chain(len(parents), parents)
    library = compiled(system, limits=systems.Limits(unrolled=unrolled))
    x = state(system)
    out = library.fine("rhs", x, 0.4)
    np.testing.assert_array_equal(out[: system.n], x[system.n :])
    expected = accelerations(system, x, 0.4)
    np.testing.assert_allclose(out[system.n :], expected, rtol=0, atol=1e-12 * np.abs(expected).max())
    y = system.evaluate("outputs", q=x[: system.n], v=x[system.n :], a=out[system.n :])
    np.testing.assert_allclose(library.fine("outputs", x, 0.4), y, rtol=1e-13, atol=1e-13)


def differences(library, x):
    """The slopes of rhs, from four points on each line."""
    numeric = np.empty((len(x), len(x)))
    for k in range(len(x)):
        step = np.zeros(len(x))
        step[k] = 1e-3
        f = [library.fine("rhs", x + s * step, 0.4) for s in (-2, -1, 1, 2)]
        numeric[:, k] = (f[0] - 8 * f[1] + 8 * f[2] - f[3]) / (12 * step[k])
    return numeric


@pytest.mark.parametrize("nodes", [0, 10**9], ids=["by direction", "at once"])
def test_jacobian_equals_central_differences(systems, compiled, nodes):
    system = systems.chain(len(BRANCHED), BRANCHED)
    library = compiled(system, limits=systems.Limits(jacobian_nodes=nodes))
    n, x = system.n, state(system)
    J = library.fine("jacobian", x, 0.4).reshape(2 * n, 2 * n)
    np.testing.assert_allclose(J, differences(library, x), rtol=0, atol=1e-8 * np.abs(J).max())


@pytest.mark.parametrize("n", part_of([3, 5, 7, 8, 13], lambda n: n < 13))
def test_jacobians_of_every_number_of_columns_agree(systems, compiled, n):
    """Columns are solved twelve, four and one at a time: all agree with plain loops and with differences."""
    system = systems.chain(n, name=f"columns{n}", limits=systems.Limits(unrolled=0, jacobian_nodes=10**9))
    library, plain = compiled(system), compiled(system, "-DEOMGEN_PORTABLE")
    x = state(system)
    J = library.fine("jacobian", x, 0.4).reshape(2 * n, 2 * n)
    scale = np.abs(J).max()
    # other sines, of the C library, whose last digits the inverse of M carries on
    np.testing.assert_allclose(plain.fine("jacobian", x, 0.4).reshape(J.shape), J, rtol=0, atol=1e-11 * scale)
    np.testing.assert_allclose(J, differences(library, x), rtol=0, atol=1e-7 * scale)
    np.testing.assert_array_equal(J[:n], np.hstack([np.zeros((n, n)), np.eye(n)]))


def test_thirty_links_in_loops_and_unrolled_agree(systems, compiled):
    system = systems.chain(30)
    kernels = ["rhs"]
    loops = compiled(system, "-O0", kernels=kernels)
    unrolled = compiled(system, "-O0", kernels=kernels, limits=systems.Limits(unrolled=30))
    assert [d.name for d in system.program(kernels=kernels).drivers] == ["rhs"]
    x = state(system)
    a, b = loops.fine("rhs", x), unrolled.fine("rhs", x)
    assert np.abs(a).max() > 10.0
    np.testing.assert_allclose(a, b, rtol=0, atol=1e-10 * np.abs(a).max())
    np.testing.assert_allclose(a[30:], accelerations(system, x, 0.0), rtol=0, atol=1e-10 * np.abs(a).max())


@pytest.mark.parametrize("unrolled", [0, 24])
def test_kernels_of_closed_loops_are_trivial_for_trees(systems, compiled, unrolled):
    system = systems.chain(3, preferred=(2, 0, 1))
    library = compiled(system, limits=systems.Limits(unrolled=unrolled))
    x = state(system)
    np.testing.assert_array_equal(library.fine("project", x), x)
    M = library.fine("mass_matrix", x[:3]).reshape(3, 3)
    embedded = library.fine("embedded_mass_matrix", x[:3]).reshape(3, 3)
    np.testing.assert_array_equal(embedded, M[np.ix_([2, 0, 1], [2, 0, 1])])
    given = np.arange(9.0)
    q, v, a = np.split(library.fine("kinematics", [*given, 7.0, 7.0, 7.0]), 3)
    order = [2, 0, 1]
    assert [*q[order], *v[order], *a[order]] == list(given)
    for kernel in ("constraints", "constraint_jacobian", "velocity_constraints", "loop_coordinates"):
        assert library.fine(kernel, np.zeros(library.entries[kernel].n_in)).size == 0


@pytest.mark.parametrize("unrolled", [0, 24])
def test_a_motion_without_inertia_is_reported(systems, compiled, unrolled):
    for links in (1, 3):
        system = systems.chain(links)
        library = compiled(system, limits=systems.Limits(unrolled=unrolled))
        for mass in (0.0, -1.0):
            system.p[1] = mass
            library.set_parameters(system.p)
            assert library("rhs", state(system))[0] == 2
            assert library("jacobian", state(system))[0] == 2


def test_only_the_kernels_asked_for_are_there(systems, compiled):
    system = systems.slider_crank()
    for kernel in [k.name for k in system.program().kernels]:
        library = compiled(system, kernels=[kernel])  # warnings are errors: nothing unused is left in the source
        assert kernel in library.entries
    assert set(compiled(system, kernels=["project"]).entries) == {"project", "scales"}


SCRIPT = """
import hashlib, importlib.util, sys
spec = importlib.util.spec_from_file_location("systems", sys.argv[1])
systems = importlib.util.module_from_spec(spec)
sys.modules["systems"] = systems
spec.loader.exec_module(systems)
from eomgen.emit import emit_c, emit_numpy, emit_package
for system in (systems.chain(4, [-1, 0, 0, 2]), systems.slider_crank(copies=2)):
    for sources in (emit_c(system.program()), emit_numpy(system.program()), emit_package(system.program(), "cython")):
        print(hashlib.sha256(repr(dict(sources)).encode()).hexdigest())
"""


def test_the_same_text_under_any_hash_seed():
    path = str(Path(__file__).parent / "systems.py")
    texts = {
        subprocess.run(
            [sys.executable, "-c", SCRIPT, path],
            env={"PYTHONHASHSEED": seed},
            capture_output=True,
            text=True,
            check=True,
        ).stdout
        for seed in ("1", "2")
    }
    assert len(texts) == 1
    assert len(set(texts.pop().split())) == 6


MAIN = """
#include <stdio.h>
#include <stdlib.h>
#include "eomgen.h"
int main(void)
{
    const eomgen_model *m = eomgen_model_table();
    const double p[] = { %s, 0.0 }, q[] = { %s };
    double *c = malloc(sizeof(double) * (size_t)(m->n_const + 1)), *u = calloc((size_t)m->n_u + 1, sizeof(double));
    double *w = malloc(sizeof(double) * (size_t)(m->n_work + 1)), total = 0.0;
    if (m->precompute(p, c) != 0) { return 1; }
    for (int k = 0; k < m->n_kernels; k++) {
        const eomgen_kernel *f = m->kernels + k;
        double *x = malloc(sizeof(double) * (size_t)(f->n_in + 1));
        double *out = malloc(sizeof(double) * (size_t)(f->n_out + 1));
        for (int i = 0; i < f->n_in; i++) { x[i] = i < %d ? q[i] : 0.3; }
        const int status = f->call(0.1, x, u, c, out, w);
        if (status != 0 && status != 3) { printf("%%s: %%d\\n", f->name, status); return 1; }
        for (int i = 0; i < f->n_out; i++) { total += status == 0 ? out[i] : 0.0; }
        free(x); free(out);
    }
    free(c); free(u); free(w);
    return total == total ? 0 : 1;
}
"""


@pytest.mark.parametrize("make", ["crank", "chain", "large"])
def test_clean_under_the_sanitizers(systems, libraries, tmp_path, make):
    """Every kernel through the table, with arrays of exactly the stated lengths on the heap."""
    from eomgen.emit import emit_c

    system = {
        "crank": lambda: systems.slider_crank(copies=2, limits=systems.Limits(statements=40)),
        "chain": lambda: systems.chain(3),
        "large": lambda: systems.chain(7, BRANCHED, limits=systems.Limits(unrolled=2, jacobian_nodes=0)),
    }[make]()
    libraries.write(emit_c(system.program()), tmp_path)
    numbers = [", ".join(map(repr, map(float, values))) for values in (system.p, system.q)]
    (tmp_path / "main.c").write_text(MAIN % (*numbers, system.n))
    sources = [str(path) for path in tmp_path.glob("*.c")]
    flags = ["-g", "-O0", "-fsanitize=address,undefined", "-fno-sanitize-recover=all"]
    subprocess.run(
        ["gcc", *libraries.STRICT, *flags, *sources, "-o", str(tmp_path / "main"), "-lm"], check=True, timeout=600
    )
    done = subprocess.run([str(tmp_path / "main")], capture_output=True, text=True, check=False, timeout=600)
    assert done.returncode == 0, done.stdout + done.stderr


@pytest.mark.parametrize("make", ["crank", "chain", "large"])
def test_the_optimizer_finds_nothing_to_warn_of(systems, compiled, make):
    """What is used before it is set, or out of bounds, shows only where the compiler follows values."""
    system, limits = {
        "crank": (systems.slider_crank(copies=2, driven=True), systems.Limits(statements=40)),
        "chain": (systems.chain(3), systems.Limits()),
        "large": (systems.chain(7, BRANCHED), systems.Limits(unrolled=2, jacobian_nodes=0)),
    }[make]
    compiled(system, "-O1", limits=limits)


def test_large_models_are_split_into_files_that_link(systems, compiled, monkeypatch):
    """The same results from one file and from several."""
    from eomgen.emit import c_parts, emit_c

    system = systems.chain(12)
    limits = systems.Limits(statements=200)
    one = compiled(system, limits=limits)
    monkeypatch.setattr(c_parts, "LENGTH", 20_000)
    files = [name for name in emit_c(system.program(limits=limits)) if name.endswith(".c")]
    assert len(files) >= 3
    several = compiled(system, limits=limits)
    x = state(system)
    for kernel in ("rhs", "jacobian", "bias"):
        np.testing.assert_array_equal(several.fine(kernel, x), one.fine(kernel, x))
