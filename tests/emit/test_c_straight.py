"""Straight-line kernels in C against the graph's own evaluator, to a few units in the last place."""

import numpy as np
import pytest

from eomgen.graph.core import Graph
from eomgen.graph.evaluate import evaluate
from eomgen.operations import OPERATIONS
from eomgen.program import KERNELS

FIELDS = {
    "mass_matrix": ("mass_matrix", "q"),
    "bias": ("bias", "qv"),
    "inverse_dynamics": ("inverse_dynamics", "qva"),
    "constraints": ("constraints", "q"),
    "constraint_jacobian": ("constraint_jacobian", "q"),
    "velocity_constraints": ("velocity_constraints", "qv"),
    "poses": ("poses", "q"),
    "loop_coordinates": ("loop_coordinates", "qva"),
    "loop_coordinate_jacobian": ("loop_coordinate_jacobian", "q"),
}


def compare(system, library, rtol=4e-15):
    rng = np.random.default_rng(3)
    for t in (0.0, 0.7):
        state = {name: rng.uniform(-2.0, 2.0, system.n) for name in "qva"}
        for kernel, (field, inputs) in FIELDS.items():
            out = library.fine(kernel, np.concatenate([state[i] for i in inputs]), t)
            expected = system.evaluate(field, t=t, **state).ravel()
            scale = max(1.0, np.abs(expected).max(initial=0.0))
            np.testing.assert_allclose(out, expected, rtol=rtol, atol=rtol * scale, err_msg=kernel)
        out = library.fine("energy", np.concatenate([state["q"], state["v"]]), t)
        values = system.values(t=t, **state)
        np.testing.assert_allclose(out, evaluate([system.terms.kinetic, system.terms.potential], values), rtol=rtol)


@pytest.mark.parametrize("make", ["chain", "crank"])
def test_kernels_equal_the_evaluator(systems, compiled, make):
    system = systems.chain(3) if make == "chain" else systems.slider_crank(driven=True)
    compare(system, compiled(system))


def test_one_perturbed_coefficient_is_seen(systems, libraries, tmp_path):
    from eomgen.emit import emit_c

    system = systems.chain(3)
    sources = dict(emit_c(system.program(kernels=[k.name for k in KERNELS if not k.late])))
    text = sources["chain.c"]
    assert text.count("/12.0") == 1
    sources["chain.c"] = text.replace("/12.0", "/12.0000001")
    library = libraries.Library(libraries.compile_library(sources, tmp_path), system.p, system.u)
    with pytest.raises(AssertionError):
        compare(system, library)


def test_pieces_give_the_same_bits_as_one_function(systems, compiled):
    from eomgen.program import Limits

    system = systems.slider_crank()
    whole, cut = compiled(system), compiled(system, limits=Limits(statements=20))
    assert cut.table.n_work > whole.table.n_work
    x = np.concatenate([system.q, [8.0, -2.0, 0.1]])
    for kernel in ("bias", "rhs", "jacobian", "energy"):
        np.testing.assert_array_equal(cut.fine(kernel, x), whole.fine(kernel, x))


def every_operation(systems):
    """A system whose outputs are every operation of the graph on two coordinates."""
    g = Graph()
    x, y = g.symbol("x"), g.symbol("y")
    names = sorted(set(OPERATIONS) - {"select"})
    results = [g.apply(n, *(x, y)[: OPERATIONS[n].arity]) for n in names]
    conditions = [g.apply(n, x, y) for n in ("lt", "le", "eq", "and", "or")] + [g.apply("not", x)]
    results += [g.apply("select", c, x + 1.0, y * 2.0) for c in conditions]
    results += [g.apply("and", conditions[0], conditions[1]) + conditions[1], g.apply("select", x, y, -x)]
    return systems.lagrangian_system(
        g, "operations", ["x", "y"], {}, {}, lambda q, v: ((v[0] * v[0] + v[1] * v[1]) / 2, g.zero),
        outputs=lambda q, v, a: results,
    )  # fmt: skip


def test_every_operation_means_what_the_evaluator_says(systems, compiled):
    system = every_operation(systems)
    library = compiled(system, kernels=["outputs"])
    inputs = [0.0, 0.4, -0.4, 0.9, 1.0, -1.0, 2.5, -3.0, np.nan, np.inf]
    for x in inputs:
        for y in inputs:
            _, out = library("outputs", [x, y, 0.0, 0.0])
            expected = np.array(evaluate(system.terms.outputs, {"x": x, "y": y}), dtype=float)
            arrays = evaluate(system.terms.outputs, {"x": np.array([x]), "y": np.array([y])})
            with np.errstate(all="ignore"):
                arrays = np.array([float(np.ravel(value)[0]) for value in arrays])
            np.testing.assert_allclose(out, expected, rtol=4e-15, err_msg=f"{x} {y}")
            np.testing.assert_allclose(out, arrays, rtol=4e-15, err_msg=f"{x} {y}")


def test_null_result_is_not_wanted_and_nan_is_reported(systems, compiled):
    system = systems.chain(2)
    library = compiled(system)
    entry = library.entries["rhs"]
    assert entry.call(0.0, None, None, None, None, None) == 0
    assert library("bias", [np.nan, 0.0, 0.0, 0.0])[0] == 1
    assert library("rhs", [np.inf, 0.0, 0.0, 0.0])[0] == 1


def test_the_table_describes_the_model(systems, compiled):
    system = systems.slider_crank()
    library = compiled(system)
    assert library.table.abi == 4
    assert library.table.name == b"crank"
    lanes = ["rhs", "mass_matrix", "bias", "inverse_dynamics", "energy"]
    series = {"series": False, "no_series": "its closed loops are solved at every state"}
    assert library.metadata == {**system.program().metadata, "lanes": lanes, **series}
    assert library.metadata["kernels"]["rhs"] == [6]
    assert {"terms", "position", "precompute"} <= set(library.metadata["operations"])
    assert library.metadata["operations"]["precompute"]["multiplications"] > 0
    assert list(library.entries) == list(library.metadata["kernels"])


def test_parameters_change_without_recompiling(systems, compiled):
    system = systems.chain(2)
    library = compiled(system)
    system.p = system.p * [1.0, 2.0, 0.5]
    library.set_parameters(system.p)
    compare(system, library)


@pytest.mark.parametrize("name", ["block", "rhs", "driver", "scale", "N", "main", "eomgen_model", "x"])
def test_a_model_may_have_any_name(systems, compiled, name):
    for system in (systems.chain(1, name=name), systems.slider_crank(name=name)):
        compiled(system, "-O0").fine("rhs", np.zeros(2 * system.n))
