"""Every nasty text in every text field of a model, written in every language: it stays a text, and stays the same."""

from __future__ import annotations

import ast
import html.parser
import json
import re
import subprocess
import tomllib
import zipfile
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest
import xarray
from hostile.held_texts import PLACES, assert_held, described, equations_of, files_of, model_of, text_fields
from hostile.nasty_texts import CLOSERS, NASTY
from ruamel.yaml import YAML

import eomgen as eg
from eomgen import pipeline, texts
from eomgen.describe.yaml_file import describe_yaml
from eomgen.emit import emit_package
from eomgen.files import inline_pictures
from eomgen.generation import generate


def test_every_text_field_is_among_those_that_are_filled() -> None:
    assert len(NASTY) >= 60
    assert set(text_fields()) == set(PLACES)
    filled = json.dumps(described("nasty"))
    assert filled.count('"nasty"') == sum(place is not None for place in PLACES.values())


# -- C ----------------------------------------------------------------------------------------------------------------
#: The literals of the metadata: harmless characters, and all others as escapes of three digits.
METADATA = re.compile(r'metadata_texts\[\] = \{\n((?: +"(?:[A-Za-z0-9 _.,:-]|\\[0-7]{3})*",?\n)*) +NULL\n\};')


def code_of(text: str) -> str:
    """What is left of C after trigraphs, joined lines, comments and literals are gone."""
    for pair in ("=#", "/\\", "'^", "([", ")]", "!|", "<{", ">}", "-~"):
        text = text.replace(f"??{pair[0]}", pair[1])
    text = re.sub(r"\\[ \t\v\f]*(\r\n|\n|\r)", "", text)
    return re.sub(r"/\*.*?\*/|//[^\n]*|\"(\\.|[^\"\\\n])*\"|'(\\.|[^'\\\n])+'", " ", text, flags=re.DOTALL)


@pytest.mark.parametrize("key", NASTY)
def test_c_holds_the_text_as_comment_and_data_only(key: str) -> None:
    name = f"m{list(NASTY).index(key)}"
    reference = dict(emit_package(pipeline.build(model_of(described("", name)).derive(), "c"), "c"))
    for file, text in files_of(key, "c").items():
        if file.endswith((".c", ".h")):
            assert text.isascii(), file
            assert text.replace("\n", "").isprintable(), file
            assert code_of(METADATA.sub("", text)).split() == code_of(METADATA.sub("", reference[file])).split(), file
        elif file == "Makefile":
            assert text == reference[file]
        elif file == "README.md":
            assert texts.visible(text) == text
            assert not re.search(r"<(?!stdio\.h>|U\+)[a-zA-Z/!?]", text)
    data = METADATA.search(files_of(key, "c")[f"{name}.c"])
    assert data is not None
    literals = "".join(re.findall(r'"(.*)"', data[1]))
    assert_held(json.loads(re.sub(r"\\(\d{3})", lambda found: chr(int(found[1], 8)), literals)), NASTY[key])


def test_a_compiler_takes_every_header_without_a_warning(tmp_path: Any) -> None:
    lines = []
    for k, key in enumerate(NASTY):
        for file in (f"m{k}.h", "eomgen.h"):
            (tmp_path / file).write_text(files_of(key, "c")[file], encoding="utf-8")
        lines.append(f'#include "m{k}.h"\n')
    (tmp_path / "all.c").write_text("".join(lines) + "int done;\n")
    for standard in ("-std=c99", "-std=gnu17"):
        words = [
            standard,
            "-trigraphs",
            "-Wall",
            "-Wextra",
            "-Wcomment",
            "-Wpedantic",
            "-Werror",
            "-fsyntax-only",
            "all.c",
        ]
        done = subprocess.run(["gcc", *words], cwd=tmp_path, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr[:1000]


def test_a_compiler_takes_whole_libraries_without_a_warning(tmp_path: Any) -> None:
    keys = [key for key in CLOSERS if "end" in key][::3]
    for key in keys:
        for file, text in files_of(key, "c").items():
            (tmp_path / file).write_text(text, encoding="utf-8")
    sources = [f"m{list(NASTY).index(key)}.c" for key in keys]
    words = ["-std=c99", "-trigraphs", "-Wall", "-Wextra", "-Wcomment", "-Werror", "-fsyntax-only"]
    done = subprocess.run(["gcc", *words, *sources], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr[:1000]


# -- Python packages --------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("target", ["cython", "numpy"])
@pytest.mark.parametrize("key", NASTY)
def test_packages_hold_the_text_as_strings_only(key: str, target: str) -> None:
    text, found = NASTY[key], files_of(key, target)
    for file in (
        "__init__.py",
        "__init__.pyi",
        "selftest.py",
        *(("setup.py",) if target == "cython" else ("_core.py",)),
    ):
        assert found[file].isascii()
        assert found[file].replace("\n", "").isprintable()
        tree = ast.parse(found[file], file)
        calls = [ast.unparse(node.func) for node in ast.walk(tree) if isinstance(node, ast.Call)]
        assert not any("import" in call or "abort" in call for call in calls)
        if file == "__init__.py":
            assert text.strip() in (ast.get_docstring(tree, clean=False) or "")
    assert_held(json.loads(found["model.json"]), text)
    if target == "numpy":
        namespace = next(n for n in ast.parse(found["_core.py"]).body if isinstance(n, ast.Assign))
        assert_held(json.loads(ast.literal_eval(namespace.value)), text)
    project = tomllib.loads(found["pyproject.toml"])
    assert set(project) == {"build-system", "project", "tool"}
    assert project["project"]["description"].isprintable()
    assert len(project["project"]["description"]) <= 500
    assert not {"scripts", "entry-points"} & set(project["project"])
    readme = found["README.md"]
    assert texts.visible(readme) == readme
    assert not re.search(r"<(script|img|svg|b|!|/|\?)", re.sub(r"`[^`\n]*`", "", readme))


def test_a_package_with_every_text_installs_and_runs(tmp_path: Any) -> None:
    import sys

    text = "\n".join(NASTY[key] for key in NASTY if not key.startswith("long"))
    model = model_of(described(text, "everything"))
    folder = generate(model, tmp_path, target="numpy")
    target = tmp_path / "installed"
    words = ["pip", "install", "-q", "--no-deps", "--no-build-isolation", "--target", str(target), str(folder)]
    done = subprocess.run([sys.executable, "-m", *words], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr[-2000:]
    code = "import json, everything as m; m.rhs(0.0, m.x0()); print(json.dumps(m.metadata['doc']))"
    run = subprocess.run([sys.executable, "-c", code], cwd=target, capture_output=True, text=True, check=True)
    assert json.loads(run.stdout) == text
    check = subprocess.run([sys.executable, "-m", "everything.selftest"], cwd=target, capture_output=True, check=False)
    assert check.returncode == 0


@pytest.mark.parametrize("key", ["joined end", "trigraph end", "NUL", "wide"])
def test_a_compiled_module_holds_the_text(key: str) -> None:
    module = equations_of(key).compile(kernels=["rhs", "energy"])
    assert_held(module.metadata, NASTY[key])
    assert module.doc == NASTY[key]
    assert module.energy(module.x0()).shape == (2,)


# -- pages, pictures, terminals ----------------------------------------------------------------------------------------
class Tags(html.parser.HTMLParser):
    """Names of all elements, comments and instructions of a page."""

    def __init__(self, page: str) -> None:
        super().__init__()
        self.tags: set[str] = set()
        self.sources: list[str | None] = []
        self.feed(page)
        self.close()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags |= {tag, *(name for name, _ in attrs if name not in ("style", "colspan"))}
        self.sources += [value for name, value in attrs if name == "src"]

    def handle_comment(self, data: str) -> None:
        self.tags.add("comment")

    def handle_decl(self, decl: str) -> None:
        self.tags.add("declaration")

    handle_pi = unknown_decl = handle_decl


#: Of these the pictures of all pages are drawn, and among them is every mark that matplotlib takes for a formula.
DRAWN = {*[*NASTY][::12], "LaTeX", "dollar", "two dollars", "dollars"}


@pytest.mark.parametrize("key", NASTY)
def test_what_is_shown_shows_the_text_and_obeys_none_of_it(key: str, monkeypatch: pytest.MonkeyPatch) -> None:
    if key not in DRAWN:  # figures are made of all of them, their dots, which take most of the time, of some
        monkeypatch.setattr(inline_pictures, "trimmed_png", lambda figure: (b"drawn elsewhere", 1))
    equations = equations_of(key)
    module = equations.compile(target="numpy", kernels=["rhs"])
    model = model_of(described(NASTY[key]))
    formulas = equations._repr_html_()
    for page in (model._repr_html_(), module._repr_html_(), formulas, equations.report._repr_html_()):
        assert texts.visible(page) == page
        found = Tags(page)
        own = {"table", "tr", "td", "th", "b", "p", "pre", "div", "details", "summary", "code", "i"}
        if page is formulas:  # MathML of names and operations, which runs nothing
            own |= {"math", "mrow", "mi", "mn", "mo", "mtext", "mfrac", "msub", "msup", "msubsup", "msqrt", "mover"}
            own |= {"mtable", "mtr", "mtd", "mspace", "displaystyle", "accent", "mathvariant", "stretchy"}
        assert found.tags <= own | {"img", "src", "alt", "width"}
        assert len(found.sources) <= 1  # the picture, which is in the page
        assert all(re.fullmatch(r"data:image/png;base64,[A-Za-z0-9+/=]+", str(one)) for one in found.sources)
    for shown in (str(model), repr(model), str(module), repr(module), str(equations), str(equations.report)):
        assert texts.visible(shown) == shown
    assert_held(module.metadata, NASTY[key])


#: Every nasty text, and what a reader of XML does not take, or what turns and hides the characters around it.
TOGETHER = (
    "\n".join(t for key, t in NASTY.items() if not key.startswith("long")) + "\x07\x1b\uffff\u202e\u2066\u200b\ufeff"
)


def test_a_unit_holds_the_text_in_well_formed_files(tmp_path: Path) -> None:
    for version in ("2.0", "3.0"):
        unit = model_of(described(TOGETHER, "unit")).derive().write_fmu(tmp_path / f"unit{version[0]}.fmu", version)
        with zipfile.ZipFile(unit) as archive:
            root = ElementTree.fromstring(archive.read("modelDescription.xml"))
            page = archive.read("documentation/index.html").decode()
        told = [root.attrib["description"], *(x.attrib["description"] for x in root.iter() if x.get("name") == "tau")]
        assert told == [texts.one_line(TOGETHER)] * 2
        assert texts.visible(page) == page
        own = (
            "html",
            "head",
            "meta",
            "title",
            "body",
            "h1",
            "p",
            "table",
            "tr",
            "th",
            "td",
            "charset",
            "lang",
            "declaration",
        )
        assert Tags(page).tags <= {*own}


@pytest.mark.filterwarnings("ignore:the mesh")
def test_documents_and_tables_hold_no_character_that_does_not_print(tmp_path: Path) -> None:
    equations = model_of(described(TOGETHER)).derive()
    for form in ("html", "md", "tex"):
        written = equations.explain("short").save(tmp_path / f"x.{form}").read_text(encoding="utf-8")
        assert texts.visible(written) == written, form
    run = equations.compile(target="numpy").simulate(0.1)
    page = str(run.animate())
    assert texts.visible(page) == page
    data = xarray.load_dataset(run.save(tmp_path / "run.nc"))
    assert data["y"].attrs["long_name"] == texts.visible(TOGETHER)


@pytest.mark.parametrize("key", NASTY)
def test_a_model_file_that_is_written_reads_back_the_text(key: str) -> None:
    text = NASTY[key]
    written = model_of(described(text)).to_yaml()
    assert texts.visible(written) == written
    data = YAML(typ="safe", pure=True).load(written)
    assert data["doc"] == text if text else "doc" not in data
    assert data["bodies"]["rod"]["display"][0]["file"] == text
    again = eg.Model.from_description(describe_yaml(written))
    assert again.to_yaml() == written
    assert again.mechanism().doc == text


def test_pictures_are_whole_and_hold_no_element_of_a_text(tmp_path: Any) -> None:
    import xml.etree.ElementTree as ET

    from matplotlib import rc_context
    from matplotlib.figure import Figure

    for key in (
        "HTML",
        "dollar",
        "two dollars",
        "dollars",
        "LaTeX",
        "XML",
        "NUL",
        "C1",
        "colours",
        "directions",
        "HTML comment end",
    ):
        run = equations_of(key).compile(target="numpy", kernels=["rhs", "outputs", "events"]).simulate((0, 0.05))
        run.units["y"] = NASTY[key]  # as a stored trajectory may have it
        axes = Figure().add_subplot()
        run.plot("y", ax=axes)
        label = axes.get_ylabel()
        unit = texts.visible(NASTY[key], lines=False)
        assert label == f"$y$ ({unit.replace('$', chr(92) + '$')})"
        with rc_context({"svg.fonttype": "none"}):
            axes.figure.savefig(tmp_path / "shown.svg")
        written = "".join(ET.parse(tmp_path / "shown.svg").getroot().itertext())
        assert "".join(unit.split()) in "".join(written.split())  # as it is, no formula
        axes.figure.savefig(tmp_path / "y.svg")
        found = {part.tag.rpartition("}")[2] for part in ET.parse(tmp_path / "y.svg").iter()}
        assert not found & {"script", "img", "b", "foreignObject", "image"}


def on_the_command_line(capfd: pytest.CaptureFixture[str], *words: object) -> tuple[int, str, str]:
    from eomgen.cli import main

    with pytest.raises(SystemExit) as left:
        main([str(word) for word in words])
    captured = capfd.readouterr()
    assert texts.visible(captured.out) == captured.out
    assert texts.visible(captured.err) == captured.err
    return int(left.value.code or 0), captured.out, captured.err


def test_nothing_of_a_text_drives_the_terminal(
    tmp_path: Any, capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    text = "\n".join(NASTY[key] for key in NASTY if not key.startswith("long"))
    (tmp_path / "held.yaml").write_text(json.dumps(described(text)))
    for words in (["check"], ["derive"], ["run", "--target", "numpy", "--end", "0.01"], ["convert"]):
        assert on_the_command_line(capfd, words[0], "held.yaml", *words[1:])[0] == 0
    code, out, _ = on_the_command_line(capfd, "check", "held.yaml", "--json")
    assert (code, json.loads(out)["name"]) == (0, "held")
    assert on_the_command_line(capfd, "generate", "held.yaml", "--out", "made", "--target", "numpy")[0] == 0
    assert not (tmp_path / "touch").exists()
    assert sorted(p.name for p in tmp_path.iterdir()) == ["held.yaml", "made"]
    for name in ("colours", "directions", "C1"):
        (tmp_path / "bad.yaml").write_text(json.dumps({**described(""), "name": NASTY[name]}))
        assert on_the_command_line(capfd, "check", "bad.yaml")[0] == 1
        assert on_the_command_line(capfd, "check", NASTY[name])[0] == 2
        assert on_the_command_line(capfd, "run", "held.yaml", "--target", NASTY[name])[0] == 2
