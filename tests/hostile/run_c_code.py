"""Generated C of every example by every method: warnings, sanitizers, valgrind, symbols; a table at the end.

``python -m hostile.run_c_code`` from the folder ``tests`` runs everything, for hours, and exits 1 on a fault.
``--only warnings sanitizers valgrind symbols`` and ``--examples pendulum.yaml`` choose; ``--record FILE`` keeps a line
of JSON for each result and leaves out, in a later run, what is there already.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
from collections.abc import Callable, Iterator
from hashlib import sha256
from pathlib import Path
from time import perf_counter
from typing import Any

from hostile import c_code

import eomgen as eg
from eomgen.emit import emit_c
from eomgen.equations import METHODS

MAIN = "embedding"  #: by this method lanes and functions of all kinds are run; by the others at -O0 and 2 lanes
Row = dict[str, Any]


def warnings(name: str, method: str, folder: Path, known: set[str]) -> Iterator[Row]:
    """Every file of target c and of both libraries of target cython, by every compiler that is installed."""
    for kernels in ("all", "now", "late"):
        program = c_code.program_of(name, method, kernels)
        sources = dict(emit_c(program))
        headers = "".join(text for file, text in sorted(sources.items()) if file.endswith(".h"))
        files = c_code.write(folder, sources)
        new = [f for f in files if sha256((sources[f] + headers).encode()).hexdigest() not in known]
        known |= {sha256((sources[f] + headers).encode()).hexdigest() for f in files}
        for compiler in c_code.installed("gcc", "clang", "g++", "clang++"):
            fault = c_code.warnings_of(compiler, folder, new) if new else ""
            yield {"what": f"warnings {compiler}", "kernels": kernels, "files": len(new), "fault": fault}


class Layers:
    """The layer's objects and the driver's, compiled once for each choice of flags."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.made: dict[tuple[str, ...], list[str]] = {}

    def objects(self, compiler: str, flags: tuple[str, ...]) -> list[str]:
        if (compiler, *flags) not in self.made:
            folder = self.folder / f"layer{len(self.made)}"
            files = c_code.write(folder, c_code.layer())
            (folder / c_code.DRIVER.name).write_text(c_code.DRIVER.read_text())
            self.made[compiler, *flags] = c_code.objects_of(compiler, folder, [*files, c_code.DRIVER.name], flags)
        return self.made[compiler, *flags]


def driven(
    name: str, method: str, folder: Path, layers: Layers, compiler: str, flags: tuple[str, ...], *before: str
) -> Row:
    """Compile an example and have the driver call it."""
    program = c_code.program_of(name, method)
    files = c_code.write(folder, emit_c(program))
    lanes = () if method == MAIN else ("-DEOMGEN_LANES=2",)
    objects = c_code.objects_of(compiler, folder, files, (*flags, *lanes))
    binary = c_code.executable(compiler, folder, [*objects, *layers.objects(compiler, flags)], flags)
    counts, fault = c_code.drive(folder, binary, program, *before)
    return {**counts, "fault": fault}


def sanitizers(name: str, method: str, folder: Path, layers: Layers) -> Iterator[Row]:
    for compiler in c_code.installed("gcc", "clang"):
        if method != MAIN and compiler != "gcc":
            continue
        flags = ("-O1" if method == MAIN else "-O0", "-ffp-contract=off", *c_code.SANITIZERS)
        yield {"what": f"sanitizers {compiler}", **driven(name, method, folder, layers, compiler, flags)}


def valgrind(name: str, method: str, folder: Path, layers: Layers) -> Iterator[Row]:
    if method == MAIN and c_code.find("valgrind"):
        before = ("valgrind", "-q", "--error-exitcode=9", "--leak-check=full", "--undef-value-errors=yes")
        flags = ("-O1", "-g", "-ffp-contract=off")
        yield {"what": "valgrind", **driven(name, method, folder, layers, "gcc", flags, *before)}


def symbols(name: str, method: str, folder: Path) -> Iterator[Row]:
    files = c_code.write(folder, emit_c(c_code.program_of(name, method)))
    for compiler in c_code.installed("gcc", "clang"):
        if method == MAIN or compiler == "gcc":
            level = "-O2" if method == MAIN else "-O0"
            objects = c_code.objects_of(compiler, folder, files, (level,))
            fault = "; ".join(c_code.state_of(objects, folder))
            yield {"what": f"symbols {compiler}", "objects": len(objects), "fault": fault}


def table(rows: list[Row]) -> str:
    """Counts of what was run, a line for each kind of check."""
    lines = ["| check | runs | files or calls | with faults |", "|---|---|---|---|"]
    for what in sorted({row["what"] for row in rows}):
        own = [row for row in rows if row["what"] == what]
        amount = sum(row.get(key, 0) for row in own for key in ("files", "objects", "calls", "lanes"))
        lines.append(f"| {what} | {len(own)} | {amount} | {sum(bool(row['fault']) for row in own)} |")
    return "\n".join(lines)


def main() -> int:
    """Run what was asked for; print a table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--only", nargs="*", default=["warnings", "symbols", "sanitizers", "valgrind"])
    parser.add_argument("--examples", nargs="*", default=list(c_code.NAMES))
    parser.add_argument("--methods", nargs="*", default=list(METHODS))
    parser.add_argument("--record", type=Path, help="file of JSON lines")
    asked = parser.parse_args()
    record = asked.record or Path(tempfile.mkdtemp()) / "record"
    rows: list[Row] = [json.loads(line) for line in record.read_text().splitlines()] if record.exists() else []
    done = {(row["example"], row["method"], row["what"].partition(" ")[0]) for row in rows}
    known: set[str] = set()
    with tempfile.TemporaryDirectory() as place, open(record, "a", encoding="utf-8") as file:
        layers = Layers(Path(place))
        checks: dict[str, Callable[[str, str, Path], Iterator[Row]]] = {
            "warnings": lambda *given: warnings(*given, known),
            "symbols": symbols,
            "sanitizers": lambda *given: sanitizers(*given, layers),
            "valgrind": lambda *given: valgrind(*given, layers),
        }
        for what in asked.only:
            for method in sorted(asked.methods, key=lambda method: method != MAIN):
                for name in asked.examples:
                    if (name, method, what) in done:
                        continue
                    start = perf_counter()
                    with tempfile.TemporaryDirectory(dir=place) as own:
                        try:
                            found = list(checks[what](name, method, Path(own)))
                        except eg.EomgenError as error:
                            found = [{"what": f"{what} refused", "fault": f"{type(error).__name__}: {error}"}]
                    for row in found:
                        row |= {"example": name, "method": method, "seconds": round(perf_counter() - start, 1)}
                        rows.append(row)
                        print(json.dumps(row), file=file, flush=True)
                        if row["fault"]:
                            print(f"{name} {method} {row['what']}: {row['fault'][:600]}", flush=True)
    print(table(rows))
    return 1 if any(row["fault"] for row in rows) else 0


if __name__ == "__main__":
    sys.exit(main())
