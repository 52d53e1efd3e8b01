"""MP4 films (H.264), by imageio-ffmpeg, which brings its own ffmpeg."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Final

import numpy as np

from posse_training.errors import SettingsError, require
from posse_training.reports.pictures.gif import Frame

_LEAST_RATE: Final = 10.0  # frames per second; slower films repeat frames, as some players need
_QUALITY: Final = 7.0  # of 10


def check_mp4() -> None:
    """Raise unless MP4 films can be written.

    Raises:
        MissingExtraError: imageio-ffmpeg is not installed.
    """
    require("video", "imageio_ffmpeg")


def write_mp4(path: Path, frames: Sequence[Frame], frame_time: float) -> None:
    """Write frames (H, W, 3) as an MP4 film, ``frame_time`` s each.

    H.264 with 4:2:0 colours wants even sides: an odd one is extended by its last row or column.

    Raises:
        MissingExtraError: imageio-ffmpeg is not installed.
        SettingsError: ffmpeg failed; the message holds what it says.
    """
    check_mp4()
    import imageio_ffmpeg

    height, width, _ = frames[0].shape
    even = ((0, height % 2), (0, width % 2), (0, 0))
    repeats = max(1, int(np.ceil(_LEAST_RATE * frame_time - 1e-9)))
    writer = imageio_ffmpeg.write_frames(
        str(path), (width + width % 2, height + height % 2), fps=repeats / frame_time,
        codec="libx264", quality=_QUALITY, macro_block_size=2, ffmpeg_log_level="error",
        output_params=["-movflags", "+faststart"],
    )  # fmt: skip
    writer.send(None)
    try:
        for frame in frames:
            padded = np.ascontiguousarray(np.pad(frame, even, mode="edge"))
            for _ in range(repeats):
                writer.send(padded)
    except OSError as error:
        raise SettingsError(f"ffmpeg could not write {path}: {error}") from error
    finally:
        writer.close()
