"""Statements of alike branches as vectors: which are found, and that every number is the one without vectors."""

from dataclasses import replace

import numpy as np
import pytest

import eomgen as eg
from benchmarks.robot_calls import ROBOTS, build
from eomgen import pipeline
from eomgen.emit import alike_branches, emit_c
from eomgen.graph.evaluate import evaluate
from eomgen.graph.schedule import order

#: Robot -> pairs of statements in its right-hand side.
FOUND = {"Talos": 2692, "ANYmal": 1078}
KERNELS = ["rhs", "mass_matrix", "bias"]


def tensor(*entries):
    return dict(zip(("xx", "yy", "zz", "xy", "xz", "yz"), entries, strict=True))


def two_arms(turned=0.0):
    """Two arms of a body that slides and turns; they mirror each other, but for one mass."""
    m = eg.Model("two_arms")
    m.body("trunk", mass=8.0, inertia=tensor(0.4, 0.3, 0.5, 0.01, 0.02, -0.03))
    m.revolute("turn", "ground", "trunk", axis=(np.sin(turned), 0.0, np.cos(turned)))
    for side, sign in (("left", 1.0), ("right", -1.0)):
        before = "trunk"
        for k in range(3):
            name = f"{side}{k}"
            heavy = 1.0 + 0.2 * (side == "right" and k == 1)
            m.body(name, mass=heavy * (1.5 - 0.3 * k), com=(0.03, 0.2 * sign, 0.05),
                   inertia=tensor(0.03, 0.03, 0.04, 0.002 * sign, 0.001, -0.003 * sign))  # fmt: skip
            axis = ((1.0, 0.0, 0.0), (0.0, 0.6 * sign, 0.8), (0.0, 0.0, 1.0))[k]
            m.revolute(f"{name}_angle", {"body": before, "at": (0.0, 0.3 * sign, 0.1 * k)}, name, axis=axis)
            m.torque(f"{name}_motor", f"{name}_angle", m.input(f"tau_{name}"))
            before = name
    m.gravity = (0.0, 0.3, -9.81)
    return m


@pytest.fixture(scope="module", params=[0.0, 0.4], ids=["straight", "turned"])
def program(request):
    return pipeline.build(two_arms(request.param).derive("embedding"), "c", KERNELS)


def compile_text(libraries, folder, program, *flags):
    sources = emit_c(program)
    path = libraries.compile_library(sources, folder, *flags)
    return libraries.Library(path, program.metadata["p_values"], np.linspace(-1.0, 1.0, len(program.inputs))), sources


@pytest.mark.parametrize("statements", [1500, 120], ids=["whole", "in pieces"])
def test_vectors_have_the_bits_of_single_statements(libraries, program, statements, tmp_path, monkeypatch):
    """The same text without vectors, with structures in their place, and the graph itself."""
    program = replace(program, limits=replace(program.limits, statements=statements))
    folders = [tmp_path / name for name in ("vectors", "portable", "single")]
    for folder in folders:
        folder.mkdir()
    vectors, sources = compile_text(libraries, folders[0], program)
    assert sum(text.count("const both b") for text in sources.values()) > 300
    portable, _ = compile_text(libraries, folders[1], program, "-DEOMGEN_PORTABLE")
    monkeypatch.setattr(alike_branches, "WORTH", 2.0)
    single, sources = compile_text(libraries, folders[2], program)
    assert not any("const both b" in text for text in sources.values())
    rng = np.random.default_rng(3)
    for _ in range(5):
        x = rng.uniform(-2.0, 2.0, 14)
        for kernel in KERNELS:
            given = x[: vectors.entries[kernel].n_in]
            found = vectors.fine(kernel, given)
            np.testing.assert_array_equal(found, single.fine(kernel, given))
            # other sines, of the C library
            np.testing.assert_allclose(portable.fine(kernel, given), found, rtol=1e-11, atol=1e-11)
        block = next(b for b in program.blocks if b.name == "rhs")
        values = dict(zip(block.inputs, x, strict=True)) | dict(zip(program.inputs, vectors.u, strict=False))
        expected = np.array(evaluate(list(block.outputs), values), dtype=float)
        np.testing.assert_allclose(vectors.fine("rhs", x), expected, rtol=1e-12, atol=1e-12 * np.abs(expected).max())


def test_pairs_stand_after_their_operands(program):
    block = next(b for b in program.blocks if b.name == "rhs")
    wanted = [*block.outputs, *block.checks]
    pairs = alike_branches.find_pairs(program, order(wanted), {y.id for y in wanted})
    sequence = pairs.in_order(program.graph, order(wanted))
    assert sorted(sequence) == sorted(order(wanted))
    at = {i: k for k, i in enumerate(sequence)}
    nodes = program.graph.nodes
    assert all(at[k] < at[i] for i in sequence if nodes[i][0] not in ("const", "sym") for k in nodes[i][1:] if k in at)
    assert all(at[b] == at[a] + 1 for a, b in pairs.second.items())
    assert {-1, 1} == set(pairs.sign.values())


def test_branches_that_differ_are_left_alone():
    """An arm with joints of other kinds beside it makes too few pairs."""
    m = eg.Model("unlike")
    m.body("slider", mass=1.0)
    m.prismatic("slide", "ground", "slider", axis="x")
    m.body("bar", mass=1.0, com=(0.3, 0.0, 0.0), inertia=(0.1, 0.2, 0.3))
    m.revolute("turn", "ground", "bar", axis="z")
    m.gravity = (0.0, -9.81, 0.0)
    program = pipeline.build(m.derive(), "c", ["rhs"])
    assert alike_branches.alike_coordinates(program)
    assert not any("const both b" in text for text in emit_c(program).values())


@pytest.mark.parametrize("robot", [r for r in ROBOTS if r.name in FOUND], ids=lambda robot: robot.name)
def test_statements_that_legs_and_arms_save(robot):
    _, program = build(robot)
    block = next(b for b in program.blocks if b.name == "rhs")
    wanted = [*block.outputs, *block.checks]
    pairs = alike_branches.find_pairs(program, order(wanted), {y.id for y in wanted})
    assert len(pairs.second) == FOUND[robot.name]
