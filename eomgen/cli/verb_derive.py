"""Stage cli, derive: model file -> size of the equations of motion, and on request the equations themselves."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from ..base.files import write_whole
from ..targets import FORMATS
from .failures import reports_failures
from .screen import print_heading, print_json, print_table, say, stage
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

if TYPE_CHECKING:
    from ..api.equations import Equations


@verb_command()
@model_argument
@native_option
@method_option
@baumgarte_option
@independent_option
@click.option("--equations", is_flag=True, help="Also write out mass matrix and force (this loads SymPy).")
@click.option(
    "--format",
    "form",
    type=click.Choice(FORMATS),
    help="Write named intermediates, M and f of M v' = f for reading or for another program.",
)
@click.option("--out", metavar="FILE", type=click.Path(path_type=Path), help="File to write the format into.")
@json_option
@robot_options
@reports_failures
def derive(
    model: Path,
    allow_native: bool,
    method: str,
    independent: tuple[str, ...],
    equations: bool,
    form: str | None,
    out: Path | None,
    as_json: bool,
    baumgarte: tuple[float, float] | None,
    robot: dict[str, Any],
) -> None:
    """Derive the equations of motion; parameters need no values.

    Prints the mechanism and the operations of each part of the equations.
    """

    if out is not None and form is None:
        raise click.UsageError("--out needs --format")
    if form is not None and as_json:
        raise click.UsageError("--json and --format exclude each other")
    require_document_folder("--out", out)
    with blaming_option(independent), stage("derive") as parts:
        derived = load_model(model, allow_native, robot).derive(method, independent or None, baumgarte)
        parts |= derived.seconds
    if form is not None:
        write_or_print(derived, form, out)
        return
    if as_json:
        print_json(summary(derived) | (written(derived) if equations else {}))
        return
    say(str(derived.report))
    print_operations(derived)
    if equations:
        print_equations(written(derived))


def write_or_print(derived: Equations, form: str, out: Path | None) -> None:
    """Equations in a format, into a file or on the standard output."""
    from ..reading.formats import write_format

    text = write_format(derived, form)
    if out is None:
        say(text.rstrip("\n"))
    else:
        write_whole(out, text)
        say(str(out))


def summary(derived: Equations) -> dict[str, Any]:
    """What was derived, as plain values."""
    return {
        "name": derived.name,
        "method": derived.method,
        "choice": dict(derived.choice.operations) if derived.choice else None,
        "report": derived.report.to_dict(),
        "operations": {name: count.as_dict() | {"total": count.total} for name, count in derived.operations.items()},
        "system": derived.system_size and dict(zip(("unknowns", "entries"), derived.system_size, strict=True)),
        "seconds": dict(derived.seconds),
    }


def print_operations(derived: Equations) -> None:
    """The operations of each part of the equations, as a table."""
    print_heading(f"equations by {derived.method}: operations")
    rows = [
        [name, *(str(n) for n in (c.multiplications, c.additions, c.divisions, c.total, sum(c.functions.values())))]
        for name, c in derived.operations.items()
    ]
    if derived.choice:
        say(str(derived.choice))
    if derived.system_size:
        unknowns, entries = derived.system_size
        say(f"a linear system of {unknowns} unknowns with {entries} nonzero entries")
    header = ["", "multiply", "add", "divide", "total", "functions"]
    print_table(header, rows, right=range(1, len(header)))


def written(derived: Equations) -> dict[str, Any]:
    """The equations as text: mass_matrix * v' = force, after the intermediates they use."""
    return {
        "intermediates": {str(symbol): str(expression) for symbol, expression in derived.intermediates},
        "mass_matrix": [[str(x) for x in row] for row in derived.mass_matrix.tolist()],
        "force": [str(x) for x in derived.force],
        "accelerations": list(derived.acceleration_names),
    }


def print_equations(text: dict[str, Any]) -> None:
    """Equations as :func:`written` gives them, one entry a line."""
    print_heading(f"mass_matrix * [{', '.join(text['accelerations'])}] = force")
    for name, expression in text["intermediates"].items():
        say(f"  {name} = {expression}")
    for i, row in enumerate(text["mass_matrix"]):
        for j, entry in enumerate(row[: i + 1]):
            say(f"  mass_matrix[{i}, {j}] = {entry}")
    for i, entry in enumerate(text["force"]):
        say(f"  force[{i}] = {entry}")
