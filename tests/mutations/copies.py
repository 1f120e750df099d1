"""A copy of the repository in which one fault at a time is put, and the tests that are run in it."""

import importlib.util
import os
import shutil
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from mutations.fault import ROOT, Fault, read_sources

FOLDERS = ("eomgen", "tests", "docs", "notebooks", "benchmarks")
FILES = ("pyproject.toml", "README.md", "Makefile", "LICENSE")
#: Installed in the environment are links to the sources; in a copy these two folders must lie inside the package.
INSIDE = ("templates", "examples")
LIMIT = 600.0  #: s, on a busy machine
CHECK = (
    "import eomgen, eomgen.templates, eomgen.examples, eomgen.toolchain.layer, sys; root = sys.argv[1]; "
    "paths = [eomgen.__file__, eomgen.templates.__path__[0], eomgen.examples.__path__[0]]; "
    "sys.exit(any(not path.startswith(root) for path in paths) and str(paths))"
)


class Outcome(NamedTuple):
    """What became of one run of tests."""

    code: int  #: of pytest: 0 passed, 1 failed; -1 for a run that did not end in time
    seconds: float
    by: str  #: the test that failed first
    text: str


class Copy:
    """The repository's sources in a folder of their own."""

    def __init__(self, folder: Path) -> None:
        self.root = folder.resolve()
        bytecode = shutil.ignore_patterns("__pycache__", ".*_cache")
        for name in FOLDERS:
            shutil.copytree(ROOT / name, self.root / name, ignore=bytecode)
        for name in INSIDE:
            shutil.copytree(ROOT / name, self.root / "eomgen" / name, ignore=bytecode)
            (self.root / name).symlink_to(self.root / "eomgen" / name, target_is_directory=True)
        for name in FILES:
            shutil.copy(ROOT / name, self.root / name)
        self._require_own_sources()

    def _environment(self) -> dict[str, str]:
        kept = {k: v for k, v in os.environ.items() if k not in ("EOMGEN_CACHE_DIR", "PYTHONDONTWRITEBYTECODE")}
        temporary = self.root / "tmp"
        temporary.mkdir(exist_ok=True)
        return kept | {
            "PYTHONPATH": os.pathsep.join([str(self.root), str(self.root / "tests")]),
            "TMPDIR": str(temporary),
        }

    def _require_own_sources(self) -> None:
        done = subprocess.run(
            [sys.executable, "-c", CHECK, str(self.root)],
            cwd=self.root, env=self._environment(), capture_output=True, text=True, check=False,
        )  # fmt: skip
        if done.returncode:
            raise RuntimeError(f"the copy in {self.root} does not run its own sources: {done.stderr}")

    def run(self, tests: Sequence[str], *, first: bool = True) -> Outcome:
        """Run tests in the copy, up to the first failure or all of them."""
        words = ["-p", "mutations.plugin", "-q", "--tb=short", "-p", "no:cacheprovider", *(["-x"] if first else [])]
        start = time.monotonic()
        with subprocess.Popen(
            [sys.executable, "-m", "pytest", *words, *tests],
            cwd=self.root, env=self._environment(), stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
        ) as process:  # fmt: skip
            try:
                text, code = process.communicate(timeout=LIMIT if first else 20.0 * LIMIT)[0], process.returncode
            except subprocess.TimeoutExpired:
                process.kill()
                text, code = process.communicate()[0], -1
        shutil.rmtree(self.root / "tmp", ignore_errors=True)
        lines = [line for line in text.splitlines() if line.startswith(("FAILED ", "ERROR "))]
        failed = [line.split(" ", 1)[1].split(" - ")[0] for line in lines]
        return Outcome(code, time.monotonic() - start, failed[0] if failed else "", text)

    def run_with(self, fault: Fault, tests: Sequence[str]) -> Outcome:
        """The same with a fault, which is taken back afterwards."""
        texts = read_sources(self.root)
        path, text = fault.apply(texts)
        native = {file: file.read_bytes() for file in (self.root / "eomgen").glob("_native*.so")}
        try:
            path.write_text(text, encoding="utf-8")
            self._forget(path)
            return self.run(tests)
        finally:
            path.write_text(texts[path], encoding="utf-8")
            self._forget(path)
            for file, content in native.items():  # a fault in its sources has built another
                file.write_bytes(content)

    @staticmethod
    def _forget(path: Path) -> None:
        """Python takes bytecode for current where size and second of the change agree."""
        if path.suffix == ".py":
            Path(importlib.util.cache_from_source(str(path.resolve()))).unlink(missing_ok=True)
