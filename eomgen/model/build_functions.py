"""Entries of the functions section -> functions that expressions of the graph can call.

Of a function in C nothing is read before permission: that of a model file is refused unless the file was loaded with
``allow_native``, because compiling and calling it runs code of the file's author.
"""

from __future__ import annotations

import importlib.util
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ..base.files import open_plain
from ..base.limits.numbers import APART, PERIODIC
from ..base.splines import curve_coefficients, slopes
from ..elements import kinds
from ..errors import UsageError
from ..expr.functions import Curve, Function, NativeCode, Orders, PythonFallback, Surface, up_to
from .checks import check_keys
from .description import DescribedEntry, items
from .fields import FUNCTION, PYTHON_SLOPES, function_fields
from .names import fault_of_name
from .quantities import QUANTITIES
from .values import Reader, is_number

_HIDDEN = re.compile(r'/\*.*?\*/|//[^\n]*|"(?:\\.|[^"\\\n])*"', re.DOTALL)
_QUALIFIERS = {"const", "static", "inline", "extern", "register", "volatile", "restrict"}
_OTHERS = {"int", "float", "char", "short", "long", "unsigned", "signed", "void", "_Bool", "bool", "struct", "union"}


class Signature(NamedTuple):
    """A C function as it is defined or declared."""

    line: int  #: where its name stands
    arguments: int
    foreign: str  #: the first type that is surely not a plain double, or empty


def find_signature(text: str, name: str) -> Signature | None:
    """Where and how C source defines a function; None if that cannot be seen, as behind a macro."""
    bare = _HIDDEN.sub(lambda result: re.sub(r"[^\n]", " ", result[0]), text)
    pattern = rf"(?P<given>[A-Za-z_]\w*(?:\s+[A-Za-z_]\w*|\s*\*)*)[\s*]*\b{name}\s*\((?P<taken>[^()]*)\)\s*[{{;]"
    for result in re.finditer(pattern, bare):
        raw = result["given"].split()
        if raw[0] in ("return", "else", "case"):
            continue  # a call
        taken = [part.strip() for part in result["taken"].split(",")]
        taken = [] if taken in ([""], ["void"]) else taken
        foreign = next((part for part in [" ".join(raw), *taken] if _is_foreign(part)), "")
        return Signature(bare.count("\n", 0, result.start("taken")) + 1, len(taken), " ".join(foreign.split()))
    return None


def _is_foreign(declared: str) -> bool:
    """Whether words that declare a value are surely not those of a double."""
    if "*" in declared or "[" in declared:
        return True
    tokens = [word for word in declared.split() if word not in _QUALIFIERS]
    return bool(tokens) and tokens[0] in _OTHERS


ARGUMENTS = 16  #: of one function
SIZE = 1_000_000  #: bytes of one source file


def build_native(reader: Reader, entry: DescribedEntry) -> Function | None:
    """The function of an entry whose keys are checked; None if it is at fault, which is noted."""
    faults, path, values = reader.faults, entry.path, entry.values
    if not entry.trusted:
        message = "is native code, and native code of model files is not allowed in this call"
        remedy = f"read {values['source']!r} and, if you trust it, use --allow-native (in Python load(path, "
        faults.add(path, message, f"{remedy}allow_native=True))", "EG-REFUSED")
        return None
    arity = _arity(reader, path, values)
    names = _names(reader, entry, arity) if arity else None
    source = _read(reader, f"{path}.source", values["source"], entry.folder)
    if not arity or names is None or source is None:
        return None
    for _, name in names:
        _check_signature(reader, path, name, arity, source)
    fallback = _fallback(reader, entry, arity, names)
    if faults.under(path):
        return None
    code = NativeCode(source[0], source[1], tuple(names))
    return Function(entry.name, arity, fallback, code, reader.description.place(path))


def _check_signature(reader: Reader, path: str, name: str, arity: int, source: tuple[str, str]) -> None:
    """Note a C function that is not there, or not one of so many doubles."""
    file, text = source
    result = find_signature(text, name)
    one = "double " + name + "(" + ", ".join(["double"] * arity) + ")"
    if result is None:
        if not re.search(rf"\b{name}\b", text):
            remedy = "it must be a C function double f(double, ...)"
            reader.fault(f"{path}.source", f"{file} has no function {name!r}", remedy, "EG-NAME-UNKNOWN")
    elif result.foreign:
        message = f"{name} in {file}:{result.line} has {result.foreign!r}, which is not double"
        reader.fault(f"{path}.source", message, f"write {one}", "EG-TYPE")
    elif result.arguments != arity:
        message = f"{name} in {file}:{result.line} takes {result.arguments} arguments, not the {arity} declared"
        reader.fault(f"{path}.arguments", message, f"give arguments: {result.arguments}, or write {one}", "EG-SHAPE")


def _arity(reader: Reader, path: str, values: dict[str, Any]) -> int | None:
    listed = items(values.get("derivatives"))
    raw = values.get("arguments", len(listed) if listed else 1)
    if isinstance(raw, bool) or not isinstance(raw, int) or not 1 <= raw <= ARGUMENTS:
        reader.fault(f"{path}.arguments", f"{raw!r} arguments", f"allowed: 1 to {ARGUMENTS}", "EG-SHAPE")
        return None
    return raw


def _names(reader: Reader, entry: DescribedEntry, arity: int) -> list[tuple[Orders, str]] | None:
    """Names of the C functions by order of derivative."""
    path, values = entry.path, entry.values
    wanted: list[tuple[str, Orders, Any]] = [(f"{path}.function", (0,) * arity, values.get("function", entry.name))]
    for key, total in (("derivatives", 1), ("second_derivatives", 2)):
        every = list(up_to(arity, total))
        for k, name in enumerate(_listed(reader, f"{path}.{key}", values.get(key), len(every))):
            if name is not None:
                wanted.append((f"{path}.{key}[{k}]", every[k], name))
    for place, _, name in wanted:
        fault = fault_of_name(name, symbol=True)
        if fault:
            reader.fault(place, *fault, "EG-NAME-FORM")
    if reader.faults.under(path):
        return None
    if len({name for _, _, name in wanted}) < len(wanted):
        reader.fault(
            path, "names one C function twice", "name a different C function for each derivative", "EG-CONFLICT"
        )
    return None if reader.faults.under(path) else [(orders, name) for _, orders, name in wanted]


def _listed(reader: Reader, path: str, raw: Any, length: int) -> list[Any]:
    if raw is None:
        return []
    listed = items(raw)
    if listed is None:
        reader.wrong(path, raw, kinds.Functions)
        return []
    if len(listed) != length:
        what = f"with that many arguments it needs {length}, null where the source has none"
        reader.fault(path, f"has {len(listed)} entries", what, "EG-SHAPE")
        return []
    return listed


def _read(reader: Reader, path: str, raw: Any, folder: str) -> tuple[str, str] | None:
    """Name and text of a file."""
    name = reader.file(path, raw)
    if name is None:
        return None
    file = Path(folder) / name
    try:
        with open_plain(file) as stream:
            data = stream.read(SIZE + 1)
        if len(data) > SIZE:
            reader.fault(path, f"{file} is too large", f"at most {SIZE} bytes", "EG-TOO-LARGE")
            return None
        return file.name, data.decode("utf-8-sig").replace("\r\n", "\n")
    except OSError as error:
        reader.fault(
            path, f"{file} cannot be read ({error.strerror})", "paths are relative to the model file", "EG-FILE"
        )
    except UnicodeDecodeError:
        reader.fault(path, f"{file} is not UTF-8 text", "save it as UTF-8", "EG-FILE-DAMAGED")
    except UsageError as error:
        reader.fault(path, str(error), code=error.code)
    return None


def _fallback(
    reader: Reader, entry: DescribedEntry, arity: int, names: Sequence[tuple[Orders, str]]
) -> PythonFallback | None:
    """The Python fallback."""
    raw, path = entry.values.get("python"), f"{entry.path}.python"
    functions: dict[Orders, Any] = {(0,) * arity: raw}
    for key, total in zip(PYTHON_SLOPES, (1, 2), strict=True):
        place, every, further = f"{entry.path}.{key}", list(up_to(arity, total)), entry.values.get(key) or None
        if further and not callable(raw):
            remedy = "give a callable; a Python file has derivatives under their C names"
            reader.fault(place, "python_derivatives need a callable python", remedy, "EG-MISSING")
        listed = _listed(reader, place, further, len(every))
        functions |= {orders: f for orders, f in zip(every, listed, strict=False) if f is not None}
    if callable(raw):
        if not all(map(callable, functions.values())):
            reader.fault(path, "is not a function", "give callables, or the path of a Python file", "EG-TYPE")
        return PythonFallback(functions)
    if raw is None:
        return None
    source = _read(reader, path, raw, entry.folder)
    if source is None:
        return None
    try:
        spec = importlib.util.spec_from_file_location(f"_native_{entry.name}", Path(entry.folder) / raw)
        assert spec is not None
        assert spec.loader is not None
        module = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(module)
    except Exception as error:  # whatever the file of the user raises
        reader.fault(path, f"{source[0]} cannot be imported: {type(error).__name__}: {error}", code="EG-FILE")
        return None
    missing = [name for _, name in names if not callable(getattr(module, name, None))]
    if missing:
        remedy = "its functions must have the names of the C functions"
        reader.fault(path, f"{source[0]} has no function {', '.join(missing)}", remedy, "EG-NAME-UNKNOWN")
        return None
    return PythonFallback({orders: getattr(module, name) for orders, name in names})


POINTS = 20_000  #: of a table, those of a grid together

Array = np.ndarray


def build_functions(reader: Reader, entries: list[DescribedEntry]) -> None:
    """Declare the functions of all entries; one at fault gets a stand-in, so that its calls are not at fault too."""
    for entry in entries:
        if isinstance(entry.name, str) and entry.name in QUANTITIES:
            message = f"{entry.name!r} is a built-in name for the motion of a marker"
            reader.fault(entry.path, message, "choose another name", "EG-NAME-TAKEN")
        reader.names.declare("function", entry.name, entry.path)
        function = None if reader.faults.under(entry.path) else _build(reader, entry)
        if function is None:
            arity = _arity_meant(entry)
            function = Function(str(entry.name), arity, PythonFallback({(0,) * arity: lambda *arguments: 1.0}))
        if reader.names.kinds.get(str(entry.name)) == "function":  # not taken by something else
            reader.graph.declare(function)


def _arity_meant(entry: DescribedEntry) -> int:
    raw = entry.values.get("arguments", len(items(entry.values.get("derivatives")) or ()))
    return raw if isinstance(raw, int) and 1 <= raw <= 16 else 2 if "z" in entry.values else 1


def _build(reader: Reader, entry: DescribedEntry) -> Function | None:
    raw = reader.type_of(entry.path, entry.values, FUNCTION, "function")
    if raw:
        callables = [
            entry.values.get("python"),
            *(f for key in PYTHON_SLOPES for f in items(entry.values.get(key)) or ()),
        ]
        fields = function_fields(raw) | (PYTHON_SLOPES if any(map(callable, callables)) else {})
        check_keys(entry.path, entry.values, fields, reader.faults)
    if reader.faults.under(entry.path):
        return None
    return build_native(reader, entry) if raw == "native" else read_table(reader, entry.name, entry.path, entry.values)


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
            message = f"ends with {y[-1]:g} and begins with {y[0]:g}"
            faults.add(f"{path}.y", message, "make the two values of a period equal", "EG-CONTRADICTION")
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
    reader.fault(path, "is too steep for double precision", "scale its values or its points", "EG-RANGE")
    return None


def curve_function(name: str, x: Array, y: Array, kind: str, linear: bool = True) -> Function:
    """A function of one argument through checked points; ``linear`` is how it goes on beyond them."""
    period = float(x[-1] - x[0]) if kind == "periodic" else None
    return Function(name, 1, Curve(x, curve_coefficients(x, y, slopes(x, y, kind), linear), period))


def _points(reader: Reader, path: str, raw: Any) -> Array | None:
    """Places of a table, at least two and in order."""
    x = _numbers(reader, path, raw)
    if x is None:
        return None
    if len(x) < 2:
        reader.fault(path, "has fewer than two points", "give two or more", "EG-SHAPE")
        return None
    steps = np.diff(x)
    if not (steps > 0.0).all():
        k = int(np.argmax(~(steps > 0.0)))
        reader.fault(
            f"{path}[{k + 1}]", f"{x[k + 1]:g} follows {x[k]:g}", "the points of a table must increase", "EG-RANGE"
        )
        return None
    if not np.isfinite(x[-1] - x[0]) or (steps < APART * np.max(np.abs(x))).any():
        reader.fault(path, "has points too close together, or too far apart, for double precision", code="EG-RANGE")
        return None
    return x


def _numbers(reader: Reader, path: str, raw: Any) -> Array | None:
    """A list of finite numbers; a text such as ``pi/2`` counts as one."""
    listed = items(raw)
    if listed is None:
        reader.wrong(path, raw, kinds.Numbers)
        return None
    if len(listed) > POINTS:
        reader.fault(path, f"has {len(listed)} numbers", f"a table has at most {POINTS} points", "EG-TOO-LARGE")
        return None
    read = [
        float(x) if is_number(x) and -1e300 < x < 1e300 else reader.number(f"{path}[{k}]", x)
        for k, x in enumerate(listed)
    ]
    result = [x for x in read if x is not None]
    return np.array(result) if len(result) == len(listed) else None


def _grid(reader: Reader, path: str, raw: Any, n_x: int, n_y: int) -> Array | None:
    """Values on a grid, a row for each x."""
    rows = items(raw)
    if rows is None:
        reader.wrong(path, raw, kinds.Grid)
        return None
    if len(rows) != n_x:
        reader.fault(path, f"has {len(rows)} rows for {n_x} points x", "give one for each x", "EG-SHAPE")
        return None
    if n_x * n_y > POINTS:
        reader.fault(path, f"has {n_x * n_y} points", f"a table has at most {POINTS}", "EG-TOO-LARGE")
        return None
    read = [_numbers(reader, f"{path}[{k}]", row) for k, row in enumerate(rows)]
    for k, row in enumerate(read):
        if row is not None and len(row) != n_y:
            reader.fault(f"{path}[{k}]", f"has {len(row)} values for {n_y} points y", "give one for each y", "EG-SHAPE")
    result = [row for row in read if row is not None and len(row) == n_y]
    return np.array(result) if len(result) == n_x else None


def surface_nodes(x: Array, y: Array, z: Array, kind: str) -> Array:
    """Values and derivatives (n_x, n_y, 4) of a surface: a tensor product spline."""
    along_x = slopes(x, z, kind)
    along_y = slopes(y, z.T, kind).T
    both = slopes(y, along_x.T, kind).T
    return np.stack([z, along_x, along_y, both], axis=-1)
