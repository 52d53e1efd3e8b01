"""Animated GIFs of flat colours, small and without dithering."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Final

import numpy as np
import numpy.typing as npt
from PIL import Image

from posse.rendering.style import PALETTE
from posse_baselines.files import replacing

Frame = npt.NDArray[np.uint8]

_BLENDS: Final = 64  # colours for fading and anti-aliased edges
_UNKNOWN: Final = 255
_SAMPLED: Final = 12  # frames that the palette is made from
_LAST_SHOWN: Final = 1.5  # s, before the film repeats


def write_gif(path: Path, frames: Sequence[Frame], frame_time: float) -> None:
    """Write frames (H, W, 3) as a GIF that repeats for ever, ``frame_time`` s each.

    All frames share one palette and are not dithered. Pixels equal to the previous frame's are
    transparent, which compresses well.
    """
    palette = _Palette(frames)
    clear = len(palette.entries)
    # The transparent colour has an entry too: strict readers refuse an index beyond the table.
    table = palette.entries.tobytes() + bytes(3)
    images: list[Image.Image] = []
    before: Frame | None = None
    for frame in frames:
        indices = palette.indices(frame)
        changed = indices if before is None else np.where(indices == before, clear, indices)
        before = indices
        image = Image.fromarray(changed.astype(np.uint8))
        image.putpalette(table)
        images.append(image)
    # In 1/1000 s; a GIF counts in 1/100 s, and players slow down frames of less than 2/100 s.
    shown_for = max(2, round(frame_time * 100)) * 10
    times = [shown_for] * len(images)
    times[-1] = max(shown_for, round(_LAST_SHOWN * 1000))
    with replacing(path) as part:
        images[0].save(
            part,
            save_all=True,
            append_images=images[1:],
            duration=times,
            loop=0,
            disposal=1,  # each frame is drawn over the previous one
            transparency=clear,
            optimize=False,
        )


class _Palette:
    """The colours of all frames of a film: at most 255, since one index means transparent.

    The flat colours of the pictures are included exactly, however small their areas; the blends
    between them share the remaining entries.

    Attributes:
        entries: (K, 3) red, green, blue.
    """

    def __init__(self, frames: Sequence[Frame]) -> None:
        chosen = np.unique(np.linspace(0, len(frames) - 1, _SAMPLED).round().astype(int))
        codes, counts = np.unique([_codes(frames[k]) for k in chosen], return_counts=True)
        # Weighted by the logarithm of its area, so that small robots count as well as the arena.
        blends = _colours(np.repeat(codes, np.log2(counts).astype(int) + 1))
        image = Image.fromarray(blends[None]).quantize(_BLENDS, method=Image.Quantize.MEDIANCUT)
        shared = np.reshape(image.getpalette() or [], (-1, 3))[:_BLENDS]
        self.entries = np.concatenate([np.array(PALETTE), shared]).astype(np.uint8)
        self._index = np.full(1 << 24, _UNKNOWN, np.uint8)  # by code, filled on demand

    def indices(self, frame: Frame) -> Frame:
        """Return the (H, W) indices of the entries nearest to a frame's colours."""
        codes = _codes(frame)
        found = self._index[codes]
        new = np.unique(codes[found == _UNKNOWN])
        if len(new):
            apart = _colours(new)[:, None].astype(np.int32) - self.entries
            self._index[new] = (apart**2).sum(axis=-1).argmin(axis=-1)
            found = self._index[codes]
        return found


def _codes(frame: Frame) -> npt.NDArray[np.int32]:
    """Return the (H, W) colours of a frame as 0xRRGGBB."""
    codes: npt.NDArray[np.int32] = frame.astype(np.int32) @ np.array([1 << 16, 1 << 8, 1], np.int32)
    return codes


def _colours(codes: npt.NDArray[np.int32]) -> Frame:
    """Return (..., 3) red, green, blue of colours coded as 0xRRGGBB."""
    return np.stack([codes >> 16, (codes >> 8) & 255, codes & 255], axis=-1).astype(np.uint8)
