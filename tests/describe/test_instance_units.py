"""Values of instances with units, ``{value: 500, unit: mm}``: converted, checked, told at their place."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import pytest

import eomgen as eg

TEXT = """
name: pair
parameters: {s: 0.3}
components:
  arm:
    attachments: [top]
    parameters: {l: {value: 0.5, unit: m}, w: {value: 10, unit: mm}, c: 1}
    inputs: {tau: {value: 1, unit: N*m}}
    bodies: {rod: {mass: 1, com: [0, -l/2, 0], inertia: {zz: 0.1}, markers: {end: [c*w, -l, 0]}}}
    joints: {hinge: {type: revolute, between: [top, rod], coordinate: q}}
    forces: {motor: {type: torque, joint: hinge, value: tau}}
add:
  a: {component: arm, at: ground, parameters: {GIVEN}, inputs: {INPUTS}}
"""
RIGHT: list[tuple[str, str, float]] = [  # what is given, the parameter and its value in SI units
    ("l: {value: 500, unit: mm}", "a_l", 0.5),
    ("l: {value: 2, unit: ft}", "a_l", 0.6096),
    ("l: {value: 100*pi, unit: cm}", "a_l", math.pi),
    ("l: {value: 0.25}", "a_l", 0.25),
    ("w: {value: 0.02, unit: m}", "a_w", 0.02),
    ("w: {value: 5}", "a_w", 0.005),
    ("w: 5", "a_w", 0.005),
    ("c: {value: 90, unit: deg}", "a_c", math.pi / 2),
]
WRONG = [  # what is given, the end of its place and the words
    ("l: {value: 500, unit: kg}", "parameters.l.unit", "does not measure what l is in: m"),
    ("l: {value: 500, unit: mmm}", "parameters.l.unit", "mmm"),
    ("l: {value: 500, unit: 3}", "parameters.l.unit", "is not a unit"),
    ("l: {value: 500, units: mm}", "parameters.l.units", "no key 'units'"),
    ("l: {unit: mm}", "parameters.l", "has no value"),
    ("l: {value: 2*s, unit: mm}", "parameters.l.unit", "is an expression"),
]


def loaded(folder: Path, given: str, inputs: str = "") -> Any:
    path = folder / "pair.yaml"
    path.write_text(TEXT.replace("GIVEN", given).replace("INPUTS", inputs), encoding="utf-8")
    return eg.load(path)


def arm() -> eg.Model:
    m = eg.Model("arm")
    length = m.parameter("l", 0.5, unit="m")
    m.parameter("w", 10, unit="mm")
    m.parameter("c", 1)
    tau = m.input("tau", 1, unit="N*m")
    rod = m.body("rod", mass=1, com=(0, -length / 2, 0), inertia={"zz": 0.1})
    rod.marker("end", at=("c*w", "-l", 0))
    m.torque("motor", m.revolute("hinge", m.attachment("top"), rod, coordinate="q"), tau)
    return m


@pytest.mark.parametrize(("given", "name", "value"), RIGHT)
def test_values_are_converted(given: str, name: str, value: float, tmp_path: Path) -> None:
    mod = loaded(tmp_path, given).compile(target="numpy")
    assert dict(zip(mod.p_names, mod.p, strict=True))[name] == pytest.approx(value, rel=1e-15)


@pytest.mark.parametrize(("given", "place", "said"), WRONG)
def test_what_is_wrong_is_told_at_its_place(given: str, place: str, said: str, tmp_path: Path) -> None:
    with pytest.raises(eg.ModelError) as told:
        loaded(tmp_path, given).check()
    assert f"add.a.{place}: " in str(told.value)
    assert said in str(told.value)


def test_expressions_of_the_model_and_inputs(tmp_path: Path) -> None:
    mod = loaded(tmp_path, "l: {value: 2*s, unit: m}", "tau: {value: 300, unit: N*mm}").compile(target="numpy")
    assert mod.p_names == ("s", "a_w", "a_c")
    assert mod.u_names == ("a_tau",)
    assert mod.u.tolist() == [pytest.approx(0.3, rel=1e-15)]
    end = mod.bind(p={"s": 0.4}).simulate(0.01).position("a.rod.end")[:, 0]
    assert end[1] == pytest.approx(-0.8)


def test_the_same_in_python() -> None:
    for given in (
        {"l": {"value": 500, "unit": "mm"}, "tau": {"value": 0.2, "unit": "kN*m"}},
        {"parameters": {"l": {"value": 500, "unit": "mm"}}, "inputs": {"tau": {"value": 0.2, "unit": "kN*m"}}},
    ):
        m = eg.Model("pair")
        m.add(arm(), prefix="a_", at=m.ground, **given)
        mod = m.compile(target="numpy")
        assert mod.p.tolist() == [0.5, 0.01, 1.0]
        assert mod.u.tolist() == [200.0]


def test_slips_in_python() -> None:
    m = eg.Model("pair")
    with pytest.raises(eg.UsageError, match="l given twice"):
        m.add(arm(), "a_", m.ground, parameters={"l": 0.3}, l=0.4)
    with pytest.raises(eg.UsageError, match="parameters must be a mapping"):
        m.add(arm(), "a_", m.ground, parameters=[0.3])
    with pytest.raises(eg.UsageError, match="does not measure what l is in"):
        m.add(arm(), "a_", m.ground, l={"value": 1, "unit": "s"})
