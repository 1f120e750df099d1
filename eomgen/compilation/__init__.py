"""Compilation: source texts -> a cached library of one model, opened by the extension module that all models share.

::

    sources -> options.compile_flags -> cache key -> found? -> load: native.Model
                                             |  no
                                             v
                         private attempt directory: compiler -> link -> manifest -> published by one rename
"""

from .build import Artifact, compile_c_library, compile_model
from .cache import Cache, CacheEntry, cache_directory
from .compiler import CompilerInfo, find_compiler
from .load import load_core
from .options import Options

__all__ = [
    "Artifact",
    "Cache",
    "CacheEntry",
    "CompilerInfo",
    "Options",
    "cache_directory",
    "compile_c_library",
    "compile_model",
    "find_compiler",
    "load_core",
]
