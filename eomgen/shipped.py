"""What comes with the package, templates and examples: inside it where installed, beside it in a clone."""

from __future__ import annotations

from pathlib import Path

_PACKAGE = Path(__file__).parent


def shipped(name: str) -> Path:
    """A folder: ``templates`` or ``examples``."""
    clone = _PACKAGE.parent
    beside = not (_PACKAGE / name).is_dir() and (clone / "pyproject.toml").is_file()
    return (clone if beside else _PACKAGE) / name


def example_files() -> dict[str, Path]:
    """Every example by what to call it: a model file by its name alone, others with their suffix.

    Those in the folder ``large`` take seconds to compile, or move far where a centimetre is much.
    """
    found = {}
    folder = shipped("examples")
    for file in sorted([*folder.iterdir(), *(folder / "large").iterdir()], key=lambda f: f.name):
        if file.name.endswith(".yaml"):
            found[file.name.removesuffix(".yaml")] = file
        elif file.name.endswith(".urdf") or (file.name.endswith(".py") and not file.name.startswith("_")):
            found[file.name] = file
    return found


def find_example(name: str, found: dict[str, Path]) -> Path | None:
    """The file of an example, which may be called with or without its suffix."""
    return found.get(name) or found.get(name.removesuffix(".yaml")) or found.get(f"{name}.urdf")
