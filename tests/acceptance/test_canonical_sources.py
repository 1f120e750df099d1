"""Sources and cache key follow from the model alone: not from what was read before, nor from the order of keys."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from functools import cached_property
from typing import Any

import models
import pytest
import sympy
from sweeps import part_of

import eomgen as eg
from eomgen import pipeline
from eomgen.api.equations import Equations
from eomgen.describe.description import SECTIONS
from eomgen.describe.yaml_file import describe_yaml
from eomgen.describe.yaml_nodes import Document
from eomgen.emit import emit_c, emit_numpy
from eomgen.equations import METHODS
from eomgen.errors import UnavailableError
from eomgen.kinematics.report import MechanismReport
from eomgen.program.fingerprint import fingerprint

#: Read last to first and first to last; what writes files or takes arguments is not a property.
SHOWN = [name for name in dir(Equations) if not name.startswith("__") and name != "compile"]
REPORTED = [name for name in dir(MechanismReport) if not name.startswith("__")]


def bare() -> eg.Model:
    a, b, a_dot, b_dot, k = sympy.symbols("a b a_dot b_dot k")
    lagrangian = (a_dot**2 + b_dot**2 * sympy.cos(a) ** 2 + (a - b) * a_dot * b_dot / 3) / 2 - k * (b - a) ** 2
    return eg.Model.from_lagrangian("bare", lagrangian, [a, b], dissipation=(a_dot - b_dot) ** 2, parameters={"k": 2.0})


def example(name: str) -> Callable[[], eg.Model]:
    return lambda: eg.load(str(models.EXAMPLES / f"{name}.yaml"))


def texts(equations: Equations) -> list[tuple[str | None, dict[str, str]]]:
    """Key and files of each target."""
    found = []
    for target, emit in (("c", emit_c), ("numpy", emit_numpy)):
        program = pipeline.build(equations, target)
        found.append((fingerprint(program), dict(emit(program))))
    return found


def read_everything(model: eg.Model, equations: Equations, names: list[str]) -> None:
    """Read every property, print, and compile, the last first."""
    model.check()
    for name in names:
        try:
            value = getattr(equations, name)
        except UnavailableError:  # of another method
            continue
        if name.startswith("_repr") or name in ("linearize", "with_dynamicsymbols"):
            value()
        if isinstance(value, Mapping):
            dict(value)
    for name in REPORTED:
        value = getattr(equations.report, name)
        if name.startswith("_repr"):
            value()
    str(equations), str(equations.report), equations.fresh()
    kinematics, tree = equations.kinematics, equations.tree
    for part in filter(None, (kinematics, kinematics.motion, kinematics.motion.momentum, tree, tree.turned)):
        for name, kind in vars(type(part)).items():
            if isinstance(kind, property | cached_property):
                getattr(part, name)
    equations.compile(target="numpy", kernels=["energy", "rhs"])


READ = [
    *((example("slider_crank"), method) for method in METHODS),
    *((example("spherical_pendulum"), method) for method in ("auto", "lagrange", "recursive")),
    (example("rolling_disc"), "auto"),
    *((bare, method) for method in pipeline.OF_LAGRANGIANS),
]
#: One order each, by turns; the other one by ``make thorough``.
CASES = [(make, method, order) for make, method in READ for order in ("forward", "backward")]
BY_TURNS = {2 * k + k % 2 for k in range(len(READ))}


@pytest.mark.parametrize(("make", "method", "order"), part_of(CASES, lambda case: CASES.index(case) in BY_TURNS))
def test_reading_changes_neither_sources_nor_key(make: Callable[[], eg.Model], method: str, order: str) -> None:
    untouched = texts(make().derive(method))
    assert all(key for key, _ in untouched)
    model = make()
    equations = model.derive(method)
    nodes = len(equations.kinematics.graph.nodes)
    read_everything(model, equations, SHOWN if order == "forward" else SHOWN[::-1])
    assert len(equations.kinematics.graph.nodes) > nodes  # what was read did grow the graph
    assert texts(equations) == untouched
    if order == "forward":
        assert texts(equations) == untouched  # nor does building itself


def turned_round(value: Any, path: tuple[str, ...] = ()) -> Any:
    """The same data with the keys of every mapping in the other order, but for names, whose order says theirs."""
    if isinstance(value, dict):
        declares = (len(path) == 1 and path[0] in SECTIONS) or path[-1:] in (("intermediates",), ("markers",))
        pairs = list(value.items()) if declares else list(value.items())[::-1]
        return {key: turned_round(part, (*path, key)) for key, part in pairs}
    return [turned_round(part, (*path, "")) for part in value] if isinstance(value, list) else value


EXTRA = {
    "name": "keys",
    "parameters": {"m": {"value": 1.0, "unit": "kg"}, "l": 0.3},
    "bodies": {
        "a": {"mass": "m", "com": ["l/2", 0, 0], "inertia": {"xx": "m*l/9", "zz": "m*l**2/12", "yy": "m*l/7"}},
        "b": {"mass": "2*m", "inertia": {"zz": "m*l/11", "xx": "m*l/9", "yy": "m*l/8", "xy": "m*l/90"}},
    },
    "joints": {
        "A": {"type": "revolute", "between": ["ground", "a"], "limits": {"lower": -1, "upper": 2, "effort": 3}},
        "B": {"type": "revolute", "between": ["a", "b"]},
    },
    "constraints": {"c": {"type": "coupling", "coordinates": {"B": "l*2", "A": "m*3"}, "offset": "m*l"}},
    "events": {"stop": {"expression": "A", "reset": {"B_dot": "-l*B_dot", "A_dot": "-l*A_dot/2"}}},
    "initial": {"B_dot": "m*l", "A": "l/5"},
    "guess": {"B": "l/4", "A": "m/9"},
    "simulation": {"end": 1, "rtol": 1e-7},
}  # fmt: skip
BARE = {
    "name": "bare_keys",
    "parameters": {"k": 2.0},
    "lagrangian": {
        "coordinates": ["a", "b"],
        "expression": "(a_dot**2 + b_dot**2)/2 - k*(a - b)**2",
        "forces": {"b": "k*a/3", "a": "k*b/5"},
        "dissipation": "k*a_dot**2",
    },
}


@pytest.mark.parametrize("name", ["keys", "bare_keys", "double_pendulum", "bricard", "planetary_gear"])
def test_the_order_of_keys_changes_neither_sources_nor_key(name: str) -> None:
    data = {"keys": EXTRA, "bare_keys": BARE}.get(name)
    if data is None:
        path = models.EXAMPLES / f"{name}.yaml"
        data = Document(path.read_text(), path.name).value
    given, other = (
        texts(eg.Model.from_description(describe_yaml(json.dumps(d), "m.yaml")).derive())
        for d in (data, turned_round(data))
    )
    assert given == other
