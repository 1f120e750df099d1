"""A short attack in this process: ``python -m hostile.short FOLDER '{KIND: CASES}'``, then all kept cases."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from pathlib import Path
from types import CodeType
from typing import Any

from .kind import find, generator, kept
from .outcome import FINDINGS, Runner


def main() -> int:
    """The command line; exit status 1 if anything was found."""
    folder, wanted = Path(sys.argv[1]), json.loads(sys.argv[2])
    runner = Runner(folder / "home", folder / "cache")
    runner.limit()
    total = 0
    for name, count in wanted.items():
        kind = find(name)
        runner.prepare(kind)
        total += told(name, runner, ((seed, kind.make(generator(name, seed))) for seed in range(count)))
    found = [(path.parent.name, path) for path in sorted((Path(__file__).parent / "kept").glob("*/*.*"))]
    bad = 0
    for name, path in found:
        kind = find(name)
        runner.prepare(kind)
        bad += told(name, runner, [(path.name, kept(path))], quiet=True)
    if found and not bad:
        print("kept cases: nothing found")
    return int(total + bad > 0)


def told(name: str, runner: Runner, cases: Any, quiet: bool = False) -> int:
    """Run cases of one kind; print and count the findings."""
    bad = 0
    for label, case in cases:
        found = runner.run(find(name), case)
        if found.kind in FINDINGS:
            bad += 1
            print(f"{name} {label}: {found.kind}: {found.detail}\n{found.text[-1500:]}")
    if not bad and not quiet:
        print(f"{name}: nothing found")
    return bad


class Attempt:
    """A kind whose case runs given code, to try the guard."""

    name = "attempt"
    programs: frozenset[str] = frozenset()
    unjudged: tuple[type[Warning], ...] = ()

    def __init__(self, code: CodeType) -> None:
        self.code = code

    def prepare(self, folder: Path) -> None:
        """Nothing."""

    def make(self, r: Any) -> Any:
        return None

    def build(self, case: Any) -> Any:
        return case

    def run(self, given: Any, folder: Path) -> str:
        exec(self.code, {})  # noqa: S102 - what the guard has to stop
        return "ran"

    def smaller(self, case: Any) -> Iterator[Any]:
        return iter(())


if __name__ == "__main__":
    sys.exit(main())
