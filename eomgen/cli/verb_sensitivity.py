"""Stage cli, sensitivity: model file -> derivatives of a run by parameters, inputs and initial values."""

from __future__ import annotations

from pathlib import Path

import click

from ..errors import bad_file, incomplete
from .analysis import Prepared, analysis_options
from .number_option import NumberRange
from .screen import finite, print_heading, print_json, print_table, say, stage
from .sections import verb_command
from .shared_options import require_folder


@verb_command()
@analysis_options
@click.option(
    "--by", multiple=True, metavar="NAME", help="Parameter, input or initial value; by default all parameters."
)
@click.option("--end", type=NumberRange(min=0, min_open=True), metavar="T", help="End time in s.")
@click.option("--out", type=click.Path(path_type=Path), metavar="FILE", help="Write them to FILE.npz or FILE.csv.")
def sensitivity(work: Prepared, by: tuple[str, ...], end: float | None, out: Path | None, as_json: bool) -> None:
    """Integrate a model together with its derivatives, and report the derivatives at the end."""
    if out is not None and out.suffix not in (".npz", ".csv"):
        raise bad_file(f"--out {out}: sensitivities are written as .npz or .csv")
    require_folder("--out", out)
    module = work.module
    names = [name for words in by for name in words.split(",") if name] or list(module.p_names)
    if not names:
        raise incomplete("the model has no parameters; name an input or an initial value with --by")
    with stage("integrate"):
        found = module.sensitivities(names, end, work.initial or None)
    if out is not None:
        found.save(out)
    rows = dict.fromkeys((*module.x_names, *module.y_names))
    final = {row: {name: finite(found[row, name][-1]) for name in found.names} for row in rows}
    events = [
        {"event": e.name, "t": e.t, "by": {name: finite(x) for name, x in zip(found.names, e.dt, strict=True)}}
        for e in found.events
    ]
    if as_json:
        end_time = float(found.t[-1])
        print_json(
            work.heading(end_time) | {"names": found.names, "held": found.held, "steps": len(found.t) - 1} |
            {"final": final, "events": events, "files": [] if out is None else [str(out)]}
        )  # fmt: skip
        return
    print_heading(f"derivatives at t = {found.t[-1]:g} s, by")
    lines = [[row, *("-" if x is None else f"{x:.6g}" for x in values.values())] for row, values in final.items()]
    print_table(["", *found.names], lines, right=range(1, len(found.names) + 1))
    if events:
        print_heading("times of events, by")
        shown = [[f"{e.name}, t = {e.t:.6g} s", *(f"{x:.6g}" for x in e.dt)] for e in found.events]
        print_table(["", *found.names], shown, right=range(1, len(found.names) + 1))
    say(f"held at the start: {', '.join(found.held)}")
    if out is not None:
        say(f"wrote {out}")
