"""Pictures in a notebook."""

from __future__ import annotations

import base64
import html
import struct
import zlib
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

# Side of a picture in a notebook, in pixels of the screen.
_SHOWN_SIDE = 100


def png(picture: npt.NDArray[np.uint8]) -> bytes:
    """A grey picture (rows, columns) as a PNG file."""

    def chunk(kind: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    rows, columns = picture.shape
    header = struct.pack(">IIBBBBB", columns, rows, 8, 0, 0, 0, 0)
    # Each row begins with the number of its filter: 0, for none.
    filtered = np.pad(picture, ((0, 0), (1, 0))).tobytes()
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", zlib.compress(filtered)) + chunk(b"IEND", b"")


def taxonomy_page(pictures: npt.NDArray[np.uint8], medoids: Sequence[Mapping[str, Any]]) -> str:
    """The medoids of a taxonomy as a row of pictures with words below."""
    # Merge the channels of species.
    grey = pictures.max(axis=1) if pictures.ndim == 4 else pictures
    figures = [_figure(number, *shown) for number, shown in enumerate(zip(grey, medoids, strict=True), 1)]
    return f'<div style="display:flex;flex-wrap:wrap;gap:8px">{"".join(figures)}</div>'


def _figure(number: int, picture: npt.NDArray[np.uint8], medoid: Mapping[str, Any]) -> str:
    data = base64.b64encode(png(picture)).decode()
    named = html.escape(medoid["cluster_name"] or medoid["class"] or "")
    size = f"{medoid['cluster_size']} individual{'' if medoid['cluster_size'] == 1 else 's'}"
    words = f"<b>{number}</b> {named}<br>{size}<br>medoid: {medoid['index']}"
    image = f'<img width="{_SHOWN_SIDE}" style="image-rendering:pixelated" src="data:image/png;base64,{data}">'
    return f'<figure style="margin:0;font-size:small">{image}<figcaption>{words}</figcaption></figure>'
