"""Late classes: a core from the cache -> its ensembles and rigid contacts, compiled when first asked for.

They are shares of the Cython layer (:data:`.cython_layer.ENSEMBLES`, :data:`.cython_layer.CONTACTS`), compiled once for
all models, and linked for each model with a file that hands on the model's table. So nothing of the model is compiled
again.
"""

from __future__ import annotations

import ctypes
import importlib.machinery
import importlib.util
import sys
import threading
import warnings
from pathlib import Path
from types import ModuleType
from typing import Any

from ..base.files import read_manifest, require_trusted
from ..errors import EomgenError, bad_cache
from ..layer import read_header, read_layer
from .build import compile_and_link
from .cache import Cache, CacheEntry, compute_key
from .compiler import CompilerInfo, find_compiler
from .cython_layer import CONTACTS, ENSEMBLES, FIRST, HEADERS, Share, build_layer, describe_interpreter
from .late_lanes import find_lanes, told
from .options import Options, compile_flags, link_flags

#: What they are called in a core, and the share that has them.
NAMES = {"ensemble": ENSEMBLES, "solve_contacts": CONTACTS, "rigid_stepper": CONTACTS}
WORDS = {ENSEMBLES: "ensembles", CONTACTS: "rigid contacts"}
TABLE = "eomgen_handed_table.c"
#: The table that Python hands over before the module is made.
HANDED = """\
#include "eomgen.h"

static const eomgen_model *handed;

#if defined(__GNUC__)
__attribute__((visibility("default")))
#endif
void eomgen_hand_table(const eomgen_model *table);
void eomgen_hand_table(const eomgen_model *table) { handed = table; }

const eomgen_model *eomgen_model_table(void) { return handed; }
"""
_lock = threading.RLock()
_missing: set[tuple[str, Share]] = set()  # cores and what they go without: said once


def find_class(core: Any, file: Path, name: str) -> Any:
    """A late class or function of a core, compiled now if need be.

    Where that fails a warning says why; ensembles and steps with rigid contacts are then computed in Python.

    Parameters
    ----------
    core : module
    file : Path
        The core's, in the cache.
    name : str
        One of ``NAMES``.

    Raises
    ------
    AttributeError
        There is no such name, or it cannot be compiled.
    """
    if name not in NAMES:
        raise AttributeError(f"module {core.__name__!r} has no attribute {name!r}")
    share = NAMES[name]
    with _lock:
        if (core.__name__, share) in _missing:
            raise AttributeError(name)
        try:
            made = _load(core, file, share)
        except (EomgenError, OSError, ValueError, ImportError) as error:
            _missing.add((core.__name__, share))
            if file in told:
                raise AttributeError(name) from error
            told.add(file)
            warnings.warn(
                f"{WORDS[share]} of the model in {file} are computed in Python, which takes longer, because their code "
                f"cannot be compiled: {error}",
                RuntimeWarning,
                stacklevel=2,
            )
            raise AttributeError(name) from error
        if name == "ensemble":
            core.take_lanes()
        found = vars(core)[name] = getattr(made, name)
    return found


def _load(core: Any, file: Path, share: Share) -> ModuleType:
    name = f"{core.__name__.removesuffix('._core')}_{WORDS[share].replace(' ', '_')}._core"
    if name in sys.modules:
        return sys.modules[name]
    entry = _find_or_build(file, share)
    loader = importlib.machinery.ExtensionFileLoader(name, str(entry.product))
    spec = importlib.util.spec_from_file_location(name, entry.product, loader=loader)
    assert spec is not None
    require_trusted(entry.product)
    try:
        ctypes.CDLL(str(entry.product)).eomgen_hand_table(ctypes.c_void_p(core.table))
        module = importlib.util.module_from_spec(spec)
        loader.exec_module(module)
    except (OSError, ImportError, AttributeError) as error:
        Cache(file.parents[2]).discard(entry.key)
        raise ImportError(f"{entry.product} cannot be loaded: {error}") from error
    module.offer_lanes(lambda: find_lanes(file))
    sys.modules[name] = module
    return module


def _find_or_build(file: Path, share: Share) -> CacheEntry:
    """The library's entry."""
    cache = Cache(file.parents[2])
    built = cache.find(file.parent.name)
    if built is None:
        raise bad_cache("its cache entry is gone or was changed; compile the model again")
    recipe = read_manifest(file.parent)["recipe"]
    if (entry := cache.find(_key(built.key, recipe["compiler"], share))) is not None:
        return entry  # needs no compiler
    compiler = find_compiler(recipe["options"]["compiler"])
    key = _key(built.key, [*compiler.command, compiler.version], share)
    return cache.find(key) or _build(cache, key, built.name, compiler, share)


def _texts() -> tuple[dict[str, str], dict[str, str]]:
    return read_layer(), {header: read_header(header) for header in HEADERS}


def _key(of: str, compiler: list[str], share: Share) -> str:
    layer, headers = _texts()
    sources = {**layer, **headers, TABLE: HANDED}
    parts = {"kind": "classes", "of": of, "compiler": compiler, "sources": sources, "files": share.c_files}
    return compute_key({**parts, "interpreter": describe_interpreter()})


def _build(cache: Cache, key: str, name: str, compiler: CompilerInfo, share: Share) -> CacheEntry:
    """Link a share of the layer with the table's file."""
    layer, headers = _texts()
    options = Options()
    flags = {TABLE: compile_flags(options, compiler, 0, hidden=True), "": link_flags(options, compiler, extension=True)}

    def objects() -> list[str]:
        first, late = (build_layer(cache, layer, headers, compiler, _tell, one) for one in (FIRST, share))
        return [*map(str, late), *map(str, first[1:])]

    with cache.attempt(key) as directory:
        for file, text in {TABLE: HANDED, HEADERS[0]: headers[HEADERS[0]]}.items():
            (directory / file).write_text(text, encoding="utf-8", newline="\n")
        product = f"_core{describe_interpreter()['suffix']}"
        compile_and_link(directory, key, name, {TABLE: Path(TABLE)}, flags, product, compiler, 1, objects)
        return cache.publish(directory, key, "classes", name, product, {"flags": flags})


def _tell(line: str) -> None:
    """Tell somebody who waits at a terminal or before a notebook; compiling takes seconds."""
    shell = getattr(sys.modules.get("IPython"), "get_ipython", lambda: None)()
    if sys.stderr.isatty() or getattr(shell, "kernel", None) is not None:
        print(f"eomgen: {line}", file=sys.stderr)
