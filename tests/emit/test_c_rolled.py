"""Functions of big trees as loops over alike bodies: equal to the straight-line ones, to Pinocchio, and short."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from mechanisms import random_mechanism
from pinocchio_trees import STEPS, pinocchio_model
from sweeps import seeds

import eomgen as eg
from eomgen import pipeline
from eomgen.emit import c_rolled, emit_c
from eomgen.equations import METHODS
from eomgen.kinematics import analyse
from eomgen.kinematics.mobility import find_mobility
from eomgen.program import Limits, Program
from eomgen.program.build_program import build_program
from eomgen.program.collect import collect_metadata, collect_terms

NEVER = 10**9
KERNELS = ["rhs", "bias", "inverse_dynamics", "energy", "poses", "outputs", "jacobian", "input_jacobian"]


def limited(program: Program, rolled: int) -> Program:
    return replace(program, limits=replace(program.limits, rolled=rolled))


def planar_chain(n: int) -> eg.Model:
    m = eg.Model("chain", gravity=(1.0, "-g", 0))
    for name, value in (("g", 9.81), ("m", 0.7), ("l", 0.3)):
        m.parameter(name, value)
    last: Any = m.ground
    for k in range(n):
        link = m.body(f"b{k}", mass="m", com=("l/2", 0, 0), inertia=(0.002, 0.003, f"m*l**2/{14 + k % 7}"))
        m.revolute(f"j{k}", last, link)
        last = link.at("l", 0, 0)
    return m


def numbers_chain(n: int) -> eg.Model:
    """Hinges across each other, springs on every third joint, a force at the tip."""
    m = eg.Model("numbers_chain", gravity=(0.3, -9.0, 2.0))
    m.input("u", 0.4)
    last: Any = m.ground
    for k in range(n):
        link = m.body(f"b{k}", mass=1.0 + 0.01 * k, com=(0.05, 0.01, 0), inertia=(2e-3, 1e-3, 1.5e-3))
        m.revolute(f"j{k}", last, link, axis="zy"[k % 2])
        if k % 3 == 0:
            m.torsional_spring(f"s{k}", f"j{k}", stiffness=3.0 + k)
            m.torque(f"d{k}", f"j{k}", f"u - 0.2*j{k}_dot")
        last = link.at(0.1, 0, 0)
    m.force("tip", last, (1, "2*u", "sin(t)"))
    m.output("x_tip", "x(b2)")
    return m


def slides(n: int) -> eg.Model:
    """Slides and hinges in turn, on turned axes, two on every body."""
    m = eg.Model("slides", gravity=(0, 0, -9.81))
    m.parameter("c", 0.3)
    bodies: list[Any] = []
    for k in range(n):
        body = m.body(
            f"b{k}", mass=1.2, com=(0, 0.1, "c/5"), inertia={"xx": 0.03, "yy": 0.02, "zz": 0.025, "xy": 0.002}
        )
        outer = (bodies[(k - 1) // 2] if k else m.ground).at(0.1, 0.2, 0, rpy=(0.3, -0.2, 0.1 * (k % 2)))
        joint = m.prismatic if k % 2 else m.revolute
        joint(f"j{k}", outer, body, axis=(0.6, 0.0, 0.8))
        m.damper(f"d{k}", m.ground, body, damping=0.5 + 0.1 * k) if k % 4 == 0 else None
        bodies.append(body)
    return m


def afloat(n: int) -> eg.Model:
    """Three equal arms on a body that floats, in Euler parameters."""
    m = eg.Model("afloat", gravity=(0, 0, -9.81))
    base = m.body("base", mass=5.0, inertia=(0.4, 0.5, 0.6))
    m.free("root", m.ground, base, rotation="euler_parameters")
    for arm in range(3):
        last: Any = base.at(0.2 * arm, 0.1, 0, rpy=(0, 0, 2.0 * arm))
        for k in range(n // 3):
            link = m.body(f"a{arm}_{k}", mass=1.0, com=(0.1, 0, 0.02), inertia=(0.01, 0.02, 0.03))
            if k == 1:
                m.spherical(f"j{arm}_{k}", last, link, rotation="euler_parameters")
            else:
                m.revolute(f"j{arm}_{k}", last, link, axis="xyz"[k % 3])
            last = link.at(0.3, 0, 0)
    return m


def touching(n: int) -> eg.Model:
    """A hanging chain whose links are discs that meet each other and the floor."""
    m = planar_chain(n)
    discs = {"shape": "circle", "on": [m.bodies[f"b{k}"] for k in range(n)], "radius": 0.2}
    law = {"stiffness": 300.0, "dissipation": "0.2*m", "friction": 0.3, "smoothing": 0.1}
    m.contacts("floor", discs, {"shape": "half_plane", "on": m.ground.at(0, -0.4, 0)}, law)
    m.contacts("among", discs, law=law)
    return m


MODELS: dict[str, Callable[[int], eg.Model]] = {
    "planar": planar_chain,
    "numbers": numbers_chain,
    "slides": slides,
    "afloat": afloat,
    "touching": touching,
}


@pytest.mark.parametrize("name", MODELS)
def test_loops_and_straight_line_text_give_the_same(
    name: str, libraries: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(c_rolled, "ALIKE", 0)
    equations = MODELS[name](18).derive("recursive")
    program = pipeline.build(equations, "c", [k for k in KERNELS if k != "input_jacobian" or name == "numbers"])
    texts, found = [], []
    metadata = program.metadata
    p = [0.7 if value is None else value for value in (x.value for x in equations.kinematics.mechanism.parameters)]
    for rolled in (0, NEVER):
        sources = emit_c(limited(program, rolled), "double", lanes=False)
        texts.append(sources[f"{program.name}.c"])
        folder = tmp_path / str(rolled)
        folder.mkdir()
        found.append(libraries.Library(libraries.compile_library(sources, folder, "-O0"), p, [0.4] * metadata["n_u"]))
    assert "for (int m = first; m < last; m++)" in texts[0]
    assert "for (int m = first; m < last; m++)" not in texts[1]
    random = np.random.default_rng(3)
    for kernel, entry in found[0].entries.items():
        for _ in range(3):
            x = random.uniform(-1.0, 1.0, entry.n_in)
            a, b = (library.fine(kernel, x, 0.3) for library in found)
            np.testing.assert_allclose(a, b, rtol=0, atol=1e-12 * np.abs(b).max(initial=1.0), err_msg=kernel)
    far = random.uniform(-1.0, 1.0, found[0].entries["rhs"].n_in)
    far[: metadata["n_q"]] *= 1e7  # angles that need an exact reduction
    a, b = (library.fine("rhs", far) for library in found)
    np.testing.assert_allclose(a, b, rtol=0, atol=1e-12 * np.abs(b).max())


def test_loops_equal_the_evaluator_and_lanes_have_their_bits(libraries: Any, tmp_path: Path) -> None:
    equations = numbers_chain(40).derive("recursive")
    program = limited(pipeline.build(equations, "c", ["rhs"]), 0)
    library = libraries.Library(
        libraries.compile_library(emit_c(program), tmp_path, "-UEOMGEN_LANES", "-Wno-psabi"), [], [0.4]
    )
    module = equations.compile("numpy", ["rhs"])
    x = np.random.default_rng(5).uniform(-1.0, 1.0, (80, 4))
    expected = module.rhs(0.2, x)
    got = np.stack([library.fine("rhs", column, 0.2) for column in x.T], axis=1)
    np.testing.assert_allclose(got, expected, rtol=0, atol=1e-12 * np.abs(expected).max())
    widths = [width for width in library.lanes if width <= 4]
    assert widths
    for width in widths:
        given = np.full((1, width), 0.2), x[:, :width], np.full((1, width), 0.4), np.zeros((0, width))
        status, out = library.side_by_side(width, "rhs", *given)
        assert not status.any()
        np.testing.assert_array_equal(out, got[:, :width])


@pytest.mark.parametrize("planar", [False, True])
@pytest.mark.parametrize("seed", seeds(4, 2))
def test_random_big_trees_equal_pinocchio(
    seed: int, planar: bool, libraries: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(c_rolled, "ALIKE", 0)
    kinds = ("revolute",) if planar else tuple(STEPS) if seed == 3 else ("revolute", "prismatic")
    made = random_mechanism(seed, bodies=60, planar=planar, forces=False, types=kinds)
    kinematics = analyse(made.mechanism)
    mobility = find_mobility(kinematics)
    tree = METHODS["recursive"](kinematics)
    metadata = collect_metadata(kinematics, mobility, tree)
    terms = collect_terms(kinematics, mobility, tree, in_c=True)
    program = build_program(terms, metadata, kernels=["rhs", "inverse_dynamics"], limits=Limits(rolled=0))
    sources = emit_c(program, lanes=False)
    assert "for (int m = first; m < last; m++)" in sources[f"{program.name}.c"]
    p = [x.value for x in made.mechanism.parameters]
    library = libraries.Library(libraries.compile_library(sources, tmp_path), p, [0.0] * len(terms.u))
    model, _ = pinocchio_model(made, [b.body for b in kinematics.topology.branches])
    data, n = model.createData(), model.nv
    q, v = np.random.default_rng(seed).uniform(-1, 1, (2, n))
    expected = pin.aba(model, data, q, v, np.zeros(n))
    mass = pin.crba(model, data, q)
    condition = np.linalg.cond(np.triu(mass) + np.triu(mass, 1).T)
    got = library.fine("rhs", np.concatenate([q, v]))[n:]
    assert np.abs(got - expected).max() <= 1e-12 * max(1.0, condition / 1e3) * np.abs(expected).max()
    forces = pin.rnea(model, data, q, v, v)
    found = library.fine("inverse_dynamics", np.concatenate([q, v, v]))
    assert np.abs(found - forces).max() <= 1e-12 * np.abs(forces).max()


def test_a_mass_that_is_not_positive_is_refused_in_loops(libraries: Any, tmp_path: Path) -> None:
    equations = planar_chain(40).derive("recursive")
    program = limited(pipeline.build(equations, "c", ["rhs"]), 0)
    library = libraries.Library(libraries.compile_library(emit_c(program, lanes=False), tmp_path), [9.81, -0.7, 0.3])
    status, _ = library("rhs", np.linspace(-1, 1, 80))
    assert status == 2


def test_text_grows_much_less_than_the_tree() -> None:
    def size(n: int) -> int:
        program = pipeline.build(numbers_chain(n).derive("recursive"), "c", ["rhs"])
        assert program.is_rolled("rhs")
        (printed,) = [p for b in program.blocks if (p := c_rolled.print_rolled(program, b))]
        return len(printed.text)

    small, big = size(80), size(160)
    assert big < 1.35 * small


def test_few_alike_segments_stay_straight_line() -> None:
    program = pipeline.build(numbers_chain(3).derive("recursive"), "c", ["rhs"])
    assert not program.is_rolled("rhs")
    assert c_rolled.print_rolled(program, program.blocks[0]) is None
