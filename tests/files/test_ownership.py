"""Who could have written a path: owners, modes and links of every part of it."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import pytest
from foreign import give_away

from eomgen.errors import ToolchainError
from eomgen.files import ownership
from eomgen.files.build_folder import read_entry, read_manifest, sealed
from eomgen.files.kept import Kept
from eomgen.files.ownership import make_private, read_trusted, require_trusted


@pytest.fixture
def place(tmp_path: Path) -> Path:
    """Folder a/b/c with a file."""
    folder = tmp_path / "a" / "b" / "c"
    make_private(folder)
    (folder / "file").write_text("content")
    (folder / "file").chmod(0o600)
    return folder


def test_a_private_folder_is_taken(place: Path, tmp_path: Path) -> None:
    require_trusted(place / "file")
    assert read_trusted(place / "file") == b"content"
    assert {f.stat().st_mode & 0o777 for f in (place, place.parent, tmp_path / "a")} == {0o700}


@pytest.mark.parametrize("part", ["", "..", "../..", "file"])
def test_a_foreign_part_is_refused_wherever_it_is(place: Path, part: str, monkeypatch: pytest.MonkeyPatch) -> None:
    foreign = Path(os.path.normpath(place / part))
    give_away(foreign, monkeypatch)
    with pytest.raises(ToolchainError) as raised:
        require_trusted(place / "file")
    for words in (f" {foreign} (owner ", "uid 12345", "belongs to another user", "EOMGEN_CACHE_DIR"):
        assert words in str(raised.value)


@pytest.mark.parametrize("mode", [0o777, 0o770, 0o702, 0o722])
@pytest.mark.parametrize("part", ["", "..", "../.."])
def test_a_folder_that_others_write_is_refused_wherever_it_is(place: Path, part: str, mode: int) -> None:
    open_ = Path(os.path.normpath(place / part))
    os.chown(open_, -1, 0 if os.geteuid() == 0 else os.getgid())
    open_.chmod(mode)
    refused = pytest.raises(ToolchainError, match=f"mode 0{mode:o}. can be written by other users.*chmod go-w {open_}")
    if mode & 0o002 or os.geteuid() == 0 or part == "":
        with refused:
            require_trusted(place)


def test_a_sticky_folder_is_taken_above_but_not_itself(place: Path) -> None:
    place.parent.chmod(0o1777)
    require_trusted(place)
    with pytest.raises(ToolchainError, match="mode 1777"):
        require_trusted(place.parent)


def test_every_link_on_the_way_counts(place: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "one").symlink_to("two")
    (tmp_path / "two").symlink_to(tmp_path / "a" / "b" / ".." / "b")
    require_trusted(tmp_path / "one" / "c" / "file")
    give_away(tmp_path / "two", monkeypatch)
    with pytest.raises(ToolchainError, match=f"the symbolic link {tmp_path / 'two'}"):
        require_trusted(tmp_path / "one" / "c" / "file")
    (tmp_path / "round").symlink_to("round")
    with pytest.raises(OSError, match="symbolic links"):
        require_trusted(tmp_path / "round" / "x")
    (tmp_path / "open").mkdir(mode=0o700)
    (tmp_path / "open" / "inner").mkdir(mode=0o700)
    (tmp_path / "open").chmod(0o777)
    (tmp_path / "three").symlink_to("open/inner")
    with pytest.raises(ToolchainError, match=f"{tmp_path / 'open'} "):
        require_trusted(tmp_path / "three")


def test_files_are_opened_first(place: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (place / "link").symlink_to("file")
    os.mkfifo(place / "pipe", 0o600)
    for name in ("link", "pipe", "."):
        with pytest.raises(OSError):  # noqa: PT011
            read_trusted(place / name)
    (place / "file").chmod(0o622)
    with pytest.raises(ToolchainError, match="the file .*can be written by other users"):
        read_trusted(place / "file")
    (place / "file").chmod(0o644)
    give_away(place / "file", monkeypatch)
    with pytest.raises(ToolchainError, match="the file .*belongs to another user"):
        read_trusted(place / "file")


def test_a_private_group_may_write_above(place: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As where the umask is 002 and every user has a group of their own; root has no such group."""
    import grp
    import pwd

    me = 4242
    own = pwd.struct_passwd(("me", "x", me, place.stat().st_gid, "", "/", ""))
    groups = [("me", []), ("me", ["me"]), ("me", ["me", "other"]), ("staff", [])]
    monkeypatch.setattr(pwd, "getpwuid", lambda uid: own)
    for name, members in groups:
        monkeypatch.setattr(grp, "getgrgid", lambda gid, n=name, m=members: grp.struct_group((n, "x", gid, m)))
        taken = name == "me" and "other" not in members
        assert ownership._private_group(str(place), own.pw_gid, me) == taken
        assert not ownership._private_group(str(place), own.pw_gid, 0)


def test_what_a_sandbox_hides_counts_above_only(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    real = Path("/proc/sys/kernel/overflowuid").read_text()
    assert not ownership._unmapped(int(real)), "in a namespace of its own this user is hidden, and nobody is mapped"
    maps = tmp_path / "map"
    maps.write_text("0 1000 1\n")
    original: Callable[..., object] = open

    def opened(path: str, **words: str) -> object:
        return original(maps if path.endswith("uid_map") else path, **words)

    monkeypatch.setattr(ownership, "open", opened, raising=False)
    assert ownership._unmapped(int(real))
    assert not ownership._unmapped(12345)
    assert not ownership._unmapped(0)


def test_kept_files_are_sealed_with_their_names(place: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    kept = Kept(place / "kept")
    assert kept.read("a") is None
    kept.write("a", b"one")
    kept.write("b", b"two")
    assert (kept.read("a"), kept.read("b")) == (b"one", b"two")
    content = (kept.folder / "a").read_bytes()
    for length in (0, 1, len(content) // 2, len(content) - 1):
        (kept.folder / "a").write_bytes(content[:length])
        assert kept.read("a") is None
    for k in range(len(content)):
        (kept.folder / "a").write_bytes(content[:k] + bytes([content[k] ^ 4]) + content[k + 1 :])
        assert kept.read("a") is None
    os.replace(kept.folder / "b", kept.folder / "a")
    assert kept.read("a") is None
    assert list(kept.names()) == ["a"]
    give_away(kept.folder / "a", monkeypatch)
    with pytest.raises(ToolchainError, match="belongs to another user"):
        kept.read("a")


def test_every_flipped_bit_of_a_manifest_is_noticed(place: Path) -> None:
    manifest = place / "manifest.json"
    facts = {"key": "k", "files": {"file": "0" * 64}, "recipe": {"flags": ["-O1"], "path": "\udcff"}}
    text = sealed(facts).encode()
    manifest.write_bytes(text)
    manifest.chmod(0o600)
    assert read_manifest(place) == facts
    with pytest.raises(ValueError, match="file is damaged"):
        read_entry(place)
    missed = 0
    for k in range(8 * len(text)):
        flipped = bytearray(text)
        flipped[k // 8] ^= 1 << k % 8
        manifest.write_bytes(flipped)
        with suppress(ValueError):
            missed += read_manifest(place) != facts
    assert missed == 0
    for text in (b"", b"{}", b"[]", b"[" * 100_000, b'{"seal": 1}', b"null", b"\xff"):
        manifest.write_bytes(text)
        with pytest.raises(ValueError, match="damaged"):
            read_manifest(place)


def test_a_missing_folder_is_told_as_missing(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError):
        require_trusted(tmp_path / "nowhere" / "x")
    code = "import os; os.umask(0); from eomgen.files.ownership import *; make_private('x/y'); require_trusted('x/y')"
    subprocess.run([sys.executable, "-c", code], cwd=tmp_path, check=True)
