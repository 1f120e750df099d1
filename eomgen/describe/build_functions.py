"""Entries of the functions section -> functions that expressions of the graph can call."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from ..base.limits.numbers import APART, PERIODIC
from ..elements import kinds
from ..graph.functions import Function
from ..numeric.splines import curve_coefficients, slopes, surface_nodes
from ..numeric.user_functions import Curve, Surface, Twin
from .build_native import build_native
from .checks import check_keys
from .description import DescribedEntry, items
from .fields import FUNCTION, function_fields
from .names import QUANTITIES, nearest
from .values import Reader, is_number

POINTS = 20_000  #: of a table, those of a grid together

Array = np.ndarray


def build_functions(reader: Reader, entries: list[DescribedEntry]) -> None:
    """Declare the functions of all entries; one at fault gets a stand-in, so that its calls are not at fault too."""
    for entry in entries:
        if isinstance(entry.name, str) and entry.name in QUANTITIES:
            message = f"{entry.name!r} is a built-in name for the motion of a marker"
            reader.faults.add(entry.path, message, "choose another name", "EG-NAME-TAKEN")
        reader.names.declare("function", entry.name, entry.path)
        function = None if reader.faults.under(entry.path) else _build(reader, entry)
        if function is None:
            arity = _arity_meant(entry)
            function = Function(str(entry.name), arity, Twin({(0,) * arity: lambda *arguments: 1.0}))
        if reader.names.kinds.get(str(entry.name)) == "function":  # not taken by something else
            reader.graph.declare(function)


def _arity_meant(entry: DescribedEntry) -> int:
    given = entry.values.get("arguments", len(items(entry.values.get("derivatives")) or ()))
    return given if isinstance(given, int) and 1 <= given <= 16 else 2 if "z" in entry.values else 1


def _build(reader: Reader, entry: DescribedEntry) -> Function | None:
    faults, path = reader.faults, entry.path
    given = entry.values.get("type")
    if not isinstance(given, str) or given not in FUNCTION:
        message = "is missing" if given is None else f"no function of type {given!r}"
        faults.add(f"{path}.type", message, nearest(str(given), FUNCTION, "types"), "EG-CHOICE")
        return None
    check_keys(path, entry.values, function_fields(given), faults)
    if faults.under(path):
        return None
    return (
        build_native(reader, entry) if given == "native" else read_table(reader, entry.name, entry.path, entry.values)
    )


def read_table(reader: Reader, name: str, path: str, values: Mapping[str, Any]) -> Function | None:
    """A table of one or two arguments; None where something is wrong with it, which is noted."""
    faults = reader.faults
    fields = FUNCTION["table"]
    kind = reader.choice(f"{path}.kind", values.get("kind", fields["kind"].default), fields["kind"])
    beyond = reader.choice(
        f"{path}.extrapolation", values.get("extrapolation", fields["extrapolation"].default), fields["extrapolation"]
    )
    x = _points(reader, f"{path}.x", values["x"])
    surface = values.get("z") is not None
    y = _points(reader, f"{path}.y", values["y"]) if surface else _numbers(reader, f"{path}.y", values["y"])
    if x is None or y is None:
        return None
    if surface:
        if kind not in ("cubic", "natural"):
            message = f"{kind!r} is not available for tables of two arguments"
            faults.add(f"{path}.kind", message, "allowed: cubic, natural", "EG-UNSUPPORTED")
        z = _grid(reader, f"{path}.z", values["z"], len(x), len(y))
        if z is None or faults.under(path):
            return None
        with np.errstate(all="ignore"):
            nodes = surface_nodes(x, y, z, kind)
        function = Function(name, 2, Surface(x, y, nodes, float(beyond == "linear")))
        return _finite(reader, path, function, nodes)
    if len(y) != len(x):
        faults.add(f"{path}.y", f"has {len(y)} values for {len(x)} points", "give one for each x", "EG-SHAPE")
    elif kind == "periodic":
        if len(x) < 3:
            remedy = "a periodic table needs three or more, of which the last repeats the first"
            faults.add(f"{path}.x", "has fewer than three points", remedy, "EG-SHAPE")
        elif abs(y[-1] - y[0]) > PERIODIC * np.max(np.abs(y)):
            faults.add(
                f"{path}.y",
                f"ends with {y[-1]:g} and begins with {y[0]:g}",
                "make the two values of a period equal",
                "EG-CONTRADICTION",
            )
        y[-1] = y[0]
    if faults.under(path):
        return None
    with np.errstate(all="ignore"):
        curve = curve_function(name, x, y, kind, beyond == "linear")
    assert isinstance(curve.evaluator, Curve)
    return _finite(reader, path, curve, curve.evaluator.coefficients)


def _finite(reader: Reader, path: str, function: Function, numbers: Array) -> Function | None:
    """The function, unless its slopes are too large for doubles."""
    if np.isfinite(numbers).all():
        return function
    reader.faults.add(path, "is too steep for double precision", "scale its values or its points", "EG-RANGE")
    return None


def curve_function(name: str, x: Array, y: Array, kind: str, linear: bool = True) -> Function:
    """A function of one argument through checked points; ``linear`` is how it goes on beyond them."""
    period = float(x[-1] - x[0]) if kind == "periodic" else None
    return Function(name, 1, Curve(x, curve_coefficients(x, y, slopes(x, y, kind), linear), period))


def _points(reader: Reader, path: str, given: Any) -> Array | None:
    """Places of a table, at least two and in order."""
    x = _numbers(reader, path, given)
    if x is None:
        return None
    if len(x) < 2:
        reader.faults.add(path, "has fewer than two points", "give two or more", "EG-SHAPE")
        return None
    steps = np.diff(x)
    if not (steps > 0.0).all():
        k = int(np.argmax(~(steps > 0.0)))
        reader.faults.add(
            f"{path}[{k + 1}]", f"{x[k + 1]:g} follows {x[k]:g}", "the points of a table must increase", "EG-RANGE"
        )
        return None
    if not np.isfinite(x[-1] - x[0]) or (steps < APART * np.max(np.abs(x))).any():
        reader.faults.add(
            path, "has points too close together, or too far apart, for double precision", code="EG-RANGE"
        )
        return None
    return x


def _numbers(reader: Reader, path: str, given: Any) -> Array | None:
    """A list of finite numbers; a text such as ``pi/2`` counts as one."""
    listed = items(given)
    if listed is None:
        reader.wrong(path, given, kinds.Numbers)
        return None
    if len(listed) > POINTS:
        reader.faults.add(path, f"has {len(listed)} numbers", f"a table has at most {POINTS} points", "EG-TOO-LARGE")
        return None
    read = [
        float(x) if is_number(x) and -1e300 < x < 1e300 else reader.number(f"{path}[{k}]", x)
        for k, x in enumerate(listed)
    ]
    found = [x for x in read if x is not None]
    return np.array(found) if len(found) == len(listed) else None


def _grid(reader: Reader, path: str, given: Any, n_x: int, n_y: int) -> Array | None:
    """Values on a grid, a row for each x."""
    rows = items(given)
    if rows is None:
        reader.wrong(path, given, kinds.Grid)
        return None
    if len(rows) != n_x:
        reader.faults.add(path, f"has {len(rows)} rows for {n_x} points x", "give one for each x", "EG-SHAPE")
        return None
    if n_x * n_y > POINTS:
        reader.faults.add(path, f"has {n_x * n_y} points", f"a table has at most {POINTS}", "EG-TOO-LARGE")
        return None
    read = [_numbers(reader, f"{path}[{k}]", row) for k, row in enumerate(rows)]
    for k, row in enumerate(read):
        if row is not None and len(row) != n_y:
            reader.faults.add(
                f"{path}[{k}]", f"has {len(row)} values for {n_y} points y", "give one for each y", "EG-SHAPE"
            )
    found = [row for row in read if row is not None and len(row) == n_y]
    return np.array(found) if len(found) == n_x else None
