"""Hostile model files: the examples and the documents' models changed, models from the JSON Schema, broken YAML."""

import contextlib
import json
import random
import re
import warnings
from collections.abc import Iterator
from copy import deepcopy
from importlib import import_module
from pathlib import Path
from typing import Any

import command
from attack.guard import PACKAGE
from attack.runner import Kind, Wrong
from attack.words import NUMBERS, TEXTS
from ruamel.yaml import YAML

import eomgen as eg

#: What is done with a text -> of 1000 texts, how many.  Each does what those before it do.
STAGES = {"build": 940, "check": 50, "compile": 10}
PUNCTUATION = (
    *"{ } [ ] : , # *a | > ... \" ' @ ` \\ |+9\n >-0\n ---\n".split(" "), "&a ", "!x ", "!!binary ", "\t", "\x00", "\ufeff", "\x85",
    "\u2028", "%YAML 1.1\n", "%TAG ! x\n", "? ", "- ", "<<: ", "\r", "\x0b", "? [a, b]\n: c\n", '"\\x00"', '"\\N"',
    '!!python/object/apply:os.system ["touch CANARY"]', "!<tag:yaml.org,2002:float> ", '"\\ud83d\\ude00"',
)  # fmt: skip
VALUES: tuple[Any, ...] = (
    None, True, False, 0, -1, 1, -0.0, 1e308, -1e308, 5e-324, float("nan"), float("inf"), -float("inf"), 10**39, 2**63, 10**9,
    [], {}, [[]], [None], {"a": 1}, [1, 2, 3], [1, 2], [0, 0, 0], ["x", "y", "z"], [1e308] * 3, [float("nan")] * 3,
    [1e-320, 0, 0], {"zz": 0}, {"zz": -1}, {"zz": 1e-300}, {"xx": 1, "yy": 1, "zz": 100}, "ground", "x", "-x",
    {"body": "ground"}, {"body": "nowhere"}, {"body": "ground", "at": [1, 2, 3], "rpy": [0, 0, 1e300]}, {"at": [0, 0, 0]},
    [["ground"]], {"": 1}, "12:30:45", "2001-01-01", [[1, 2], [3, 4]], ["ground", "ground"], "error", "off",
)  # fmt: skip
SUMMARY = re.compile(r"Traceback|(?:Runtime|Syntax|Deprecation|User|Future)Warning: ")
KEY = re.compile(r"[A-Za-z_][A-Za-z0-9_.]*\Z")
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


class YamlFiles(Kind):
    """Texts of model files."""

    name = "yaml"

    def prepare(self, folder: Path) -> None:
        self.texts = [path.read_text() for path in sorted((PACKAGE.parent / "examples").glob("*.yaml"))]
        for page in sorted((PACKAGE.parent / "docs").glob("*.md")):
            blocks = re.findall(r"```yaml\n(.*?)```", page.read_text(), re.DOTALL)
            self.texts += [block for block in blocks if block.startswith("name:")]
        self.texts += [text for _, text in sorted(SMALL.items())]
        self.trees = [YAML(typ="safe", pure=True).load(text) for text in self.texts]
        self.weights = [1.0 / len(text) for text in self.texts]
        self.schema = Schema(command.run("check", "--schema").json)
        places = [place for tree in self.trees for place in paths(tree)]
        self.keys = sorted({key for place in places for key in place if isinstance(key, str)})
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            for library in ("integrate", "interpolate", "linalg", "optimize", "special", "spatial"):
                import_module(f"scipy.{library}")  # which run texts of their own as they load
            for k, tree in enumerate(self.trees[:4]):  # imports whatever deriving and compiling need
                (folder / f"{k}.yaml").write_text(yaml_text(tree, random.Random(0)))
                module = eg.load(folder / f"{k}.yaml").compile(target="numpy")
                module.simulate((0.0, 0.01), t_eval=[0.0, 0.01])

    def make(self, r: random.Random) -> dict[str, Any]:
        stage, k = r.choices(list(STAGES), list(STAGES.values()))[0], r.random()
        if k < 0.3:
            text = r.choices(self.texts, self.weights)[0]
            for _ in range(r.choice((1, 1, 1, 2, 3, 6))):
                text = broken(text, r)
            return {"stage": stage, "text": text}
        tree = self.schema.tree(r) if k < 0.5 else deepcopy(r.choices(self.trees, self.weights)[0])
        changes = (0, 1, 2) if k < 0.5 else (0, 1) if stage == "compile" else (1, 1, 1, 1, 2, 2, 3, 5, 9)
        for _ in range(r.choice(changes)):
            with contextlib.suppress(KeyError, TypeError, IndexError):
                change(tree, r, self.trees, self.keys, self.schema.types)
        return {"stage": stage, "text": yaml_text(tree, r)}

    def run(self, case: Any, folder: Path) -> str:
        with (folder / "model.yaml").open("w", encoding="utf-8", errors="surrogatepass", newline="") as file:
            file.write(case["text"])
        if case["stage"] == "check":
            return answered(["check", "model.yaml"], (0, 1))
        model = eg.load("model.yaml")
        model.mechanism()
        if case["stage"] == "build":
            return "built"
        module = model.compile(target="numpy")
        module.rhs(0.0, module.x0())
        module.simulate((0.0, 0.01), t_eval=[0.0, 0.01])
        model.save("again.yaml")
        try:
            eg.load("again.yaml").mechanism()
        except eg.ModelError as error:
            raise Wrong(f"what save writes is refused: {error}") from None
        return "run"


def answered(words: list[str], allowed: tuple[int, ...]) -> str:
    """Run the command in this process; a bad exit code, silence or a traceback on stderr is wrong."""
    done = command.run(*words)
    if done.code not in allowed:
        raise Wrong(f"exit code {done.code}: {done.err[-300:]}")
    if done.code and not (done.err + done.out).strip():
        raise Wrong(f"exit code {done.code} without a message")
    if SUMMARY.search(done.err):
        raise Wrong(f"stderr holds a traceback or a warning: {done.err[-300:]}")
    return f"exit {done.code}"


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
        codes = (r.randrange(32, 127), r.randrange(32), r.randrange(0x80, 0x3000), 0x1F600, 0xFFFE, 0xD800)
        return text[:at] + chr(r.choice(codes)) + text[at + 1 :]
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


# -- trees of plain values ---------------------------------------------------------------------------------------------
def paths(tree: Any, place: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    """The place of every value in a tree."""
    yield place
    for key, value in tree.items() if isinstance(tree, dict) else enumerate(tree) if isinstance(tree, list) else ():
        yield from paths(value, (*place, key))


def at(tree: Any, place: tuple[Any, ...]) -> Any:
    for key in place:
        tree = tree[key]
    return tree


def number(r: random.Random) -> Any:
    """A number, or what looks like one."""
    k = r.randrange(6)
    if k == 0:
        return r.uniform(-10, 10)
    if k == 1:
        return r.choice((1, -1)) * 10.0 ** r.uniform(-320, 308)
    if k == 2:
        return r.randint(-(10**6), 10**6)
    return deepcopy(r.choice(VALUES)) if k == 3 else r.choice(NUMBERS)


def change(tree: dict[str, Any], r: random.Random, others: list[Any], keys: list[str], types: list[str]) -> None:
    """One place of a tree changed; ``others`` and ``keys`` are where parts and key names come from."""
    places = list(paths(tree))[1:]
    place = r.choice(places)
    value, parent, last = at(tree, place), at(tree, place[:-1]), place[-1]
    k = r.randrange(18)
    if k == 0:
        del parent[last]
    elif k in (1, 2):
        parent[last] = deepcopy(r.choice(VALUES))
    elif k in (3, 4):
        parent[last] = r.choice(NUMBERS if k == 3 else TEXTS)
    elif k == 5 and isinstance(parent, dict):
        parent[r.choice((*TEXTS, *keys))] = parent.pop(last)
    elif k == 6 and isinstance(parent, dict):
        parent[r.choice((*keys, r.choice(TEXTS)))] = deepcopy(value)
    elif k == 7 and isinstance(parent, list):
        parent.insert(r.randrange(len(parent) + 1), deepcopy(value))
    elif k == 8:
        parent[last] = deepcopy(at(tree, r.choice(places)))
    elif k in (9, 10):
        parent[last] = number(r)
    elif k == 11:
        for _ in range(r.choice((1, 2, 5, 11, 13, 50))):
            value = r.choice(([value], {"a": value}))
        parent[last] = value
    elif k == 12 and isinstance(value, str | int | float):
        parent[last] = f"({value}){r.choice(('*', '+', '/', '**', '<', '-'))}{r.choice(NUMBERS)}"
    elif k == 13 and isinstance(value, str):
        n = r.randrange(len(value) + 1)
        parent[last] = value[:n] + r.choice("()*/-+.e9 _\\\"'\né\x00#[{") + value[n:]
    elif k == 14 and isinstance(parent, dict) and "type" in parent:
        parent["type"] = r.choice(types)
    elif k == 15:
        other = r.choice(others)
        section = r.choice(list(other))
        tree[section] = deepcopy(other[section])
    elif k == 16 and isinstance(value, dict) and value:
        one = r.choice(list(value))
        for n in range(r.choice((1, 3, 30))):
            value[f"{one}_{n}"] = deepcopy(value[one])
    elif k == 17:
        parent[last] = [number(r) for _ in range(r.choice((0, 1, 2, 3, 4, 6, 9, 40)))]


class Schema:
    """Trees that a JSON Schema allows, nearly: names come from small pools, so that references often hit."""

    POOL = ("a", "b", "c", "q", "arm", "rod")
    EXPRESSIONS = (1, 0.5, "a", "b*c", "q", "q_dot", "sin(q)", "t", "a/(b-c)", "where(q<a,b,c)")

    def __init__(self, schema: dict[str, Any]) -> None:
        self.schema, self.defs = schema, schema.get("$defs", {})
        self.types = sorted(set(re.findall(r'"const": "(\w+)"', json.dumps(schema))))

    def tree(self, r: random.Random) -> dict[str, Any]:
        return {**self.value(self.schema, r, 0), "name": "made"}

    def value(self, schema: Any, r: random.Random, depth: int) -> Any:
        if "$ref" in schema:
            name = schema["$ref"].rpartition("/")[2]
            if name == "name":
                return r.choice(self.POOL)
            if name == "expression":
                return r.choice((*self.EXPRESSIONS, number(r)))
            if name == "pair" or "marker" in name:
                ends = [r.choice(("ground", *self.POOL, "rod.a", {"body": "arm", "at": [1, 0, 0]})) for _ in range(2)]
                return ends if name == "pair" else ends[0]
            return self.value(self.defs[name], r, depth + 1)
        for key in ("oneOf", "anyOf"):
            if key in schema:
                return self.value(r.choice(schema[key]), r, depth + 1)
        if "const" in schema or "enum" in schema:
            return r.choice(schema.get("enum", [schema.get("const")]))
        kind = schema.get("type")
        kind = r.choice(kind) if isinstance(kind, list) else kind
        if kind == "object":
            made = {
                key: self.value(inner, r, depth + 1)
                for key, inner in schema.get("properties", {}).items()
                if key in schema.get("required", ()) or r.random() < (0.25 if depth else 0.45)
            }
            if isinstance(more := schema.get("additionalProperties"), dict):
                made |= {r.choice(self.POOL): self.value(more, r, depth + 1) for _ in range(r.choice((1, 2, 3)))}
            return made
        if kind == "array":
            least = schema.get("minItems", 0)
            count = least if r.random() < 0.8 else r.randint(least, schema.get("maxItems", least + 3))
            return [self.value(schema.get("items", {}), r, depth + 1) for _ in range(count)]
        if kind == "string":
            return r.choice((*self.POOL, "1", "2*3", "x", "text"))
        if kind in ("number", "integer"):
            return r.choice((0, 1, 2, 0.5, -1, 3.5, 10))
        return {"boolean": r.random() < 0.5, "null": None}.get(str(kind), 1)


def yaml_text(tree: Any, r: random.Random) -> str:
    """A tree as YAML: sections and entries as blocks, the rest in one line."""
    lines = []
    for key, value in tree.items():
        if isinstance(value, dict) and value and r.random() < 0.8:
            lines.append(f"{plain(key, r)}:")
            lines += [f"  {plain(name, r)}: {flow(entry, r)}" for name, entry in value.items()]
        else:
            lines.append(f"{plain(key, r)}: {flow(value, r)}")
    return "\n".join(lines) + "\n"


def flow(value: Any, r: random.Random) -> str:
    if isinstance(value, dict):
        return "{" + ", ".join(f"{plain(k, r)}: {flow(v, r)}" for k, v in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(flow(v, r) for v in value) + "]"
    if isinstance(value, float):
        return {"nan": ".nan", "inf": ".inf", "-inf": "-.inf"}.get(repr(value), repr(value))
    if value is None:
        return r.choice(("null", "~"))
    if isinstance(value, str) and r.random() < 0.1 and "\n" not in value:
        return value  # plain, whatever YAML makes of it
    if isinstance(value, str) and r.random() < 0.5:
        return "'" + value.replace("'", "''") + "'"
    return json.dumps(value, ensure_ascii=r.random() < 0.5, default=str)


def plain(key: Any, r: random.Random) -> str:
    return str(key) if KEY.match(str(key)) else flow(str(key), r)


KINDS = {"yaml": YamlFiles()}
