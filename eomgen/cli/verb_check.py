"""Stage cli, check: model file -> mechanism report, or every fault of the model."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from .failures import reports_failures
from .screen import print_json, say
from .shared_options import json_option, load_model, model_argument, native_option, robot_options


def _print_schema(context: click.Context) -> None:
    from ..describe import model_schema

    print_json(model_schema())
    context.exit()


@click.command()
@model_argument
@native_option
@json_option
@click.option(
    "--schema",
    is_flag=True,
    is_eager=True,
    expose_value=False,
    callback=lambda context, _, wanted: _print_schema(context) if wanted else None,
    help="Print the JSON Schema of model files, for editors, and stop.",
)
@click.option(
    "--graph",
    type=click.Path(dir_okay=False, path_type=Path),
    metavar="FILE",
    help="Draw bodies, joints and constraints as a graph (svg, png, pdf; needs matplotlib).",
)
@robot_options
@reports_failures
def check(model: Path, allow_native: bool, as_json: bool, graph: Path | None, robot: dict[str, Any]) -> None:
    """Report bodies, joints, loops, constraints, rank and degrees of freedom, and everything wrong with a model.

    Faults are printed as FILE:LINE: path: what is wrong; the exit code is then 1.
    """
    report = load_model(model, allow_native, robot).check()
    if graph is not None:
        report.draw(graph)
    if as_json:
        print_json(report.to_dict())
    else:
        say(str(report))
        if graph is not None:
            say(f"wrote {graph}")
