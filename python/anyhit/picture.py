"""Images as pictures: in notebooks, and as PNG files."""

from __future__ import annotations

import os
import struct
import zlib
from typing import TYPE_CHECKING, Any, Union

from .errors import InvalidArgument

if TYPE_CHECKING:
    import numpy as np
    import numpy.typing as npt

__all__ = ["Picture"]

# Colour types of PNG by the number of components: grey, grey with alpha, RGB, RGB with alpha.
_COLOUR_TYPES = {1: 0, 2: 4, 3: 2, 4: 6}


class Picture:
    """An image that a notebook shows: an array (height, width), or (height, width, N) of 1 to 4
    components. Floats from 0 to 1 become 0 to 255, and other values are clamped; ``uint8`` stays.

    ``srgb=True`` encodes linear light as sRGB, except for alpha. ``np.asarray`` returns the array.
    """

    def __init__(self, image: npt.ArrayLike, *, srgb: bool = False) -> None:
        import numpy as np

        try:
            array = np.asarray(image)
        except (TypeError, ValueError, MemoryError, OverflowError, RecursionError) as error:
            raise _invalid(f"image: {error}") from None
        if array.ndim == 2:
            array = array[:, :, None]
        if array.ndim != 3 or array.shape[2] not in _COLOUR_TYPES or 0 in array.shape:
            raise _invalid(f"image: an array of shape {array.shape}, not (height, width, N) with N from 1 to 4")
        if array.dtype.kind not in "biuf":
            raise _invalid(f"image: an array of {array.dtype} is no picture")
        self._array = array
        self._srgb = srgb

    def __array__(self, dtype: Any = None, copy: Any = None) -> npt.NDArray[Any]:
        import numpy as np

        return np.array(self._array, dtype) if copy or dtype is not None else self._array

    @property
    def png(self) -> bytes:
        """The picture as a PNG file."""
        import numpy as np

        height, width, components = self._array.shape
        rows = np.zeros((height, 1 + width * components), np.uint8)
        rows[:, 1:] = self._bytes().reshape(height, -1)
        header = struct.pack(">IIBBBBB", width, height, 8, _COLOUR_TYPES[components], 0, 0, 0)
        chunks = [(b"IHDR", header), (b"IDAT", zlib.compress(rows.tobytes())), (b"IEND", b"")]
        return b"\x89PNG\r\n\x1a\n" + b"".join(_chunk(name, data) for name, data in chunks)

    def save(self, path: Union[str, os.PathLike[str]]) -> None:
        """Writes the PNG file."""
        with open(path, "wb") as file:
            file.write(self.png)

    def _repr_png_(self) -> bytes:
        return self.png

    def __repr__(self) -> str:
        height, width, components = self._array.shape
        return f"<anyhit.Picture: {width} x {height}, {components} components>"

    def _bytes(self) -> npt.NDArray[np.uint8]:
        import numpy as np

        array = self._array
        if array.dtype == np.uint8 and not self._srgb:
            return np.ascontiguousarray(array)
        scale = 255.0 if array.dtype == np.uint8 else 1.0
        # A NaN is black.
        values = np.clip(np.nan_to_num(array.astype(np.float64), nan=0.0) / scale, 0, 1)
        if self._srgb:
            light = values[..., : 3 if values.shape[2] > 2 else 1]
            light[...] = np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055)
        rounded: npt.NDArray[np.uint8] = np.rint(255 * values).astype(np.uint8)
        return rounded


def _chunk(name: bytes, data: bytes) -> bytes:
    return struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))


def _invalid(message: str) -> InvalidArgument:
    return InvalidArgument(f"error: {message}\n", {"kind": "InvalidArgument", "message": message})
