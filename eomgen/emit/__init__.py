"""Stage emit: Program -> SourceSet, the text of the generated files; pure and deterministic."""

from .c import emit_c
from .numpy import emit_numpy
from .package import emit_package
from .sources import SourceSet

__all__ = ["SourceSet", "emit_c", "emit_numpy", "emit_package"]
