"""Entries: a folder with a published build <-> its manifest, whose seal and digests say that nothing has changed.

The manifest lists the SHA-256 of every file; its own, under "seal", covers the rest of it.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from pathlib import Path, PurePosixPath
from typing import Any

from .ownership import read_trusted, require_trusted

MANIFEST = "manifest.json"


def digest(data: bytes) -> str:
    """SHA-256 as 64 digits."""
    return hashlib.sha256(data).hexdigest()


def sealed(manifest: Mapping[str, Any]) -> str:
    """The text of a manifest with its seal."""
    return json.dumps({**manifest, "seal": _seal(manifest)}, indent=1)


def read_manifest(directory: Path) -> dict[str, Any]:
    """The manifest of an entry as it was written.

    Raises
    ------
    ValueError
        It is damaged.
    OSError
        It cannot be read.
    ToolchainError
        Another user could have written it.
    """
    require_trusted(directory)
    try:
        manifest = json.loads(read_trusted(directory / MANIFEST))
        if manifest.pop("seal") != _seal(manifest):
            raise ValueError("the seal is broken")
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
        raise ValueError(f"the manifest in {directory} is damaged: {error}") from None
    found: dict[str, Any] = manifest
    return found


def read_entry(directory: Path) -> tuple[dict[str, Any], dict[str, bytes]]:
    """The manifest of an entry and the bytes of all its files, each as it was published.

    Raises
    ------
    ValueError
        Something is damaged.
    OSError
        Something is missing.
    ToolchainError
        Another user could have written it.
    """
    manifest = read_manifest(directory)
    files: dict[str, str] = manifest["files"]
    for folder in {PurePosixPath(name).parent for name in files}:
        require_trusted(directory / folder)
    found = {name: read_trusted(directory / name) for name in files}
    for name, data in found.items():
        if digest(data) != files[name]:
            raise ValueError(f"{directory / name} is damaged")
    return manifest, found


def _seal(manifest: Mapping[str, Any]) -> str:
    return digest(json.dumps(manifest, sort_keys=True).encode())
