"""MP4 films (H.264), by the ffmpeg that imageio-ffmpeg brings."""

from __future__ import annotations

import contextlib
import itertools
import math
import subprocess
import tempfile
from collections.abc import Iterable
from pathlib import Path
from typing import IO, Final

import numpy as np

from posse_baselines.files import replacing
from posse_training.errors import SettingsError, require
from posse_training.reports.pictures.gif import Frame

_LEAST_RATE: Final = 10.0  # frames per second; slower films repeat frames, as some players need
_QUALITY: Final = "20"  # constant rate factor: 0 is lossless, 51 the worst


def check_mp4() -> None:
    """Raise unless MP4 films can be written.

    Raises:
        MissingExtraError: imageio-ffmpeg is not installed.
    """
    require("video", "imageio_ffmpeg")


def write_mp4(path: Path, frames: Iterable[Frame], frame_time: float) -> None:
    """Write one or more frames (H, W, 3) as an MP4 film, ``frame_time`` s each.

    Each frame is written before the next one is taken, so that a long film needs little memory. An
    old file is replaced when the film is complete. H.264 with 4:2:0 colours needs even sides: an
    odd one is extended by its last row or column.

    Raises:
        MissingExtraError: imageio-ffmpeg is not installed.
        SettingsError: ffmpeg failed; the message holds its own.
    """
    check_mp4()
    import imageio_ffmpeg

    rest = iter(frames)
    first = next(rest)
    height, width = (side + side % 2 for side in first.shape[:2])
    even = ((0, height - first.shape[0]), (0, width - first.shape[1]), (0, 0))
    repeats = max(1, math.ceil(_LEAST_RATE * frame_time - 1e-9))
    command = [
        imageio_ffmpeg.get_ffmpeg_exe(),
        "-y",
        "-loglevel",
        "error",
        "-f",
        "rawvideo",
        "-pix_fmt",
        "rgb24",
        "-s",
        f"{width}x{height}",
        "-r",
        f"{repeats / frame_time:.6f}",
        "-i",
        "-",
        "-c:v",
        "libx264",
        "-crf",
        _QUALITY,
        "-pix_fmt",
        "yuv420p",
        "-movflags",
        "+faststart",
    ]
    padded = (np.pad(frame, even, mode="edge").tobytes() * repeats for frame in itertools.chain([first], rest))
    with replacing(path) as part, tempfile.TemporaryFile() as messages:
        if not _pipe([*command, str(part)], padded, messages):
            messages.seek(0)
            said = messages.read().decode(errors="replace").strip()
            raise SettingsError(f"ffmpeg could not write {path}: {said or 'no reason given'}")


def _pipe(command: list[str], data: Iterable[bytes], messages: IO[bytes]) -> bool:
    """Run a program on data, its errors written to a file; return whether it succeeded."""
    with subprocess.Popen(command, stdin=subprocess.PIPE, stderr=messages) as program:
        assert program.stdin is not None
        try:
            for piece in data:
                program.stdin.write(piece)
            program.stdin.close()
        except BrokenPipeError:  # it has ended; its status says why
            with contextlib.suppress(BrokenPipeError):
                program.stdin.close()
        except BaseException:
            program.kill()
            raise
        return program.wait() == 0
