"""The build of the package: what pyproject.toml says, the extension module of all models, and a stub for editors.

``eomgen._native`` is compiled by eomgen's own code.  Where there is no compiler the build asks for the package ziglang,
which has one.
"""

from __future__ import annotations

import sys
from importlib import import_module
from pathlib import Path
from typing import Any, ClassVar

from setuptools import Command, Distribution, setup
from setuptools.command.build import build

ROOT = Path(__file__).parent
sys.path.insert(0, str(ROOT))

from eomgen.errors import ToolchainError  # noqa: E402
from eomgen.toolchain.compiler import find_compiler  # noqa: E402
from eomgen.toolchain.native import build_native, product_in  # noqa: E402


class BuildNative(Command):
    """Compile the extension module into the package."""

    description = "compile eomgen._native"
    user_options: ClassVar[list[tuple[str, str | None, str]]] = []
    editable_mode = False

    def initialize_options(self) -> None:
        self.build_lib: str | None = None

    def finalize_options(self) -> None:
        self.set_undefined_options("build", ("build_lib", "build_lib"))

    @property
    def folder(self) -> Path:
        """The package that is built."""
        return (ROOT if self.editable_mode else Path(str(self.build_lib)).absolute()) / "eomgen"

    def run(self) -> None:
        build_native(self.folder)

    def get_source_files(self) -> list[str]:
        return []

    def get_outputs(self) -> list[str]:
        return [str(product_in(Path(str(self.build_lib), "eomgen")))]

    def get_output_mapping(self) -> dict[str, str]:
        return {}


class Build(build):
    """The build with one step more."""

    sub_commands: ClassVar[list[Any]] = [*build.sub_commands, ("build_native", None)]


class Compiled(Distribution):
    """Its wheel bears the tag of this computer."""

    def has_ext_modules(self) -> bool:
        return True


def compilers() -> list[str]:
    """What must be installed for a compiler."""
    try:
        find_compiler()
    except ToolchainError:
        return ["ziglang>=0.13"]
    return []


if (ROOT / "tools").is_dir():  # a source distribution has the stub already
    import_module("tools.stubs").write()
setup(cmdclass={"build": Build, "build_native": BuildNative}, distclass=Compiled, setup_requires=compilers())
