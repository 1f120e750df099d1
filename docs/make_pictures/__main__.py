"""The pictures of the documentation, made from models by eomgen's public calls.

``python docs/make_pictures`` writes all of them to ``docs/pictures``; names after it choose some.
"""

from __future__ import annotations

import io
import sys

import drawn  # noqa: F401  (its functions enter the table)
import matplotlib.pyplot as plt
import numpy as np
import plotted  # noqa: F401
from PIL import Image
from tools import DOCS, PICTURES

LARGEST = 60_000  #: bytes of one picture


def write(name: str) -> None:
    """Make one picture and store it in few colours."""
    made = PICTURES[name]()
    if not isinstance(made, Image.Image):
        figure = made if hasattr(made, "savefig") else np.ravel(made)[0].figure
        memory = io.BytesIO()
        figure.savefig(memory, dpi=100)
        plt.close("all")
        made = Image.open(memory).convert("RGB")
    colors = made.quantize(128, dither=Image.Dither.NONE)
    path = DOCS / "pictures" / f"{name}.png"
    path.parent.mkdir(exist_ok=True)
    colors.save(path, optimize=True)
    size = path.stat().st_size
    print(f"{path.relative_to(DOCS.parent)}  {size / 1000:.0f} kB")
    if size > LARGEST:
        raise SystemExit(f"{path.name} has {size} bytes, more than {LARGEST}")


if __name__ == "__main__":
    for chosen in sys.argv[1:] or PICTURES:
        write(chosen)
