"""Stage cli, check: model file -> mechanism report, or every fault of the model."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from ..base.files import save_figure
from .failures import reports_failures
from .plot import require_plotting
from .screen import print_json, say
from .sections import verb_command
from .shared_options import json_option, load_model, model_argument, native_option, robot_options

if TYPE_CHECKING:
    pass


def _print_schema(context: click.Context) -> None:
    from ..describe import model_schema

    print_json(model_schema())
    context.exit()


@verb_command()
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
@click.option(
    "--draw",
    type=click.Path(dir_okay=False, path_type=Path),
    metavar="FILE",
    help="Draw the mechanism at its initial position (svg, png, pdf; needs matplotlib).",
)
@robot_options
@reports_failures
def check(
    model: Path, allow_native: bool, as_json: bool, graph: Path | None, draw: Path | None, robot: dict[str, Any]
) -> None:
    """Report bodies, joints, loops, constraints, rank and degrees of freedom of a model, and all its faults.

    Faults are printed as FILE:LINE: path: what is wrong; the exit code is then 1.
    """
    if draw is not None:
        require_plotting(draw, "--draw")
    described = load_model(model, allow_native, robot)
    report = described.check()
    if graph is not None:
        report.draw(graph)
    if draw is not None:
        from ..show.draw import figure_at

        save_figure(figure_at(described.compile(target="numpy")), draw)
    if as_json:
        print_json(report.to_dict())
    else:
        say(str(report))
        if graph is not None:
            say(f"wrote {graph}")
        if draw is not None:
            say(f"wrote {draw}")
