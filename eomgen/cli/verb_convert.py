"""Stage cli, convert: robot file -> model file that loads to the same mechanism."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from ..base.files import write_whole
from .failures import reports_failures
from .screen import print_json, say
from .sections import verb_command
from .shared_options import json_option, load_model, model_argument, require_folder, robot_options


@verb_command()
@model_argument
@click.option("--out", type=click.Path(path_type=Path), metavar="FILE", help="Write to FILE.yaml instead of stdout.")
@json_option
@robot_options
@reports_failures
def convert(model: Path, out: Path | None, as_json: bool, robot: dict[str, Any]) -> None:
    """Write a robot (or a model file, tidied) as a model file.

    What the model file cannot hold is told on stderr, and in comments at its top.
    """
    require_folder("--out", out)
    described = load_model(model, robot=robot)
    described.mechanism()  # every fault, before anything is written
    text = described.to_yaml()
    if out is not None:
        write_whole(out, text)
    if as_json:
        notes, renamed = list(described.notes), described.renamed
        print_json({"name": described.name, "file": str(out) if out else None, "notes": notes, "renamed": renamed})
    elif out is not None:
        say(str(out))
    else:
        click.echo(text, nl=False)
