"""Calls of compiled modules with odd arguments: wrong shapes, types, names, sizes, numbers that are none."""

from __future__ import annotations

import contextlib
import inspect
import math
import random
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import sympy

from eomgen import Model
from eomgen.describe.yaml_file import describe_yaml
from eomgen.errors import EomgenError

from .guard import PACKAGE
from .kind import pruned
from .words import TEXTS
from .yaml_files import SMALL

#: Model -> its text; an example is read from its file.
MODELS = {"pendulum": SMALL["pendulum"], "spring": SMALL["spring"], "four_bar": "", "rolling_disc": ""}
TARGETS = ("numpy", "cython")
NOT_CALLED = {"verify", "bind", "report"}  #: take seconds by design, or are bound before each call
RARE = {
    "simulate",
    "simulate_many",
    "simulate_impacts",
    "sensitivities",
    "workspace",
    "kinematic_analysis",
    "motion_range",
    "equilibrium",
    "branches",
    "integrator",
}
MOST, FEW = 100_000, 2_000  #: numbers of an array; of points at which a mechanism is closed one after the other
LONG = {"span", "points", "most", "of", "over", "within"}  #: arguments in which a large number rightly takes long
#: Options of runs that stand behind **options.
OPTIONS = {
    "rtol": 1e-6,
    "atol": 1e-8,
    "t_eval": [0.0, 0.01],
    "max_step": 0.01,
    "first_step": 0.001,
    "events": None,
    "step": 0.01,
    "dense_output": True,
    "workers": 1,
    "samples": 3,
    "colour": "red",
    "method": "RK45",
    "vectorized": True,
}
NUMBERS = (0, 1, -1, 2, 0.5, -0.0, 1e308, -1e308, 1e-308, 5e-324, 1e16, "nan", "inf", "-inf", 10**30, 2**63, 10**400)
OBJECTS = (
    "set",
    "bytes",
    "complex",
    "symbol",
    "function",
    "self",
    "type",
    "generator",
    "object",
    "masked",
    "date",
    "ellipsis",
    "slice",
    "true",
    "false",
)
DTYPES = ("f8", "f4", "f2", "i8", "u1", "c16", "O", "U3", "?", ">f8", "M8[s]", "f8,f8", "S2", "g")
FILLS = ("good", 0.0, 1.0, "nan", "inf", 1e308, 1e16, -1.0, 1e-320, "random")
LAYOUTS = ("C", "F", "strided", "reversed", "readonly", "broadcast", "matrix")


class Calls:
    """Calls by keyword: most arguments good, some odd."""

    name = "calls"
    programs: frozenset[str] = frozenset()
    #: NumPy's of a complex array given for a real one, SciPy's of options that a solver does not know.
    unjudged: tuple[type[Warning], ...] = (np.exceptions.ComplexWarning, UserWarning)

    def prepare(self, folder: Path) -> None:
        self.modules: dict[str, Any] = {}
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            for name, text in MODELS.items():
                text = text or (PACKAGE.parent / "examples" / f"{name}.yaml").read_text()
                for target in TARGETS:
                    self.modules[f"{name} {target}"] = Model.from_description(describe_yaml(text)).compile(
                        target=target
                    )
        self.good = {name: good_values(module) for name, module in self.modules.items()}
        self.calls = {name: list(callables(module)) for name, module in self.modules.items()}
        with warnings.catch_warnings(), contextlib.suppress(EomgenError):
            warnings.simplefilter("ignore")
            for name, calls in self.calls.items():  # each once: what loads or compiles late does so here
                for on, call, names in calls:
                    with contextlib.suppress(Exception):
                        self.call(self.modules[name], on, call, {n: self.good[name][n] for n in names if n in NEEDED})

    def make(self, r: random.Random) -> dict[str, Any]:
        module = r.choice(list(self.modules))
        on, call, names = r.choice(self.calls[module])
        if call in RARE and r.random() < 0.6:
            on, call, names = r.choice(self.calls[module])
        chosen = {}
        for name in names:
            if name in NEEDED or r.random() < 0.25:
                chosen[name] = {"good": 1} if r.random() < 0.6 else odd(r, name)
                if call == "kinematic_analysis" and chosen[name].get("array", {}).get("shape") == (MOST,):
                    chosen[name]["array"]["shape"] = (FEW,)
                if name == "reduce" and chosen[name].get("object") in ("type", "function"):
                    chosen[name] = {"good": 1}  # a function of the user's own raises what it likes
        if r.random() < 0.1:
            chosen[r.choice(("x", "out", "foo", "p", "__class__", "t", "rows", "theta"))] = odd(r, "")
        return {"module": module, "on": on, "call": call, "arguments": chosen}

    def build(self, case: Any) -> Any:
        return case

    def run(self, case: Any, folder: Path) -> str:
        module, good = self.modules[case["module"]], self.good[case["module"]]
        values = {name: made(spec, good.get(name, 1.0), module) for name, spec in case["arguments"].items()}
        self.call(module, case["on"], case["call"], values)
        return "returned"

    def call(self, module: Any, on: str, call: str, values: dict[str, Any]) -> None:
        bound = getattr(module.minimal if on == "minimal" else module, call)
        options = values.pop("options", None)
        named = values.pop("named", None)
        for more in (options, named):
            values |= more if isinstance(more, dict) else {}
        places = [values.pop(name) for name in ("guess_", "values_") if name in values]
        bound(*places, **values)

    def smaller(self, case: Any) -> Iterator[Any]:
        yield from ({**case, "arguments": arguments} for arguments in pruned(case["arguments"]))


#: Arguments without which most calls say only that they are missing.
NEEDED = {"t", "x", "q", "v", "a", "q_i", "x_min", "h", "name", "names", "gaps", "over", "of", "span", "named"}


def callables(module: Any) -> Iterator[tuple[str, str, list[str]]]:
    """Every public call of a module and of its minimal form, with the names of its arguments."""
    owners = [("module", module)]
    with contextlib.suppress(EomgenError):  # rolling leaves none
        owners.append(("minimal", module.minimal))
    for on, owner in owners:
        for name in sorted(set(dir(owner)) - NOT_CALLED):
            try:
                call = getattr(owner, name)
                parameters = inspect.signature(call).parameters.values()
            except (EomgenError, TypeError, ValueError):
                continue
            if name.startswith("_") or isinstance(call, type):
                continue
            names = [p.name + "_" if p.kind is p.POSITIONAL_ONLY else p.name for p in parameters if p.name != "cluster"]
            if "args" in names:  # a kernel that is compiled late
                names = ["t", "x", "p", "u", "out"]
            yield on, name, names


def good_values(module: Any) -> dict[str, Any]:
    """A value that fits for every name of an argument."""
    x = module.x0()
    first = module.q_names[0]
    values: dict[str, Any] = OPTIONS | {
        "t": 0.0,
        "x": x,
        "q": x[: module.n_q],
        "v": x[module.n_q : module.n_q + module.n_v],
        "a": np.zeros(module.n_v),
        "p": module.p,
        "u": module.u,
        "out": np.empty(module.n_x),
        "q_i": np.atleast_1d(x[: module.n_dof]),
        "v_i": np.zeros(module.n_dof),
        "a_i": np.zeros(module.n_dof),
        "guess": {first: float(x[0])},
        "guess_": {first: float(x[0])},
        "values_": {first: float(x[0])},
        "rows": "all",
        "h": 0.01,
        "span": (0.0, 0.05),
        "initial": {first: float(x[0])},
        "parameters": dict(zip(module.p_names, module.p, strict=True)),
        "inputs": dict(zip(module.u_names, module.u, strict=True)),
        "name": first,
        "names": [*module.p_names[:1], first],
        "gaps": {first: 0.5},
        "lock": [first],
        "hold": [first],
        "unknowns": list(module.p_names[:1]),
        "over": {first: (0.0, 0.5, 3)},
        "of": first,
        "method": None,
        "step": None,
        "checkpoint": None,
        "store": None,
        "resume": None,
        "progress": False,
        "form": "minimal",
        "independent": [first],
        "weights": {first: 2.0},
        "points": 10,
        "most": 3,
        "limits": True,
        "partial": True,
        "closed": True,
        "within": (0.0, 1.0),
        "actuated": [first],
        "options": dict(OPTIONS),
        "count": 2,
        "threads": 1,
        "block": 1,
        "keep_events": 2,
        "max_steps": 1000,
        "reduce": "states",
        "samples": 3,
        "states": 1,
        "named": {first: float(x[0])},
        "led": {first: [float(x[0]), float(x[0]) + 0.01]},
    }
    with contextlib.suppress(EomgenError):
        values["x_min"] = module.minimal.reduce(x)
    return values | ({} if "x_min" in values else {"x_min": x})


def odd(r: random.Random, name: str) -> dict[str, Any]:
    """The description of an odd value."""
    k = r.randrange(9)
    if name in ("options", "named", "led"):
        keys = (
            r.sample(list(OPTIONS), r.randint(0, 3))
            if name == "options"
            else r.choices((*TEXTS, "theta", "q", "q_dot", "t", "p"), k=r.randint(0, 2))
        )
        return {
            "dict": {
                key: {"value": OPTIONS[key]} if r.random() < 0.4 and key in OPTIONS else odd(r, "span") for key in keys
            }
        }
    if k <= 1 and name not in LONG:
        return {"value": r.choice(NUMBERS)}
    if k == 2:
        return {"value": r.choice(TEXTS)}
    if k == 3:
        return {"object": r.choice(OBJECTS)}
    if k == 4:
        return {
            "value": r.choice(
                (
                    None,
                    [],
                    {},
                    [[]],
                    [None],
                    ["a"],
                    [1, "a"],
                    [[1, 2], [3]],
                    {"": 1},
                    {"theta": "nan"},
                    {"q": None},
                    ["nan"],
                    [-1.0],
                    [1.0, 0.0],
                    [0.0, "nan"],
                    [0.0, 0.0],
                    "theta",
                    ["theta", "theta"],
                )
            )
        }
    if k == 5:
        key = r.choice((*TEXTS, "theta", "q", "q_dot", "l", "k", "u"))
        return {"dict": {key: odd(r, name)}}
    shape = r.choice(
        (
            (),
            (0,),
            (1,),
            (2,),
            (3,),
            (5,),
            (0, 0),
            (2, 0),
            (2, 2),
            (4, 3),
            (1, 1, 1),
            (2, 1000),
            (MOST,),
            "good",
            "good",
            "good",
            "batch",
            "batch",
            "longer",
            "shorter",
        )
    )
    return {
        "array": {
            "shape": shape,
            "fill": r.choice(FILLS),
            "dtype": r.choice(DTYPES) if r.random() < 0.4 else "f8",
            "layout": r.choice(LAYOUTS),
        }
    }


def made(spec: Any, good: Any, module: Any) -> Any:
    """The value that a description means."""
    if "good" in spec:
        return good.copy() if isinstance(good, np.ndarray) else dict(good) if isinstance(good, dict) else good
    if "value" in spec:
        return plain(spec["value"])
    if "dict" in spec:
        return {key: made(inner, 1.0, module) for key, inner in spec["dict"].items()}
    if "object" in spec:
        return OBJECT[spec["object"]](module)
    return array(spec["array"], good)


def plain(value: Any) -> Any:
    """JSON's value, with the numbers that JSON lacks."""
    if isinstance(value, list):
        return [plain(v) for v in value]
    if isinstance(value, dict):
        return {k: plain(v) for k, v in value.items()}
    return float(value) if value in ("nan", "inf", "-inf") else value


def array(spec: dict[str, Any], good: Any) -> Any:
    """An array of a shape, content, type and layout."""
    try:
        base = np.atleast_1d(np.asarray(good if not isinstance(good, dict) else list(good.values()), dtype=float))
    except (TypeError, ValueError):
        base = np.ones(2)
    shape, fill = spec["shape"], spec["fill"]
    sizes = {
        "good": base.shape,
        "batch": (*base.shape, 3),
        "longer": (base.shape[0] + 1,),
        "shorter": (max(base.shape[0] - 1, 0),),
    }
    size = sizes[shape] if isinstance(shape, str) else tuple(shape)
    if fill == "good" and shape in ("good", "batch"):
        values = np.ascontiguousarray(np.broadcast_to(base.T, size[::-1]).T)
    else:
        values = np.full(size, math.pi if fill == "good" else 0.0 if fill == "random" else float(fill))
        if fill == "random":
            values = np.random.default_rng(len(size)).normal(size=size)
    with warnings.catch_warnings(), np.errstate(all="ignore"):
        warnings.simplefilter("ignore")
        try:
            values = values.astype(spec["dtype"])
        except (TypeError, ValueError):
            values = np.zeros(size, dtype=spec["dtype"])
    return LAYOUT[spec["layout"]](values)


def _readonly(values: Any) -> Any:
    values.setflags(write=False)
    return values


def _strided(values: Any) -> Any:
    return np.repeat(values, 2, axis=-1)[..., ::2] if values.ndim else values


LAYOUT: dict[str, Callable[[Any], Any]] = {
    "C": lambda a: a,
    "F": np.asfortranarray,
    "strided": _strided,
    "reversed": lambda a: a[::-1] if a.ndim else a,
    "readonly": _readonly,
    "broadcast": lambda a: np.broadcast_to(a, (2, *a.shape)),
    "matrix": lambda a: a.tolist(),
}
OBJECT: dict[str, Callable[[Any], Any]] = {
    "set": lambda m: {1.0, 2.0},
    "bytes": lambda m: b"abc",
    "complex": lambda m: 1j,
    "symbol": lambda m: sympy.Symbol("q"),
    "function": lambda m: lambda *a: 1.0,
    "self": lambda m: m,
    "type": lambda m: float,
    "generator": lambda m: (x for x in (1.0, 2.0)),
    "object": lambda m: object(),
    "masked": lambda m: np.ma.masked_array([1.0, 2.0], mask=[True, False]),
    "date": lambda m: np.datetime64("2001-01-01"),
    "ellipsis": lambda m: ...,
    "slice": lambda m: slice(None),
    "true": lambda m: True,
    "false": lambda m: np.False_,
}
KIND = Calls()
