"""Writing a package over an earlier one: what is replaced, what goes, what is left alone."""

import json
from pathlib import Path

import pytest

from eomgen.emit.write import write_package
from eomgen.errors import EomgenError

MODEL = json.dumps({"abi": 1, "name": "m"})


def names(folder: Path) -> set[str]:
    return {str(p.relative_to(folder)) for p in folder.rglob("*") if p.is_file()}


def test_stale_files_go_and_foreign_ones_stay(tmp_path):
    folder = tmp_path / "out" / "m"
    write_package({"model.json": MODEL, "m.c": "1", "m_part1.c": "2", "runtime/a.py": "3"}, folder)
    (folder / "notes.txt").write_text("mine")
    write_package({"model.json": MODEL, "m.c": "new"}, folder)
    assert names(folder) == {"model.json", "m.c", "notes.txt"}
    assert not (folder / "runtime").exists()
    assert (folder / "m.c").read_text() == "new"
    assert json.loads((folder / "model.json").read_text())["files"] == ["m.c", "model.json"]
    assert [p.name for p in folder.parent.iterdir()] == ["m"]


def test_a_file_of_the_user_is_never_overwritten(tmp_path):
    folder = tmp_path / "m"
    write_package({"model.json": MODEL}, folder)
    (folder / "Makefile").write_text("mine")
    with pytest.raises(EomgenError, match="Makefile exists and was not written by eomgen"):
        write_package({"model.json": MODEL, "Makefile": "ours"}, folder)
    assert (folder / "Makefile").read_text() == "mine"


@pytest.mark.parametrize("held", ["{}", "not json", '"abi"', '["abi"]', "[" * 99999, None])
def test_a_folder_of_someone_else_is_refused(tmp_path, held):
    (tmp_path / ("other.txt" if held is None else "model.json")).write_text(held or "")
    with pytest.raises(EomgenError, match="not a generated package"):
        write_package({"model.json": MODEL}, tmp_path)


def test_names_that_lead_out_of_the_folder_are_not_removed(tmp_path):
    (tmp_path / "precious").write_text("")
    folder = tmp_path / "m"
    folder.mkdir()
    (folder / "model.json").write_text(json.dumps({"abi": 1, "files": ["../precious", "model.json"]}))
    write_package({"model.json": MODEL}, folder)
    assert (tmp_path / "precious").exists()


def test_a_package_is_readable_like_any_new_folder(tmp_path):
    (tmp_path / "plain").mkdir()
    write_package({"model.json": MODEL}, tmp_path / "m")
    assert (tmp_path / "m").stat().st_mode == (tmp_path / "plain").stat().st_mode
