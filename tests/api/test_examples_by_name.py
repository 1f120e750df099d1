"""Examples are models by their name, from any folder."""

from __future__ import annotations

from pathlib import Path

import pytest

import eomgen as eg
from eomgen.errors import UsageError

EXAMPLES = Path(__file__).parents[2] / "examples"


def test_an_example_is_the_model_of_its_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    for name in ("slider_crank", "slider_crank.yaml"):
        assert eg.load_example(name).to_yaml() == eg.load(EXAMPLES / "slider_crank.yaml").to_yaml()
    for name in ("arm", "arm.urdf"):
        arm = eg.load_example(name, floating=True)
        assert arm.to_yaml() == eg.load(EXAMPLES / "arm.urdf", floating=True).to_yaml()


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("slider_krank", "no example 'slider_krank'; did you mean slider_crank?"),
        ("nothing_near", "there are: andrews_squeezer, arm.urdf, "),
        (3, "no example 3"),
        ("bicycle.py", "bicycle.py is a script .* 'eomgen examples bicycle.py'"),
        ("../slider_crank", "no example"),
    ],
)
def test_what_is_no_example_is_told(name: str, words: str) -> None:
    with pytest.raises(UsageError, match=words):
        eg.load_example(name)


def test_the_name_of_an_example_given_as_a_file_is_told() -> None:
    with pytest.raises(UsageError, match=r"the example is load_example\('four_bar'\)"):
        eg.load("four_bar")
