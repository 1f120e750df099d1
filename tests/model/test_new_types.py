"""A force, a joint, a constraint and a kind of key that are added from outside, each by one class."""

from __future__ import annotations

import runpy
from collections.abc import Sequence
from importlib import import_module
from pathlib import Path
from pkgutil import iter_modules
from typing import Any, ClassVar

import numpy as np
import pytest

import eomgen as eg
from eomgen.base.value_rules import POSITIVE
from eomgen.elements.constraints import CONSTRAINTS
from eomgen.elements.constraints.constraint import Condition, Constraint, ConstraintView
from eomgen.elements.dimensions import LENGTH, NONE, STIFFNESS
from eomgen.elements.element_type import element, key
from eomgen.elements.forces import FORCES
from eomgen.elements.forces.force import View
from eomgen.elements.forces.paths import LINE, PathForce
from eomgen.elements.frames import Marker
from eomgen.elements.glyphs import COIL, CROSS, SPIRAL, Drawn, Glyph, JointLook, SymbolPart
from eomgen.elements.joints import JOINTS, Closure, Coordinate, Joint, Screw, joint
from eomgen.elements.kinds import MarkerReference, Scalar
from eomgen.expr import vectors as vec
from eomgen.expr.core import Expr, Graph
from eomgen.expr.vectors import Mat3, Vec3
from eomgen.model import model_schema


class Percent(Scalar):
    """A number of hundredths."""

    argument, annotation = "hundredths", "float"
    schema: ClassVar[dict[str, Any]] = {"type": "number", "minimum": 0}

    def read(self, reader: Any, path: str, value: Any, *_: Any) -> Any:
        return reader.graph.constant(reader.number(path, value, positive=True) or 1.0) / 100.0


class HardeningSpring(PathForce):
    """Force -f (k s + k3 s^3) of the distance s."""

    sentence: ClassVar[str] = "A spring that hardens by the third power of its length."
    formula: ClassVar[str] = r"F = -f (k s + k_3 s^3)"
    stiffness: Expr = key(Scalar("stiffness (N/m)", required=True, dimension=STIFFNESS, allowed=POSITIVE))
    hardening: Expr = key(Scalar("stiffness per squared length (N/m^3)", default=0))
    share: Expr = key(Percent("of both, what acts", default=100))

    def push(self, value: Expr, rate: Expr) -> Expr:
        return -self.share * (self.stiffness * value + self.hardening * value**3)

    def potential(self, view: View) -> Expr:
        s, _ = self.path.measure(view)
        return self.share * (0.5 * self.stiffness * s**2 + 0.25 * self.hardening * s**4)

    def glyphs(self) -> list[Glyph]:
        return [self.path.glyphs(COIL, SPIRAL)]


class Slanted(Joint):
    """S slides along z and, by ``slope``, along x of P.  Allows 1, removes 5."""

    sentence: ClassVar[str] = "S slides on a slope of P."
    formula: ClassVar[str] = r"\mathbf{u} = q (\mathbf{e}_{z} + m \mathbf{e}_{x})"
    look: ClassVar[JointLook] = JointLook((SymbolPart("box", (2.0, 2.0, 2.0)),))
    coordinates: ClassVar[tuple[Coordinate, ...]] = (Coordinate("", "length"),)
    slope: Expr = key(Scalar("x for each z", required=True, dimension=NONE))

    def _along(self, graph: Graph) -> Vec3:
        return (self.slope, graph.zero, graph.one)

    def pose(self, graph: Graph, q: Sequence[Expr]) -> tuple[Mat3, Vec3]:
        return vec.identity(graph), vec.scale(q[0], self._along(graph))

    def subspace(self, graph: Graph, q: Sequence[Expr]) -> list[tuple[Vec3, Vec3]]:
        return [(vec.zero(graph), self._along(graph))]

    def closure(self, graph: Graph, rotation: Mat3, position: Vec3) -> list[Closure]:
        raise TypeError("is not cut here")

    def measure(self, graph: Graph, rotation: Mat3, position: Vec3) -> list[Expr]:
        return [position[2]]


class Level(Constraint):
    """A marker stays at a height over ground."""

    sentence: ClassVar[str] = "The marker stays at the height $h$."
    formula: ClassVar[str] = r"z = h"
    marker: Marker = key(MarkerReference("marker that stays at the height", required=True))
    height: Expr = key(Scalar("height (m)", default=0, dimension=LENGTH))

    def glyphs(self) -> list[Glyph]:
        return [Drawn((self.marker,), about=CROSS)]

    def conditions(self, view: ConstraintView) -> list[Condition]:
        return [Condition("height", view.position(self.marker)[2] - self.height, "length")]


@pytest.fixture(autouse=True)
def added(monkeypatch: pytest.MonkeyPatch) -> None:
    spring = element(HardeningSpring, "hardening_spring", "a spring that hardens.", LINE)
    monkeypatch.setitem(FORCES, "hardening_spring", spring)
    monkeypatch.setitem(JOINTS, "slanted", joint(Slanted))
    monkeypatch.setitem(CONSTRAINTS, "level", element(Level, "level", "a marker that stays at a height."))


def sprung() -> eg.Model:
    m = eg.Model("sprung")
    block = m.body("block", mass=2.0)
    m.prismatic("s", m.ground, block, axis="x")
    m.hardening_spring("k", m.ground, block, stiffness="k", hardening=3.0, share=50)
    m.parameter("k", 5.0, unit="N/m")
    m.initial(s=0.7)
    return m


def slanting() -> eg.Model:
    m = eg.Model("slope", gravity=(0, 0, -10))
    m.slanted("s", m.ground, m.body("block", mass=1.0), slope="2*h")
    m.parameter("h", 0.5)
    return m


def leveled() -> eg.Model:
    m = eg.Model("level")
    block = m.body("block", mass=1.0, inertia=(1, 1, 1))
    m.translational("t", m.ground, block)
    m.level("flat", block, height=0.25)
    return m


STUBS = {
    "hardening_spring": "a: Any, b: Any, stiffness: Value, hardening: Value = 0, share: float = 100",
    "slanted": "predecessor: Any, successor: Any, slope: Value",
    "level": "marker: Any, height: Value = 0)",
}


@pytest.mark.parametrize(
    ("model", "section", "entry", "kind", "measured", "doc", "sentence"),
    [
        (sprung, "forces", "k", "hardening_spring", "stiffness", "stiffness (N/m)", "hardens by the third power"),
        (slanting, "joints", "s", "slanted", "slope", "x for each z", "S slides on a slope of P"),
        (leveled, "constraints", "flat", "level", "height", "height (m)", "The marker stays at the height"),
    ],
)
def test_all_follows_from_the_class(
    model: Any, section: str, entry: str, kind: str, measured: str, doc: str, sentence: str, tmp_path: Path
) -> None:
    m = model()
    method = getattr(m, kind)
    assert f"{measured} : scalar" in method.__doc__
    assert doc.lower() in method.__doc__.lower()
    m.save(tmp_path / "m.yaml")
    assert f"{entry}: {{type: {kind}, " in m.to_yaml() == eg.load(tmp_path / "m.yaml").to_yaml()
    types = model_schema()["properties"][section]["additionalProperties"]["oneOf"]
    (schema,) = (one["properties"] for one in types if one["properties"]["type"] == {"const": kind})
    assert schema[measured]["description"] == doc
    stub = runpy.run_path(str(Path(__file__).parents[2] / "tools" / "stubs.py"))["element_stub"]()
    assert f"def {kind}(self, name: str, {STUBS[kind]}" in " ".join(stub.split())
    picture = m.compile(target="numpy").metadata["picture"]
    seen = [one for one in (*picture["joints"], *picture["elements"]) if one["name"] == entry]
    assert seen[0].get("pieces") or seen[0].get("along") or seen[0].get("about")
    assert sentence in m.derive().explain().markdown
    m.parameter("wide", 1.0, unit="m**2")
    m.description.sections[section][-1].values[measured] = "wide"
    with pytest.raises(eg.ModelError) as error:
        m.check()
    assert (f"{section}.{entry}.{measured}", "EG-DIMENSION") in [(x.path, x.code) for x in error.value.problems]


def test_a_force_acts_by_its_law() -> None:
    mod = sprung().compile(target="numpy")
    s = 0.7
    np.testing.assert_allclose(mod.rhs(0.0, [s, 0.0]), [0.0, -0.5 * (5.0 * s + 3.0 * s**3) / 2.0], rtol=1e-14)
    np.testing.assert_allclose(mod.energy([s, 0.0])[1], 0.5 * (2.5 * s**2 + 0.75 * s**4), rtol=1e-14)


def test_its_kind_of_key_is_described_everywhere() -> None:
    m = sprung()
    text = m.to_yaml()
    assert "k: {type: hardening_spring, between: [ground, block], stiffness: k, hardening: 3.0, share: 50}" in text
    assert "share : hundredths, optional" in m.hardening_spring.__doc__
    found = next(
        one for one in model_schema()["properties"]["forces"]["additionalProperties"]["oneOf"]
        if one["properties"]["type"] == {"const": "hardening_spring"}
    )  # fmt: skip
    assert found["properties"]["share"] == {
        "type": "number", "minimum": 0, "default": 100, "description": "of both, what acts",
    }  # fmt: skip
    assert found["required"] == ["type", "between", "stiffness"]


@pytest.mark.parametrize(
    ("keys", "code", "path"),
    [
        ({"stiffness": "k*a"}, "EG-DIMENSION", "forces.k.stiffness"),
        ({"stiffness": -1.0}, "EG-RANGE", "forces.k.stiffness"),
        ({"stiffness": 1.0, "share": "much"}, "EG-REFERENCE", "forces.k.share"),
    ],
)
def test_its_keys_are_judged_by_their_kinds(keys: dict[str, Any], code: str, path: str) -> None:
    m = sprung()
    m.parameter("a", 1.0, unit="m")
    m.parameter("much", 1.0)
    m.description.sections["forces"][0].values.update(keys)
    with pytest.raises(eg.ModelError) as error:
        m.check()
    assert (path, code) in [(problem.path, problem.code) for problem in error.value.problems]


def test_a_joint_moves_as_it_says() -> None:
    mod = slanting().compile(target="numpy")
    np.testing.assert_allclose(mod.rhs(0.0, [0.0, 0.0])[1], -5.0, rtol=1e-14)  # g / (1 + slope^2)
    assert type("Finer", (Screw,), {}).coordinates == Screw.coordinates


def test_a_constraint_holds_what_it_says() -> None:
    mod = leveled().compile(target="numpy")
    x = mod.x0()
    np.testing.assert_allclose(x[2], 0.25, atol=1e-12)
    assert mod.rhs(0.0, x)[5] == pytest.approx(0.0, abs=1e-12)


def test_keys_called_as_their_type_are_arguments_of_that_name() -> None:
    m = eg.Model("two")
    assert "rack : handle" in m.rack.__doc__
    assert "cam : handle" in m.cam.__doc__
    assert "value : scalar" in m.sampled.__doc__


def test_tables_name_the_types_of_their_files_and_what_was_added() -> None:
    for table, new, *packages in (
        (FORCES, "hardening_spring", "elements.forces", "contact"),
        (CONSTRAINTS, "level", "elements.constraints"),
    ):
        homes = [import_module(f"eomgen.{package}") for package in packages]
        files = [
            import_module(f"{home.__name__}.{file.name}") for home in homes for file in iter_modules(home.__path__)
        ]
        assert {*table} == {new, *(name for file in files for name in getattr(file, "TYPES", ()))}
        assert len(table | {"other": None}) == len({"other": None} | table) == len(table) + 1
