"""Stage cli, reactions: model file -> forces and moments in all joints, at the initial state or over a run."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click
import numpy as np

from ..base.files import whole_file
from ..base.limits.numbers import SHOWN_FORCE
from ..errors import bad_file
from .analysis import Prepared, analysis_options, time_option
from .number_option import Number
from .screen import print_heading, print_json, print_table, say, stage
from .sections import verb_command
from .shared_options import require_folder

COMPONENTS = ("Fx", "Fy", "Fz", "Mx", "My", "Mz")


@verb_command()
@analysis_options
@time_option
@click.option(
    "--end",
    type=Number(),
    metavar="T",
    help="Simulate to T and give the largest values; without it those of the initial state.",
)
@click.option(
    "--out", type=click.Path(path_type=Path), metavar="FILE", help="With --end: write histories to FILE.csv or .npz."
)
def reactions(work: Prepared, t: float, end: float | None, out: Path | None, as_json: bool) -> None:
    """Find the force and moment that each joint's predecessor exerts on its successor, in ground axes (N, N m).

    Components that redundant constraints leave undetermined are marked with *; the smallest reactions are given.
    """
    if out is not None and (end is None or out.suffix not in (".npz", ".csv")):
        raise bad_file(f"--out {out}: histories need --end and are written as .npz or .csv")
    require_folder("--out", out)
    module = work.module
    x = module.x0(work.initial or None, t=t)
    times: Any = t
    if end is not None:
        with stage("integrate"):
            run = module.simulate((t, end), x)
        times, x = run.t, run.x
    found, marks = module.reactions(times, x), module.undetermined_reactions(times, x)
    multipliers = module.multipliers(times, x)
    names = [f"{joint}.{component}" for joint in module.joint_names for component in COMPONENTS]
    if out is not None:
        flat = found.reshape(len(names), -1)
        with whole_file(out) as file:
            if out.suffix == ".npz":
                np.savez(file, t=times, names=np.array(names), reactions=flat)
            else:
                table, head = np.vstack([times, flat]).T, ",".join(["t", *names])
                np.savetxt(file, table, delimiter=",", header=head, comments="", encoding="utf-8")
    if end is not None:
        places = np.abs(found).argmax(axis=-1)
        found = np.take_along_axis(found, places[..., None], axis=-1)[..., 0]
        marks = marks.any(axis=-1)
        multipliers = np.take_along_axis(multipliers, np.abs(multipliers).argmax(axis=-1)[:, None], axis=-1)[:, 0]
    if as_json:
        print_json(
            work.heading(t)
            | {"end": end, "joints": module.joint_names, "components": COMPONENTS}
            | {"reactions": found, "undetermined": marks}
            | {"constraints": module.constraint_labels, "multipliers": multipliers}
            | {"files": [] if out is None else [str(out)]}
        )
        return
    print_heading(f"reactions at t = {t:g} s" if end is None else f"largest reactions up to t = {end:g} s")
    found = np.where(np.abs(found) < SHOWN_FORCE * np.abs(found).max(initial=0.0), 0.0, found)
    lines = [
        [joint, *(f"{value:.6g}{'*' if mark else ''}" for value, mark in zip(row, stars, strict=True))]
        for joint, row, stars in zip(module.joint_names, found, marks, strict=True)
    ]
    print_table(["joint", *COMPONENTS], lines, right=range(1, 7))
    if marks.any():
        say("* not determined by rigid bodies: the constraints are redundant")
    if out is not None:
        say(f"wrote {out}")
