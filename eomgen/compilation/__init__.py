"""Compilation: source texts -> a cached extension module or C library, and the loaded core.

::

    sources -> options.compile_flags -> cache key -> found? -> load
                                             |  no
                                             v
               private attempt directory: compiler -> cython_layer (once) -> link -> manifest -> published by one rename
"""

from .build import Artifact, compile_c_library, compile_sources
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
    "compile_sources",
    "find_compiler",
    "load_core",
]
