"""Every argument of the builder given as what it cannot be: a named error that says what is allowed, or taken."""

from __future__ import annotations

import _thread
import inspect
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
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


@pytest.mark.parametrize("name", METHODS)
def test_methods(name: str) -> None:
    for what, keys, places in each(arguments(getattr(base(), name))):
        m = base()

        def call(m: eg.Model = m, keys: Any = keys, places: Any = places) -> None:
            getattr(m, name)(*places, **keys)
            m.mechanism()

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
            refused_or_taken(lambda p=p, value=value: eg.from_sympy(method, **{p.name: value}).mechanism(), p.name)


@pytest.mark.parametrize("name", ["gravity", "initial", "guess", "independent", "simulation", "check_inertia"])
def test_settings(name: str) -> None:
    for value in WRONG:
        m = base()
        refused_or_taken(lambda m=m, value=value: (setattr(m, name, value), m.mechanism()), f"{value!r}")


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
    with pytest.raises(eg.UsageError, match=r"rates must be a mapping of names to values, .* not \['v'\]"):
        eg.Model.from_equations("m", ["q"], velocities=["v"], rates=["v"], mass_matrix=[["1"]], forcing=["0"])
    with pytest.raises(eg.UsageError, match=r"initial must be a mapping of names to values, .* not 3"):
        base().initial = 3
    with pytest.raises(eg.UsageError, match=r"joints: a name is a text, such as 'A', not \['A'\]"):
        base().weld(["A"], "ground", "a")
    with pytest.raises(eg.UsageError, match=r"give a body or a marker, .* not 'a'"):
        base().ground.distance("a")


def test_faults_name_the_line_of_the_call() -> None:
    here = inspect.currentframe()
    assert here is not None
    m = base()
    m.revolute("ja", "a.tip", "b", coordinate="other")
    m.body("c", mass=-1)
    m.bodies["c"].marker("tip", ("length", 0, 0))
    m.output("height", "nothing")
    last = here.f_lineno
    with pytest.raises(eg.ModelError) as found:
        m.check()
    lines = {p.path: p.line for p in found.value.problems if p.file == __file__}
    assert lines["joints.ja"] == last - 4
    assert lines["bodies.c.mass"] == last - 3
    assert lines["bodies.c.markers.tip.at[0]"] == last - 2
    assert lines["outputs.height.expression"] == last - 1
    assert f"{__file__}:{last - 3}: bodies.c.mass: is -1" in str(found.value)


def test_a_package_named_like_eomgen_is_the_users_own() -> None:
    """Its calls are the lines to name; a thread that begins within eomgen has none."""
    file = Path(eg.__file__).parent.with_name("eomgen_demo") / "arm.py"  # never written
    scope: dict[str, Any] = {"__name__": "eomgen_demo.arm"}
    text = "import eomgen\nmade = eomgen.Model('arm')\nmade.body('c', mass=-1)\n"
    exec(compile(text, str(file), "exec"), scope)  # noqa: S102 - as a module of that package does
    with pytest.raises(eg.ModelError) as found:
        scope["made"].check()
    assert {(p.file, p.line) for p in found.value.problems if "mass" in p.path} == {(str(file), 3)}
    threads: list[eg.Model] = []
    _thread.start_new_thread(threads.extend, (map(eg.Model, ["arm"]),))
    for _ in range(1000):
        time.sleep(0.0 if threads else 0.01)
    assert threads[0].description.lines["name"] == ("", 0)
