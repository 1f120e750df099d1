"""Stage cli, view: model file -> the mechanism as it moves, in a browser or a file."""

from __future__ import annotations

import webbrowser
from pathlib import Path
from tempfile import gettempdir
from typing import Any

import click

from ..errors import at_odds, incomplete
from .failures import after_integration, reports_failures
from .number_option import NumberRange
from .screen import print_json, say, stage
from .sections import verb_command
from .shared_options import (
    blaming_option,
    independent_option,
    json_option,
    load_model,
    model_argument,
    native_option,
    parse_settings,
    require_folder,
    robot_options,
    solver_options,
    split_names,
    target_option,
)
from .verb_kinematics import range_values, read_range
from .verb_run import complete_parameters, sort_settings


@verb_command()
@model_argument
@click.option(
    "--range",
    "ranges",
    multiple=True,
    metavar="NAME=START:END[:COUNT]",
    help="Move a coordinate over a range without forces, e.g. theta=0:2*pi; t for drivers.",
)
@click.option("--end", type=NumberRange(min=0, min_open=True), metavar="T", help="End time of the run in s.")
@click.option(
    "--out",
    type=click.Path(path_type=Path),
    metavar="FILE",
    help="Write FILE.html, .gif, .mp4, or a folder of PNG frames, instead of opening a browser.",
)
@click.option("--trace", multiple=True, callback=split_names, metavar="MARKER", help="Draw the path of a marker.")
@click.option("--plot", multiple=True, callback=split_names, metavar="NAME", help="Draw columns along the animation.")
@click.option("--forces", is_flag=True, help="Draw arrows of the forces in the joints.")
@click.option(
    "--speed", type=NumberRange(min=0, min_open=True), metavar="X", help="Seconds of motion shown in one second."
)
@click.option("--fps", type=NumberRange(min=0, min_open=True), metavar="N", help="Frames in one second; 25 by default.")
@click.option(
    "--set",
    "settings",
    multiple=True,
    metavar="NAME=VALUE",
    help="Value of a parameter, an input or an initial value; repeat it for more.",
)
@json_option
@independent_option
@target_option("cython", "numpy")
@native_option
@solver_options
@robot_options
@reports_failures
def view(
    model: Path,
    ranges: tuple[str, ...],
    end: float | None,
    out: Path | None,
    trace: tuple[str, ...],
    plot: tuple[str, ...],
    forces: bool,
    speed: float | None,
    fps: float | None,
    settings: tuple[str, ...],
    as_json: bool,
    independent: tuple[str, ...],
    target: str,
    allow_native: bool,
    solver: dict[str, Any],
    robot: dict[str, Any],
) -> None:
    """Show how a mechanism moves: over a range of its coordinates, or in a run.

    Without --out a page is written to the folder of temporary files and a browser opens it; it needs no network.
    """
    from ..show.writers import require_kind

    chosen = parse_settings(settings)
    asked = [read_range(words) for words in ranges]
    if asked and (end is not None or solver):
        raise at_odds("--range moves the model without forces; leave out --end and options of the integrator")
    if any(count == 1 for *_, count in asked):
        raise incomplete("an animation needs two positions: give --range a COUNT of at least 2")
    file = out if out is not None else Path(gettempdir()) / f"eomgen_{model.stem}.html"
    require_kind(file)
    require_folder("--out", None if out is None or not out.suffix else out)
    with blaming_option(independent), stage("derive"):
        described = load_model(model, allow_native, robot)
        complete_parameters(described, chosen)
        equations = described.derive("embedding" if asked else "auto", independent or None)
    with stage("compile"):
        module = equations.compile(target=target)
    initial, parameters, inputs = sort_settings(module, chosen)
    if asked:
        with stage("kinematics"):
            bound = module.bind(parameters or None, inputs or None)
            motion: Any = bound.kinematic_analysis(initial=initial or None, **range_values(module, asked))
    else:
        with stage("simulate"):
            motion = module.simulate(
                end, initial=initial or None, parameters=parameters or None, inputs=inputs or None, **solver
            )
    look = {key: value for key, value in (("speed", speed), ("fps", fps)) if value is not None}
    with after_integration(), stage("animate"):
        written = motion.animate(file, trace=trace, plot=plot, forces=forces, **look)
    opened = out is None and webbrowser.open(Path(written).absolute().as_uri())
    if as_json:
        print_json({"name": module.name, "points": len(motion), "files": [str(written)], "opened": opened})
        return
    say(f"wrote {written}")
    if out is None and not opened:
        say("no browser was found here; open that file in one, or give --out FILE")
