"""Arguments and numbers that cannot be: a named error that says what is allowed, however they are given."""

import inspect
import pickle
from collections.abc import Callable, Iterator
from copy import deepcopy
from pathlib import Path
from typing import Any

import command
import numpy as np
import pytest
from model_files import described, faults, load
from refusals import refused, refuses
from sympy import symbols
from sympy.physics.mechanics import LagrangesMethod, dynamicsymbols

import eomgen as eg

WRONG: tuple[Any, ...] = (
    None, 3, "x", "", [], {}, object(), float("nan"), b"x", [[["x"], {"a": [None]}]], {1}, {3: None}, int, True, 1j,
    np.zeros((2, 2)), [None],
)  # fmt: skip
#: What an argument is given as while another of the same call is wrong.
RIGHT: dict[str, Any] = {
    "name": "z", "first": "a", "second": "b", "predecessor": "ground", "successor": "b", "body": "b", "joint": "ja",
    "value": 1.0, "expression": "qa", "at": (0, 0, 0), "x": [0, 1, 2, 3], "y": [0, 1, 2, 3], "source": "f.c",
    "rate": "-z", "terms": {"qa": 1, "qb": -1}, "ratio": 2,
}  # fmt: skip
#: Not of the builder, or makers of whole models, which have cases of their own.
OTHERS = ("from_lagrangian", "from_equations", "from_sympy", "from_description", "check", "derive", "compile", "draw",
          "mechanism", "to_yaml", "save")  # fmt: skip
#: Of these the arguments are tried always, of all others by ``make thorough``.
SOME = ("body", "parameter", "output", "state", "table", "native", "event", "add", "revolute", "free", "spring",
        "torque", "friction", "coupling", "rolling", "driver")  # fmt: skip
METHODS = [n for n in dir(eg.Model) if n[0] != "_" and n not in OTHERS and callable(getattr(eg.Model, n))]
MAKERS: dict[str, tuple[Callable[..., eg.Model], dict[str, Any]]] = {
    "from_lagrangian": (eg.Model.from_lagrangian, {"name": "m", "L": "q_dot**2/2 - q**2", "coordinates": ["q"]}),
    "from_equations": (
        eg.Model.from_equations,
        {"name": "m", "coordinates": ["q"], "velocities": ["v"], "rates": {"q": "v"}, "mass_matrix": [["1"]],
         "forcing": ["0"], "intermediates": None, "constraints": (), "multipliers": (), "kinetic_energy": None,
         "potential_energy": None, "parameters": None, "inputs": None, "latex": None},
    ),
}  # fmt: skip


def base() -> eg.Model:
    m = eg.Model("m", gravity=(0, -9.81, 0))
    m.parameter("k", 1.0)
    m.revolute("ja", m.ground, m.body("a", mass=1, com=(0.1, 0, 0), inertia={"zz": 0.1}), coordinate="qa")
    m.prismatic("jb", m.ground, m.body("b", mass=1, inertia=(0.1, 0.1, 0.1)), coordinate="qb")
    m.spring("s", "a", "b", stiffness=1.0, length=0.1)
    return m


def arguments(of: Any) -> list[inspect.Parameter]:
    every = inspect.signature(of).parameters.values()
    return [p for p in every if p.kind not in (p.VAR_POSITIONAL, p.VAR_KEYWORD) and p.name != "self"]


def refused_or_taken(call: Callable[[], Any], what: str) -> None:
    """What Python says of a missing argument, and a file that is not there, are no fault of a type."""
    try:
        call()
    except (eg.EomgenError, FileNotFoundError) as error:
        assert str(error)
    except TypeError as error:
        assert "missing" in str(error), f"{what}: {error}"


def each(parameters: list[inspect.Parameter]) -> Iterator[tuple[str, dict[str, Any], list[Any]]]:
    """Keywords and places of a call for every argument and every wrong value."""
    required = {p.name: RIGHT[p.name] for p in parameters if p.default is p.empty and p.name in RIGHT}
    for p in parameters:
        for value in WRONG:
            keys, only = {**required, p.name: value}, p.kind is p.POSITIONAL_ONLY
            yield f"{p.name} = {value!r}", {n: x for n, x in keys.items() if not only or n != p.name}, [value] * only


@pytest.mark.parametrize("name", [n if n in SOME else pytest.param(n, marks=pytest.mark.thorough) for n in METHODS])
def test_methods(name: str) -> None:
    for what, keys, places in each(arguments(getattr(base(), name))):
        m = base()

        def call(m: eg.Model = m, keys: Any = keys, places: Any = places) -> None:
            getattr(m, name)(*places, **keys)
            m.check()

        refused_or_taken(call, what)


@pytest.mark.parametrize("name", MAKERS)
def test_makers_of_models(name: str) -> None:
    make, right = MAKERS[name]
    for key in right if name == "from_equations" else [p.name for p in arguments(make)]:
        for value in WRONG:
            refused_or_taken(lambda key=key, value=value: make(**right | {key: value}).check(), f"{key} = {value!r}")


def test_from_sympy() -> None:
    q, m, g = dynamicsymbols("q"), *symbols("m g")
    method = LagrangesMethod(m * q.diff() ** 2 / 2 - g * q, [q])
    method.form_lagranges_equations()
    for p in arguments(eg.from_sympy)[1:]:
        for value in WRONG:
            refused_or_taken(lambda p=p, value=value: eg.from_sympy(method, **{p.name: value}).check(), p.name)


@pytest.mark.parametrize("name", ["gravity", "initial", "guess", "independent", "simulation", "check_inertia"])
def test_settings(name: str) -> None:
    for value in WRONG:
        m = base()
        refused_or_taken(lambda m=m, value=value: (setattr(m, name, value), m.check()), f"{value!r}")


def test_handles() -> None:
    """Their methods take markers and names; a text is no marker that has a place of its own."""
    part = eg.Model("part")
    part.prismatic("slide", part.ground, part.body("block", mass=1))

    def handles() -> list[Any]:
        m = base()
        return [m.ground, m.bodies["a"], m.ground.at(1, 0, 0), m.joints["ja"], m.spring("t", "a", "b", stiffness=1.0),
                m.add(part, prefix="p_")]  # fmt: skip

    for k, handle in enumerate(handles()):
        names = [n for n in dir(type(handle)) if n[0] != "_" and inspect.isfunction(getattr(type(handle), n))]
        for name in names:
            for what, keys, places in each(arguments(getattr(handle, name))):

                def call(k: int = k, name: str = name, keys: Any = keys, places: Any = places) -> None:
                    getattr(handles()[k], name)(*places, **keys)

                refused_or_taken(call, f"{name}: {what}")


@pytest.mark.parametrize("key", ["method", "independent"])
def test_derive(key: str) -> None:
    for value in WRONG:
        refused_or_taken(lambda value=value: base().derive(**{key: value}), f"{value!r}")


def test_messages_name_the_argument_and_what_is_allowed() -> None:
    with refused("EG-TYPE rates v"):
        eg.Model.from_equations("m", ["q"], velocities=["v"], rates=["v"], mass_matrix=[["1"]], forcing=["0"])
    with refused("EG-TYPE initial 3"):
        base().initial = 3
    refuses("EG-TYPE joints A", lambda: base().weld(["A"], "ground", "a"))
    refuses("EG-TYPE a", lambda: base().ground.distance("a"))


#: Method -> its arguments that are neither a mapping nor empty: both are refused where they stand.
EMPTY = {"body": "solids points com principal about axes check_inertia display mass", "input": "value signal",
         "parameter": "value", "table": "x y z kind", "state": "rate initial", "output": "expression",
         "event": "expression terminal direction restitution friction"}  # fmt: skip


@pytest.mark.parametrize(("method", "key"), [(name, key) for name, keys in EMPTY.items() for key in keys.split()])
def test_what_is_empty_is_no_value_left_out(method: str, key: str) -> None:
    needed = {p.name: RIGHT[p.name] for p in arguments(getattr(base(), method)) if p.name in RIGHT}
    needed |= {"name": "w", **({"mass": 1} if method == "body" else {})}
    for value in ({}, ""):
        m = base()
        getattr(m, method)(**needed | {key: value})
        with pytest.raises(eg.ModelError) as caught:
            m.check()
        assert any(f".w.{key}" in p.path and "missing" not in p.message for p in caught.value.problems), value


def test_what_is_empty_by_default_is_left_out() -> None:
    m = base()
    m.event("e", "qa", reset={}, doc="")
    m.state("s", "-s", initial=0, unit="", doc="", latex="")
    assert "e: qa\n" in m.to_yaml()
    assert "s: -s\n" in m.to_yaml()


# -- places of arguments, and what is left out ------------------------------------------------------------------------


def parts() -> tuple[eg.Model, Any, Any, Any, Any]:
    m = eg.Model("m")
    a, b = m.body("a", mass=1.0), m.body("b", mass=1.0)
    return m, a, b, m.revolute("J", m.ground, a), m.prismatic("S", m.ground, b)


def last(m: eg.Model, section: str = "forces") -> dict[str, Any]:
    """The element that was added last, as a model file has it."""
    return list(described(m)[section].values())[-1]


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
    for call in (lambda: m.torsional_spring("s2", a, b), lambda: m.actuator("u6", S)):
        with pytest.raises(TypeError, match="missing a required argument: '(stiffness|value)'"):
            call()
    m.torque("t1", a, (0, 0, 1))
    m.torque("t2", J.coordinate, 1)
    assert (described(m)["forces"]["t1"]["body"], last(m)["joint"]) == ("a", "J")


def test_ends_that_are_not_there_are_reported_by_the_check() -> None:
    m, a, b, J, _ = parts()
    m.spring("s", a, None, 5)
    m.revolute("K", a, None)
    m.gear("g", J, None, teeth=(1, 2))
    m.revolute("L", a, b, "z", "phi", coordinates=["psi"])
    with pytest.raises(eg.ModelError) as caught:
        m.check()
    told = {p.path: p.message for p in caught.value.problems}
    assert told["forces.s.between[1]"] == told["joints.K.between[1]"] == "has no value"
    assert told["joints.L.coordinates"].startswith("coordinate is given too")
    assert "constraints.g.joints[1]" in told


def test_calls_that_cannot_be() -> None:
    m, a, b, J, _ = parts()
    other = eg.Model("other")
    ball = m.spherical("B", a, b)
    for call, said in {
        lambda: other.revolute("J", other.ground, a): "EG-REFERENCE a 'm' 'other'",
        lambda: m.torsional_damper("d", b, b, b, damping=1): "EG-TYPE markers",
        lambda: m.friction("f", b, 1): "EG-REFERENCE marker",
        lambda: m.point_gravity("p", m.ground, J, mu=1): "EG-REFERENCE J",
        lambda: ball.coordinate: "EG-REFERENCE 3 B_1 B_2 B_3",
        lambda: m.spring(self=3): "EG-NAME-UNKNOWN self",
        lambda: m.revolute("A", m.ground, b, axiss="x"): "EG-NAME-UNKNOWN axiss 'axis'?",
        lambda: m.spring("k", m.ground, b, stifness=1): "EG-NAME-UNKNOWN 'stiffness'?",
        lambda: m.initial(3): "EG-TYPE 3",
        lambda: m.initial({"J": 0.4}, J=0.3): "EG-CONFLICT J",
    }.items():
        refuses(said, call)
    for name, near in (("revolut", "revolute"), ("gravty", "gravity")):
        refuses(f"EG-UNAVAILABLE '{name}' '{near}'?", getattr, m, name)
        refuses(f"EG-UNAVAILABLE '{name}' '{near}'?", setattr, m, name, 1)  # it would be set without any effect


def test_calls_of_a_module_with_the_wrong_shape_of_values_are_reported() -> None:
    m = eg.Model("calls")
    length = m.parameter("l", 1.0)
    m.revolute("q", m.ground, m.body("a", mass=1, com=(0, "-l", 0)))
    m.torque("law", "q", 1 / length)
    module = m.compile(target="numpy")
    refuses("EG-TYPE mapping 1", module.x0, 1)
    refuses("EG-SINGULAR q inertia", module.bind(p={"l": 0.0}).rhs, 0, [0.1, 0.0])
    assert module.rhs(0, [0.1, 0.0], p={"l": 2}).tolist() == module.rhs(0, [0.1, 0.0], p=[2.0]).tolist()
    refuses("EG-NAME-UNKNOWN ll", module.rhs, 0, [0.0, 0.0], p={"ll": 1})


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


def test_settings_are_set_and_read() -> None:
    m = eg.Model("s")
    m.initial(theta=0.3)
    m.initial["theta_dot"] = 1
    m.independent("theta")
    m.simulation(end=3)
    assert (m.initial, m.independent, m.simulation) == ({"theta": 0.3, "theta_dot": 1}, ["theta"], {"end": 3})
    m.independent = ["s"]
    m.initial = {symbols("s"): 2}
    m.guess = {"s": 1}
    m.simulation = {"rtol": 1e-6}
    m.prismatic("J", m.ground, m.body("b", mass=1), axis="z", coordinate=symbols("s"))
    m.gravity = (0, 0, -1.625)
    mod = m.compile(target="numpy")
    assert mod.x0().tolist() == [2.0, 0.0]
    assert mod.rhs(0.0, mod.x0()).tolist() == [0.0, -1.625]
    assert described(m)["simulation"] == {"rtol": 1e-6}


# -- numbers that elements do not allow: one refusal however they are given -------------------------------------------
BASE = """
name: scene
PARAMETERS
bodies:
  a: {mass: 1, inertia: {zz: 0.1}}
  b: {mass: 1, inertia: {zz: 0.1}}
  c: {mass: 1, inertia: [0.1, 0.1, 0.1]}
  d: {mass: 1, inertia: {zz: 0.1}}
  BODIES
joints:
  ja: {type: revolute, between: [ground, a], coordinate: alpha}
  jb: {type: revolute, between: [ground, b], coordinate: beta}
  jc: {type: free, between: [ground, c]}
  JOINTS
"""
CIRCLE, FLOOR = "{shape: circle, on: a, radius: 0.1}", "{shape: half_plane, on: ground}"
SHAPE = "{type: contacts, stiffness: 1e4, second: [{shape: half_plane, on: ground}], first: [{on: a, "
SPACE = SHAPE.replace("half_plane", "half_space")
CUBOID = SPACE + "shape: cuboid, size: [0.3, 0.2, 0.1], "
POLYGON = SHAPE + "shape: polygon, points: [[0, 0], [1, 0], [2, @], [0, 1]]}]}"
SPHERES = "{type: sphere_sphere, between: [a, b], normal_law: hertz, "
RUBBING = "{type: friction, joint: ja, coulomb: 1, smoothing: 1, "
BRUSH = "relaxation: [0.3, 0.2], law: brush, friction: 1, "
RUB = "stiffness: 1e4, friction: 0.3, smoothing: 0.01, "
LUGRE = "stiffness: 1e4, friction_law: lugre, friction: 0.3, bristle_damping: 10, "
TYRE = "{type: tyre, between: [ground, a], radius: 0.3, stiffness: 2e5, "
NOT_POSITIVE, NEGATIVE = (0.0, -1.5), (-1.5,)
#: Keys of a contact between a circle and a plane.
CONTACTS: list[tuple[str, str, float, tuple[float, ...]]] = [
    ("stiffness: @", "stiffness", 1e4, NOT_POSITIVE),
    ("stiffness: 1e4, exponent: @", "exponent", 1.0, (0.5, -1.0)),
    ("stiffness: 1e4, dissipation: @", "dissipation", 0.0, NEGATIVE),
    ("stiffness: 1e4, restitution: @, velocity: 1", "restitution", 1.0, (0.0, -0.1, 1.2)),
    ("stiffness: 1e4, restitution: 0.5, velocity: @", "velocity", 0.1, NOT_POSITIVE),
    ("normal_law: rigid, friction: @", "friction", 0.0, NEGATIVE),
    ("stiffness: 1e4, friction: 0.3, smoothing: @", "smoothing", 0.1, NOT_POSITIVE),
    (f"{RUB}static_friction: @, stribeck: 0.1", "static_friction", 0.3, (0.2, -0.1)),
    (f"{LUGRE}bristle_stiffness: @", "bristle_stiffness", 1.0, NOT_POSITIVE),
]
#: Section, an entry with a number in it, where its fault is told, one that is allowed, and some that are not.
CASES: list[tuple[str, str, str, float, tuple[float, ...]]] = [
    *(
        ("forces", f"{{type: contacts, first: [{CIRCLE}], second: [{FLOOR}], {keys}}}", *rest)
        for keys, *rest in CONTACTS
    ),
    ("forces", SHAPE + "shape: circle, radius: @}]}", "first[0].radius", 0.1, NOT_POSITIVE),
    ("forces", SPACE + "shape: ellipsoid, semi_axes: [0.1, 0.2, @]}]}", "first[0].semi_axes[2]", 0.1, NOT_POSITIVE),
    ("forces", SPACE + "shape: cuboid, size: [0.3, @, 0.1]}]}", "first[0].size[1]", 0.1, NOT_POSITIVE),
    ("forces", CUBOID + "edge_radius: @}]}", "first[0].edge_radius", 0.02, (0.06,)),
    ("forces", POLYGON, "first[0].points[1]", 0.5, (0.0,)),
    ("forces", "{type: stop, joint: ja, lower: 0.2, upper: @, stiffness: 10}", "upper", 1.0, (0.2, 0.1)),
    ("forces", "{type: sphere_plane, between: [ground, a], radius: @, stiffness: 1}", "radius", 0.1, NOT_POSITIVE),
    ("forces", SPHERES + "radii: [@, 0.1], poisson: [0.3, 0.3], moduli: [1e9, 1e9]}", "radii[0]", 0.1, (0.0,)),
    ("forces", SPHERES + "radii: [1, 1], poisson: [0.3, 0.3], moduli: [1e9, @]}", "moduli[1]", 1e9, NOT_POSITIVE),
    ("forces", SPHERES + "radii: [1, 1], poisson: [@, 0.3], moduli: [1e9, 1e9]}", "poisson[0]", 0.5, (-1.0, 0.6)),
    ("forces", "{type: friction, joint: ja, viscous: @}", "viscous", 0.0, NEGATIVE),
    ("forces", RUBBING + "static: @, stribeck: 1}", "static", 1.0, (0.9, -0.1)),
    ("forces", "{type: point_gravity, center: ground, body: c, mu: @}", "mu", 1.0, NOT_POSITIVE),
    ("forces", TYRE + "relaxation: [0.1, @], law: magic_formula}", "relaxation[1]", 0.1, NOT_POSITIVE),
    ("forces", TYRE + BRUSH + "slip_stiffness: @}", "slip_stiffness", 1.0, (0.0,)),
    (
        "forces",
        "{type: creep, between: [ground, a], longitudinal: 1, lateral: 1, radius: @}",
        "radius",
        0.2,
        (0.0, -1.5),
    ),
    ("constraints", "{type: gear, joints: [ja, jb], radii: [@, 0.1]}", "radii[0]", 0.2, NOT_POSITIVE),
    ("constraints", "{type: planetary, sun: ja, carrier: jb, radii: {sun: 0.1, ring: @}}", "radii", 0.3, (0.05,)),
    ("constraints", "{type: rolling, wheel: c, plane: ground, shape: sphere, radius: @}", "radius", 0.2, NOT_POSITIVE),
    ("joints", "{type: distance, between: [a, c], length: @}", "length", 0.2, NOT_POSITIVE),
    ("joints", "{type: screw, between: [ground, d], pitch: @}", "pitch", -0.2, (0.0,)),
    ("joints", "{type: revolute, between: [ground, d], armature: @}", "armature", 0.0, NEGATIVE),
    ("bodies", "{mass: @, inertia: [1, 1, 1]}", "mass", 0.5, NEGATIVE),
    ("bodies", "{mass: 1, inertia: [@, 1, 1]}", "inertia", 1.5, (-1.0, 2.5)),
    ("states", "{sampled: alpha, period: @}", "period", 0.1, NOT_POSITIVE),
]


def scene(section: str, entry: str, value: Any, declared: Any = None) -> str:
    """Two links on the ground and two bodies, with the element of a case."""
    inner = value if isinstance(value, str) else repr(value)
    entry = entry.replace("@", inner)
    texts = {"parameters": "" if declared is None else f"parameters: {{p: {declared}}}"}
    texts["joints"] = f"x: {entry}" if section == "joints" else ""
    if "d]" not in texts["joints"]:
        texts["joints"] += "\n  jd: {type: weld, between: [ground, d]}"
    texts["bodies"] = f"x: {entry}" if section == "bodies" else ""
    texts["joints"] += "\n  jx: {type: free, between: [ground, x]}" if section == "bodies" else ""
    text = BASE
    for key, given in texts.items():
        text = text.replace(key.upper(), given)
    return text if section in ("joints", "bodies") else f"{text}\n{section}: {{x: {entry}}}\n"


@pytest.mark.parametrize(
    ("section", "entry", "place", "good", "bad"), CASES, ids=[f"{c[0]}-{c[2]}-{k}" for k, c in enumerate(CASES)]
)
def test_one_refusal_however_a_number_is_given(
    section: str, entry: str, place: str, good: float, bad: tuple[float, ...], tmp_path: Path
) -> None:
    place = f"{section}.x.{place}"
    assert faults(tmp_path, scene(section, entry, good)) == []
    model = load(tmp_path, scene(section, entry, "p", good))
    module = model.compile(target="numpy", kernels=["poses"])
    for value in bad:
        number = {p.path for p in faults(tmp_path, scene(section, entry, value))}
        assert any(path.startswith(place) for path in number), number
        assert {p.path for p in faults(tmp_path, scene(section, entry, "p", value))} == number
        with pytest.raises(eg.ParameterError) as late:
            module.bind(p={"p": value})
        told = [p for p in late.value.problems if p.path.startswith(place)]
        assert told
        assert f"{value:.6g}" in str(told[0])


# -- a name that is not known is answered by the nearest one, in the place where it is written ------------------------
@pytest.fixture(scope="module")
def held() -> dict[str, Any]:
    equations = eg.load_example("pendulum").derive()
    module = equations.compile(target="numpy")
    parts = {"Module": module, "Trajectory": module.simulate(0.1), "Equations": equations}
    return {"eomgen": eg, "Model": eg.Model("m"), **parts}


@pytest.mark.quick
@pytest.mark.parametrize(
    ("kind", "word", "meant"),
    [
        ("Model", "revolut", "revolute"), ("Model", "PrismaticJoint", "prismatic"), ("Model", "BODY", "body"),
        ("Model", "add_spring", "spring"), ("Model", "gravty", "gravity"), ("Module", "mass_matrx", "mass_matrix"),
        ("Module", "lineraize", "linearize"), ("Module", "simulate_mny", "simulate_many"), ("Module", "X0", "x0"),
        ("Trajectory", "to_panda", "to_pandas"), ("Equations", "massmatrix", "mass_matrix"),
        ("eomgen", "modle", "Model"),
    ],
)  # fmt: skip
def test_names_in_python(held: dict[str, Any], kind: str, word: str, meant: str) -> None:
    with pytest.raises(AttributeError, match=rf"has no attribute '{word}'; did you mean '?{meant}\b"):
        getattr(held[kind], word)
    assert not hasattr(held[kind], word)
    assert getattr(held[kind], word, 3) == 3
    with pytest.raises(AttributeError, match="zzz"):
        held[kind].zzz  # noqa: B018


@pytest.mark.parametrize(
    ("text", "meant"),
    [
        ("bodys: {a: {mass: 1}}", "bodies"), ("paramters: {a: 1}", "parameters"), ("Forces: {}", "forces"),
        ("bodies: {a: {mas: 1}}", "mass"), ("bodies: {a: {mass: 1, CoM: [0, 0, 0]}}", "com"),
        ("bodies: {a: {mass: 1}}\njoints: {A: {type: revolut, between: [ground, a]}}", "revolute"),
        ("bodies: {a: {mass: 1}}\njoints: {A: {type: revolute, betwen: [ground, a]}}", "between"),
        ("bodies: {a: {mass: 1}}\njoints: {A: {type: revolute, between: [grond, a]}}", "ground"),
        ("bodies: {a: {mass: 1}}\nforces: {f: {type: spring, between: [ground, a], stifness: 3}}", "stiffness"),
        ("simulation: {ends: 3}", "end"), ("simulation: {rtoll: 3}", "rtol"),
    ],
)  # fmt: skip
def test_names_in_a_file(tmp_path: Path, text: str, meant: str) -> None:
    code = "EG-CHOICE" if "revolut," in text else "EG-NAME-UNKNOWN"
    refuses(f"{code} '{meant}'?", lambda: load(tmp_path, f"name: m\n{text}\n").check())


@pytest.mark.parametrize(
    ("words", "meant"),
    [
        (["rum"], "run"), (["exmples"], "examples"), (["run", "m.yaml", "--ends", "3"], "--end"),
        (["run", "m.yaml", "--sett", "l=1"], "--set"), (["run", "m.yaml", "--OUT", "a"], "--out"),
    ],
)  # fmt: skip
def test_names_on_the_command_line(words: list[str], meant: str) -> None:
    done = command.run(*words)
    assert done.code == 2
    assert f"id you mean {meant}" in done.err.replace("'", "")


def test_a_file_is_suggested_where_its_name_without_suffix_is_alike(tmp_path: Path) -> None:
    (tmp_path / "cam.yaml").touch()
    assert "did you mean" not in command.run("check", tmp_path / "scissor.yaml").err
    assert f"did you mean {tmp_path / 'cam.yaml'}?" in command.run("check", tmp_path / "cma.yaml").err


def test_what_there_is_stands_once_for_all_names_that_are_like_none(held: dict[str, Any]) -> None:
    with refused("EG-NAME-UNKNOWN 'zzz' 'G' '?'") as caught:
        held["Module"].simulate((0, 1), parameters={"zzz": 1.0, "G": 2.0, "?": 3.0})
    first, second = str(caught.value).splitlines()
    assert first.startswith("no parameter 'zzz', '?'; there are ")
    assert second == "no parameter 'G'; did you mean g?"


@pytest.mark.parametrize(("word", "meant"), [("initial_", "initial"), ("methd", "method"), ("teval", "t_eval")])
def test_an_argument_of_a_run(held: dict[str, Any], word: str, meant: str) -> None:
    refuses(f"EG-NAME-UNKNOWN '{word}' {meant}?", lambda: held["Module"].simulate((0, 1), **{word: 1.0}))


def test_the_name_that_is_written_alike_comes_first() -> None:
    words = {"thetta": "theta", "Theta": "theta", "hinge": "hinges", "zzzzz": ""}
    for word, meant in words.items():
        m = eg.Model("m")
        for name in ("theta", "phi", "hinges"):
            m.parameter(name, 1.0)
        m.prismatic("s", m.ground, m.body("a", mass=word))
        with refused(f"EG-NAME-UNKNOWN bodies.a.mass: '{word}'" + f" '{meant}'?" * bool(meant)) as caught:
            m.check()
        assert ("did you mean" in str(caught.value)) == bool(meant)


@pytest.mark.parametrize(
    "line",
    [
        "m.revolut('A', m.ground, rod)",
        "m.gravty = (0, 0, 1)",
        "mod.simulat(1.0)",
        "run.tt",
        "equations.mass_matrx",
        "eg.Modle",
    ],
)
def test_a_notebook_shows_the_line_of_the_user_and_no_other(held: dict[str, Any], line: str) -> None:
    """Through IPython's own shell: the cell, its line and the message, and nothing of eomgen's files."""
    from IPython.core.interactiveshell import InteractiveShell
    from IPython.utils.capture import capture_output

    shell = InteractiveShell()
    names = {"m": held["Model"], "mod": held["Module"], "run": held["Trajectory"], "equations": held["Equations"]}
    shell.user_ns.update(names, eg=eg, rod=None)
    with capture_output() as captured:
        result = shell.run_cell(f"def mine():\n    {line}\nmine()", store_history=True)
    InteractiveShell.clear_instance()
    assert isinstance(result.error_in_exec, AttributeError)
    text = captured.stdout + captured.stderr
    assert "in mine" in text
    assert line in text
    assert "did you mean" in text
    assert "near_names" not in text
    assert "builder.py" not in text
    assert len(text.splitlines()) <= 8
