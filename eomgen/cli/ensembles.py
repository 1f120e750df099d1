"""Verb ensemble: model file and cases -> many runs, their last states or statistics."""

from __future__ import annotations

import csv
import sys
from io import TextIOWrapper
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import click

from ..base.files import open_plain, save_figure, write_whole
from ..errors import UsageError, at_odds, bad_data, bad_file, ill_shaped, incomplete, no_number, off_range
from ..runtime.argument_checks import require, require_size
from ..runtime.ensembles.block import BAD_PARAMETERS
from ..runtime.storage import split_head, write_netcdf
from .options import Count, End, Integration, Prepared, Seed, Texts, parse_spans, require_folder, verb
from .output import MODEL, stage

if TYPE_CHECKING:
    from ..module import Module

LISTED = 10  #: failures listed
MOST_WORKERS = 4096  #: processes of a local cluster


@verb()
def ensemble(
    work: Prepared,
    solver: Integration,
    cases: Annotated[
        Path | None,
        click.Path(path_type=Path, exists=True, dir_okay=False),
        "FILE: CSV with a column for each name (parameter, input, coordinate, rate), a row for each run.",
    ] = None,
    vary: Annotated[Texts, "NAME=LOW:HIGH: Draw a random value between LOW and HIGH for each run."] = (),
    grid: Annotated[Texts, "NAME=LOW:HIGH:COUNT: Take COUNT evenly spaced values, in all combinations."] = (),
    count: Annotated[Count | None, "N: Number of runs for --vary."] = None,
    seed: Annotated[Seed, "Seed of the random numbers."] = 0,
    end: End = None,
    samples: Annotated[int | None, click.IntRange(min=2), "M: Keep the states at M evenly spaced times."] = None,
    statistics: Annotated[bool, "Keep only mean, standard deviation, least and greatest values."] = False,
    threads: Annotated[Count | None, "N: Number of runs at a time; by default all processors."] = None,
    cluster: Annotated[str | None, "N|ADDRESS: Run on N local dask workers, or on the workers of a scheduler."] = None,
    store: Annotated[Path | None, "DIR: Keep finished runs in DIR, and continue from there."] = None,
    plot: Annotated[tuple[str, str] | None, "NAME FILE: Draw column NAME to the picture FILE."] = None,
    out: Annotated[Path | None, "FILE: Write results to FILE.npz, .csv or .nc."] = None,
) -> None:
    """Run a model many times: for a table of cases, for random values, or over a grid of values."""
    if out is not None and out.suffix not in (".npz", ".csv", ".nc"):
        raise bad_file(f"--out {out}: ensembles are written as .npz, .csv or .nc")
    for word, path in (("--out", out), ("--plot", None if plot is None else Path(plot[1]))):
        require_folder(word, path)
    if out is not None and out.suffix == ".csv":
        require("pandas", "pandas", "--out FILE.csv")
    if out is not None and out.suffix == ".nc":
        require("xarray", "xarray h5netcdf h5py", "--out FILE.nc")
    if cases is not None and count is not None:
        raise at_odds("--count is for values drawn by --vary; --cases has as many runs as rows")
    module = work.module
    require_size(f"--count {count}", float(count or 0) * max(len(vary) + 2 * module.n_x, 1), "draw fewer runs")
    require_size(f"--samples {samples}", float(samples or 0) * (1 + module.n_x), "keep fewer times")
    if cluster is not None and cluster.isdigit() and not 1 <= int(cluster) <= MOST_WORKERS:
        raise off_range(f"--cluster {cluster}: give 1 to {MOST_WORKERS} workers, or the address of a scheduler")
    if grid and (cases is not None or vary or count is not None):
        raise at_odds("--grid defines all runs itself; leave out --cases, --vary and --count")
    axes = _read_grid(grid)
    values = _read(cases, module) if cases is not None else {}
    values |= _draw(vary, count or len(next(iter(values.values()), ())) or 100, seed)
    if not values and not axes:
        raise incomplete("all runs are equal: give --cases FILE, --vary NAME=LOW:HIGH or --grid")
    sorted_values: dict[str, dict[str, Any]] = {"initial": dict(work.initial or {}), "parameters": {}, "inputs": {}}
    for name, column in values.items():
        kind = "parameters" if name in module.p_names else "inputs" if name in module.u_names else "initial"
        sorted_values[kind][name] = column
    last = module.info.simulation.get("end") or 10.0
    times = None if samples is None else _even(end or float(last), samples)
    with stage("integrate"):
        result = module.simulate_many(
            end, *(group or None for group in sorted_values.values()), t_eval=times, grid=axes or None,
            threads=threads, reduce="statistics" if statistics else None,
            cluster=int(cluster) if cluster is not None and cluster.isdigit() else cluster, store=store,
            **solver.keywords,
        )  # fmt: skip
    if out is not None:
        if out.suffix == ".csv":
            write_whole(out, result.to_pandas(samples=times is not None and not statistics).to_csv(index=False))
        elif out.suffix == ".nc":
            write_netcdf(result.to_xarray(), out)
        else:
            result.save(out)
    if plot is not None:
        save_figure(result.plot(plot[0]).figure, plot[1], dpi=150)
    varied, failures = sorted({**values, **axes}), result.failures()
    (table,) = result.tables
    notes = [str(one) for one in failures[:LISTED]]
    if len(failures) > LISTED:
        notes.append(f"... and {len(failures) - LISTED} more of {result.count} failed")
    work.show(
        float(result.t[-1]),
        table._replace(title=f"{result.count} runs to t = {result.t[-1]:g} s; varied: {', '.join(varied)}"), *notes,
        values=result.to_dict() | {"varied": varied},
        files=[path for path in (out, plot and plot[1]) if path],
    )  # fmt: skip
    if any(one.status == BAD_PARAMETERS for one in failures):
        sys.exit(MODEL)


def _even(end: float, count: int) -> list[float]:
    return [end * (i / (count - 1)) for i in range(count)]  # the last is end itself


def _read(path: Path, module: Module) -> dict[str, list[float]]:
    with TextIOWrapper(open_plain(path), newline="", encoding="utf-8-sig") as file:
        try:
            rows = [row for row in csv.reader(file) if row]
        except (UnicodeDecodeError, csv.Error) as error:
            raise bad_data(f"--cases {path}: this is not a table of text (CSV, UTF-8): {error}") from None
    if len(rows) < 2:
        raise incomplete(f"--cases {path}: the table needs a line of names and a line for each run")
    heads = [split_head(head) for head in rows[0]]
    names = [name for name, _ in heads]
    if twice := sorted({name for name in names if names.count(name) > 1}):
        raise at_odds(f"--cases {path}: the names {', '.join(twice)} appear twice in the table")
    columns: dict[str, list[float]] = {name: [] for name in names}
    for number, row in enumerate(rows[1:], start=2):
        if len(row) != len(names):
            raise ill_shaped(f"{path}:{number}: {len(row)} values for {len(names)} names")
        for name, word in zip(names, row, strict=True):
            try:
                columns[name].append(float(word))
            except ValueError:
                raise no_number(f"{path}:{number}: {name} must be a number, not {word!r}") from None
    for name, unit in heads:
        if unit and unit != (declared := module.layout.unit(name)):
            raise UsageError(
                f"--cases {path}: {name} is given in {unit}; give values in {declared or '1'}, without a unit",
                code="EG-UNIT",
            )
    return columns


def _draw(vary: tuple[str, ...], count: int, seed: int) -> dict[str, Any]:
    """Values drawn for each name, from a stream of its own."""
    import numpy as np

    spans = parse_spans("--vary", vary, "NAME=LOW:HIGH", "r=0.1:0.2")
    drawn = {}
    for k, (name, low, high, _) in enumerate(spans):
        if not (isfinite(low) and isfinite(high) and low <= high):
            raise no_number(f"--vary {vary[k]}: write NAME=LOW:HIGH with two finite numbers in order")
        drawn[name] = np.random.default_rng([seed, k]).uniform(low, high, count)
    return drawn


def _read_grid(options: tuple[str, ...]) -> dict[str, tuple[float, float, int]]:
    spans = parse_spans("--grid", options, "NAME=LOW:HIGH:COUNT", "theta=0:2*pi:73")
    return {name: (low, high, count or 0) for name, low, high, count in spans}
