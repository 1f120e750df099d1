"""Methods of Model made from the tables: places of arguments, what is left out, what is refused at the call."""

from __future__ import annotations

import inspect
import pickle
from copy import deepcopy
from typing import Any

import pytest

import eomgen as eg
from eomgen.constraints import CONSTRAINTS
from eomgen.elements.element_type import ElementType
from eomgen.elements.field import Field
from eomgen.errors import ModelError, UsageError
from eomgen.forces import FORCES
from eomgen.joints import JOINTS


def parts() -> tuple[eg.Model, Any, Any, Any, Any]:
    m = eg.Model("m")
    a, b = m.body("a", mass=1.0), m.body("b", mass=1.0)
    return m, a, b, m.revolute("J", m.ground, a), m.prismatic("S", m.ground, b)


def last(m: eg.Model, section: str = "forces") -> dict[str, Any]:
    return dict(m.description.sections[section][-1].values)


#: Arguments after the name that people give by place.
ORDERS = {
    "revolute": "predecessor successor axis coordinate",
    "screw": "predecessor successor pitch axis coordinate",
    "cylindrical": "predecessor successor axis coordinates",
    "spherical": "predecessor successor sequence coordinates rotation",
    "free": "predecessor successor sequence coordinates rotation",
    "curve_slider": "predecessor successor curve coordinate",
    "distance": "predecessor successor length",
    "force": "marker value axes",
    "torque": "on value axes",
    "spring": "a b stiffness length via",
    "damper": "a b damping via",
    "friction": "joint viscous coulomb static stribeck smoothing",
    "stop": "joint stiffness lower upper exponent dissipation restitution velocity formula",
    "sphere_plane": "a b radius stiffness exponent",
    "bushing": "a b stiffness damping",
    "point_gravity": "center body mu extent",
    "muscle": "a b activation force_max fiber_length slack_length velocity_max pennation damping via",
    "coupling": "coordinates offset equation",
    "gear": "a b radii teeth cones internal phase",
    "rolling": "wheel plane radius shape tube no_spin",
    "driver": "coordinate value between angle marker axis on",
}


@pytest.mark.parametrize("name", ORDERS)
def test_arguments_keep_their_places(name: str) -> None:
    names = [key for key in inspect.signature(getattr(eg.Model, name)).parameters if key not in ("self", "name")]
    wanted = ORDERS[name].split()
    assert [key for key in names if key in wanted] == wanted


def test_what_a_force_acts_on_and_its_value() -> None:
    m, a, b, J, S = parts()
    for given in (lambda: m.actuator("u1", J, 5), lambda: m.actuator("u2", 5, joint=J), lambda: m.actuator(
        "u3", joint=J, value=5), lambda: m.actuator("u4", "J", value=5)):  # fmt: skip
        given()
        assert last(m) == {"type": "actuator", "joint": "J", "value": 5}
    m.actuator("u5", a, b, "2*t")
    assert last(m) == {"type": "actuator", "between": ["a", "b"], "value": "2*t"}
    m.torsional_spring("s1", a, b, 7)
    assert last(m) == {"type": "torsional_spring", "between": ["a", "b"], "stiffness": 7}
    wrong = (lambda: m.torsional_spring("s2", a, b), lambda: m.torsional_spring("s3", J), lambda: m.actuator("u6", S))
    for call in wrong:
        with pytest.raises(TypeError, match="missing a required argument: '(stiffness|value)'"):
            call()
    m.torque("t1", a, (0, 0, 1))
    assert last(m)["body"] == "a"
    m.torque("t2", "a", (0, 0, 1))
    assert last(m)["body"] == "a"
    m.torque("t3", J.coordinate, 1)
    assert "joint" in last(m)


def test_ends_that_are_not_there_are_told_by_the_check() -> None:
    m, a, _, J, _ = parts()
    m.spring("s", a, None, 5)
    m.revolute("K", a, None)
    m.gear("g", J, None, teeth=(1, 2))
    with pytest.raises(ModelError) as caught:
        m.check()
    told = {p.path: p.message for p in caught.value.problems}
    assert told["forces.s.between[1]"] == told["joints.K.between[1]"] == "has no value"
    assert "constraints.g.joints[1]" in told


def test_numbers_that_hold_anyway_and_none_are_left_out() -> None:
    m, _, b, J, _ = parts()
    m.sphere_plane("c", m.ground, b, radius=1, stiffness=5, exponent=1.5, viscous_friction=0, formula=None)
    assert set(last(m)) == {"type", "between", "radius", "stiffness"}
    m.coupling("x", equation="J - t", offset=0)
    assert set(last(m, "constraints")) == {"type", "equation"}
    m.friction("f", J, viscous=0)  # a law all the same
    m.element("e", J, law=0)
    m.check()
    m.gear("g", J, J, teeth=(1, 2), internal=False)  # a word that is given is kept: it may contradict others
    assert last(m, "constraints")["internal"] is False


def test_every_method_takes_its_own_numbers_for_defaults() -> None:
    for types, section in ((FORCES, "forces"), (CONSTRAINTS, "constraints")):
        for name, found in types.items():
            shown = inspect.signature(getattr(eg.Model, name)).parameters
            for key, field in found.keys.items():
                if key in shown and shown[key].default not in (None, inspect.Parameter.empty):
                    assert shown[key].default == field.default, (section, name, key)


def test_what_is_refused() -> None:
    m, a, b, J, _ = parts()
    with pytest.raises(UsageError, match="is a joint; a body or a marker is expected"):
        m.point_gravity("p", m.ground, J, mu=1)
    with pytest.raises(UsageError, match="no argument 'self'"):
        m.spring(self=3)
    with pytest.raises(UsageError, match="belongs to the model"):
        eg.Model("other").spring("s", a, b, 1)
    m.revolute("K", a, b, "z", "phi", coordinates=["psi"])
    with pytest.raises(ModelError, match=r"joints\.K\.coordinates: coordinate is given too"):
        m.check()
    own = ElementType(
        "twins", "a pair.", {"between": Field("pair", "two", required=True), "a": Field("expression", "x")}
    )
    FORCES["twins"] = own
    try:
        with pytest.raises(UsageError, match="type 'twins': two of its keys would be the argument 'a'"):
            m.twins("t", a, b)
    finally:
        del FORCES["twins"]


def test_methods_and_models_are_copied_and_kept() -> None:
    assert pickle.loads(pickle.dumps(eg.Model.spring)) is eg.Model.spring
    m, a, b, *_ = parts()
    m.spring("s", a, b, 5, via=(marker for marker in [m.ground]))
    for other in (deepcopy(m), pickle.loads(pickle.dumps(m))):
        assert other.to_yaml() == m.to_yaml()

    class Own(eg.Model):
        def spring(self, name: str, *given: Any, **keys: Any) -> None:
            super().spring(name, *given, stiffness=3, **keys)

    own = Own("own")
    own.spring("s", own.ground, own.body("x", mass=1))
    assert last(own)["stiffness"] == 3
    for name in (*FORCES, *CONSTRAINTS, *JOINTS):
        assert "Parameters" in (inspect.getdoc(getattr(eg.Model, name)) or "")
