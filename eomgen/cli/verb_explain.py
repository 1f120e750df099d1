"""Stage cli, explain: model file -> a document with every step to its equations of motion."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

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
    require_document_folder,
    robot_options,
)


@verb_command()
@model_argument
@native_option
@click.option(
    "--out",
    metavar="FILE",
    required=True,
    type=click.Path(path_type=Path),
    help="Document to write: .html (one page, offline), .md, .tex, or .pdf where pdflatex is installed.",
)
@click.option(
    "--level",
    type=click.Choice(["short", "full"]),
    default="full",
    show_default=True,
    help="short: topology, coordinates, final equations and counts.",
)
@method_option
@baumgarte_option
@independent_option
@json_option
@robot_options
@reports_failures
def explain(
    model: Path,
    allow_native: bool,
    out: Path,
    level: str,
    method: str,
    baumgarte: tuple[float, float] | None,
    independent: tuple[str, ...],
    as_json: bool,
    robot: dict[str, Any],
) -> None:
    """Write the worked solution of a model.

    Mechanism, motion of each body, constraints, forces, the steps of the method, the equations, and one state with
    numbers, line by line.  At the end stands the largest difference between shown formulas and the compiled module.
    """
    require_document_folder("--out", out)
    with blaming_option(independent), stage("derive") as parts:
        derived = load_model(model, allow_native, robot).derive(method, independent or None, baumgarte)
        parts |= derived.seconds
    with stage("explain"):
        document = derived.explain(level)
        document.save(out)
    if as_json:
        told = {"file": str(out), "name": derived.name, "method": derived.method, "level": level}
        print_json({**told, "sections": [s.title for s in document.sections], "difference": document.difference})
        return
    say(str(out))
    if document.difference is not None:
        say(f"largest difference between shown formulas and the compiled module: {document.difference:.1e}")
