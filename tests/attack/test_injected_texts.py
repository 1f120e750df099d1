"""Every nasty text in every text field of a model stays a text in every language; elsewhere it is refused by its place."""

import ast
import html.parser
import json
import re
import subprocess
import sys
import tomllib
import zipfile
from collections.abc import Callable, Iterator
from copy import deepcopy
from functools import cache
from pathlib import Path
from typing import Any
from xml.etree import ElementTree
from xml.sax import saxutils

import command
import pytest
import xarray
from attack.nasty_texts import LONE, NASTY, PAIR
from attack.yaml_files import at, paths
from model_files import load
from refusals import refused
from ruamel.yaml import YAML

import eomgen as eg

ALL = "\n".join(text for key, text in NASTY.items() if not key.startswith("long"))


def described(texts: list[str], name: str = "held") -> dict[str, Any]:
    """A model file's data with these texts in turn in every field that takes a text; all of them in its own."""
    n = len(texts)
    return {
        "name": name,
        "doc": "\n".join(texts),
        "gravity": [0, "-9.81", 0],
        "parameters": {f"p{k}": {"value": 0.5, "unit": "m", "doc": texts[k]} for k in range(n)},
        "inputs": {f"u{k}": {"value": 0.0, "unit": "N*m", "doc": texts[k]} for k in range(n)},
        "bodies": {
            "rod": {
                "mass": 1.0,
                "com": ["p0/2", 0, 0],
                "inertia": {"zz": 0.1},
                "markers": {"tip": {"at": ["p0", 0, 0]}},
                "display": [{"shape": "mesh", "file": text} for text in texts[:3]],
            }
        },
        "joints": {"A": {"type": "revolute", "between": ["ground", "rod"], "coordinate": "theta", "axis": "z"}},
        "forces": {"motor": {"type": "torque", "joint": "A", "value": "u0"}},
        "states": {f"z{k}": {"rate": f"-z{k}", "doc": texts[k]} for k in range(0, n, 20)},
        "outputs": {f"y{k}": {"expression": f"p{k}*theta", "unit": "m", "doc": texts[k]} for k in range(n)},
        "events": {f"e{k}": {"expression": f"theta - {9 + k}", "doc": texts[k]} for k in range(0, n, 20)},
        "initial": {"theta": 0.3},
        "simulation": {"end": 1, "method": "DOP853"},
    }


def printable(text: str) -> bool:
    return all(c.isprintable() or c in "\n\t" for c in text)


def assert_held(metadata: dict[str, Any], texts: list[str]) -> None:
    """Metadata has the texts where the model has them, unchanged."""
    assert metadata["doc"] == "\n".join(texts)
    for k, text in enumerate(texts):
        assert {metadata["docs"].get(f"{letter}{k}", "") for letter in "puy"} == {text}
    assert [event["doc"] for event in metadata["events"]] == texts[::20]


@pytest.fixture(scope="module")
def packages(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], tuple[dict[str, str], dict[str, str]]]:
    """By target: files of the package of a model with all texts, and of the same model without."""
    folder = tmp_path_factory.mktemp("packages")

    @cache
    def files(target: str) -> tuple[dict[str, str], dict[str, str]]:
        made = []
        for kind, texts in (("nasty", [*NASTY.values()]), ("plain", ["plain"] * len(NASTY))):
            (folder / f"{kind}.yaml").write_text(json.dumps(described(texts)))
            words = (folder / f"{kind}.yaml", "--out", folder / f"{kind} {target}", "--target", target)
            done = command.run("generate", *words)
            assert done.code == 0, done.err
            top = folder / f"{kind} {target}" / "held"
            found = {str(file.relative_to(top)): file for file in sorted(top.rglob("*")) if file.is_file()}
            made.append({name: file.read_text(encoding="utf-8") for name, file in found.items()})
        assert made[0].keys() == made[1].keys()
        return made[0], made[1]

    return files


# -- C ----------------------------------------------------------------------------------------------------------------
#: The literals of the metadata: harmless characters, and all others as escapes of three digits.
METADATA = re.compile(
    r'metadata_texts\[\] = \{\n#ifndef EOMGEN_WITHOUT_METADATA\n((?: +"(?:[A-Za-z0-9 _.,:-]|\\[0-7]{3})*",?\n)*)#endif\n'
    r" +NULL\n\};"
)


def code_of(text: str) -> list[str]:
    """What is left of C after the metadata, trigraphs, joined lines, comments and literals are gone."""
    text = METADATA.sub("", text)
    for pair in ("=#", "/\\", "'^", "([", ")]", "!|", "<{", ">}", "-~"):
        text = text.replace(f"??{pair[0]}", pair[1])
    text = re.sub(r"\\[ \t\v\f]*(\r\n|\n|\r)", "", text)
    return re.sub(r"/\*.*?\*/|//[^\n]*|\"(\\.|[^\"\\\n])*\"|'(\\.|[^'\\\n])+'", " ", text, flags=re.DOTALL).split()


@pytest.mark.parametrize("target", ["c", "cython"])
def test_c_holds_the_texts_as_comments_and_data_only(packages: Any, target: str) -> None:
    nasty, plain = packages(target)
    sources = [file for file in nasty if file.endswith((".c", ".h"))]
    for file in sources:
        assert nasty[file].isascii(), file
        assert printable(nasty[file]), file
        assert code_of(nasty[file]) == code_of(plain[file]), file
        assert len({METADATA.sub("", files[file]).count("\\") for files in (nasty, plain)}) == 1, file  # joins lines
    data = next(found for file in sources if (found := METADATA.search(nasty[file])))
    literals = "".join(re.findall(r'"(.*)"', data[1]))
    assert_held(json.loads(re.sub(r"\\(\d{3})", lambda c: chr(int(c[1], 8)), literals)), [*NASTY.values()])
    if target == "c":
        assert nasty["Makefile"] == plain["Makefile"]


def test_a_compiler_takes_them_without_a_warning(packages: Any, tmp_path: Path) -> None:
    nasty, _ = packages("c")
    for file, text in nasty.items():
        if file.endswith((".c", ".h")):
            (tmp_path / file).write_text(text, encoding="utf-8")
    warnings = ["-trigraphs", "-Wall", "-Wextra", "-Wcomment", "-Wpedantic", "-Werror", "-fsyntax-only"]
    for standard, file in (("-std=c99", "held.c"), ("-std=gnu17", "held.h")):
        words = ["gcc", standard, *warnings, file]
        done = subprocess.run(words, cwd=tmp_path, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr[:1000]


# -- Python packages --------------------------------------------------------------------------------------------------
class NoTexts(ast.NodeTransformer):
    """Of a program all but its texts."""

    def visit_Constant(self, node: ast.Constant) -> ast.Constant:
        return ast.Constant("") if isinstance(node.value, str) else node


def test_python_packages_hold_the_texts_as_strings_only(packages: Any) -> None:
    nasty, plain = packages("cython")
    changed = [file for file in nasty if nasty[file] != plain[file]]
    assert {"__init__.py", "model.json", "README.md"} <= set(changed)
    for file in changed:
        text = nasty[file]
        if file.endswith((".py", ".pyi")):
            assert text.isascii()
            assert printable(text), file
            bare = (ast.dump(NoTexts().visit(ast.parse(one))) for one in (text, plain[file]))
            assert next(bare) == next(bare), file
        elif file == "model.json":
            assert_held(json.loads(text), [*NASTY.values()])
        elif file == "pyproject.toml":
            found, expected = tomllib.loads(text), tomllib.loads(plain[file])
            shown = found["project"].pop("description")
            assert shown.isprintable()
            assert len(shown) <= 500
            expected["project"].pop("description")
            assert found == expected
        elif file.endswith(".md"):
            assert printable(text)
            assert not re.search(r"<(script|img|svg|b|!|/|\?)", re.sub(r"`[^`\n]*`", "", text))
        else:
            assert file.endswith((".c", ".h", ".json", ".pyx", ".pxd"))
    docstring = ast.get_docstring(ast.parse(nasty["__init__.py"]), clean=False)
    assert docstring is not None
    assert "\n".join(NASTY.values()).strip() in docstring


@pytest.mark.slow
@pytest.mark.thorough
def test_a_package_with_every_text_installs_and_runs(tmp_path: Path) -> None:
    (tmp_path / "model.yaml").write_text(json.dumps(described([ALL], "everything")))
    assert command.run("generate", "model.yaml", "--out", ".", cwd=tmp_path).code == 0
    words = ["pip", "install", "-q", "--no-deps", "--no-build-isolation", "--target", "installed", "./everything"]
    done = subprocess.run([sys.executable, "-m", *words], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr[-2000:]
    code = "import json, everything as m; m.rhs(0.0, m.x0()); print(json.dumps(m.metadata['doc']))"
    run = subprocess.run(
        [sys.executable, "-c", code], cwd=tmp_path / "installed", capture_output=True, text=True, check=True
    )
    assert json.loads(run.stdout) == ALL


def test_a_compiled_module_holds_the_texts(tmp_path: Path) -> None:
    texts = [*NASTY.values()]
    module = load(tmp_path, json.dumps(described(texts))).compile(kernels=["rhs", "energy"], optimize=0)
    assert_held(module.metadata, texts)
    assert module.doc == "\n".join(texts)
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


def test_what_is_shown_shows_the_texts_and_obeys_none_of_them(tmp_path: Path) -> None:
    nasty, plain = (
        load(tmp_path, json.dumps(described(texts))) for texts in ([*NASTY.values()], ["plain"] * len(NASTY))
    )
    equations, reference = nasty.derive(), plain.derive()
    module = equations.compile(target="numpy", kernels=["rhs"])
    pairs = ((nasty, plain), (module, reference.compile(target="numpy", kernels=["rhs"])), (equations, reference))
    for one, other in (*pairs, (equations.report, reference.report)):
        page = Tags(one._repr_html_())
        assert printable(one._repr_html_())
        assert page.tags <= Tags(other._repr_html_()).tags | {"p", "pre"}, type(one)
        assert all(re.fullmatch(r"data:image/png;base64,[A-Za-z0-9+/=]+", str(source)) for source in page.sources)
        assert printable(str(one))
        assert printable(repr(one))
    assert_held(module.metadata, [*NASTY.values()])


#: Every nasty text, and what a reader of XML does not take, or what turns and hides the characters around it.
TOGETHER = f"{ALL}\x07\x1b\uffff\u202e\u2066\u200b\ufeff"


@pytest.mark.parametrize("version", ["2.0", pytest.param("3.0", marks=pytest.mark.thorough)])
def test_a_unit_holds_the_text_in_well_formed_files(version: str, tmp_path: Path) -> None:
    unit = load(tmp_path, json.dumps(described([TOGETHER]))).derive().write_fmu(tmp_path / "unit.fmu", version)
    with zipfile.ZipFile(unit) as archive:
        root = ElementTree.fromstring(archive.read("modelDescription.xml"))
        page = archive.read("documentation/index.html").decode()
    told = [root.attrib["description"], *(x.attrib["description"] for x in root.iter() if x.get("name") == "u0")]
    assert len(set(told)) == 1
    assert all(one.isprintable() and "<script>alert(1)</script>" in one for one in told)
    assert printable(page)
    assert Tags(page).tags <= {*"html head meta title body h1 p table tr th td charset lang declaration".split()}


@pytest.mark.filterwarnings("ignore:the mesh")
def test_documents_and_tables_hold_no_character_that_does_not_print(tmp_path: Path) -> None:
    equations = load(tmp_path, json.dumps(described([TOGETHER]))).derive()
    for form in ("html", "md", "tex"):
        assert printable(equations.explain("short").save(tmp_path / f"x.{form}").read_text(encoding="utf-8")), form
    run = equations.compile(target="numpy").simulate(0.1)
    assert printable(str(run.animate()))
    data = xarray.load_dataset(run.save(tmp_path / "run.nc"))
    assert printable(data["y0"].attrs["long_name"])
    assert "<script>alert(1)</script>" in data["y0"].attrs["long_name"]


def test_a_model_file_that_is_written_reads_back_the_texts(tmp_path: Path) -> None:
    texts = [text for text in NASTY.values() if text]
    written = load(tmp_path, json.dumps(described(texts))).to_yaml()
    assert printable(written)
    data = YAML(typ="safe", pure=True).load(written)
    assert data["doc"] == "\n".join(texts)
    assert [data["parameters"][f"p{k}"]["doc"] for k in range(len(texts))] == texts
    (tmp_path / "again.yaml").write_text(written)
    again = eg.load(tmp_path / "again.yaml")
    assert again.to_yaml() == written


def test_a_pair_of_surrogates_is_a_character_and_half_of_one_is_refused(tmp_path: Path) -> None:
    for text in LONE.values():
        with refused("EG-FILE-DAMAGED doc") as caught:
            load(tmp_path, json.dumps(described([text]))).check()
        places = {"doc", "parameters.p0.doc", "inputs.u0.doc", "outputs.y0.doc", "states.z0.doc", "events.e0.doc"}
        assert places | {"bodies.rod.display[0].file"} == {problem.path for problem in caught.value.problems}
        model = eg.Model("held", doc=text)  # in Python as in a file
        model.parameter("l", 1.0, unit=text, doc=text)
        model.revolute("A", model.ground, model.body("rod", mass=1.0, inertia={"zz": 1.0}))
        with pytest.raises(eg.ModelError) as caught:
            model.check()
        assert {problem.path for problem in caught.value.problems} == {"doc", "parameters.l.unit", "parameters.l.doc"}
    module = load(tmp_path, json.dumps(described([PAIR]))).compile(target="numpy", kernels=["rhs"])
    assert_held(module.metadata, ["\N{GRINNING FACE}"])


def test_pictures_are_whole_and_hold_no_element_of_a_text(tmp_path: Path) -> None:
    from matplotlib import rc_context
    from matplotlib.figure import Figure

    module = load(tmp_path, json.dumps(described(["plain"]))).compile(
        target="numpy", kernels=["rhs", "outputs", "events"]
    )
    run = module.simulate(0.05)
    for key in ("HTML", "dollar", "two dollars", "dollars", "LaTeX", "XML", "NUL", "C1", "colours", "HTML comment end"):
        run.units["y0"] = NASTY[key]  # as a stored trajectory may have it
        axes = Figure().add_subplot()
        run.plot("y0", ax=axes)
        shown = "".join(axes.get_ylabel().replace("\\$", "$").partition("(")[2].rpartition(")")[0].split())
        assert shown
        assert shown.isprintable()
        with rc_context({"svg.fonttype": "none"}):
            axes.figure.savefig(tmp_path / "shown.svg")
        root = ElementTree.parse(tmp_path / "shown.svg").getroot()
        assert shown in "".join("".join(root.itertext()).split())  # as it is, no formula
        found = {part.tag.rpartition("}")[2] for part in root.iter()}
        assert not found & {"script", "img", "b", "foreignObject", "image"}


def test_nothing_of_a_text_drives_the_terminal(tmp_path: Path) -> None:
    (tmp_path / "held.yaml").write_text(json.dumps(described([ALL])))
    names = [NASTY[name] for name in ("colours", "directions", "C1")]
    good = ("check held.yaml", "check held.yaml --json", "derive held.yaml", "convert held.yaml",
            "run held.yaml --target numpy --end 0.01", "generate held.yaml --out made --target c")  # fmt: skip
    calls: list[tuple[int, tuple[str, ...]]] = [
        *((0, tuple(line.split())) for line in good),
        *((1, ("check", f"bad{k}.yaml")) for k in range(3)),
        *((2, ("check", name)) for name in names),
        *((2, ("run", "held.yaml", "--target", name)) for name in names),
    ]
    for k, name in enumerate(names):
        (tmp_path / f"bad{k}.yaml").write_text(json.dumps({**described([""]), "name": name}))
    for code, words in calls:
        done = command.run(*words, cwd=tmp_path)
        assert done.code == code, (words, done.err)
        assert printable(done.out), words
        assert printable(done.err), words
    assert sorted(p.name for p in tmp_path.iterdir()) == ["bad0.yaml", "bad1.yaml", "bad2.yaml", "held.yaml", "made"]


# -- where no text belongs ---------------------------------------------------------------------------------------------
#: Models that together have every section of a file.
TEXTS = """
name: held
gravity: [0, "-9.81", 0]
parameters: {l: {value: 0.5, unit: m}}
inputs: {tau: {value: 0.0, unit: N*m}}
bodies:
  rod: {mass: 1.0, com: [l/2, 0, 0], inertia: {zz: 0.1}, markers: {tip: {at: [l, 0, 0]}},
    display: [{shape: box, size: [1, 1, 1]}]}
joints: {A: {type: revolute, between: [ground, rod], coordinate: theta, axis: z}}
forces: {motor: {type: torque, joint: A, value: tau}}
states: {z: {rate: -z}}
outputs: {y: {expression: y(rod.tip), unit: m}}
events: {low: {expression: y(rod.tip)}}
initial: {theta: 0.3}
simulation: {end: 1, method: DOP853}
---
name: mechanism
parameters: {m: 1.0}
functions: {f: {type: table, x: [0, 1, 2], y: [0, 1, 4], kind: cubic}}
bodies:
  a: {mass: m, inertia: [1, 1, 1]}
  b: {mass: m, points: [{mass: 1, at: [1, 0, 0]}]}
joints:
  A: {type: revolute, between: [ground, a], limits: {lower: -1}}
  B: {type: cylindrical, between: [{body: a, at: [1, 0, 0]}, b], coordinates: [s, w]}
forces: {k: {type: spring, between: [ground, b], stiffness: f(m)}}
constraints: {c: {type: coupling, coordinates: {A: 1, w: 2}}}
events: {e: {expression: A, reset: {A_dot: -A_dot}, terminal: 2}}
guess: {A: 0.1}
independent: [A, s]
---
name: bare
parameters: {k: 1.0}
lagrangian: {coordinates: [a, b], expression: a_dot**2 + b_dot**2 - k*a, forces: {a: k}}
---
name: given
equations: {coordinates: [q], velocities: [v], rates: {q: v}, intermediates: {z: q**2}, mass_matrix: [[1]], forcing: [-z]}
"""
MODELS: dict[str, Any] = {data["name"]: data for data in YAML(typ="safe", pure=True).load_all(TEXTS)}


def places(data: Any) -> Iterator[tuple[tuple[Any, ...], bool]]:
    """Places of all values, and of all keys, of a model file's data."""
    for place in [*paths(data)][1:]:
        if isinstance(at(data, place[:-1]), dict):
            yield place, True
        if not isinstance(at(data, place), dict | list):
            yield place, False


def changed(data: Any, place: tuple[Any, ...], text: str, is_key: bool) -> Any:
    """The data with a text in place of one value or key."""
    data, last = deepcopy(data), place[-1]
    holder = at(data, place[:-1])
    if is_key:
        items = [(text if key == last else key, value) for key, value in holder.items()]
        holder.clear()
        holder.update(items)
    else:
        holder[last] = text
    return data


@pytest.mark.parametrize("every", [44, pytest.param(6, marks=pytest.mark.thorough)])
@pytest.mark.parametrize("name", [pytest.param("bare", marks=pytest.mark.quick), "given", "held", "mechanism"])
def test_a_nasty_text_is_refused_by_name(name: str, every: int, tmp_path: Path) -> None:
    """A few of the texts in each place, the next in the next."""
    assert load(tmp_path, json.dumps(MODELS[name])).mechanism().name == name
    for number, (place, is_key) in enumerate(places(MODELS[name])):
        for text in [*NASTY.values()][number % every :: every]:
            with pytest.raises(eg.ModelError) as caught:
                load(tmp_path, json.dumps(changed(MODELS[name], place, text, is_key))).mechanism()
            for problem in caught.value.problems:
                assert str(problem).isprintable(), (place, text)
                assert len(str(problem)) < 10_000


def test_names_in_a_robot_become_identifiers(tmp_path: Path) -> None:
    inertial = "<inertial><mass value='1'/><inertia ixx='1' iyy='1' izz='1' ixy='0' ixz='0' iyz='0'/></inertial>"
    path, taken = tmp_path / "robot.urdf", 0
    for text in NASTY.values():
        text = re.sub(r"[^\t\n\r -\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]", "", text)  # what XML can hold
        shown = saxutils.quoteattr(text, {"\n": "&#10;", "\r": "&#13;", "\t": "&#9;"})
        path.write_text(
            f"<robot name={shown}><link name='base'/><link name={shown}>{inertial}</link>"
            f"<joint name={shown} type='continuous'><parent link='base'/><child link={shown}/><axis xyz='0 1 0'/></joint>"
            "</robot>",
            encoding="utf-8",
        )
        try:
            model = eg.load(path)
            mechanism = model.mechanism()
        except eg.EomgenError as error:
            assert all(c.isprintable() or c == "\n" for c in str(error))
            continue
        taken += 1
        for name in (mechanism.name, *(b.name for b in mechanism.bodies), *(j.name for j in mechanism.joints)):
            assert re.fullmatch(r"[A-Za-z][A-Za-z0-9_]{0,63}", name)
        model.save(tmp_path / "again.yaml")
        assert eg.load(tmp_path / "again.yaml").mechanism().name == mechanism.name
    assert taken > len(NASTY) / 2


def test_a_nasty_file_name_is_an_error_with_a_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    for text in NASTY.values():
        model = eg.Model("held")
        model.body("rod", solids=[{"type": "mesh", "file": text, "density": 1.0}])
        model.native("f", text, python=text)
        with pytest.raises(eg.ModelError) as caught:
            model.mechanism()
        assert {"bodies.rod.solids[0].file", "functions.f.source"} <= {p.path for p in caught.value.problems}
        assert all(c.isprintable() or c == "\n" for c in str(caught.value))
        with pytest.raises((eg.EomgenError, OSError)):
            eg.load(text)


# -- names of models, which become names of functions and files --------------------------------------------------------
WORD = "zzname"


@pytest.mark.parametrize("target", ["c", "cython"])
def test_no_name_of_a_model_makes_a_name_that_is_there(target: str, tmp_path: Path) -> None:
    """Nor a file: where the name would have to be one that generated code has, the model is refused."""
    example = (Path(__file__).parents[2] / "examples" / "cam_follower.yaml").read_text()
    (tmp_path / "model.yaml").write_text(re.sub(r"^name: .*$", f"name: {WORD}", example, flags=re.MULTILINE))
    assert command.run("generate", "model.yaml", "--out", ".", "--target", target, cwd=tmp_path).code == 0
    files = [file for file in (tmp_path / WORD).rglob("*") if file.is_file()]
    there = {file.name.lower() for file in files if file.parent.name == WORD}
    for file in files:
        # in a module what lies in several files is not linked by name, nor are static functions of the solvers
        if target == "c" and file.suffix in (".c", ".h") and file.name != "eomgen_solvers.c":
            bare = re.sub(r'/\*.*?\*/|"(\\.|[^"\\\n])*"', " ", file.read_text(), flags=re.DOTALL)
            # members are no names, nor what the list of the solvers joins with "eom_"
            bare = re.sub(r"typedef struct \{.*?\}|->\w+|\bX\(\w+\)", " ", bare, flags=re.DOTALL)
            there |= set(re.findall(r"[A-Za-z_]\w*", bare))
    own = {word for word in there if WORD in word.lower()}
    assert len(own) > 2
    names = set()
    for word in own - {WORD}:
        start, _, end = re.split(f"({WORD})", word, maxsplit=1, flags=re.IGNORECASE)
        for other in there - own:
            if len(other) > len(start + end) and other.startswith(start) and other.endswith(end):
                names.add(other[len(start) : len(other) - len(end)].lower())
    names |= {"eomgen", "eomgen_real", "eom", "eom_x", "EOMGEN_x", "Python", "python", "structmember", "errors"}
    for name in sorted(names):
        with pytest.raises(eg.ModelError) as caught:
            eg.Model(name).mechanism()
        assert "name" in {problem.path for problem in caught.value.problems}, name
