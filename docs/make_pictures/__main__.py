"""The pictures of the documentation, made from models by eomgen's public calls.

``python docs/make_pictures`` writes all of them to ``docs/pictures``; names after it choose some, ``--out DIR`` another
folder.
"""

from __future__ import annotations

import argparse
import io
from pathlib import Path

import drawn  # noqa: F401  (its functions enter the table)
import matplotlib.pyplot as plt
import numpy as np
import plotted  # noqa: F401
from PIL import Image

from tools import DOCS, PICTURES

LARGEST = 60_000  #: bytes of one picture


def write(name: str, folder: Path) -> None:
    """Make one picture and store it in few colours."""
    made = PICTURES[name]()
    if not isinstance(made, Image.Image):
        figure = made if hasattr(made, "savefig") else np.ravel(made)[0].figure
        memory = io.BytesIO()
        figure.savefig(memory, dpi=100)
        plt.close("all")
        made = Image.open(memory).convert("RGB")
    path = folder / f"{name}.png"
    made.quantize(128, dither=Image.Dither.NONE).save(path, optimize=True)
    size = path.stat().st_size
    print(f"{path}  {size / 1000:.0f} kB")
    if size > LARGEST:
        raise SystemExit(f"{path.name} has {size} bytes, more than {LARGEST}")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("names", nargs="*", metavar="NAME", help=", ".join(PICTURES))
    parser.add_argument("--out", type=Path, default=DOCS / "pictures")
    chosen = parser.parse_args()
    if unknown := set(chosen.names) - set(PICTURES):
        parser.error(f"no pictures of these names: {', '.join(sorted(unknown))}")
    chosen.out.mkdir(exist_ok=True)
    for one in chosen.names or PICTURES:
        write(one, chosen.out)
