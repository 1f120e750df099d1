"""Stage show, palettes: pictures of many colours -> the few that a GIF may have, near to all of them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Image = NDArray[np.uint8]

COLORS = 128  #: of a GIF: more make it larger, fewer are seen
ROUNDS = 3  #: of moving the colours to the middles of those that they stand for
SHADES = np.array([65536, 256, 1])


def palette_of(images: Sequence[Image], colors: int) -> Image:
    """At most so many colours (n, 3) that stand for those of pictures (height, width, 3).

    A colour counts by the root of its dots: by their number the background would take nearly all places, and a thin bar
    would get the colour of its neighbour.
    """
    from PIL import Image as Pictures

    packed, counts = np.unique(np.concatenate([_packed(image).ravel() for image in images]), return_counts=True)
    if len(packed) <= colors:
        return _unpacked(packed)
    often = np.repeat(_unpacked(packed), np.ceil(np.sqrt(counts)).astype(int), axis=0)
    found = Pictures.fromarray(often[None]).quantize(colors, Pictures.Quantize.MEDIANCUT, kmeans=ROUNDS)
    return np.array(found.getpalette(), dtype=np.uint8).reshape(-1, 3)[:colors]


def indices_in(palette: Image, image: Image) -> Image:
    """Index (height, width) of the colour of a palette that is nearest to each dot.

    Pillow's own search looks at six bits of a colour, which turns white into light grey.
    """
    packed, where = np.unique(_packed(image), return_inverse=True)
    own, known = _unpacked(packed).astype(float), palette.astype(float)
    distances = (own**2).sum(axis=1)[:, None] - 2 * own @ known.T + (known**2).sum(axis=1)
    nearest: Image = distances.argmin(axis=1).astype(np.uint8)[where].reshape(image.shape[:2])
    return nearest


def _packed(image: Image) -> NDArray[np.int64]:
    packed: NDArray[np.int64] = (image.astype(float) @ SHADES).astype(np.int64)
    return packed


def _unpacked(packed: NDArray[np.int64]) -> Image:
    colors: Image = (packed[:, None] // SHADES % 256).astype(np.uint8)
    return colors
