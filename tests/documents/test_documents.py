"""README and docs: every block of Python, YAML and shell in them runs as it stands."""

from __future__ import annotations

import inspect
import re
import shlex
from pathlib import Path

import numpy as np
import pytest
from forked import run_python
from PIL import Image

import eomgen
from eomgen import rotations
from eomgen.constraints import CONSTRAINTS
from eomgen.constraints.switching import SWITCHING
from eomgen.describe.fields import BODY, EQUATIONS, FUNCTION, LAGRANGIAN, MODEL, SIMULATION, SOLID, SOLID_KEYS
from eomgen.describe.names import QUANTITIES, TOTALS, function_words
from eomgen.describe.scope import ENERGIES
from eomgen.forces import FORCES
from eomgen.joints import JOINTS
from eomgen.program import KERNELS

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
DOCUMENTS = [ROOT / "README.md", *sorted(path for path in DOCS.rglob("*.md") if "_build" not in path.parts)]


def blocks(path: Path, language: str) -> list[str]:
    """Fenced blocks of one language."""
    return re.findall(rf"^```{language}\n(.*?)^```$", path.read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL)


def having(language: str) -> list[Path]:
    return [path for path in DOCUMENTS if blocks(path, language)]


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.slow
@pytest.mark.parametrize("path", having("python"), ids=lambda p: p.name)
def test_python_blocks_run_in_order(path: Path, here: Path) -> None:
    script = here / "document.py"
    script.write_text("\n".join(blocks(path, "python")), encoding="utf-8")
    result = run_python(script, options=("-W", "error"))
    assert result.returncode == 0, result.stderr
    for name in re.findall(r"!\[[^\]]*\]\((?:\.\./)?pictures/([^)]+)\)", path.read_text(encoding="utf-8")):
        if (here / name).exists():  # the block that saves it stands on the page
            assert_same_picture(here / name, DOCS / "pictures" / name)


def assert_same_picture(made: Path, stored: Path) -> None:
    """Up to the fonts and lines of another version of matplotlib."""
    with Image.open(made) as one, Image.open(stored) as two:
        assert abs(one.width - two.width) + abs(one.height - two.height) <= 8, "python docs/pictures_of_pages.py PAGE"
        assert getattr(one, "n_frames", 1) == getattr(two, "n_frames", 1)
        size = (one.width // 4, one.height // 4)
        grey = [np.asarray(picture.convert("L").resize(size), dtype=float) for picture in (one, two)]
    assert np.abs(grey[0] - grey[1]).mean() < 5, f"{stored.name} is not what the page makes now"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "words", "said"),
    [
        ("slider_crank.py", [], "plain SciPy: energy kept to"),
        ("two_link_manipulator.py", [], "tip acceleration against the book"),
        ("four_bar.py", [], "the rocker keeps its length"),
        ("chain.py", ["4"], "4 rods fell"),
        ("bicycle.py", [], "stable from 4.2923825363 to 6.0242620154 m/s"),
    ],
)
def test_example_scripts_run(here: Path, name: str, words: list[str], said: str) -> None:
    script = ROOT / "examples" / name
    result = run_python(script, *words, options=("-W", "error"))
    assert result.returncode == 0, result.stderr
    assert said in result.stdout
    for error in re.findall(r"(?:kept to|book:|length to|equal to) ([0-9.e+-]+)", result.stdout):
        assert float(error) < 1e-8


def test_every_example_script_is_run() -> None:
    scripts = {path.name for path in (ROOT / "examples").glob("*.py")} - {"__init__.py"}
    here = {"slider_crank.py", "two_link_manipulator.py", "four_bar.py", "chain.py", "bicycle.py"}
    assert scripts == here | {"tracked_excavator.py"}  # run by tests/examples


@pytest.mark.parametrize("path", having("yaml"), ids=lambda p: p.name)
def test_yaml_blocks_pass_check(path: Path, here: Path) -> None:
    for text in blocks(path, "yaml"):
        (here / "model.yaml").write_text(text, encoding="utf-8")
        assert eomgen.load("model.yaml").check().degrees_of_freedom >= 0


@pytest.mark.slow
@pytest.mark.parametrize("path", having("console"), ids=lambda p: p.name)
def test_commands_run_in_order(path: Path, here: Path) -> None:
    commands = [line[2:] for text in blocks(path, "console") for line in text.splitlines() if line.startswith("$ ")]
    assert commands
    for command in commands:
        program, *words = shlex.split(command)
        assert program == "eomgen"
        result = run_python("-m", "eomgen", *words)
        assert result.returncode == 0, f"{command}\n{result.stderr}"


def test_links_lead_somewhere() -> None:
    for path in DOCUMENTS:
        for target in re.findall(r"\]\(([^)#:]+)\)", path.read_text(encoding="utf-8")):
            assert (path.parent / target).exists(), f"{path.name}: {target}"


def test_the_model_file_page_knows_every_key() -> None:
    text = (ROOT / "docs" / "model_file.md").read_text(encoding="utf-8")
    words = set(re.findall(r"\w+", text))
    keys = {*MODEL, *LAGRANGIAN, *EQUATIONS, *SIMULATION, *JOINTS, *FORCES, *function_words(), *QUANTITIES}
    keys |= {key for found in FORCES.values() for key in found.keys} | {o for j in JOINTS.values() for o in j.options}
    keys |= {*BODY, *SOLID, *TOTALS, *ENERGIES} | SOLID_KEYS
    assert keys - words == set()


def test_the_page_of_functions_knows_every_key() -> None:
    words = set(re.findall(r"\w+", (ROOT / "docs" / "functions.md").read_text(encoding="utf-8")))
    fields = {key: field for keys in FUNCTION.values() for key, field in keys.items()}
    assert {*FUNCTION, *fields, *(word for field in fields.values() for word in field.choices)} - words == set()


def test_the_pages_know_kernels_sequences_rotations_and_methods() -> None:
    text = {
        name: (ROOT / "docs" / f"{name}.md").read_text(encoding="utf-8") for name in ("python", "joints", "constraints")
    }
    assert {k.name for k in KERNELS} - set(re.findall(r"`(\w+)`", text["python"])) == set()
    assert set(rotations.__all__) - set(re.findall(r"`(\w+)`", text["joints"])) == set()
    sequences = {a + b + c for a in "xyz" for b in "xyz" for c in "xyz" if b not in (a, c)}
    assert sequences - set(re.findall(r"`(\w+)`", text["joints"])) == set()
    for name, shown in re.findall(r"^\| `m\.(\w+)` \| `([^`]*)` \|$", text["constraints"], re.MULTILINE):
        taken = [
            p
            for key, p in inspect.signature(getattr(eomgen.Model, name)).parameters.items()
            if key not in ("self", "name", *SWITCHING)  # which a section of the page tells of all types
        ]
        assert shown == ", ".join(p.name if p.default is p.empty else f"{p.name}={p.default!r}" for p in taken), name
    assert set(CONSTRAINTS) == set(re.findall(r"^\| `m\.(\w+)` ", text["constraints"], re.MULTILINE))


def test_numbers_of_the_comparison_are_those_measured() -> None:
    text = (DOCS / "comparison.md").read_text(encoding="utf-8")
    measured, number = 0, r"(?<![\w.,-])[0-9][0-9,]*(?:\.[0-9]+)?(?:e-?[0-9]+)?(?![\w,.]*[0-9])"
    for part, source in re.findall(r"^## [^\n]*\n(.*?)\*Source: (\S+?\.md)", text, re.MULTILINE | re.DOTALL):
        known = set(re.findall(number, (ROOT / source).read_text(encoding="utf-8")))
        cells = [
            cell.strip() for row in re.findall(r"^\|[^|]*\|(.*)\|$", part, re.MULTILINE) for cell in row.split("|")
        ]
        shown = {cell for cell in cells if re.fullmatch(r"[0-9.,]+", cell)} or set(re.findall(r"([0-9.]+) ns", part))
        assert shown, source
        assert shown - known == set(), source
        measured += len(shown)
    assert measured > 40


def test_the_readme_shows_the_slider_crank_that_ships() -> None:
    (shown,) = blocks(ROOT / "README.md", "yaml")
    shipped = (ROOT / "examples" / "slider_crank.yaml").read_text(encoding="utf-8")
    shipped = re.sub(r"^doc:.*\n", "", shipped, flags=re.MULTILINE)
    assert re.sub(r" *#.*", "", shown) == shipped
