"""Texts of a user stay texts: in C, in Python, in TOML, in pages and on a terminal; names near a slip are told."""

from __future__ import annotations

import ast
import html.parser
import json
import re
import subprocess
import tomllib
from pathlib import Path
from typing import Any

import command
import pytest
from models import EXAMPLES

import eomgen as eg

#: Ends of comments, trigraphs, joined lines, quotes, escape sequences, marks of direction, markup.
TEXTS = {
    "comment": "a */ int broken; /* b //",
    "trigraph": "what ??/\n int broken; ??) */",
    "joined": "ends in a backslash \\",
    "quotes": '""" + broken + \'\'\' \\" "',
    "escape": "red \x1b[31m \x1b]0;title\x07 \x9b2J \u202e over \u2028 lines",
    "markup": "<script>broken()</script> <!-- ]]> &amp; $a_1$ `x` [l](u) *b* | c",
    "unicode": "µm ü \N{GRINNING FACE} ✓",
}


EVERY = "\n\n".join(TEXTS.values())


def model(**more: Any) -> dict[str, Any]:
    """A model in whose texts they stand."""
    return {
        "name": "texts", "doc": EVERY, "gravity": [0, -9.81, 0],
        "parameters": {f"l_{key}": {"value": 1.0, "unit": "m", "doc": text} for key, text in TEXTS.items()},
        "inputs": {"u": {"value": 0.0, "doc": EVERY}},
        "bodies": {"rod": {"mass": 1, "com": [0, "-l_comment", 0]}},
        "joints": {"pin": {"type": "revolute", "between": ["ground", "rod"], "coordinate": "q"}},
        "forces": {"motor": {"type": "torque", "joint": "pin", "value": "u"}},
        "outputs": {"x": {"expression": "x(rod)", "doc": EVERY}},
    } | more  # fmt: skip


def package(target: str, folder: Path) -> dict[str, str]:
    """The files that generate writes."""
    (folder / "texts.yaml").write_text(json.dumps(model()), encoding="utf-8")
    done = command.run("generate", "texts.yaml", "--target", target, "--out", "made", cwd=folder)
    assert done.code == 0, done.err
    made = folder / "made"
    return {p.relative_to(made).as_posix(): p.read_text(encoding="utf-8") for p in made.rglob("*") if p.is_file()}


def test_a_compiler_sees_nothing_of_them(tmp_path: Path) -> None:
    for name, text in package("c", tmp_path).items():
        (tmp_path / Path(name).name).write_text(text, encoding="utf-8")
    words = ["gcc", "-std=c99", "-trigraphs", "-Wall", "-Wextra", "-Wcomment", "-Werror", "-fsyntax-only", "texts.c"]
    done = subprocess.run(words, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr[:1000]
    for name in ("texts.c", "texts.h"):
        source = (tmp_path / name).read_text(encoding="utf-8")
        assert source.isascii()
        assert source.replace("\n", "").isprintable()
        code = re.sub(r"\\[ \t]*\n", "", source.replace("??/", "\\"))
        code = re.sub(r"/\*.*?\*/|\"(\\.|[^\"\\\n])*\"", " ", code, flags=re.DOTALL)
        assert "broken" not in code
        assert not any("\\" in comment for comment in re.findall(r"/\*.*?\*/", source, re.DOTALL))  # joins lines


def test_python_and_toml_have_them_as_strings(tmp_path: Path) -> None:
    files = package("cython", tmp_path)
    for name, text in files.items():
        if name.endswith((".py", ".pyi")):
            tree = ast.parse(text, name)
            assert not any(isinstance(node, ast.Name) and node.id == "broken" for node in ast.walk(tree))
        if name.endswith("texts/__init__.py"):
            assert text.isascii()
            assert all(
                " ".join(part.split()) in " ".join(ast.get_docstring(tree, False).split()) for part in TEXTS.values()
            )
        if name.endswith("pyproject.toml"):
            assert tomllib.loads(text)["project"]["name"] == "texts"
    assert sum(name.endswith((".py", ".toml")) for name in files) > 3


def test_a_page_shows_them_and_a_file_keeps_them(tmp_path: Path) -> None:
    (tmp_path / "texts.yaml").write_text(json.dumps(model()), encoding="utf-8")
    found = eg.load(tmp_path / "texts.yaml")
    found.save(tmp_path / "again.yaml")
    again = eg.load(tmp_path / "again.yaml")
    assert again.to_yaml() == found.to_yaml()
    module = again.compile(target="numpy")
    assert module.doc == EVERY
    page = html.parser.HTMLParser()
    tags: list[str] = []
    page.handle_starttag = lambda tag, attrs: tags.append(tag)  # type: ignore[method-assign]
    shown = re.sub(r"base64,[^'\"]+", "", module._repr_html_())
    page.feed(shown)
    assert "script" not in tags
    assert "broken()" in shown
    assert "\x1b" not in shown


@pytest.mark.parametrize("field", ["doc", "name", "type"])
def test_no_escape_sequence_reaches_a_terminal(field: str, tmp_path: Path) -> None:
    wrong = model(**({} if field == "type" else {field: TEXTS["escape"]}))
    wrong["joints"]["pin"]["type"] = TEXTS["escape"]
    wrong["bodies"]["rod"]["mass"] = f"-1 + {TEXTS['escape']}"
    (tmp_path / "texts.yaml").write_text(json.dumps(wrong), encoding="utf-8")
    for words in (("check", "texts.yaml"), ("run", "texts.yaml"), ("check", TEXTS["escape"] + ".yaml")):
        done = command.run(*words, cwd=tmp_path)
        assert done.code in (1, 2)
        for text in (done.out, done.err):
            assert all(c.isprintable() or c in "\n\t" for c in text)


# -- names that are near ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("word", "meant"),
    [
        ("hinge", "revolute"),
        ("ball", "spherical"),
        ("fixed", "weld"),
        ("motor", "driver"),
        ("animate", "draw"),
        ("sprnig", "spring"),
        ("COM", "center_of_mass"),
    ],
)
def test_a_method_of_model(word: str, meant: str) -> None:
    with pytest.raises(AttributeError, match=f"did you mean '{meant}'"):
        getattr(eg.Model("m"), word)


def test_words_of_runs_files_and_verbs() -> None:
    mod = eg.load(EXAMPLES / "pendulum.yaml").compile(target="numpy")
    for word, meant in (("x0", "initial"), ("tol", "rtol"), ("teval", "t_eval")):
        with pytest.raises(eg.UsageError, match=f"did you mean .*{meant}"):
            mod.simulate((0, 1), **{word: 1.0})
    m = eg.Model("m")
    m.body("a")
    with pytest.raises(eg.ModelError, match="did you mean 'revolute'"):
        m.joint("hinge", "j", m.ground, "a")
        m.derive()
    for word, meant in (("integrate", "run"), ("eigenvalues", "modes"), ("animate", "view"), ("chek", "check")):
        assert f"did you mean {meant}?" in command.run(word).err
    far = command.run("zzzzz").err
    assert "did you mean" not in far
    assert "there are: run, ensemble" in far
