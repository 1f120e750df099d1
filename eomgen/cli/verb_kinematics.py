"""Stage cli, kinematics: model file, a range -> positions, velocities and accelerations over it, without forces."""

from __future__ import annotations

from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Any

import click
import numpy as np

from ..base.texts import without_noise
from ..errors import at_odds, bad_file, ill_shaped, ill_typed, incomplete, no_number, off_range
from ..runtime.storage import RUNS
from .failures import reports_failures
from .plot import Picture, check_columns, check_picture, find_paths, picture_options, plot_run
from .screen import finite, print_heading, print_json, print_rows, print_table, say, stage
from .sections import verb_command
from .shared_options import (
    blaming_option,
    independent_option,
    json_option,
    load_model,
    model_argument,
    native_option,
    parse_number,
    parse_settings,
    require_folder,
    target_option,
)
from .verb_derive import summary
from .verb_run import complete_parameters, final_names, sort_settings

if TYPE_CHECKING:
    from ..module import Module
    from ..simulation.kinematic import KinematicAnalysis

COUNT = 201  #: points of a range unless it says
SHOWN = 9  #: of them on the screen


@verb_command()
@model_argument
@native_option
@independent_option
@target_option("cython", "numpy")
@click.option(
    "--range",
    "ranges",
    multiple=True,
    metavar="NAME=START:END[:COUNT]",
    help="Values of a coordinate, or of t for drivers, e.g. theta=0:2*pi:361; all ranges must have the same count.",
)
@click.option("--limits", multiple=True, metavar="NAME", help="Find how far a coordinate can move from the start.")
@click.option("--partial", is_flag=True, help="If the range cannot be reached completely, give the part that can.")
@click.option("--set", "settings", multiple=True, metavar="NAME=VALUE", help="Value of a parameter, or start position.")
@click.option(
    "--out",
    type=click.Path(path_type=Path),
    metavar="FILE",
    help="Write all columns to FILE.npz, .csv, .nc or .parquet.",
)
@click.option("--plot", type=click.Path(path_type=Path), metavar="FILE", help="Draw them, e.g. to FILE.png.")
@picture_options
@json_option
@reports_failures
def kinematics(
    model: Path,
    allow_native: bool,
    independent: tuple[str, ...],
    target: str,
    ranges: tuple[str, ...],
    limits: tuple[str, ...],
    partial: bool,
    settings: tuple[str, ...],
    out: Path | None,
    plot: Path | None,
    picture: Picture,
    as_json: bool,
) -> None:
    """Analyse the motion of a model over a range of time or coordinates, without forces.

    Without --range, drivers move the model from t = 0 to the end given in its file.
    """
    chosen = parse_settings(settings)
    asked = [read_range(words) for words in ranges]
    if out is not None and out.suffix not in RUNS:
        raise bad_file(f"--out {out}: the motion is written as {' or '.join(RUNS)}")
    check_picture(plot, picture)
    require_folder("--out", out)
    require_folder("--plot", plot)

    with blaming_option(independent), stage("derive"):
        described = load_model(model, allow_native)
        complete_parameters(described, chosen)
        equations = described.derive("embedding", independent or None)
    with stage("compile"):
        module = equations.compile(target=target)
    initial, parameters, inputs = sort_settings(module, chosen)
    check_columns(module, picture)
    named = range_values(module, asked) if asked or not limits else {}
    bound = module.bind(parameters or None, inputs or None)
    start = perf_counter()
    with stage("kinematics"):
        motion = bound.kinematic_analysis(initial=initial or None, partial=partial, **named) if named else None
        found = [bound.motion_range(name, initial=initial or None) for name in limits]
    seconds = {**equations.seconds, "analysis": perf_counter() - start}
    files: list[str] = []
    if motion is not None and out is not None:
        motion.save(out)
        files.append(str(out))
    if motion is not None and plot is not None:
        plot_run(motion, find_paths(equations.kinematics.mechanism), motion.name, plot, picture)
        files.append(str(plot))
    if as_json:
        report: dict[str, Any] = {
            "name": module.name,
            "report": summary(equations)["report"],
            "seconds": seconds,
            "files": files,
        }
        report |= {"motion": None if motion is None else to_dict(motion), "limits": [_limits(r) for r in found]}
        print_json(report)
        return
    say(str(equations.report))
    if motion is not None:
        print_motion(motion)
    for one in found:
        print_heading(f"range of {one.name}")
        sides = (("lower", one.lower, one.stops[0], one.gaps[0]), ("upper", one.upper, one.stops[1], one.gaps[1]))
        print_rows([(s, f"{x:.9g}" + (f"   {stop}; {gap}" if stop else "")) for s, x, stop, gap in sides])
    for file in files:
        say(f"wrote {file}")


def read_range(words: str) -> tuple[str, float, float, int | None]:
    """``NAME=START:END[:COUNT]`` -> its parts.

    Raises
    ------
    UsageError
    """
    name, equals, text = words.partition("=")
    parts = text.split(":")
    if not equals or not name.strip() or len(parts) not in (2, 3):
        raise ill_typed(f"--range {words}: write NAME=START:END[:COUNT], for example theta=0:2*pi:361")
    try:
        start, end = (parse_number(part) for part in parts[:2])
        count = _count(parts[2]) if len(parts) == 3 else None
    except ValueError as error:  # a UsageError too
        raise no_number(f"--range {words}: {error}") from None
    if count is not None and not 1 <= count <= 10_000_000:
        raise off_range(f"--range {words}: the count is 1 to 10000000, not {count}")
    return name.strip(), start, end, count


def _count(text: str) -> int:
    try:
        return int(text)
    except ValueError:
        raise off_range(f"the count is a whole number of points, 1 to 10000000, not {text!r}") from None


def range_values(module: Module, asked: list[tuple[str, float, float, int | None]]) -> dict[str, Any]:
    """Arrays over the ranges asked for, by name; of the time where drivers leave nothing free."""
    if not asked:
        if module.n_dof:
            free = ", ".join(module.layout.velocity_labels[i] for i in module.layout.independent)
            raise incomplete(f"give --range: {_left(module.n_dof)}, for example of {free}")
        asked = [("t", 0.0, float(module.metadata.get("simulation", {}).get("end") or 10.0), None)]
    names = [name for name, *_ in asked]
    if len(set(names)) < len(names):
        raise at_odds(f"--range: {', '.join(names)}: give each name once")
    counts = {count for *_, count in asked if count is not None} or {COUNT}
    if len(counts) > 1:
        raise ill_shaped(f"--range: the counts {', '.join(map(str, sorted(counts)))} must be equal")
    (count,) = counts
    values: dict[str, Any] = {name: np.linspace(start, end, count) for name, start, end, _ in asked}
    if "t" in values and len(asked) > 1 and count > 1:  # coordinates that are led over time have their rates
        span = values["t"][-1] - values["t"][0]
        values |= {f"{name}_dot": (end - start) / span for name, start, end, _ in asked if name != "t" and span}
    return values


def _left(n: int) -> str:
    return "1 degree of freedom is left" if n == 1 else f"{n} degrees of freedom are left"


def to_dict(motion: KinematicAnalysis) -> dict[str, Any]:
    """An analysis as plain values."""
    ends: dict[str, dict[str, float | None]] = {}
    for where, k in (("first", 0), ("last", -1)):
        ends[where] = {n: finite(motion[n][k]) for n in ("t", *final_names(motion))}
    return {
        "points": len(motion),
        "complete": motion.complete,
        "led": list(motion.led),
        "singular": [_singular(s) for s in motion.singular],
        "residual": {"position": motion.residuals.position, "velocity": motion.residuals.velocity},
        **ends,
    }


def _singular(found: Any) -> dict[str, Any]:
    return {
        "kind": found.kind,
        "t": found.t,
        "values": dict(found.values),
        "moving": list(found.moving),
        "joints": list(found.joints),
    }


def _limits(found: Any) -> dict[str, Any]:
    return {
        "name": found.name,
        "lower": finite(found.lower),
        "upper": finite(found.upper),
        "stops": [None if stop is None else _singular(stop) for stop in found.stops],
        "gaps": list(found.gaps),
    }


def print_motion(motion: KinematicAnalysis) -> None:
    """Points, residuals and singular positions of an analysis, and some of its rows."""
    over = ", ".join(motion.led) if motion.led else "t"
    print_heading(f"kinematics over {over}: {len(motion)} points")
    rows = [("loop residual", f"{motion.residuals.position:.1e} (m, rad), {motion.residuals.velocity:.1e} of rates")]
    for found in motion.singular[:20]:
        place, _, words = str(found).removeprefix(f"{found.kind} at ").partition(": ")
        rows.append((found.kind, f"{place}: {words}"))
    if len(motion.singular) > 20:
        rows.append(("", f"and {len(motion.singular) - 20} more singular positions"))
    print_rows(rows)
    names = [n for n in final_names(motion) if not n.endswith("_dot")][:8]
    header = [n + (f" ({motion.units[n]})" if n in motion.units else "") for n in ("t", *names)]
    picked = np.unique(np.linspace(0, len(motion) - 1, SHOWN).round().astype(int))
    if len(picked) < len(motion):
        print_rows([("shown", f"{len(picked)} of {len(motion)} points; --out FILE writes all")])
    units = [motion.units.get(n, n) for n in ("t", *names)]
    sizes = [float(np.nanmax(np.abs(motion[n]), initial=0.0)) for n in ("t", *names)]
    shown = [without_noise([motion[n][k] for n in ("t", *names)], units, sizes) for k in picked]
    print_table(header, [[f"{x:.6g}" for x in row] for row in shown], right=range(len(header)))
