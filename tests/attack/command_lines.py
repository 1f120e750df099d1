"""Hostile command lines: every verb of ``eomgen`` with odd options, values, files and environments, in this process.

No program may start here, so that compilers, if any, are named wrongly.
"""

import json
import os
import random
import re
import warnings
from pathlib import Path
from typing import Any
from unittest.mock import patch

import command
from attack.runner import Kind, Wrong
from attack.words import NUMBERS, TEXTS
from attack.yaml_files import SMALL, answered

#: Not attacked here: a cluster starts processes; targets are set to the one that needs no compiler.
NO_OPTIONS = ("--cluster", "--target", "--help")
#: Verbs that look for a compiler whatever the target is: they are given one that does not work.
COMPILING = ("doctor", "verify")
NO_COMPILERS = ("/nowhere", "'", "other.txt", "sub", ".", "-c", "\\", "$(touch CANARY)", "a b c", "é", "full.csv")
#: Variables of the environment -> values, None where there is none.  Relative paths lie in the folder of the case.
ENVIRONMENT: dict[str, tuple[str | None, ...]] = {
    "HOME": (None, "", "none", "other.txt", "sub"),
    "XDG_CACHE_HOME": (None, "", "sub", "other.txt"),
    "EOMGEN_CACHE_DIR": ("sub", "sub/new/cache", "other.txt", "other.txt/cache", ".", "a" * 300, "\udc80"),
    "LANG": (None, "", "C", "xx_YY.nothing"),
    "LC_ALL": (None, "", "C", "POSIX", "xx_YY.nothing"),
    "COLUMNS": (None, "", "0", "1", "-1", "x", "9" * 30),
    "TMPDIR": ("none", "other.txt", ""),
    "CC": (*NO_COMPILERS, "", " "),
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
    *FILES, *"none.yaml out.npz out.csv full.csv out.yaml out.png out . .. sub/none/out.csv é.csv - --json".split(), "",
    "a" * 300 + ".csv", "\x00", "\ud800.csv", "\udc80.csv",
)  # fmt: skip
WORDS = (
    "q q_dot u k h t x nothing q=1 q= =1 q=nan q=1e400 q=1=2 k=-1 k=0 u=sin(t) u=9**9**9 q=0:1:3 q=1:0 q=0:1:0 q=0:1:-1 q=0:0:2 "
    "q=nan:1:2 q=0:inf:2 q=a:b:c t=0:0.1:3 0,0 1,2 -1,1 a,b 1 embedding lagrange hamilton augmented recursive auto DOP853 RK4 "
    "Radau LSODA BDF Taylor foo"
).split()
#: Large numbers rightly take long where they count; these do not.
COUNTS = ("0", "-1", "1", "2", "3", "1.5", "nan", "inf", "", "x", "1e3", "٣", "1_0")
TIMES = ("0.01", "0.02", "0", "-1", "nan", "inf", "1e-300", "5e-324", "", "x", "0x1", "1e400")
#: A line of ``--help``: an option, and what stands for its value.
OPTION = re.compile(r"^ +(?:-\w, )?(--[a-z-]+)(?: (\[[\w|.]+\]|[A-Z][A-Z0-9,=:|.\[\]]*))?(?=  |$)", re.MULTILINE)


class CommandLines(Kind):
    """A verb, a file, options, an environment."""

    name = "command_lines"

    def prepare(self, folder: Path) -> None:
        os.environ["MPLCONFIGDIR"] = str(folder)
        verbs = re.findall(r"^  ([a-z]+)  ", command.run("--help").out, re.MULTILINE)
        self.options = {verb: OPTION.findall(command.run(verb, "--help").out) for verb in verbs}
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            for words in (
                "run --plot a.png --target numpy",
                "run --out a.csv --target numpy",
                "modes",
                "check --graph b.png",
            ):
                verb, *options = words.split()
                self.run({"words": [verb, "model.yaml", *options]}, self.build(Path.cwd()))

    def make(self, r: random.Random) -> dict[str, Any]:
        if r.random() < 0.03:
            few = [verb for verb in self.options if verb != "doctor"]
            return {"words": [r.choice((*TEXTS, *few, "--help", "--version", "-x")) for _ in range(r.randint(0, 4))]}
        verb = r.choice(list(self.options))
        words, has = [verb], dict(self.options[verb])
        if r.random() < 0.95:
            words.append(r.choice(("model.yaml", "model.yaml", "spring.yaml", "spring.yaml", r.choice(PATHS))))
        known = [(name, value) for name, value in self.options[verb] if name not in NO_OPTIONS]
        for name, value in r.choices(known, k=r.choice((0, 1, 1, 2, 2, 3, 5))) if known else ():
            words.append(name)
            if value or r.random() < 0.02:
                words.append(value_of(name, value, r))
        for _ in range(r.choice((0, 0, 0, 1))):
            words.insert(r.randint(1, len(words)), r.choice((*TEXTS, *PATHS, *WORDS, "--json", "--set", "--")))
        for name, value in (("--target", "numpy"), ("--seconds", "0.5"), ("--states", "1")):
            words[1:1] = [name, value] if name in has else []
        if "--end" in has and r.random() < 0.9:
            words += ["--end", "0.02"]
        environment: dict[str, str | None] = {}
        if r.random() < 0.25 or verb in COMPILING:
            names = r.choices(list(ENVIRONMENT), k=r.randint(0, 3))
            environment = {name: r.choice(ENVIRONMENT[name]) for name in names}
        if verb in COMPILING:
            environment["CC"] = r.choice(NO_COMPILERS)
        # what lies elsewhere is the user's own business
        words = [word for word in words if not word.startswith("/") and ".." not in word]
        return {"words": words, "environment": environment}

    def build(self, case: Any) -> Any:
        for name, text in FILES.items():
            Path(name).write_text(text, encoding="utf-8")
        Path("sub").mkdir(exist_ok=True)
        if not os.path.lexists("full.csv"):
            Path("full.csv").symlink_to("/dev/full")
        return case

    def run(self, given: Any, folder: Path) -> str:
        words = given["words"]
        with patch.dict(os.environ):
            for name, text in given.get("environment", {}).items():
                os.environ.pop(name, None)
                if text is not None:
                    os.environ[name] = text
            done = answered(words, (0, 1, 2, 3, 4, 5))
            as_value = len(words) > 1 and words[-2].startswith("-")  # of the option before it
            if done == "exit 0" and words[-1:] == ["--json"] and not as_value and not {"--help", "-h"} & {*words}:
                try:
                    json.loads(command.run(*words).out)
                except ValueError as error:
                    raise Wrong(f"--json prints no JSON: {error}") from None
        return done


def value_of(name: str, value: str, r: random.Random) -> str:
    """A value of an option: of its choices, its kind, or anything."""
    if value.startswith("[") and r.random() < 0.8:
        return r.choice(value.strip("[]").split("|"))
    if value in ("FILE", "DIR", "PATH"):
        return r.choice(PATHS)
    if re.search(r"end|step|rtol|atol|time", name):
        return r.choice(TIMES)
    if re.search(r"count|samples|states|seed|seconds|threads", name):
        return r.choice(COUNTS)
    return r.choice((*WORDS, *WORDS, *NUMBERS, *TEXTS))


KINDS = {"command_lines": CommandLines()}
