"""Trees of plain values, as model files hold them: hostile changes, values from a JSON Schema, and YAML texts."""

from __future__ import annotations

import json
import random
import re
from collections.abc import Iterator
from typing import Any

from .words import NUMBERS, TEXTS

VALUES: tuple[Any, ...] = (
    None,
    True,
    False,
    0,
    -1,
    1,
    -0.0,
    1e308,
    -1e308,
    1e-308,
    5e-324,
    float("nan"),
    float("inf"),
    -float("inf"),
    10**39,
    10**50,
    2**63,
    -(2**63),
    10**9,
    [],
    {},
    [[]],
    [None],
    {"a": 1},
    [1, 2, 3],
    [1, 2],
    [1, 2, 3, 4],
    [0, 0, 0],
    ["x", "y", "z"],
    [1e308] * 3,
    [float("nan")] * 3,
    [1e-320, 0, 0],
    {"zz": 0},
    {"zz": -1},
    {"zz": 1e-300},
    {"xx": 1, "yy": 1, "zz": 100},
    "ground",
    "x",
    "-x",
    "w",
    {"body": "ground"},
    {"body": "nowhere"},
    {"body": "ground", "at": [1, 2, 3], "rpy": [0, 0, 1e300]},
    {"at": [0, 0, 0]},
    [["ground"]],
    {"": 1},
    "nan",
    "inf",
    "1e400",
    "0x10",
    "0o7",
    "1_0",
    "12:30:45",
    "2001-01-01",
    [[1, 2], [3, 4]],
    [[1, 0, 0], [0, 1, 0], [0, 0, 1]],
    ["ground", "ground"],
    "error",
    "note",
    "off",
)
SIZES = (0, 1, 2, 3, 4, 6, 9, 40)
KEY = re.compile(r"[A-Za-z_][A-Za-z0-9_.]*\Z")


def paths(tree: Any, place: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    """The place of every value in a tree."""
    yield place
    if isinstance(tree, dict):
        for key in tree:
            yield from paths(tree[key], (*place, key))
    elif isinstance(tree, list):
        for k in range(len(tree)):
            yield from paths(tree[k], (*place, k))


def at(tree: Any, place: tuple[Any, ...]) -> Any:
    for key in place:
        tree = tree[key]
    return tree


def put(tree: Any, place: tuple[Any, ...], value: Any) -> None:
    at(tree, place[:-1])[place[-1]] = value


def copied(tree: Any) -> Any:
    if isinstance(tree, dict):
        return {key: copied(value) for key, value in tree.items()}
    return [copied(value) for value in tree] if isinstance(tree, list) else tree


def number(r: random.Random) -> Any:
    """A number, or what looks like one."""
    k = r.randrange(6)
    if k == 0:
        return r.uniform(-10, 10)
    if k == 1:
        return r.choice((1, -1)) * 10.0 ** r.uniform(-320, 308)
    if k == 2:
        return r.randint(-(10**6), 10**6)
    return copied(r.choice(VALUES)) if k == 3 else r.choice(NUMBERS)


def change(
    tree: dict[str, Any], r: random.Random, others: list[dict[str, Any]], keys: list[str], types: list[str]
) -> None:
    """One place of a tree changed; ``others`` and ``keys`` are where parts and key names come from."""
    places = list(paths(tree))[1:]
    if not places:
        return
    place = r.choice(places)
    value, parent, last = at(tree, place), at(tree, place[:-1]), place[-1]
    k = r.randrange(18)
    if k == 0:
        del parent[last]
    elif k in (1, 2):
        parent[last] = copied(r.choice(VALUES))
    elif k == 3:
        parent[last] = r.choice(NUMBERS)
    elif k == 4:
        parent[last] = r.choice(TEXTS)
    elif k == 5 and isinstance(parent, dict):
        new = r.choice((*TEXTS, *keys))
        parent[new] = parent.pop(last)
    elif k == 6 and isinstance(parent, dict):
        parent[r.choice((*keys, r.choice(TEXTS)))] = copied(value)
    elif k == 7 and isinstance(parent, list):
        parent.insert(r.randrange(len(parent) + 1), copied(value))
    elif k == 8:
        parent[last] = copied(at(tree, r.choice(places)))
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
        tree[section] = copied(other[section])
    elif k == 16 and isinstance(value, dict) and value:
        one = r.choice(list(value))
        for n in range(r.choice((1, 3, 30))):
            value[f"{one}_{n}"] = copied(value[one])
    elif k == 17:
        parent[last] = [number(r) for _ in range(r.choice(SIZES))]


class Schema:
    """Trees that a JSON Schema allows, nearly: names come from small pools, so that references often hit."""

    POOLS = ("a", "b", "c", "q", "arm", "rod")

    def __init__(self, schema: dict[str, Any]) -> None:
        self.schema = schema
        self.defs = schema.get("$defs", {})

    def tree(self, r: random.Random) -> Any:
        return self.value(self.schema, r, 0)

    def value(self, schema: Any, r: random.Random, depth: int) -> Any:
        if "$ref" in schema:
            name = schema["$ref"].rpartition("/")[2]
            if name == "name":
                return r.choice(self.POOLS)
            if name == "expression":
                return r.choice(
                    (1, 0.5, "a", "b*c", "q", "q_dot", "sin(q)", "t", number(r), "a/(b-c)", "where(q<a,b,c)")
                )
            if name in ("marker", "pair") or "marker" in name:
                one = lambda: r.choice(("ground", *self.POOLS, "rod.a", {"body": "arm", "at": [1, 0, 0]}))  # noqa: E731
                return [one(), one()] if name == "pair" else one()
            return self.value(self.defs[name], r, depth + 1)
        for key in ("oneOf", "anyOf"):
            if key in schema:
                return self.value(r.choice(schema[key]), r, depth + 1)
        if "const" in schema:
            return schema["const"]
        if "enum" in schema:
            return r.choice(schema["enum"])
        kind = schema.get("type")
        kind = r.choice(kind) if isinstance(kind, list) else kind
        if kind == "object":
            return self.mapping(schema, r, depth)
        if kind == "array":
            least = schema.get("minItems", 0)
            count = least if r.random() < 0.8 else r.randint(least, schema.get("maxItems", least + 3))
            return [self.value(schema.get("items", {}), r, depth + 1) for _ in range(count)]
        if kind == "string":
            return r.choice((*self.POOLS, "1", "2*3", "x", "text"))
        if kind in ("number", "integer"):
            return r.choice((0, 1, 2, 0.5, -1, 3.5, 10))
        return {"boolean": r.random() < 0.5, "null": None}.get(str(kind), 1)

    def mapping(self, schema: Any, r: random.Random, depth: int) -> dict[str, Any]:
        required = schema.get("required", ())
        few = 0.25 if depth else 0.45
        made = {
            key: self.value(inner, r, depth + 1)
            for key, inner in schema.get("properties", {}).items()
            if key in required or r.random() < few
        }
        more = schema.get("additionalProperties")
        if isinstance(more, dict):
            made |= {r.choice(self.POOLS): self.value(more, r, depth + 1) for _ in range(r.choice((1, 2, 3)))}
        return made


def yaml_text(tree: Any, r: random.Random) -> str:
    """A tree as YAML: sections and entries as blocks, the rest in one line."""
    if not isinstance(tree, dict):
        return flow(tree, r)
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
    return json.dumps(value, ensure_ascii=r.random() < 0.5)


def plain(key: Any, r: random.Random) -> str:
    text = str(key)
    return text if KEY.match(text) else flow(text, r)
