"""Calls of compiled modules with odd arguments: wrong shapes, types, names, sizes, numbers that are none."""

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
from attack.runner import Kind
from attack.words import TEXTS
from attack.yaml_files import SMALL

import eomgen as eg

#: Model -> its text; an example is read from its file.
MODELS = {"pendulum": SMALL["pendulum"], "spring": SMALL["spring"], "four_bar": "", "rolling_disc": ""}
TARGETS = ("numpy", "cython")
NOT_CALLED = {"verify", "bind", "report"}  #: take seconds by design, or are bound before each call
RARE = set(
    "simulate simulate_many simulate_impacts sensitivities kinematic_analysis motion_range equilibrium branches "
    "integrator".split()
)
MOST, FEW = 100_000, 2_000  #: numbers of an array; of points at which a mechanism is closed one after the other
LONG = {"span", "points", "most", "of", "over", "within"}  #: arguments in which a large number rightly takes long
#: Arguments without which most calls say only that they are missing.
NEEDED = set("t x q v a q_i x_min h name names gaps over of span named".split())
#: Options of runs that stand behind **options.
OPTIONS: dict[str, Any] = {
    "rtol": 1e-6, "atol": 1e-8, "t_eval": [0.0, 0.01], "max_step": 0.01, "first_step": 0.001, "events": None, "step": 0.01,
    "dense_output": True, "workers": 1, "samples": 3, "colour": "red", "method": "RK45", "vectorized": True,
}  # fmt: skip
NUMBERS = (0, 1, -1, 2, 0.5, -0.0, 1e308, -1e308, 1e-308, 5e-324, 1e16, "nan", "inf", "-inf", 10**30, 2**63, 10**400)
ODD: tuple[Any, ...] = (
    None, [], {}, [[]], [None], ["a"], [1, "a"], [[1, 2], [3]], {"": 1}, {"theta": "nan"}, {"q": None}, ["nan"], [-1.0],
    [1.0, 0.0], [0.0, "nan"], [0.0, 0.0], "theta", ["theta", "theta"],
)  # fmt: skip
SHAPES: tuple[Any, ...] = (
    (), (0,), (1,), (2,), (3,), (5,), (0, 0), (2, 0), (2, 2), (4, 3), (1, 1, 1), (2, 1000), (MOST,), *("good",) * 3,
    *("batch",) * 2, "longer", "shorter",
)  # fmt: skip
DTYPES = "f8 f4 f2 i8 u1 c16 O U3 ? >f8 M8[s] f8,f8 S2 g".split()
FILLS = ("good", 0.0, 1.0, "nan", "inf", 1e308, 1e16, -1.0, 1e-320, "random")


class Calls(Kind):
    """Calls by keyword: most arguments good, some odd."""

    name = "calls"
    #: NumPy's of a complex array given for a real one, SciPy's of options that a solver does not know.
    unjudged = (np.exceptions.ComplexWarning, UserWarning)

    def prepare(self, folder: Path) -> None:
        self.modules: dict[str, Any] = {}
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            for name, text in MODELS.items():
                (folder / f"{name}.yaml").write_text(text)
                model = eg.load(folder / f"{name}.yaml") if text else eg.load_example(name)
                for target in TARGETS:
                    self.modules[f"{name} {target}"] = model.compile(target=target)
            self.good = {name: good_values(module) for name, module in self.modules.items()}
            self.calls = {name: list(callables(module)) for name, module in self.modules.items()}
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

    def run(self, case: Any, folder: Path) -> str:
        module, good = self.modules[case["module"]], self.good[case["module"]]
        values = {name: made(spec, good.get(name, 1.0), module) for name, spec in case["arguments"].items()}
        self.call(module, case["on"], case["call"], values)
        return "returned"

    def call(self, module: Any, on: str, call: str, values: dict[str, Any]) -> None:
        bound = getattr(module.minimal if on == "minimal" else module, call)
        for more in (values.pop("options", None), values.pop("named", None)):
            values |= more if isinstance(more, dict) else {}
        places = [values.pop(name) for name in ("guess_", "values_") if name in values]
        bound(*places, **values)


def callables(module: Any) -> Iterator[tuple[str, str, list[str]]]:
    """Every public call of a module and of its minimal form, with the names of its arguments."""
    owners = [("module", module)]
    with contextlib.suppress(eg.EomgenError):  # rolling leaves none
        owners.append(("minimal", module.minimal))
    for on, owner in owners:
        for name in sorted(set(dir(owner)) - NOT_CALLED):
            try:
                call = getattr(owner, name)
                parameters = inspect.signature(call).parameters.values()
            except (eg.EomgenError, TypeError, ValueError):
                continue
            if name.startswith("_") or isinstance(call, type):
                continue
            names = [p.name + "_" if p.kind is p.POSITIONAL_ONLY else p.name for p in parameters if p.name != "cluster"]
            if "args" in names:  # a kernel that is compiled late
                names = ["t", "x", "p", "u", "out"]
            yield on, name, names


def good_values(module: Any) -> dict[str, Any]:
    """A value that fits for every name of an argument."""
    x, n, first = module.x0(), module.n_dof, module.q_names[0]
    start = {first: float(x[0])}
    values: dict[str, Any] = OPTIONS | {
        "t": 0.0, "x": x, "q": x[: module.n_q], "v": x[module.n_q : module.n_q + module.n_v], "a": np.zeros(module.n_v),
        "p": module.p, "u": module.u, "out": np.empty(module.n_x), "q_i": np.atleast_1d(x[:n]), "v_i": np.zeros(n),
        "a_i": np.zeros(n), "guess": start, "guess_": start, "values_": start, "rows": "all", "h": 0.01, "span": (0.0, 0.05),
        "initial": start, "parameters": dict(zip(module.p_names, module.p, strict=True)), "name": first,
        "inputs": dict(zip(module.u_names, module.u, strict=True)), "names": [*module.p_names[:1], first],
        "gaps": {first: 0.5}, "lock": [first], "hold": [first], "unknowns": list(module.p_names[:1]),
        "over": {first: (0.0, 0.5, 3)}, "of": first, "method": None, "step": None, "store": None,
        "progress": False, "form": "minimal", "independent": [first], "weights": {first: 2.0}, "points": 10,
        "most": 3, "limits": True, "partial": True, "closed": True, "within": (0.0, 1.0), "actuated": [first],
        "options": dict(OPTIONS), "count": 2, "threads": 1, "block": 1, "keep_events": 2, "max_steps": 1000,
        "reduce": "states", "samples": 3, "states": 1, "named": start, "led": {first: [start[first], start[first] + 0.01]},
    }  # fmt: skip
    with contextlib.suppress(eg.EomgenError):
        values["x_min"] = module.minimal.reduce(x)
    return {"x_min": x} | values


def odd(r: random.Random, name: str) -> dict[str, Any]:
    """The description of an odd value."""
    k = r.randrange(9)
    if name in ("options", "named", "led"):
        words = (*TEXTS, "theta", "q", "q_dot", "t", "p")
        keys = r.sample(list(OPTIONS), r.randint(0, 3)) if name == "options" else r.choices(words, k=r.randint(0, 2))
        good = {key: {"value": OPTIONS[key]} for key in keys if key in OPTIONS and r.random() < 0.4}
        return {"dict": {key: good.get(key) or odd(r, "span") for key in keys}}
    if k <= 1 and name not in LONG:
        return {"value": r.choice(NUMBERS)}
    if k == 2:
        return {"value": r.choice(TEXTS)}
    if k == 3:
        return {"object": r.choice(list(OBJECTS))}
    if k == 4:
        return {"value": r.choice(ODD)}
    if k == 5:
        return {"dict": {r.choice((*TEXTS, "theta", "q", "q_dot", "l", "k", "u")): odd(r, name)}}
    dtype = r.choice(DTYPES) if r.random() < 0.4 else "f8"
    return {
        "array": {
            "shape": r.choice(SHAPES), "fill": r.choice(FILLS), "dtype": dtype, "layout": r.choice(list(LAYOUTS))
        }
    }  # fmt: skip


def made(spec: Any, good: Any, module: Any) -> Any:
    """The value that a description means."""
    if "good" in spec:
        return good.copy() if isinstance(good, np.ndarray | dict) else good
    if "value" in spec:
        return plain(spec["value"])
    if "dict" in spec:
        return {key: made(inner, 1.0, module) for key, inner in spec["dict"].items()}
    if "object" in spec:
        return OBJECTS[spec["object"]](module)
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
    shape, fill, n = spec["shape"], spec["fill"], base.shape[0]
    sizes = {"good": base.shape, "batch": (*base.shape, 3), "longer": (n + 1,), "shorter": (max(n - 1, 0),)}
    size = sizes[shape] if isinstance(shape, str) else tuple(shape)
    if fill == "good" and shape in ("good", "batch"):
        values = np.ascontiguousarray(np.broadcast_to(base.T, size[::-1]).T)
    elif fill == "random":
        values = np.random.default_rng(len(size)).normal(size=size)
    else:
        values = np.full(size, math.pi if fill == "good" else float(fill))
    with warnings.catch_warnings(), np.errstate(all="ignore"):
        warnings.simplefilter("ignore")
        try:
            values = values.astype(spec["dtype"])
        except (TypeError, ValueError):
            values = np.zeros(size, dtype=spec["dtype"])
    return LAYOUTS[spec["layout"]](values)


def read_only(values: Any) -> Any:
    values.setflags(write=False)
    return values


LAYOUTS: dict[str, Callable[[Any], Any]] = {
    "C": lambda a: a,
    "F": np.asfortranarray,
    "strided": lambda a: np.repeat(a, 2, axis=-1)[..., ::2] if a.ndim else a,
    "reversed": lambda a: a[::-1] if a.ndim else a,
    "readonly": read_only,
    "broadcast": lambda a: np.broadcast_to(a, (2, *a.shape)),
    "matrix": lambda a: a.tolist(),
}
OBJECTS: dict[str, Callable[[Any], Any]] = {
    "set": lambda m: {1.0, 2.0},
    "bytes": lambda m: b"abc",
    "complex": lambda m: 1j,
    "symbol": lambda m: sympy.Symbol("q"),
    "function": lambda m: lambda *a: 1.0,
    "self": lambda m: m,
    "type": lambda m: float,
    "object": lambda m: object(),
    "false": lambda m: np.False_,
}
KINDS = {"calls": Calls()}
