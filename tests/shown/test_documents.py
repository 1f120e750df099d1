"""README, documentation, gallery and notebooks: blocks run, links lead somewhere, what is stored is up to date."""

import ast
import base64
import inspect
import io
import pkgutil
import re
import resource
import shlex
import subprocess
import sys
import tomllib
from functools import cache
from html.parser import HTMLParser
from itertools import pairwise
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import command
import nbformat
import numpy as np
import pytest
from browser import Browser
from children import executed
from models import EXAMPLES
from PIL import Image
from sweeps import part_of

import eomgen as eg

ROOT = EXAMPLES.parent
DOCS = ROOT / "docs"
DOCUMENTS = [ROOT / "README.md", *sorted(path for path in DOCS.rglob("*.md") if "_build" not in path.parts)]
#: Pages whose blocks run always; those of all others by ``make thorough``.
ALWAYS = ("README.md", "sympy.md", "symbolic.md", "reactions.md", "components.md")


def blocks(path: Path, language: str) -> list[str]:
    """Fenced blocks of one language."""
    return re.findall(rf"^```{language}\n(.*?)^```$", path.read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL)


def having(language: str, always: tuple[str, ...] = ALWAYS) -> list[Any]:
    return part_of([path for path in DOCUMENTS if blocks(path, language)], lambda path: path.name in always)


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


def run_python(*words: object) -> subprocess.CompletedProcess[str]:
    """A script in a process of its own, in which warnings are errors."""
    return subprocess.run([sys.executable, "-W", "error", *map(str, words)], capture_output=True, text=True)


def same_picture(made: Path, stored: Path) -> None:
    """Up to the fonts and lines of another version of matplotlib."""
    with Image.open(made) as one, Image.open(stored) as two:
        assert abs(one.width - two.width) + abs(one.height - two.height) <= 8, stored.name
        assert getattr(one, "n_frames", 1) == getattr(two, "n_frames", 1)
        size = (one.width // 4, one.height // 4)
        grey = [np.asarray(picture.convert("L").resize(size), dtype=float) for picture in (one, two)]
    assert np.abs(grey[0] - grey[1]).mean() < 5, f"{stored.name} is not what is made now; run: make pictures"


@pytest.mark.slow
@pytest.mark.parametrize("path", having("python"), ids=lambda p: p.name)
def test_python_blocks_run_in_order(path: Path, here: Path) -> None:
    script = here / "document.py"
    script.write_text("\n".join(blocks(path, "python")), encoding="utf-8")
    result = run_python(script)
    assert result.returncode == 0, result.stderr
    for name in re.findall(r"!\[[^\]]*\]\((?:\.\./)?pictures/([^)]+)\)", path.read_text(encoding="utf-8")):
        if (here / name).exists():  # the block that saves it stands on the page
            same_picture(here / name, DOCS / "pictures" / name)


@pytest.mark.parametrize("path", having("yaml"), ids=lambda p: p.name)
def test_yaml_blocks_pass_check(path: Path, here: Path) -> None:
    for text in blocks(path, "yaml"):
        (here / "model.yaml").write_text(text, encoding="utf-8")
        assert eg.load("model.yaml").check().degrees_of_freedom >= 0


@pytest.mark.slow
@pytest.mark.parametrize("path", having("console", ALWAYS[:1]), ids=lambda p: p.name)
def test_commands_run_in_order(path: Path, here: Path) -> None:
    commands = [line[2:] for text in blocks(path, "console") for line in text.splitlines() if line.startswith("$ ")]
    assert commands
    for line in commands:
        program, *words = shlex.split(line)
        assert program == "eomgen"
        result = command.run(*words, cwd=here)
        assert result.code == 0, f"{line}\n{result.err}"


def test_functions_of_the_reference_say_what_they_take() -> None:
    named = re.findall(r"autofunction:: (\S+)", "".join(p.read_text() for p in (DOCS / "reference").glob("*.md")))
    assert named
    for function in map(pkgutil.resolve_name, named):
        assert not inspect.signature(function).parameters or "Parameters\n" in (inspect.getdoc(function) or "")


SCRIPTS = {
    "slider_crank.py": "plain SciPy: energy kept to",
    "two_link_manipulator.py": "tip acceleration against the book",
    "four_bar.py": "the rocker keeps its length",
    "chain.py": "rods fell",
    "bicycle.py": "stable from 4.2923825363 to 6.0242620154 m/s",
}


@pytest.mark.slow
@pytest.mark.parametrize("name", part_of(SCRIPTS, lambda name: name == "four_bar.py"))
def test_example_scripts_run(here: Path, name: str) -> None:
    result = run_python(EXAMPLES / name, *(["4"] if name == "chain.py" else []))
    assert result.returncode == 0, result.stderr
    assert SCRIPTS[name] in result.stdout
    for error in re.findall(r"(?:kept to|book:|length to|equal to) ([0-9.e+-]+)", result.stdout):
        assert float(error) < 1e-8


def test_links_lead_somewhere_and_the_readme_shows_what_ships() -> None:
    for path in DOCUMENTS:
        for target in re.findall(r"\]\(([^)#:]+)\)", path.read_text(encoding="utf-8")):
            assert (path.parent / target).exists(), f"{path.name}: {target}"
    (shown,) = blocks(ROOT / "README.md", "yaml")
    shipped = re.sub(r"^doc:.*\n", "", (EXAMPLES / "slider_crank.yaml").read_text("utf-8"), flags=re.MULTILINE)
    assert re.sub(r" *#.*", "", shown) == shipped


def properties(schema: Any) -> set[str]:
    """The keys that a JSON Schema knows, at every depth."""
    parts = schema.values() if isinstance(schema, dict) else schema if isinstance(schema, list) else ()
    here = schema.get("properties") if isinstance(schema, dict) else None
    return set(here if isinstance(here, dict) else ()).union(*map(properties, parts))


def test_pages_know_every_key_and_public_name_and_the_glossary_every_term() -> None:
    text = "\n".join(path.read_text(encoding="utf-8") for path in DOCUMENTS)
    code = set(re.findall(r"\w+", " ".join(re.findall(r"`[^`]+`|```.*?```", text, re.DOTALL))))
    assert properties(command.run("check", "--schema").json) - code == set()
    names = {name: getattr(eg, name) for name in eg.__all__ if name != "__version__"}
    for kind in (eg.Model, eg.Module, eg.Equations, eg.Trajectory):
        members = {name: getattr(kind, name) for name in dir(kind) if not name.startswith("_")}
        members = {name: member for name, member in members.items() if callable(member) or isinstance(member, property)}
        assert [name for name, member in members.items() if not inspect.getdoc(member)] == []
        if not re.search(rf"autoclass:: eomgen\.[\w.]+\.{kind.__name__}\n   :members:\n   :inherited-members:", text):
            names |= members  # each has to stand on a page
    assert [name for name, member in names.items() if not inspect.getdoc(member)] == []
    assert set(names) - code == {"from_description"}
    glossary = (DOCS / "glossary.md").read_text(encoding="utf-8")
    targets = [re.sub(r"\s+", " ", term) for term in re.findall(r"\{term\}`([^`]+)`", text)]
    terms = set(re.findall(r"^(\S.*)\n: ", glossary, re.MULTILINE))
    assert {term.rpartition("<")[2].rstrip(">") for term in targets} <= terms
    module = eg.load_example("pendulum").compile(target="numpy")
    assert all(hasattr(module, name) for name in re.findall(r"`mod\.(\w+)", glossary))


# -- gallery and pictures ---------------------------------------------------------------------------------------------

GALLERY = (DOCS / "gallery.md").read_text(encoding="utf-8").split("\n### ")[1:]


@pytest.mark.parametrize("section", GALLERY, ids=lambda text: text.split()[0])
def test_an_entry_of_the_gallery_can_be_viewed(section: str) -> None:
    assert " Checked: " in section.replace("\n", " ")
    picture = re.search(r"\]\((pictures/gallery/[^)]+)\)", section)
    assert picture is not None
    file = DOCS / picture[1]
    moves = file.suffix == ".gif"
    assert file.stat().st_size < (300_000 if moves else 60_000)
    with Image.open(file) as image:
        assert (getattr(image, "n_frames", 1) > 20) == moves
        assert min(image.size) > 130
    (line,) = re.findall(r"eomgen view (\S+.*?)`", section.replace("\n", " "))
    name, *options = shlex.split(line)
    names = [n for k, n in pairwise(options) if k in ("--trace", "--plot")]
    example = next(path for path in EXAMPLES.rglob("*") if name in (path.name, path.stem) and path.suffix != ".py")
    if names:
        module = eg.load(example).compile(target="numpy")
        run = module.simulate(1e-3)
        for one in names:
            assert one in (*module.x_names, *module.y_names) or run.position(one).shape[0] == 3


def test_the_gallery_has_every_example_and_no_picture_besides() -> None:
    text = (DOCS / "gallery.md").read_text(encoding="utf-8")
    listed = {entry["file"] for entry in command.run("examples", "--json").json["examples"]}
    assert {name for name in listed if f"{Path(name).name}" not in text and Path(name).stem not in text} == set()
    stored = {file.name for file in (DOCS / "pictures" / "gallery").iterdir()}
    assert set(re.findall(r"pictures/gallery/([^)]+)\)", text)) == stored


@pytest.mark.slow
@pytest.mark.thorough
def test_the_stored_pictures_are_what_the_command_makes_now(tmp_path: Path) -> None:
    subprocess.run([sys.executable, DOCS / "make_pictures", "--out", tmp_path], check=True, capture_output=True)
    made = sorted(tmp_path.glob("*.png"))
    assert len(made) > 20
    for file in made:
        same_picture(file, DOCS / "pictures" / file.name)


# -- the site ---------------------------------------------------------------------------------------------------------


class Page(HTMLParser):
    """Anchors, links and what a page loads."""

    def __init__(self, path: Path) -> None:
        super().__init__()
        self.path, self.anchors, self.links, self.loaded = path, set[str](), list[str](), list[str]()
        self.feed(path.read_text(encoding="utf-8"))

    def handle_starttag(self, tag: str, attrs: Any) -> None:
        given = {key: value or "" for key, value in attrs}
        self.anchors |= {given[key] for key in ("id", "name") if key in given}
        if tag == "a" and "href" in given:
            self.links.append(given["href"])
        if tag in ("script", "img", "source", "video", "iframe") and "src" in given:
            self.loaded.append(given["src"])
        if tag == "link" and given.get("rel") not in ("canonical", "license"):
            self.loaded.append(given.get("href", ""))


@pytest.mark.slow
@pytest.mark.thorough
@pytest.mark.needs("chromium")
def test_the_site_builds_without_a_warning_and_needs_no_network(tmp_path: Path) -> None:
    words = ["-b", "html", "-W", "-n", "-q", "--keep-going", DOCS, tmp_path / "html"]
    built = subprocess.run([sys.executable, "-m", "sphinx", *words], capture_output=True, text=True)
    assert built.returncode == 0, f"{built.stdout}{built.stderr}"
    pages = {path.resolve(): Page(path) for path in (tmp_path / "html").rglob("*.html")}
    assert len(pages) > 40
    for path, page in pages.items():
        assert not [x for x in page.loaded if re.match(r"(?:https?:)?//", x)], path
        for link in (x for x in (*page.links, *page.loaded) if not re.match(r"[a-z]+:|//", x)):
            place, _, anchor = link.partition("#")
            target = path if not place else (path.parent / unquote(place.partition("?")[0])).resolve()
            assert target.is_file(), f"{path}: {link}"
            assert not anchor or target.suffix != ".html" or unquote(anchor) in pages[target].anchors, f"{path}: {link}"
    reasons = tomllib.loads((DOCS / "without_pictures.toml").read_text(encoding="utf-8"))["pages"]
    assert all(len(reason) > 15 for reason in reasons.values())
    with Browser(tmp_path / "profile") as browser:
        browser.open((tmp_path / "html" / "theory" / "index.html").as_uri())
        browser.wait_for("document.readyState == 'complete' && document.querySelectorAll('mjx-container').length > 0")
        drawn = browser.evaluate("document.querySelectorAll('mjx-container svg').length")
        assert drawn >= browser.evaluate("document.querySelectorAll('.math').length") > 10
        assert browser.evaluate("document.querySelectorAll('mjx-merror, [data-mml-node=merror]').length") == 0
        assert (browser.requests, browser.complaints) == ([], [])


# -- notebooks --------------------------------------------------------------------------------------------------------

NOTEBOOKS = sorted((ROOT / "notebooks").glob("*.ipynb"), key=lambda path: int(path.stem.split("_")[0]))
NUMBER = re.compile(r"[-+]?\d+(?:\.\d*)?(?:e[-+]?\d+)?")


@cache
def read(path: Path) -> Any:
    return nbformat.read(path, as_version=4)


def code(notebook: Any) -> list[Any]:
    return [cell for cell in notebook.cells if cell.cell_type == "code"]


def texts(cell: Any) -> list[str]:
    """What a cell says, without its pictures; in a cell tagged "varies" numbers may differ from run to run."""
    found = []
    for output in cell.outputs:
        data = output.get("data", {})
        seen = any(kind.startswith("image/") for kind in data)  # beside it stands the size of a figure
        kinds = [kind for kind in sorted(data) if not kind.startswith("image/") and not (seen and kind == "text/plain")]
        for text in [output.get("text", ""), *(data[kind] for kind in kinds)]:
            text = re.sub(r"base64,[^'\"]+", "base64,", text)
            varies = "varies" in cell.metadata.get("tags", [])
            found.append(re.sub(" +", " ", NUMBER.sub("#", text)) if varies else text)
    return found


def pictures(cell: Any) -> list[Any]:
    """The images among the outputs of a cell, opened."""
    data = [output.get("data", {}) for output in cell.outputs]
    coded = [one[kind] for one in data for kind in ("image/png", "image/gif") if kind in one]
    coded += [found for one in data for found in re.findall(r"base64,([^'\"]+)", one.get("text/html", ""))]
    return [Image.open(io.BytesIO(base64.b64decode(one))) for one in coded]


@pytest.mark.slow
@pytest.mark.thorough
@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_fresh_run_gives_what_is_stored(path: Path, tmp_path: Path) -> None:
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    fresh = executed(path, tmp_path)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    if path.stem == "14_tracked_excavator":  # minutes of drives in contact, which amplify rounding: it asserts instead
        return
    assert after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime < 60.0
    for k, (new, old) in enumerate(zip(code(fresh), code(read(path)), strict=True)):
        assert texts(new) == texts(old), f"code cell {k}"
        shown = [[(one.format, getattr(one, "n_frames", 1)) for one in pictures(cell)] for cell in (new, old)]
        assert shown[0] == shown[1], f"code cell {k}"


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_stored_notebook_is_a_lesson_that_can_be_handed_out(path: Path) -> None:
    """Text first, outputs where there are any, pictures, asserted numbers, an exercise; nothing private."""
    notebook = read(path)
    nbformat.validate(notebook)
    assert path.stat().st_size < 400_000
    text = re.sub(r"base64,[^'\"]+", "", path.read_text(encoding="utf-8"))
    text = re.sub(r'"image/(png|gif)": "[^"]+"', "", text)
    assert not re.search(r"/home/|/root/|/tmp/|/work/|/usr/|0x[0-9a-f]{6}|File .{1,3}/", text)
    assert set(notebook.metadata) == {"kernelspec", "language_info"}
    assert [cell.execution_count for cell in code(notebook)] == list(range(1, len(code(notebook)) + 1))
    first, last = notebook.cells[0], notebook.cells[-1]
    assert first.cell_type == last.cell_type == "markdown"
    assert len(notebook.cells) < 12
    assert last.source.startswith("## Exercise")
    checked, images = 0, 0
    for cell in code(notebook):
        assert not [one for one in cell.outputs if one.output_type == "error" or one.get("name") == "stderr"]
        assert not re.search(r"\._(?!replace\()[a-z]", cell.source)  # public names alone
        body, tree = ast.parse(cell.source).body, list(ast.walk(ast.parse(cell.source)))
        checked += sum(isinstance(node, ast.Assert) for node in tree)
        images += len(pictures(cell))
        calls = [ast.unparse(node.func) for node in tree if isinstance(node, ast.Call)]
        last_shows = isinstance(body[-1], ast.Expr) and not cell.source.rstrip().endswith(";")
        if last_shows or "print" in calls or any(one.endswith((".subplots", ".draw", ".plot")) for one in calls):
            assert cell.outputs, cell.source
    assert checked > 2
    assert images > 0


def test_the_commits_that_show_how_to_add_something_are_there() -> None:
    """A full clone has them; each adds to the package, to a test and, but for functions of modules, to a page."""
    recipes = re.findall(r"^\| (Recipe: [^|]+) \|", (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8"), re.M)
    assert len(recipes) == 8
    git = ["git", "-C", str(ROOT)]
    known = subprocess.run([*git, "rev-parse", "--is-shallow-repository"], capture_output=True, text=True, check=False)
    for subject in recipes if known.stdout == "false\n" else ():
        command = [*git, "show", "--format=%s", "--name-only", f":/^{subject}"]
        shown, *files = subprocess.run(command, capture_output=True, text=True, check=True).stdout.split("\n")
        assert shown == subject
        assert {"eomgen", "tests"} <= {file.partition("/")[0] for file in files}
