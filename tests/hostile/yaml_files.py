"""Hostile model files: the examples and the documents' models changed, models from the JSON Schema, broken YAML."""

from __future__ import annotations

import contextlib
import io
import random
import re
import warnings
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from typing import Any

from eomgen import Model
from eomgen.cli.command import run_command
from eomgen.describe import model_schema
from eomgen.describe.build_mechanism import build
from eomgen.describe.yaml_file import describe_yaml
from eomgen.describe.yaml_nodes import Document
from eomgen.errors import ModelError

from .guard import PACKAGE
from .kind import Wrong, trimmed
from .trees import Schema, change, copied, paths, yaml_text
from .words import TEXTS

#: What is done with a text -> of 1000 texts, how many.  Each does what those before it do.
STAGES = {"build": 940, "check": 50, "compile": 10}
PUNCTUATION = (
    "{",
    "}",
    "[",
    "]",
    ":",
    ",",
    "#",
    "&a ",
    "*a",
    "!x ",
    '!!python/object/apply:os.system ["touch CANARY"]',
    "!!binary ",
    "|",
    ">",
    "\t",
    "\x00",
    "\ufeff",
    "\x85",
    "\u2028",
    "---\n",
    "...\n",
    "%YAML 1.1\n",
    "%TAG ! x\n",
    '"',
    "'",
    "? ",
    "- ",
    "<<: ",
    "\r",
    "\x0b",
    "@",
    "`",
    "|+9\n",
    ">-0\n",
    "\\",
    "? [a, b]\n: c\n",
    "!<tag:yaml.org,2002:float> ",
    '"\\ud83d\\ude00"',
    '"\\x00"',
    '"\\N"',
)
SUMMARY = re.compile(r"Traceback|(?:Runtime|Syntax|Deprecation|User|Future)Warning: ")


class YamlFiles:
    """Texts of model files."""

    name = "yaml"
    programs: frozenset[str] = frozenset()
    unjudged: tuple[type[Warning], ...] = ()

    def prepare(self, folder: Path) -> None:
        self.texts = [path.read_text() for path in sorted((PACKAGE.parent / "examples").glob("*.yaml"))]
        for page in sorted((PACKAGE.parent / "docs").glob("*.md")):
            blocks = re.findall(r"```yaml\n(.*?)```", page.read_text(), re.DOTALL)
            self.texts += [block for block in blocks if block.startswith("name:")]
        self.texts += [text for _, text in sorted(SMALL.items())]
        self.trees = [Document(text, "model.yaml").value for text in self.texts]
        self.weights = [1.0 / len(text) for text in self.texts]
        schema = model_schema()
        self.schema = Schema(schema)
        self.keys = sorted(
            {key for tree in self.trees for place in paths(tree) for key in place if isinstance(key, str)}
        )
        self.types = sorted(set(_constants(schema)))
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            for library in ("integrate", "interpolate", "linalg", "optimize", "special", "spatial"):
                import_module(f"scipy.{library}")  # which run texts of their own as they load
            for tree in self.trees[:4]:  # imports whatever deriving and compiling need
                text = yaml_text(tree, random.Random(0))
                module = Model.from_description(describe_yaml(text)).compile(target="numpy")
                module.simulate((0.0, 0.01), t_eval=[0.0, 0.01])

    def make(self, r: random.Random) -> dict[str, Any]:
        stage = r.choices(list(STAGES), list(STAGES.values()))[0]
        k = r.random()
        if k < 0.3:
            text = r.choices(self.texts, self.weights)[0]
            for _ in range(r.choice((1, 1, 1, 2, 3, 6))):
                text = broken(text, r)
            return {"stage": stage, "text": text}
        tree = self.schema.tree(r) if k < 0.5 else copied(r.choices(self.trees, self.weights)[0])
        if k < 0.5:
            tree["name"] = "made"
        calm = stage == "compile" and r.random() < 0.5
        for _ in range(1 if calm else r.choice((0, 1, 2)) if k < 0.5 else r.choice((1, 1, 1, 1, 2, 2, 3, 5, 9))):
            with contextlib.suppress(KeyError, TypeError, IndexError):
                change(tree, r, self.trees, self.keys, self.types)
        return {"stage": stage, "text": yaml_text(tree, r)}

    def build(self, case: Any) -> Any:
        return case

    def run(self, case: Any, folder: Path) -> str:
        text, stage = case["text"], case["stage"]
        if stage == "check":
            return self.check(text, folder)
        description = describe_yaml(text)
        if stage == "build":
            build(description)
            return "built"
        module = Model.from_description(description).compile(target="numpy")
        module.rhs(0.0, module.x0())
        module.simulate((0.0, 0.01), t_eval=[0.0, 0.01])
        again = Model.from_description(describe_yaml(Model.from_description(description).to_yaml()))
        try:
            again.mechanism()
        except ModelError as error:
            raise Wrong(f"what to_yaml writes is refused: {error}") from None
        return "run"

    def check(self, text: str, folder: Path) -> str:
        """``eomgen check``: exit code 0, or 1 and a line on stderr."""
        with (folder / "model.yaml").open("w", encoding="utf-8", errors="surrogatepass", newline="") as file:
            file.write(text)
        return command(["check", "model.yaml"], (0, 1))

    def smaller(self, case: Any) -> Iterator[Any]:
        if case["stage"] == "compile":
            yield {**case, "stage": "build"}
        yield from ({**case, "text": text} for text in trimmed(case["text"]))


def command(words: list[str], allowed: tuple[int, ...]) -> str:
    """Run the command line in this process; a bad exit code, silence or a traceback on stderr is wrong."""
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        try:
            code: Any = run_command(words)
        except SystemExit as end:
            code = end.code
    if code not in allowed:
        raise Wrong(f"exit code {code}: {err.getvalue()[-300:]}")
    if code and not err.getvalue().strip():
        raise Wrong(f"exit code {code} without a message")
    if SUMMARY.search(err.getvalue()):
        raise Wrong(f"stderr holds a traceback or a warning: {err.getvalue()[-300:]}")
    return f"exit {code}"


def _constants(schema: Any) -> Iterator[str]:
    """Words that stand behind ``const`` in a schema: the types of joints, forces and so on."""
    if isinstance(schema, dict):
        if isinstance(schema.get("const"), str):
            yield schema["const"]
        for value in schema.values():
            yield from _constants(value)
    elif isinstance(schema, list):
        for value in schema:
            yield from _constants(value)


def broken(text: str, r: random.Random) -> str:
    """One place of a text changed."""
    lines = text.split("\n")
    i, at, k = r.randrange(len(lines)), r.randrange(len(text) + 1), r.randrange(13)
    if k == 0:
        del lines[i]
    elif k == 1:
        lines.insert(i, r.choice(lines))
    elif k == 2:
        lines[i] = " " * r.randint(0, 9) + lines[i].lstrip()
    elif k == 3:
        return text[:at] + r.choice(PUNCTUATION) + text[at:]
    elif k == 4:
        return text[:at] + text[at + r.choice((1, 2, 5, 50, 500)) :]
    elif k == 5:
        sign = chr(
            r.choice((r.randrange(32, 127), r.randrange(32), r.randrange(0x80, 0x3000), 0x1F600, 0xFFFE, 0xD800))
        )
        return text[:at] + sign + text[at + 1 :]
    elif k == 6:
        return text[:at]
    elif k == 7:
        return f"{text}\n---\n{text}"
    elif k == 8:
        bomb = "a: &a [x,x,x,x,x,x,x,x,x]\n"
        for this, last in zip("bcdefghij", "abcdefghi", strict=True):
            bomb += f"{this}: &{this} [{','.join(['*' + last] * 9)}]\n"
        return bomb + text if r.random() < 0.5 else f"{text}\n{bomb}"
    elif k == 9:
        return f"{text}\nx: " + r.choice('[{-"') * r.choice((5, 20, 500, 5000))
    elif k == 10:
        return text[:at] + r.choice(TEXTS) + text[at:]
    else:
        words = re.findall(r"[A-Za-z_][A-Za-z_0-9]*", text) or ["a"]
        old, new = r.choice(words), r.choice((*words, *TEXTS))
        return re.sub(rf"\b{re.escape(old)}\b", lambda _: new, text)
    return "\n".join(lines)


#: Models of few lines, so that most of the time goes into what is hostile about a case.
SMALL = {
    "lagrangian": """name: made
parameters: {m: 1, k: 2}
lagrangian: {coordinates: [q], expression: m*q_dot**2/2 - k*q**2/2}
initial: {q: 1}
""",
    "pendulum": """name: made
gravity: [0, -9.81, 0]
bodies: {bob: {mass: 1, com: [0, -0.5, 0]}}
joints: {hinge: {type: revolute, between: [ground, bob], coordinate: q}}
outputs: {h: y(bob)}
""",
    "spring": """name: made
parameters: {k: 3, c: 0.1}
inputs: {u: 0}
bodies: {bob: {mass: 2}}
joints: {slide: {type: prismatic, between: [ground, bob], axis: x, coordinate: q}}
forces:
  s: {type: spring, between: [{body: ground, at: [0, 1, 0]}, bob], stiffness: k, length: 0.5}
  d: {type: torque, joint: slide, value: u - c*q_dot}
events: {e: {expression: q - 1, terminal: true}}
""",
    "equations": """name: made
parameters: {m: 1}
equations: {coordinates: [q], mass_matrix: [[m]], forcing: [-q]}
initial: {q: 1}
""",
    "table": """name: made
functions: {f: {type: table, x: [0, 1, 2], y: [0, 1, 0]}}
bodies: {bob: {mass: 1}}
joints: {slide: {type: prismatic, between: [ground, bob], coordinate: q}}
forces: {d: {type: torque, joint: slide, value: f(q)}}
""",
}
KIND = YamlFiles()
