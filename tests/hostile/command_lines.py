"""Hostile command lines: every verb of ``eomgen`` with odd options, values, files and environments, in this process.

No program may start here, so that compilers, if any, are named wrongly; :mod:`hostile.fault_commands` has processes.
"""

from __future__ import annotations

import contextlib
import io
import json
import os
import random
import re
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import click

from eomgen.cli.command import VERBS, run_command
from eomgen.cli.command import eomgen as group

from .kind import Wrong, fewer
from .words import NUMBERS, TEXTS
from .yaml_files import SMALL

#: Not attacked here: a cluster starts processes; targets are set to the one that needs no compiler.
NO_OPTIONS = ("--cluster", "--target", "--help", "-h")
#: Verbs that look for a compiler whatever the target is: they are given one that does not work.
COMPILING = ("doctor", "verify")
NO_COMPILERS = (
    *("/nowhere", "", " ", "'", "other.txt", "sub", ".", "-c", "\\", "$(touch CANARY)", "a b c", "é", "full.csv"),
)
#: Variables of the environment -> values, None where there is none.  Relative paths lie in the folder of the case.
ENVIRONMENT: dict[str, tuple[str | None, ...]] = {
    "HOME": (None, "", "none", "other.txt", "sub"),
    "XDG_CACHE_HOME": (None, "", "sub", "other.txt"),
    "EOMGEN_CACHE_DIR": ("sub", "sub/new/cache", "other.txt", "other.txt/cache", ".", "a" * 300, "\udc80"),
    "LANG": (None, "", "C", "xx_YY.nothing"),
    "LC_ALL": (None, "", "C", "POSIX", "xx_YY.nothing"),
    "COLUMNS": (None, "", "0", "1", "-1", "x", "9" * 30),
    "LINES": ("0", "1", "x"),
    "TERM": (None, "", "dumb", "nothing"),
    "NO_COLOR": ("", "1"),
    "TMPDIR": ("none", "other.txt", ""),
    "MPLBACKEND": ("nothing", ""),
    "CC": NO_COMPILERS,
}
#: Files that every case finds in its folder.
FILES = {
    "model.yaml": SMALL["pendulum"],
    "spring.yaml": SMALL["spring"],
    "broken.yaml": "name: [",
    "empty.yaml": "",
    "odd.yaml": "name: odd\nbodies: {b: {mass: x}}\n",
    "cases.csv": "q,q_dot\n0.1,0\n0.2,x\n",
    "binary.yaml": "\x00\x01\x02",
    "robot.urdf": "<robot name='r'><link name='a'/></robot>",
    "other.txt": "text",
}
PATHS = (
    *FILES,
    "none.yaml",
    "out.npz",
    "out.csv",
    "full.csv",
    "out.yaml",
    "out.png",
    "out",
    ".",
    "..",
    "",
    "sub/none/out.csv",
    "a" * 300 + ".csv",
    "\x00",
    "é.csv",
    "-",
    "--json",
    "\ud800.csv",
    "\udc80.csv",
)
WORDS = (
    *(
        "q",
        "q_dot",
        "u",
        "k",
        "h",
        "t",
        "x",
        "nothing",
        "q=1",
        "q=",
        "=1",
        "q=nan",
        "q=1e400",
        "q=1=2",
        "k=-1",
        "k=0",
        "u=sin(t)",
        "u=9**9**9",
    ),
    *(
        "q=0:1:3",
        "q=1:0",
        "q=0:1:0",
        "q=0:1:-1",
        "q=0:0:2",
        "q=nan:1:2",
        "q=0:inf:2",
        "q=a:b:c",
        "t=0:0.1:3",
        "0,0",
        "1,2",
        "-1,1",
        "a,b",
        "1",
    ),
    *(
        "embedding",
        "lagrange",
        "hamilton",
        "augmented",
        "recursive",
        "auto",
        "DOP853",
        "RK4",
        "Radau",
        "LSODA",
        "BDF",
        "Taylor",
        "foo",
    ),
)
#: Large numbers rightly take long where they count; these do not.
COUNTS = ("0", "-1", "1", "2", "3", "1.5", "nan", "inf", "", "x", "1e3", "٣", "1_0")
TIMES = ("0.01", "0.02", "0", "-1", "nan", "inf", "1e-300", "5e-324", "", "x", "0x1", "1e400")
NUMERIC = re.compile(r"end|step|rtol|atol|count|samples|states|seed|seconds|threads|time")
TRACE = re.compile(r"Traceback|(?:Runtime|Syntax|Deprecation|User|Future)Warning: ")


class CommandLines:
    """A verb, a file, options, an environment."""

    name = "command_lines"
    programs: frozenset[str] = frozenset()
    unjudged: tuple[type[Warning], ...] = ()

    def prepare(self, folder: Path) -> None:
        os.environ["MPLCONFIGDIR"] = str(folder)
        self.options: dict[str, list[click.Option]] = {}
        for verb in VERBS:
            command = group.get_command(click.Context(group), verb)
            assert command is not None
            self.options[verb] = [p for p in command.params if isinstance(p, click.Option)]
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            for words in (
                ["run", "model.yaml", "--plot", "a.png"],
                ["run", "model.yaml", "--out", "a.csv"],
                ["modes", "model.yaml"],
                ["check", "model.yaml", "--graph", "b.png"],
            ):
                files(Path.cwd())
                self.answer([*words, "--target", "numpy"] if words[0] != "check" else words, Path.cwd())

    def make(self, r: random.Random) -> dict[str, Any]:
        if r.random() < 0.03:
            few = [verb for verb in VERBS if verb != "doctor"]
            return {"words": [r.choice((*TEXTS, *few, "--help", "--version", "-x")) for _ in range(r.randint(0, 4))]}
        verb = r.choice(list(VERBS))
        words = [verb]
        if r.random() < 0.95:
            words.append(r.choice(("model.yaml", "model.yaml", "spring.yaml", "spring.yaml", r.choice(PATHS))))
        known = [o for o in self.options[verb] if not set(o.opts) & set(NO_OPTIONS)]
        for option in r.choices(known, k=r.choice((0, 1, 1, 2, 2, 3, 5))) if known else ():
            words.append(r.choice(option.opts))
            if not option.is_flag or r.random() < 0.02:
                words += [value(option, r) for _ in range(option.nargs)]
        for _ in range(r.choice((0, 0, 0, 1))):
            words.insert(r.randint(1, len(words)), r.choice((*TEXTS, *PATHS, *WORDS, "--json", "--set", "--")))
        has = {name for o in self.options[verb] for name in o.opts}
        if "--target" in has:
            words[1:1] = ["--target", "numpy"]
        if "--seconds" in has:
            words[1:1] = ["--seconds", "0.5"]
        if "--states" in has:
            words[1:1] = ["--states", "1"]
        if "--end" in has and r.random() < 0.9:
            words += ["--end", "0.02"]
        environment: dict[str, str | None] = {}
        if r.random() < 0.25 or verb in COMPILING:
            names = r.choices(list(ENVIRONMENT), k=r.randint(0, 3))
            environment = {name: r.choice(ENVIRONMENT[name]) for name in names}
        if verb in COMPILING:
            environment["CC"] = r.choice([name for name in NO_COMPILERS if name.strip()])
        # what lies elsewhere is the user's own business
        words = [word for word in words if not word.startswith("/") and ".." not in word]
        return {"words": words, "environment": environment}

    def build(self, case: Any) -> Any:
        files(Path.cwd())
        return case

    def run(self, given: Any, folder: Path) -> str:
        with changed_environment(given.get("environment", {})):
            return self.answer(given["words"], folder)

    def answer(self, words: list[str], folder: Path) -> str:
        """Run it with a cache of its own."""
        kept = os.environ["EOMGEN_CACHE_DIR"]
        if Path(kept).is_absolute():
            os.environ["EOMGEN_CACHE_DIR"] = str(Path(kept) / "lines")
        out, err = io.StringIO(), io.StringIO()
        try:
            with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
                code: Any = run_command(words)
        except SystemExit as end:
            code = end.code
        finally:
            os.environ["EOMGEN_CACHE_DIR"] = kept
        if code not in (0, 1, 2, 3, 4, 5):
            raise Wrong(f"exit code {code}: {err.getvalue()[-300:]}")
        # what these two find is their answer, also where it is bad
        told = err.getvalue() + (out.getvalue() if words[0] in COMPILING else "")
        if code and not told.strip():
            raise Wrong(f"exit code {code} without a message")
        if TRACE.search(err.getvalue()):
            raise Wrong(f"stderr holds a traceback or a warning: {err.getvalue()[-300:]}")
        as_value = len(words) > 1 and words[-2].startswith("-")  # of the option before it
        if code == 0 and words[-1:] == ["--json"] and not as_value and "--help" not in words and "-h" not in words:
            try:
                json.loads(out.getvalue())
            except ValueError as error:
                raise Wrong(f"--json prints no JSON: {error}") from None
        return f"exit {code}"

    def smaller(self, case: Any) -> Iterator[Any]:
        yield from ({**case, "words": words} for words in fewer(case["words"]))
        given = case.get("environment", {})
        yield from ({**case, "environment": {name: given[name] for name in names}} for names in fewer(list(given)))


@contextlib.contextmanager
def changed_environment(changes: dict[str, str | None]) -> Iterator[None]:
    """Other variables of the environment for a while."""
    before = dict(os.environ)
    try:
        for name, text in changes.items():
            os.environ.pop(name, None)
            if text is not None:
                os.environ[name] = text
        yield
    finally:
        os.environ.clear()
        os.environ.update(before)


def files(folder: Path) -> None:
    """Make the files that every case finds; one is a full disk."""
    for name, text in FILES.items():
        (folder / name).write_text(text, encoding="utf-8")
    (folder / "sub").mkdir(exist_ok=True)
    if not os.path.lexists(folder / "full.csv"):
        (folder / "full.csv").symlink_to("/dev/full")


def value(option: click.Option, r: random.Random) -> str:
    """A value of an option: of its choices, its kind, or anything."""
    if isinstance(option.type, click.Choice) and r.random() < 0.8:
        return str(r.choice(list(option.type.choices)))
    if isinstance(option.type, click.Path) or option.name in ("out", "plot", "cases", "store"):
        return r.choice(PATHS)
    if NUMERIC.search(str(option.name)):
        return r.choice(TIMES if option.name in ("end", "time", "step", "rtol", "atol") else COUNTS)
    return r.choice((*WORDS, *WORDS, *NUMBERS, *TEXTS))


KIND = CommandLines()
