"""Stage cli, examples: the models shipped with eomgen -> a list, a copy of one here, or runs of all."""

from __future__ import annotations

import ast
import re
import sys
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING

import click

from ..base.files import example_files, find_example, write_whole
from ..base.names import hint
from ..errors import at_odds, bad_file, no_such
from ..syntax_trees import parse_module
from .failures import reports_failures
from .screen import print_json, print_table, say, stage
from .sections import verb_command
from .shared_options import json_option, target_option

if TYPE_CHECKING:
    from .example_runs import ExampleRun


def describe_example(file: Path) -> str:
    """The ``doc:`` line of a model file, the first comment of a robot, or the first line of a script's docstring."""
    text = file.read_text(encoding="utf-8")
    if file.name.endswith(".py"):
        return (ast.get_docstring(parse_module(text)) or "").split("\n", 1)[0]
    if file.name.endswith(".urdf"):
        comment = re.search(r"<!--(.*?)-->", text, re.DOTALL)
        return " ".join(comment.group(1).split()) if comment else ""
    found = re.search(r"^doc:\s*(.+)$", text, re.MULTILINE)
    return found.group(1).strip().strip('"') if found else ""


@verb_command()
@click.argument("name", required=False)
@click.option("--force", is_flag=True, help="Overwrite a file of that name.")
@click.option("--all", "every", is_flag=True, help="Run every example for a tenth of its time, scripts in full.")
@target_option("numpy", "cython", default="numpy")
@json_option
@reports_failures
def examples(name: str | None, force: bool, every: bool, target: str, as_json: bool) -> None:
    """List the example models, copy NAME into the current folder, or run them all.

    With --all the exit code is that of the first example that fails.  docs/gallery.md shows them.
    """
    found = example_files()
    if every:
        if name is not None:
            raise at_odds(f"--all runs every example; leave out {name} or --all")
        _run_all(found, target, as_json)
        return
    if name is None:
        rows = [(key, file.name, describe_example(file)) for key, file in found.items()]
        if as_json:
            print_json({"examples": [{"name": key, "file": file, "doc": doc} for key, file, doc in rows]})
            return
        print_table(["example", "what it is"], [[key, doc] for key, _, doc in rows])
        say("copy one here:  eomgen examples NAME")
        return
    copied = _copy(name, found, force)
    if as_json:
        print_json({"file": str(copied)})
        return
    say(str(copied))
    say(f"next:  {'python' if copied.suffix == '.py' else 'eomgen run'} {copied}", err=True)


def _run_all(found: dict[str, Path], target: str, as_json: bool) -> None:
    """Run all examples and leave with the exit code of the first that fails."""
    from .example_runs import ExampleRun, run_example

    start, runs = perf_counter(), list[ExampleRun]()
    for key, file in found.items():
        with stage(key):
            runs.append(run_example(key, file, target))
    failed = [run for run in runs if not run.ok]
    total = perf_counter() - start
    if as_json:
        entries = [{**run._asdict(), "ok": run.ok} for run in runs]
        print_json({"ok": not failed, "target": target, "seconds": total, "examples": entries})
    else:
        header = ["example", "freedoms", "derive s", "compile s", "simulate s", "steps", "result"]
        print_table(header, [_row(run) for run in runs], right=range(1, 6))
        said = f"{len(failed)} of {len(runs)} failed: {', '.join(run.name for run in failed)}" if failed else "all ran"
        say(f"{said}, {total:.1f} s")
    if failed:
        sys.exit(failed[0].exit_code)


def _row(run: ExampleRun) -> list[str]:
    def shown(value: float | None, digits: int) -> str:
        return "" if value is None else f"{value:.{digits}f}"

    times = [shown(run.seconds.get(part), 2) for part in ("derive", "compile", "simulate")]
    if "script" in run.seconds:
        times[2] = shown(run.seconds["script"], 2)
    counts = [shown(run.degrees_of_freedom, 0), *times, shown(run.steps, 0)]
    well = f"ok; {'; '.join(run.warnings)}" if run.warnings else "ok"
    return [run.name, *counts, well if run.ok else f"exit code {run.exit_code}: {run.error}"]


def _copy(name: str, found: dict[str, Path], force: bool) -> Path:
    file = find_example(name, found)
    if file is None:
        near = hint(name, found, quoted=False) or f"there are: {', '.join(found)}"
        raise no_such(f"no example {name!r}; {near}")
    target = Path(file.name)
    if target.exists() and not force:
        raise bad_file(f"{target} exists; add --force to overwrite it")
    write_whole(target, file.read_bytes())
    return target
