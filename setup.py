"""The build of the package: what pyproject.toml says, and the compiled Cython layer where this computer can make it.

The layer is the same for all models.  Compiled here, it need not be compiled for a user's first model.  Without a
compiler, or with EOMGEN_BUILD_LAYER=0, the wheel is one for all computers.
"""

from __future__ import annotations

import functools
import os
import sys
from importlib.util import find_spec
from pathlib import Path
from typing import Any, ClassVar

from setuptools import Command, Distribution, setup
from setuptools.command.build import build

ROOT = Path(__file__).parent
PLACE = Path("eomgen", "built")
sys.path.insert(0, str(ROOT))


@functools.cache
def compiling() -> bool:
    """Whether the layer can be compiled here."""
    if os.environ.get("EOMGEN_BUILD_LAYER", "1") == "0":
        return False
    try:
        from eomgen.compilation import compiler, cython_layer

        compiler.find_compiler()
        cython_layer.find_python_headers()
    except Exception as error:
        print(f"eomgen: no code for this computer is put into the package: {error}", file=sys.stderr)
        return False
    return find_spec("Cython") is not None


class BuildLayer(Command):
    """Compile the layer into the package."""

    description = "compile the Cython layer that all models share"
    user_options: ClassVar[list[tuple[str, str | None, str]]] = []
    editable_mode = False

    def initialize_options(self) -> None:
        self.build_lib: str | None = None

    def finalize_options(self) -> None:
        self.set_undefined_options("build", ("build_lib", "build_lib"))

    def run(self) -> None:
        folder = (ROOT if self.editable_mode else Path(str(self.build_lib)).absolute()) / PLACE
        compiled = compiling()
        try:
            from eomgen.compilation.install import install_layer

            install_layer(folder, compiled=compiled)
        except Exception as error:  # the package is of use without
            print(f"eomgen: the Cython layer is left to the first model: {error}", file=sys.stderr)

    def get_source_files(self) -> list[str]:
        return []

    def get_outputs(self) -> list[str]:
        return [str(path) for path in (Path(str(self.build_lib)) / PLACE).rglob("*") if path.is_file()]

    def get_output_mapping(self) -> dict[str, str]:
        return {}


class Build(build):
    """The build with one step more."""

    sub_commands: ClassVar[list[Any]] = [*build.sub_commands, ("build_layer", None)]


class ForThisComputer(Distribution):
    """Its wheel bears the tag of this computer if it holds code for it."""

    def has_ext_modules(self) -> bool:
        return compiling()


setup(cmdclass={"build": Build, "build_layer": BuildLayer}, distclass=ForThisComputer)
