"""Stage cli, cache: what is kept of compiled modules -> a list, or less of it."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

import click

from .failures import reports_failures
from .number_option import NumberRange
from .screen import print_json, print_table, readable_size, say
from .shared_options import json_option

if TYPE_CHECKING:
    from ..compilation.cache import Cache

DAY = 86400.0
MEGABYTE = 1_000_000


@click.group(invoke_without_command=True)
@click.pass_context
def cache(ctx: click.Context) -> None:
    """List, prune or clear the compiled modules; EOMGEN_CACHE_DIR sets their folder."""
    if ctx.invoked_subcommand is None:
        ctx.invoke(show, as_json=False)


def _cache() -> Cache:
    from ..compilation.cache import Cache, cache_directory

    return Cache(cache_directory())


@cache.command("list")
@json_option
@reports_failures
def show(as_json: bool) -> None:
    """List the compiled modules, the most recently used first."""
    kept = _cache()
    entries = kept.entries()
    size = sum(entry.size for entry in entries)
    if as_json:
        listed = [
            {
                "key": e.key,
                "kind": e.kind,
                "name": e.name,
                "directory": str(e.directory),
                "size": e.size,
                "created": e.created,
                "used": e.used,
            }
            for e in entries
        ]
        print_json({"directory": str(kept.root), "size": size, "entries": listed})
        return
    say(f"{kept.root}: {len(entries)} entries, {readable_size(size)}")
    if entries:
        rows = [[e.name, e.kind, readable_size(e.size), _ago(e.used), e.key[:12]] for e in entries]
        print_table(["model", "kind", "size", "used", "key"], rows, right=[2, 3])


@cache.command()
@click.option(
    "--older-than", type=NumberRange(min=0), metavar="DAYS", help="Remove entries that were not used for DAYS."
)
@click.option("--max-size", type=NumberRange(min=0), metavar="MB", help="Remove the oldest entries until MB are left.")
@json_option
@reports_failures
def prune(older_than: float | None, max_size: float | None, as_json: bool) -> None:
    """Remove the modules least recently used; without options those not used for 30 days."""
    if older_than is None and max_size is None:
        older_than = 30.0
    kept = _cache()
    removed = kept.prune(
        older_than=None if older_than is None else older_than * DAY,
        max_size=None if max_size is None else int(max_size * MEGABYTE),
    )
    freed = sum(entry.size for entry in removed)
    if as_json:
        print_json({"directory": str(kept.root), "removed": [entry.key for entry in removed], "freed": freed})
        return
    say(f"{kept.root}: removed {len(removed)} entries, {readable_size(freed)}")


@cache.command()
@json_option
@reports_failures
def clear(as_json: bool) -> None:
    """Remove every compiled module."""
    kept = _cache()
    removed = kept.clear()
    if as_json:
        print_json({"directory": str(kept.root), "removed": removed})
        return
    say(f"{kept.root}: removed {removed} entries")


def _ago(moment: float) -> str:
    seconds = max(time.time() - moment, 0.0)
    for size, unit in ((DAY, "d"), (3600.0, "h"), (60.0, "min")):
        if seconds >= size:
            return f"{seconds / size:.0f} {unit} ago"
    return "just now"
