"""Programs that were compiled before are found without writing their sources; others never."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import eomgen as eg
from eomgen import pipeline
from eomgen.compilation import Cache, Options, shortcut
from eomgen.describe.mechanism import Simulation
from eomgen.program.fingerprint import _spell, fingerprint
from eomgen.runtime.late import eager

EXAMPLE = Path(__file__).parents[2] / "examples" / "two_link_manipulator.yaml"
RUN = """
import sys
import eomgen as eg
module = eg.load(sys.argv[1]).compile()
print(module.core.core.__file__, "jinja2" in sys.modules)
"""


def model(name: str, old: str = "", new: str = "") -> Any:
    text = EXAMPLE.read_text().replace("two_link_manipulator", f"short_{name}")
    assert old in text
    return text.replace(old, new, 1) if old else text


@pytest.fixture
def write(tmp_path: Path) -> Any:
    def write(text: str) -> Path:
        file = tmp_path / "model.yaml"
        file.write_text(text)
        return file

    return write


def compiled(file: Path) -> tuple[str, bool]:
    """File of the code, and whether it had to be written; in a process of its own."""
    done = subprocess.run([sys.executable, "-c", RUN, str(file)], capture_output=True, text=True, check=True)
    place, written = done.stdout.split()
    return place, written == "True"


def test_a_second_run_writes_nothing(write: Any, cache: Cache) -> None:
    file = write(model("again"))
    place, written = compiled(file)
    assert written
    assert compiled(file) == (place, False)
    notes = cache.shortcuts
    for lie in (b"0" * 64, b"../../nowhere", b"\xff\x00"):  # notes that lead nowhere are not followed
        for note in notes.names():
            notes.write(note, lie)
        assert compiled(file) == (place, True)
    for note in notes.names():  # nor are those of another program, or cut ones
        (notes.folder / note).write_bytes((notes.folder / note).read_bytes()[:-1])
    assert compiled(file) == (place, True)
    (first,) = notes.names()
    (notes.folder / first).rename(notes.folder / ("0" * 64))
    assert notes.read("0" * 64) is None
    assert compiled(file) == (place, True)
    assert compiled(file) == (place, False)
    Path(place).write_bytes(b"damaged")
    assert compiled(file) == (place, True)
    assert eg.load(file).compile().rhs(0.0, np.zeros(4)).shape == (4,)


@pytest.mark.parametrize(
    ("old", "new"), [("value: 0.5", "value: 0.75"), ("doc: Two-link", "doc: Three-link"), ("[0, -g, 0]", "[g, 0, 0]")]
)
def test_what_changes_the_sources_changes_the_fingerprint(write: Any, old: str, new: str) -> None:
    first = fingerprint(pipeline.build(eg.load(write(model("change"))).derive()))
    again = fingerprint(pipeline.build(eg.load(write(model("change"))).derive()))
    other = fingerprint(pipeline.build(eg.load(write(model("change", old, new))).derive()))
    assert first == again
    assert first is not None
    assert other not in (None, first)


def test_tables_count_and_python_twins_have_no_fingerprint(tmp_path: Path) -> None:
    source = tmp_path / "force.c"
    source.write_text("double force(double x)\n{\n    return x;\n}\n")

    def build(stiffness: float, twin: Any = None) -> Any:
        made = eg.Model("bumper")
        points = np.linspace(-0.1, 0.1, 21)
        if twin is None:
            force = made.table("force", points, stiffness * points)
        else:
            force = made.native("force", source, python=twin)
        made.prismatic("s", made.ground, made.body("buffer", mass=2.0), axis="x")
        made.actuator("spring", "s", -force(made.coordinate("s")))
        return pipeline.build(made.derive())

    assert fingerprint(build(4e3)) == fingerprint(build(4e3)) != fingerprint(build(5e3))
    assert fingerprint(build(0.0, lambda x: x)) is None


def test_options_and_writers_count(write: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    equations = eg.load(write(model("options"))).derive()
    printed = fingerprint(pipeline.build(equations))
    notes = [shortcut.Shortcut(printed, Options(**options)).note for options in ({}, {"optimize": 0}, {"lanes": 2})]
    assert shortcut.Shortcut(printed, Options(native=True)).note is None
    monkeypatch.setattr(shortcut, "digest_writers", lambda: "other code")
    notes.append(shortcut.Shortcut(printed, Options()).note)
    assert None not in notes
    assert len(set(notes)) == len(notes)
    plain, fast = equations.compile(lanes=0), equations.compile(lanes=0, optimize=0)
    assert eager(plain.core) is not eager(fast.core)


def test_a_change_of_code_or_templates_changes_the_digest(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    files = shortcut.writers()
    names = {Path(path).name for path in files}
    assert {"model.c.j2", "dop853.c", "_core.pyx", "c_text.py", "schedule.py", "options.py", "program.py"} <= names
    before = shortcut.digest_writers.__wrapped__()
    copied, text = tmp_path / Path(files[0]).name, Path(files[0]).read_bytes()
    copied.write_bytes(text)
    monkeypatch.setattr(shortcut, "writers", lambda: [str(copied), *files[1:]])
    assert shortcut.digest_writers.__wrapped__() == before
    copied.write_bytes(text + b"\n")
    assert shortcut.digest_writers.__wrapped__() != before


def test_notes_of_builds_that_are_gone_go_too(write: Any, cache: Cache) -> None:
    place, _ = compiled(write(model("gone")))
    kept, _ = compiled(write(model("stays")))
    shutil.rmtree(Path(place).parent)
    cache.prune(older_than=1e6)
    noted = {str(cache.shortcuts.read(note), "ascii") for note in cache.shortcuts.names()}
    assert Path(place).parent.name not in noted
    assert Path(kept).parent.name in noted


def test_templates_are_compiled_once(tmp_path: Path, fresh_cache: Cache) -> None:
    folder = fresh_cache.templates.folder
    code = (
        "import sys, time, jinja2; from pathlib import Path\n"
        "from eomgen.emit.sources import environment, keep_bytecode\n"
        "from eomgen.files.kept import Kept\n"
        "keep_bytecode(Kept(Path(sys.argv[1])))\n"
        "environment()._compile = None if sys.argv[2:] else environment()._compile\n"
        "template = environment().get_template('c/lanes.c.j2')\n"
        "print(template.render(name='m', width=2, tests=(), feature='', series=False, contracted=False))"
    )
    first = subprocess.run([sys.executable, "-c", code, str(folder)], capture_output=True, text=True, check=True)
    assert list(folder.iterdir())
    assert fresh_cache.root.stat().st_mode & folder.stat().st_mode & 0o077 == 0
    again = subprocess.run([sys.executable, "-c", code, str(folder), "no"], capture_output=True, text=True, check=True)
    assert again.stdout == first.stdout
    assert "m_lanes2" in again.stdout
    for file in folder.iterdir():
        file.write_bytes(file.read_bytes()[:-1])
    cut = subprocess.run([sys.executable, "-c", code, str(folder)], capture_output=True, text=True, check=True)
    assert cut.stdout == first.stdout
    fresh_cache.clear()
    assert not folder.exists()
    folder.write_text("in the way")
    blocked = subprocess.run([sys.executable, "-c", code, str(folder)], capture_output=True, text=True, check=True)
    assert blocked.stdout == first.stdout


def test_objects_that_others_share_are_spelled_once() -> None:
    """Each of 60 holds the one before twice: 2^60 ways lead to the first, and equal ones spell equally."""

    def nested(end: float, shared: bool) -> Any:
        found: Any = Simulation(end=end)
        for depth in range(60):
            twin = found if shared or depth > 3 else nested_copy(found)
            found = Simulation(end=found, method=twin)
        return found

    def nested_copy(value: Any) -> Any:
        if not isinstance(value, Simulation):
            return value
        return Simulation(nested_copy(value.end), nested_copy(value.method))

    first = _spell(nested(1.0, True), {})
    assert first == _spell(nested(1.0, True), {}) == _spell(nested(1.0, False), {})
    assert first != _spell(nested(1.5, True), {})
