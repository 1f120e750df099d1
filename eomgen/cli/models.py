"""Verbs that read a model: check, convert, derive, explain, generate."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import click

from ..base.files import save_figure, write_whole
from ..base.results import ResultTable
from ..toolchain.targets import FMI_VERSIONS, FORMATS, PRECISIONS, TARGETS
from .options import Source, require_folder, verb
from .output import operations_of, print_json, say, stage, summary
from .plot import require_plotting

if TYPE_CHECKING:
    from ..api.equations import Equations

DERIVED = ("allow_native", "method", "baumgarte", "independent", "robot")  #: options of what derives equations
#: What no folder may stand for.
FILE = click.Path(dir_okay=False, path_type=Path)


def _print_schema(context: click.Context) -> None:
    from ..model import model_schema

    print_json(model_schema())
    context.exit()


@verb(("allow_native", "robot"))
@click.option(
    "--schema",
    is_flag=True,
    is_eager=True,
    expose_value=False,
    callback=lambda context, _, wanted: _print_schema(context) if wanted else None,
    help="Print the JSON Schema of model files, for editors, and stop.",
)
def check(
    source: Source,
    graph: Annotated[
        Path | None, FILE, "FILE: Draw bodies, joints and constraints as a graph (svg, png, pdf; needs matplotlib)."
    ] = None,
    draw: Annotated[
        Path | None, FILE, "FILE: Draw the mechanism at its initial position (svg, png, pdf; needs matplotlib)."
    ] = None,
) -> None:
    """Report bodies, joints, loops, constraints, rank and degrees of freedom of a model, and all its errors.

    Errors are printed as FILE:LINE: path: message; the exit code is then 1.
    """
    if draw is not None:
        require_plotting(draw, "--draw")
    model = source.load()
    report = model.check()
    if graph is not None:
        report.draw(graph)
    if draw is not None:
        from ..show.draw import figure_at

        save_figure(figure_at(model.compile(target="numpy")), draw)
    files = None if source.as_json else [file for file in (graph, draw) if file]
    source.show(report.to_dict(), str(report), files=files)


@verb(("robot",))
def convert(source: Source, out: Annotated[Path | None, "FILE: Write to FILE.yaml instead of stdout."] = None) -> None:
    """Write a robot (or a model file, tidied) as a model file.

    Properties that a model file cannot express are listed on stderr, and in comments at its top.
    """
    require_folder("--out", out)
    model = source.load()
    model.mechanism()  # every fault, before anything is written
    text = model.to_yaml()
    if out is not None:
        write_whole(out, text)
    if source.as_json:
        notes, renamed = list(model.notes), model.renamed
        print_json({"name": model.name, "file": str(out) if out else None, "notes": notes, "renamed": renamed})
    elif out is not None:
        say(str(out))
    else:
        click.echo(text, nl=False)


@verb(DERIVED)
def derive(
    source: Source,
    equations: Annotated[bool, "Also write out mass matrix and force (this loads SymPy)."] = False,
    form: Annotated[
        str | None,
        click.Choice(FORMATS),
        "Write named intermediates, M and f of M v' = f for reading or for another program.",
    ] = None,
    out: Annotated[Path | None, "FILE: Output file of --format."] = None,
) -> None:
    """Derive the equations of motion; parameters need no values.

    Prints the mechanism and the operations of each part of the equations.
    """
    if out is not None and form is None:
        raise click.UsageError("--out needs --format")
    if form is not None and source.as_json:
        raise click.UsageError("--json and --format exclude each other")
    require_folder("--out", out, exists=True)
    derived = source.derive()
    if form is not None:
        from ..reading.formats import write_format

        text = write_format(derived, form)
        if out is not None:
            write_whole(out, text)
        say(text.rstrip("\n") if out is None else str(out))
    else:
        written = _written(derived) if equations else {}
        parts = (str(derived.report), *operations_of(derived), *(_lines(written) if equations else ()))
        source.show(summary(derived) | written, *parts)


def _written(derived: Equations) -> dict[str, Any]:
    """The equations as text: mass_matrix * v' = force, after the intermediates they use."""
    return {
        "intermediates": {str(symbol): str(expression) for symbol, expression in derived.intermediates},
        "mass_matrix": [[str(x) for x in row] for row in derived.mass_matrix.tolist()],
        "force": [str(x) for x in derived.force],
        "accelerations": list(derived.acceleration_names),
    }


def _lines(text: dict[str, Any]) -> Iterator[ResultTable | str]:
    """Equations as :func:`_written` gives them, one entry a line."""
    yield ResultTable((), (), f"mass_matrix * [{', '.join(text['accelerations'])}] = force")
    yield from (f"  {name} = {expression}" for name, expression in text["intermediates"].items())
    entries = ((i, j, entry) for i, row in enumerate(text["mass_matrix"]) for j, entry in enumerate(row[: i + 1]))
    yield from (f"  mass_matrix[{i}, {j}] = {entry}" for i, j, entry in entries)
    yield from (f"  force[{i}] = {entry}" for i, entry in enumerate(text["force"]))


@verb(DERIVED)
def explain(
    source: Source,
    out: Annotated[
        Path, "FILE: Document to write: .html (one page, offline), .md, .tex, or .pdf where pdflatex is installed."
    ],
    level: Annotated[Literal["short", "full"], "short: topology, coordinates, final equations and counts."] = "full",
) -> None:
    """Write the worked solution of a model.

    Mechanism, motion of each body, constraints, forces, the steps of the method, the equations, and one state with
    numbers, line by line.  The document ends with the largest difference between its formulas and the module.
    """
    require_folder("--out", out, exists=True)
    derived = source.derive()
    with stage("explain"):
        document = derived.explain(level)
        document.save(out)
    values: dict[str, Any] = {"file": str(out), "name": derived.name, "method": derived.method, "level": level}
    values |= {"sections": [s.title for s in document.sections], "difference": document.difference}
    difference = f"largest difference between the formulas and the compiled module: {document.difference or 0.0:.1e}"
    source.show(values, str(out), *([] if document.difference is None else [difference]))


@verb((*DERIVED, "target"), list(TARGETS))
def generate(
    source: Source,
    out: Annotated[Path, "DIR: Folder to write <name>/ into."],
    precision: Annotated[
        str,
        click.Choice(PRECISIONS),
        "Type of the numbers of a C library; float is for processors with single precision only.",
    ] = "double",
    fmi: Annotated[
        str,
        click.Choice(FMI_VERSIONS),
        "Version of FMI, the standard of functional mock-up units, for target fmu.",
    ] = "2.0",
    wheel: Annotated[
        bool, "Also build a wheel, DIR/<name>-...whl, which pip installs elsewhere without a compiler (cython)."
    ] = False,
    analyses: Annotated[
        bool, "Also equilibria, linearization, reactions and all other analyses, without eomgen (cython)."
    ] = False,
) -> None:
    """Write one package folder DIR/<name>/ with everything it needs; a cython one installs by `pip install`.

    Targets fmu and web are one file, DIR/<name>.fmu and DIR/<name>.html.
    """
    from ..api.generation import generate as write_out
    from ..toolchain.wheel import build_wheel, require_wheel

    target, independent = source.target, source.independent or None
    if wheel:
        require_wheel(target)
    with source.blamed(), stage("generate"):
        model = source.load()
        folder = write_out(model, out, source.method, target, independent, source.baumgarte, precision, fmi, analyses)
    built = None
    if wheel:
        with stage("wheel"):
            built = build_wheel(folder)
        if built.note:
            say(f"note: {built.path.name} {built.note}", err=True)
    files = sorted(str(p.relative_to(folder)) for p in folder.rglob("*") if p.is_file())
    values = {"name": folder.stem, "target": target, "folder": str(folder), "files": files}
    values |= {"wheel": str(built.path), "note": built.note} if built else {}
    lines = [str(folder), *(f"  {name}" for name in files), *([str(built.path)] if built else [])]
    source.show(values, *lines)
