"""A new type of joint, force or constraint is one place: a class, and a row of its table.

Everything else follows: the method of Model, the keys of model files, their check, the schema, all methods of
derivation and targets.  The rows stand in a test instead of eomgen's own files; each is judged by a closed form.
"""

from __future__ import annotations

import importlib
import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import ClassVar

import numpy as np
import pytest
from jsonschema import Draft202012Validator
from scipy.special import ellipk

import eomgen as eg
from eomgen.constraints import CONSTRAINTS, Condition, Constraint
from eomgen.constraints.constraint import ConstraintView as Motion
from eomgen.describe import model_schema
from eomgen.describe.yaml_nodes import Document
from eomgen.elements.element_type import ElementType
from eomgen.elements.entry import Entry
from eomgen.elements.field import Field, Fields
from eomgen.equations import METHODS
from eomgen.forces import FORCES, Force, Load, View
from eomgen.forces import Path as Way
from eomgen.forces.paths import BETWEEN
from eomgen.forces.routes import read_path
from eomgen.graph import vectors as vec
from eomgen.graph.core import Expr, Graph, cos, sin
from eomgen.graph.vectors import Mat3, Vec3
from eomgen.joints import JOINTS, Closure, Coordinate, Joint
from eomgen.records import dataclass


@dataclass(frozen=True)
class HardeningSpring(Force):
    """Force -k s - k3 s^3 of the distance s."""

    path: Way
    stiffness: Expr
    hardening: Expr

    def loads(self, view: View) -> list[Load]:
        s, _ = self.path.measure(view)
        return self.path.loads(view, -self.stiffness * s - self.hardening * s * s * s)

    def potential(self, view: View) -> Expr | None:
        s, _ = self.path.measure(view)
        return 0.5 * self.stiffness * s * s + 0.25 * self.hardening * (s * s) * (s * s)


def read_spring(e: Entry) -> HardeningSpring | None:
    path, stiffness, hardening = read_path(e), e.positive("stiffness"), e.law("hardening")
    return None if path is None else HardeningSpring(e.name, path, stiffness, hardening)


@dataclass(frozen=True)
class Arc(Joint):
    """S slides on a circle of radius ``radius`` about z of P, without turning.  Allows 1, removes 5."""

    type_name: ClassVar[str] = "arc"
    role: ClassVar[str] = "tree"
    has_axis: ClassVar[bool] = False
    coordinates: ClassVar[tuple[Coordinate, ...]] = (Coordinate("", "angle"),)
    options: ClassVar[Fields] = {
        "radius": Field("expression", "radius (m)", required=True, not_zero="a circle without radius is a weld")
    }
    radius: Expr

    def pose(self, graph: Graph, q: Sequence[Expr]) -> tuple[Mat3, Vec3]:
        return vec.identity(graph), (self.radius * sin(q[0]), -self.radius * cos(q[0]), graph.zero)

    def subspace(self, graph: Graph, q: Sequence[Expr]) -> list[tuple[Vec3, Vec3]]:
        return [(vec.zero(graph), (self.radius * cos(q[0]), self.radius * sin(q[0]), graph.zero))]

    def closure(self, graph: Graph, rotation: Mat3, position: Vec3) -> list[Closure]:
        raise TypeError("an arc cannot be cut")

    def measure(self, graph: Graph, rotation: Mat3, position: Vec3) -> list[Expr]:
        raise TypeError("an arc cannot be cut")


@dataclass(frozen=True)
class Tackle(Constraint):
    """A rope over a fixed and a loose pulley: a + 2 b = length."""

    type_name: ClassVar[str] = "tackle"
    a: Expr
    b: Expr
    length: Expr

    def conditions(self, view: Motion) -> list[Condition]:
        return [Condition("rope", self.a + 2.0 * self.b - self.length, "length")]


def read_tackle(e: Entry) -> Tackle | None:
    pair, length = e.two_coordinates("joints", "length"), e.positive("length")
    return None if pair is None else Tackle(e.name, e.symbol(pair[0]), e.symbol(pair[1]), length)


@pytest.fixture(autouse=True)
def rows() -> Iterator[None]:
    keys: Fields = {
        "between": BETWEEN._replace(required=True),
        "stiffness": Field("expression", "stiffness (N/m)", required=True),
        "hardening": Field("expression", "stiffness per squared length (N/m^3)", default=0),
    }
    FORCES["hardening_spring"] = ElementType("hardening_spring", "a spring that hardens.", keys, read_spring)
    JOINTS["arc"] = Arc
    rope: Fields = {
        "joints": Field("joints", "two joints that slide", required=True),
        "length": Field("expression", "length of the rope (m)", required=True),
    }
    CONSTRAINTS["tackle"] = ElementType("tackle", "a rope over a fixed and a loose pulley.", rope, read_tackle)
    yield
    del FORCES["hardening_spring"], JOINTS["arc"], CONSTRAINTS["tackle"]


def duffing() -> eg.Model:
    m = eg.Model("duffing")
    block = m.body("block", mass=0.5)
    m.prismatic("J", m.ground, block, axis="x", coordinate="x")
    m.hardening_spring("S", m.ground, block, stiffness=8.0, hardening="k3")
    m.parameter("k3", 30.0)
    m.initial(x=0.6)
    return m


def test_a_force_of_ones_own_by_method_file_and_schema(tmp_path: Path) -> None:
    """Duffing's period 4 K(m) / omega, omega^2 = (k + k3 A^2) / M, m = k3 A^2 / 2 / (k + k3 A^2)."""
    A, k, k3, mass = 0.6, 8.0, 30.0, 0.5
    stiff = k + k3 * A**2
    period = 4.0 * ellipk(k3 * A**2 / 2.0 / stiff) / np.sqrt(stiff / mass)
    m = duffing()
    (tmp_path / "m.yaml").write_text(m.to_yaml(), encoding="utf-8")
    assert list(Draft202012Validator(model_schema()).iter_errors(Document(m.to_yaml(), "m.yaml").value)) == []
    for model in (m, eg.load(tmp_path / "m.yaml")):
        for target in ("cython", "numpy"):
            run = model.compile(target=target).simulate(
                1.1 * period, events={"back": {"expression": "x_dot", "direction": -1}}, rtol=1e-10, atol=1e-12
            )
            assert run.t_events["back"][-1] == pytest.approx(period, rel=1e-8)
    for method in METHODS:
        accelerated = m.compile(target="numpy", method=method).rhs(0.0, np.array([0.6, 0.0]))[1]
        assert accelerated == pytest.approx(-(k * A + k3 * A**3) / mass, rel=1e-12)


def test_a_joint_of_ones_own() -> None:
    """A pendulum that does not turn: theta'' = -g / r sin theta, whatever the inertia."""
    m = eg.Model("swing", gravity=(0, -9.81, 0))
    handle = m.arc("S", m.ground, m.body("b", mass=2.0, inertia={"zz": 5.0}), radius=0.7)
    assert handle.coordinate_names == ("S",)
    found = m.compile(target="numpy").rhs(0.0, np.array([0.9, 0.3]))
    assert found == pytest.approx([0.3, -9.81 / 0.7 * np.sin(0.9)], rel=1e-13)
    with pytest.raises(eg.ModelError, match="a circle without radius is a weld"):
        m2 = eg.Model("bad")
        m2.arc("S", m2.ground, m2.body("b", mass=1.0), radius=0)
        m2.check()


def test_a_constraint_of_ones_own() -> None:
    """Atwood's machine with a loose pulley: a'' = (m1 - m2 / 2) g / (m1 + m2 / 4) downwards."""
    m1, m2, g = 1.0, 3.0, 9.81
    m = eg.Model("tackles", gravity=(g, 0, 0))
    for name, mass in (("a", m1), ("b", m2)):
        m.prismatic(name, m.ground, m.body(f"w{name}", mass=mass), axis="x")
    m.tackle("rope", "a", "b", length=3.0)
    m.initial(a=1.0)
    found = m.compile(target="numpy").rhs(0.0, np.array([1.0, 1.0, 0.0, 0.0]))
    down = (m1 - m2 / 2.0) * g / (m1 + m2 / 4.0)
    assert found == pytest.approx([0.0, 0.0, down, -down / 2.0], rel=1e-12)


def test_their_faults_are_told_like_eomgens_own() -> None:
    m = duffing()
    m.hardening_spring("T", m.ground, "blok", stiffness=-1.0)
    m.tackle("rope", "J", "nowhere", length=1.0)
    with pytest.raises(eg.ModelError) as caught:
        m.check()
    text = str(caught.value)
    for words in (
        "forces.T.stiffness: is -1",
        "did you mean 'block'",
        "constraints.rope.joints[1]: no joint 'nowhere'",
    ):
        assert words in text
    with pytest.raises(eg.UsageError, match="no argument 'stifness'.*did you mean 'stiffness'"):
        m.hardening_spring("U", m.ground, "block", stifness=1.0)
    with pytest.raises(TypeError, match=r"hardening_spring\(\) missing a required argument: 'stiffness'"):
        m.hardening_spring("U", m.ground, "block")


def test_the_page_on_contributing_runs_as_it_stands(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Its force in a file of one's own: F = k s + k3 s^3 of the distance 1.4."""
    text = (Path(__file__).parents[2] / "CONTRIBUTING.md").read_text(encoding="utf-8")
    block = next(part for part in re.findall(r"```python\n(.*?)```", text, re.DOTALL) if "HardeningSpring" in part)
    (tmp_path / "hardening.py").write_text(f"from __future__ import annotations\n\n{block}")
    monkeypatch.syspath_prepend(tmp_path)
    for name, row in importlib.import_module("hardening").TYPES.items():
        monkeypatch.setitem(FORCES, name, row)
    m = eg.Model("duffing")
    m.prismatic("x", m.ground, m.body("mass", mass=2.0), axis="x")
    m.hardening_spring("k", m.ground.at(-1, 0, 0), "mass", stiffness=3.0, hardening=0.5)
    mod = m.compile(target="numpy")
    assert mod.rhs(0.0, [0.4, 0.0])[1] == pytest.approx(-(3.0 * 1.4 + 0.5 * 1.4**3) / 2.0)
