"""Stretches of statements that repeat themselves: found where they are, worth a loop, and loops equal to text."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from sweeps import part_of

import eomgen as eg
from eomgen import pipeline
from eomgen.emit import c_rolled, emit_c
from eomgen.emit.repeats import WORTH, find_repeats

NEVER = 10**9
HEAD = "for (int m = first; m < last; m++)"


def test_a_repeat_is_found_with_its_shortest_period() -> None:
    assert find_repeats("xyz" + "abcd" * 40 + "w", 20) == [(3, 4, 40)]


def test_an_outer_repeat_is_preferred_to_the_inner_ones() -> None:
    body = "ab" * 35 + "cd"
    assert find_repeats(body * 10, 100) == [(0, len(body), 10)]


def test_inner_repeats_remain_where_bodies_differ() -> None:
    text = "".join("ab" * (40 + k) + "cde"[k % 3] for k in range(4))
    found = find_repeats(text, 30)
    assert [count for _, _, count in found] == [40, 41, 42, 43]
    assert {period for _, period, _ in found} == {2}


def test_short_repeats_are_left_alone() -> None:
    short = "ab" * (WORTH // 2)
    assert find_repeats(short, 10) == []
    assert find_repeats(short + "abab", 10) == [(0, 2, WORTH // 2 + 2)]
    assert find_repeats("", 10) == []
    assert find_repeats("a", 10) == []


@pytest.mark.parametrize("seed", range(5))
def test_what_is_found_repeats_itself_and_does_not_overlap(seed: int) -> None:
    random = np.random.default_rng(seed)
    pieces = ["".join(random.choice(list("abc"), random.integers(1, 12))) * random.integers(1, 40) for _ in range(30)]
    text = "".join(pieces)
    done = 0
    found = find_repeats(text, 40)
    assert found
    for start, period, count in found:
        assert start >= done
        done = start + period * count
        assert text[start:done] == text[start : start + period] * count
        assert count >= 3
        assert period * (count - 1) >= WORTH
    assert done <= len(text)


def closed_chain(n: int, spatial: bool) -> eg.Model:
    """A pendulum of n links whose end is held."""
    m = eg.Model("closed", gravity=(0, "-g", 0))
    m.parameter("g", 9.81)
    m.input("tau", 0.3)
    last: Any = m.ground
    for i in range(n):
        link = m.body(f"b{i}", mass=1.0 + 0.01 * i, com=(0.05, 0, 0), inertia=(1e-3, 1.2e-3, 1.5e-3))
        m.revolute(f"j{i}", last, link, axis="y" if spatial and i % 3 == 1 else "z")
        m.guess(**{f"j{i}": 0.0 if spatial and i % 3 == 1 else 2 * np.pi / (n * (2 / 3 if spatial else 1) + 1)})
        last = link.at(0.1, 0, 0)
    m.torque("drive", "j0", "tau")
    (m.spherical if spatial else m.revolute)("end", last, m.ground.at(0.02, 0.02, 0))
    return m


def four_bars(n: int) -> eg.Model:
    """n parallelograms in a row."""
    m = eg.Model("bars", gravity=(0, "-g", 0))
    m.parameter("g", 9.81)
    m.input("tau", 0.3)
    rod: dict[str, Any] = {"mass": 1.0, "inertia": (0.01, 0.08, 0.08)}
    cranks = [m.body(f"crank{k}", com=(0, 0.5, 0), **rod) for k in range(n + 1)]
    for k, crank in enumerate(cranks):
        m.revolute(f"A{k}", m.ground.at(k, 0, 0), crank)
        m.guess(**{f"A{k}": 0.3})
    for k in range(n):
        coupler = m.body(f"coupler{k}", com=(0.5, 0, 0), **rod)
        m.revolute(f"B{k}", cranks[k].at(0, 1, 0), coupler)
        m.guess(**{f"B{k}": -0.3})
        m.revolute(f"C{k}", coupler.at(1, 0, 0), cranks[k + 1].at(0, 1, 0))
    m.torque("drive", "A0", "tau")
    return m


MODELS = {
    "planar": lambda: closed_chain(18, False),
    "spatial": lambda: closed_chain(15, True),
    "bars": lambda: four_bars(8),
}
KERNELS = ["rhs", "jacobian", "input_jacobian", "constraint_jacobian", "project", "inverse_dynamics_hessian_product"]


@pytest.mark.parametrize("name", part_of(MODELS, lambda name: name != "spatial"))
def test_loops_found_in_closed_mechanisms_give_the_bits_of_straight_text(
    name: str, libraries: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(c_rolled, "ALIKE", 0)
    equations = MODELS[name]().derive("recursive")
    program = pipeline.build(equations, "c", KERNELS)

    start = MODELS[name]().compile("recursive", target="numpy").x0()
    found, texts = [], []
    for label, change in (
        ("loops", {"rolled": 0, "repeated": 0, "repeated_dynamics": 0}),
        ("marks", {"rolled": 0, "repeated": NEVER, "repeated_dynamics": NEVER}),
        ("straight", {"rolled": NEVER, "rolled_of_long": NEVER}),
    ):
        limits = replace(program.limits, **change)
        sources = emit_c(replace(program, limits=limits), "double", lanes=False)
        folder = tmp_path / label
        folder.mkdir()
        texts.append(sources[f"{program.name}.c"])
        found.append(libraries.Library(libraries.compile_library(sources, folder, "-O0"), [9.81], [0.3]))
    assert texts[0].count(HEAD) > texts[1].count(HEAD) > 0 == texts[2].count(HEAD)
    random = np.random.default_rng(3)
    n = program.sizes.n_x
    for kernel in KERNELS:
        for far in (0.0, 1e-3):
            x = random.uniform(-1.0, 1.0, found[0].entries[kernel].n_in)
            state = start + far * random.uniform(-1.0, 1.0, n)
            x[: min(n, len(x))] = state[: min(n, len(x))]
            one, two, three = (library.fine(kernel, x, 0.3) for library in found)
            assert np.isfinite(three).all()
            np.testing.assert_array_equal(one, three, err_msg=kernel)
            np.testing.assert_array_equal(two, three, err_msg=kernel)


def test_what_another_loop_reads_inside_a_chain_is_stored(libraries: Any, tmp_path: Path) -> None:
    """Links hand values to the next in a variable; another chain that hangs on one of them reads them from memory."""
    m = eg.Model("branched", gravity=(0, -9.81, 0))
    links: list[Any] = []
    for name, n, mass, com in (("a", 30, 1.0, (0.05, 0, 0)), ("b", 30, 0.5, (0.05, 0.01, 0))):
        last: Any = links[10].at(0.1, 0, 0) if links else m.ground
        for k in range(n):
            link = m.body(f"{name}{k}", mass=mass, com=com, inertia=(1e-3, 1.2e-3, 1.5e-3))
            m.revolute(f"j{name}{k}", last, link)
            links.append(link)
            last = link.at(0.1, 2 * com[1], 0)
    program = pipeline.build(m.derive(), "c", ["rhs", "jacobian"])
    found = []
    for label, change in (("loops", {"rolled": 0, "repeated": 0, "repeated_dynamics": 0}), ("text", {"rolled": NEVER})):
        limits = replace(program.limits, rolled_of_long=NEVER, **change)
        folder = tmp_path / label
        folder.mkdir()
        sources = emit_c(replace(program, limits=limits), "double", lanes=False)
        assert (HEAD in sources["branched.c"]) == (label == "loops")
        found.append(libraries.Library(libraries.compile_library(sources, folder, "-O0"), [], []))
    x = np.random.default_rng(0).uniform(-1.0, 1.0, 120)
    for kernel in ("rhs", "jacobian"):
        loops, text = (library.fine(kernel, x, 0.3) for library in found)
        np.testing.assert_allclose(loops, text, rtol=0, atol=1e-12 * np.abs(text).max(), err_msg=kernel)
