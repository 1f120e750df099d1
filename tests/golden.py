"""Golden recordings: what the public calls of eomgen return for every model of the registry, as numbers with limits.

    python tests/golden.py record DIR [NAME ...] [--target cython]
    python tests/golden.py compare OLD NEW

``record`` writes one JSON file a model, and ``faults.json`` and ``schema.json``.  ``compare`` prints the largest
differences of two recordings, relative to the largest entry of each quantity, and exits with 1 where one is above its
limit.  ``tests/core/recordings`` was recorded before the rebuilding; it is never made anew to hide a difference.
"""

import argparse
import json
import sys
import tempfile
import warnings
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import command
import models
import numpy as np

import eomgen as eg

RECORDINGS = Path(__file__).resolve().parent / "core" / "recordings"
LIMIT = 1e-9  #: of a quantity's largest entry
LIMITS = {"run": 1e-6, "run_outputs": 1e-6, "multipliers": 1e-7, "reactions": 1e-7}  #: of conditioning, or over a run
DIGITS = 13  #: significant ones of each number that is kept
FLOOR = 1e-5  #: of the largest entry; below it all is rounding
#: Changes of the example slider_crank, each a fault: path of an entry -> its value.
FAULTS: dict[str, Any] = {
    "name": "2 words", "gravity": [0, 1], "parameters.r": "r +", "parameters.l.value": "unknown*2",
    "parameters.m_c.value": None, "parameters.m_r.unit": "parsec", "inputs.tau": "x", "bodies.crank": 3,
    "bodies.crank.mass": -1, "bodies.crank.inertia.zz": -1, "bodies.crank.inertia.ww": 1, "bodies.crank.com": [0, 0],
    "bodies.crank.markers.pin": "here", "bodies.crank.weight": 3, "joints.A.type": "hinge", "joints.A.axis": "w",
    "joints.A.between": ["ground"], "joints.A.coordinate": "r", "joints.B.between": ["crank.pin", "nobody"],
    "joints.C.between": ["rod.tip", "rod"], "joints.D": {"type": "prismatic"},
    "joints.A.limits": {"lower": 2, "upper": 1},
    "forces.motor.type": "engine", "forces.motor.value": "tau**", "forces.motor.joint": "Z",
    "forces.k1.stiffness": "s'", "forces.k1.length": [1], "forces.new": {"type": "spring"},
    "constraints": {"c": {"type": "coupling"}},
    "constraints.new": {"type": "driver", "coordinate": "theta", "value": "theta"}, "outputs.o": "x(rod.nose)",
    "outputs.speed": "import os", "independent": ["theta", "s"], "initial.theta": "a", "initial.nothing": 1,
    "initial.theta_dot": float("inf"), "simulation.end": -1, "simulation.method": "Euler", "states": {"a": "b"},
    "events": {"e": {"expression": "theta", "reset": {"r": 1}}},
    "functions": {"f": {"type": "table", "x": [1, 0], "y": [1, 2]}},
    "extra": {}, "add": {"leg": {"component": "none"}},
}  # fmt: skip


def states(module: Any, x0: np.ndarray) -> list[np.ndarray]:
    """Return the declared start and two consistent states beside it."""
    random = np.random.default_rng(zlib.crc32(module.name.encode()))
    found = [x0]
    for size in (0.02, 0.1):
        beside = x0 + size * random.standard_normal(x0.size) * np.maximum(1.0, np.abs(x0))
        beside[module.n_q + module.n_v :] = x0[module.n_q + module.n_v :]  # counters and switches take no other values
        try:
            found.append(module.project(beside))
        except eg.EomgenError:  # too far for one step: closer
            found.append(module.project(x0 + 0.01 * (beside - x0)))
    return found


def recording(name: str, target: str = "numpy", at: list[list[float]] | None = None) -> dict[str, Any]:
    """Return the quantities of one model: names, then arrays at three states, recorded ones if given, then one run."""
    known = models.MODELS[name]
    model = known.build()
    equations = model.derive()
    module = equations.compile(target=target, **(models.IN_C if target == "cython" else {}))
    out: dict[str, Any] = {
        "names": {k: list(getattr(module, k)) for k in ("x_names", "u_names", "p_names", "y_names", "body_names")},
        "independent": list(equations.independent),
        "method": equations.method,
        "freedoms": model.check().degrees_of_freedom,
        "digest": module.metadata["model_digest"],
        "operations": {
            what: [count.multiplications, count.additions, count.divisions, sum(count.functions.values())]
            for what, count in equations.operations.items()
        },
    }
    x0 = module.x0()
    out["x0"] = kept(x0)
    out["states"] = at or [kept(x) for x in states(module, x0)]
    calls: dict[str, Callable[[np.ndarray], Any]] = {
        "rhs": lambda x: module.rhs(0.0, x),
        "jacobian": lambda x: module.jacobian(0.0, x),
        "mass_matrix": lambda x: module.mass_matrix(x[: module.n_q]),
        "embedded_mass_matrix": lambda x: module.embedded_mass_matrix(x[: module.n_q]),
        "bias": lambda x: module.bias(0.0, x),
        "energy": lambda x: module.energy(x),
        "outputs": lambda x: module.outputs(0.0, x),
        "constraint_jacobian": lambda x: module.constraint_jacobian(x[: module.n_q]),
        "multipliers": lambda x: module.multipliers(0.0, x),
        "reactions": lambda x: module.reactions(0.0, x),
        "poses": lambda x: module.poses(x[: module.n_q]),
        "momentum": lambda x: module.momentum(x),
    }
    for what, call in calls.items():
        out[what] = [value(call, np.array(x)) for x in out["states"]]
    if "rigid" in known.features:
        options: dict[str, Any] = {}
    else:
        options = {"inputs": known.inputs, "rtol": 1e-10, "atol": 1e-12}
    times = np.linspace(0.0, known.span, 5)
    try:
        run = module.simulate((0.0, known.span), t_eval=times, **options)
        out["run"] = kept(run.x)
        out["run_outputs"] = [kept(run[y]) for y in module.y_names]
    except eg.EomgenError as error:
        out["run"] = type(error).__name__
    return out


def value(call: Callable[[np.ndarray], Any], x: np.ndarray) -> Any:
    """Return the result as lists, or the name of the error."""
    try:
        return kept(call(x))
    except (eg.EomgenError, AttributeError, ValueError) as error:
        return type(error).__name__


def kept(array: Any) -> Any:
    """Return numbers as lists, rounded to the digits that are kept."""
    if isinstance(array, np.ndarray | list | tuple):
        return [kept(entry) for entry in np.asarray(array, dtype=float)]
    return float(f"{float(array):.{DIGITS}g}")


def faults() -> dict[str, Any]:
    """Return for every fault of the table the class of the error, and the places that it names with their codes."""
    out: dict[str, Any] = {}
    with tempfile.TemporaryDirectory() as folder:
        for path, new in FAULTS.items():
            file = Path(folder) / "faulty.yaml"
            file.write_text(json.dumps(changed(path, new)), encoding="utf-8")
            try:
                eg.load(file).compile(target="numpy").simulate()
                out[path] = "none"
            except eg.ModelError as error:
                out[path] = ["ModelError", *sorted(f"{problem.path} {problem.code}" for problem in error.problems)]
            except eg.EomgenError as error:
                out[path] = [type(error).__name__, error.code]
    return out


def schema() -> dict[str, Any]:
    """Return the JSON Schema of model files."""
    return json.loads(command.run("check", "--schema")[1])  # type: ignore[no-any-return]


def changed(path: str, new: Any) -> dict[str, Any]:
    """Return the data of the example slider_crank with one entry replaced."""
    from ruamel.yaml import YAML

    data = YAML(typ="safe").load((models.EXAMPLES / "slider_crank.yaml").read_text(encoding="utf-8"))
    *above, last = path.split(".")
    entry = data
    for key in above:
        if not isinstance(entry.get(key), dict):
            entry[key] = {"value": entry[key]} if key in entry else {}
        entry = entry[key]
    entry[last] = new
    return data  # type: ignore[no-any-return]


def record(folder: Path, names: list[str], target: str) -> None:
    """Write the recordings of these models, or of all, and of the faulty files."""
    folder.mkdir(parents=True, exist_ok=True)
    made = {name: lambda name=name: recording(name, target) for name in names or models.MODELS}
    if not names:
        made |= {"faults": faults, "schema": schema}
    for name, make in made.items():
        (folder / f"{name}.json").write_text(json.dumps(make()) + "\n", encoding="utf-8")
        print(name, flush=True)


def difference(old: Any, new: Any) -> float:
    """Return the largest difference relative to the largest entry; infinity where shapes or words differ."""
    if isinstance(old, list) and isinstance(new, list) and len(old) == len(new):
        if all(isinstance(entry, int | float) for entry in (*old, *new)):
            gap = max((abs(a - b) for a, b in zip(old, new, strict=True)), default=0.0)
            return gap / max([FLOOR, *map(abs, old)])
        try:
            one, two = np.asarray(old, dtype=float), np.asarray(new, dtype=float)
        except (ValueError, TypeError):  # words, or entries by name
            return max((difference(a, b) for a, b in zip(old, new, strict=True)), default=0.0)
        if one.shape != two.shape:
            return np.inf
        return float(np.abs(one - two).max(initial=0.0) / max(FLOOR, np.abs(one).max(initial=0.0)))
    if isinstance(old, dict) and isinstance(new, dict) and old.keys() == new.keys():
        return max((difference(old[k], new[k]) for k in old), default=0.0)
    return 0.0 if old == new else np.inf


def differences(old: dict[str, Any], new: dict[str, Any]) -> dict[str, float]:
    """Return for each quantity of two recordings its difference in parts of the limit.

    Without freedoms x' depends on time alone: the Jacobian is 0, and what the recorded one has instead is rounding.
    """
    found = {
        key: difference(old.get(key), new.get(key)) / LIMITS.get(key, LIMIT) for key in sorted(old.keys() | new.keys())
    }
    if old.get("freedoms") == 0 and np.isfinite(found.get("jacobian", np.inf)):
        found["jacobian"] = float(np.abs(new["jacobian"]).max() / (FLOOR * LIMIT))
    return found


def read(name: str, folder: Path = RECORDINGS) -> dict[str, Any]:
    """Return a stored recording."""
    return json.loads((folder / f"{name}.json").read_text(encoding="utf-8"))  # type: ignore[no-any-return]


def compare(old: Path, new: Path) -> int:
    """Print the largest differences of two folders of recordings; 1 where one is above its limit."""
    worst: list[tuple[float, str, str]] = []
    for path in sorted(old.glob("*.json")):
        if (new / path.name).exists():
            found = differences(read(path.stem, old), read(path.stem, new))
            worst += [(gap, path.stem, key) for key, gap in found.items()]
        else:
            worst.append((np.inf, path.stem, "file"))
    worst.sort(reverse=True)
    print("\n".join(f"{ratio:10.3g} of its limit  {name}.{key}" for ratio, name, key in worst[:20]))
    return int(bool(worst) and worst[0][0] > 1.0)


if __name__ == "__main__":
    warnings.simplefilter("ignore")
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    verbs = parser.add_subparsers(dest="verb", required=True)
    one = verbs.add_parser("record")
    one.add_argument("folder", type=Path)
    one.add_argument("names", nargs="*")
    one.add_argument("--target", default="numpy")
    two = verbs.add_parser("compare")
    two.add_argument("old", type=Path)
    two.add_argument("new", type=Path)
    given = parser.parse_args()
    if given.verb == "record":
        record(given.folder, given.names, given.target)
    else:
        sys.exit(compare(given.old, given.new))
