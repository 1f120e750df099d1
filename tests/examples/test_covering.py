"""The examples that stand for all have what all have."""

from __future__ import annotations

import re
from pathlib import Path

from sweeps import COVERING

TEXTS = {
    path.stem: path.read_text(encoding="utf-8") for path in (Path(__file__).parents[2] / "examples").glob("*.yaml")
}


def words_of(text: str) -> set[str]:
    """Types of elements, sections, and keys that choose a law or a rotation."""
    types = re.findall(r"\btype: *\w+", text)
    sections = re.findall(r"^\w+:", text, re.MULTILINE)
    return {*types, *sections, *re.findall(r"\b(?:rotation|kind|law|normal_law|shape|method): *\w+", text)}


def test_they_have_every_type_section_and_choice() -> None:
    found = set[str]().union(*(words_of(TEXTS[name]) for name in COVERING))
    assert len(found) > 40
    assert set[str]().union(*map(words_of, TEXTS.values())) - found == set()
