"""Stage cli, generate: model file -> a package folder that needs neither eomgen nor SymPy."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from ..targets import FMI_VERSIONS, PRECISIONS, TARGETS
from .failures import reports_failures
from .screen import print_json, say, stage
from .sections import verb_command
from .shared_options import (
    baumgarte_option,
    blaming_option,
    independent_option,
    json_option,
    load_model,
    method_option,
    model_argument,
    native_option,
    robot_options,
    target_option,
)


@verb_command()
@model_argument
@native_option
@click.option(
    "--out", required=True, metavar="DIR", type=click.Path(path_type=Path), help="Folder to write <name>/ into."
)
@method_option
@baumgarte_option
@independent_option
@target_option(*TARGETS)
@click.option(
    "--precision",
    type=click.Choice(PRECISIONS),
    default="double",
    show_default=True,
    help="Type of the numbers of a C library; float is for processors that know single precision alone.",
)
@click.option(
    "--fmi",
    type=click.Choice(FMI_VERSIONS),
    default="2.0",
    show_default=True,
    help="Version of FMI, the standard of functional mock-up units, for target fmu.",
)
@click.option(
    "--wheel",
    is_flag=True,
    help="Also build a wheel, DIR/<name>-...whl, which pip installs elsewhere without a compiler (cython, numpy).",
)
@click.option(
    "--analyses",
    is_flag=True,
    help="Also equilibria, linearization, reactions and all other analyses, without eomgen (cython, numpy).",
)
@json_option
@robot_options
@reports_failures
def generate(
    model: Path,
    allow_native: bool,
    out: Path,
    method: str,
    baumgarte: tuple[float, float] | None,
    independent: tuple[str, ...],
    target: str,
    precision: str,
    fmi: str,
    wheel: bool,
    analyses: bool,
    as_json: bool,
    robot: dict[str, Any],
) -> None:
    """Write one package folder DIR/<name>/ with everything it needs; a cython one installs by `pip install`.

    Target fmu is one file, DIR/<name>.fmu.
    """
    from ..compilation.wheel import build_wheel, require_wheel
    from ..generation import generate as write_out

    if wheel:
        require_wheel(target)
    with blaming_option(independent), stage("generate"):
        described = load_model(model, allow_native, robot)
        folder = write_out(described, out, method, target, independent or None, baumgarte, precision, fmi, analyses)
    built = None
    if wheel:
        with stage("wheel"):
            built = build_wheel(folder)
        if built.note:
            say(f"note: {built.path.name} {built.note}", err=True)
    files = sorted(str(p.relative_to(folder)) for p in folder.rglob("*") if p.is_file())
    if as_json:
        found = {"name": folder.stem, "target": target, "folder": str(folder), "files": files}
        print_json(found | ({"wheel": str(built.path), "note": built.note} if built else {}))
        return
    say(str(folder))
    for name in files:
        say(f"  {name}")
    if built:
        say(str(built.path))
