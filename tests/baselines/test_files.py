"""Files are written as a whole or not at all, and nowhere but where they are named."""

import errno
from pathlib import Path

import pytest

from posse_baselines.files import remove_unfinished, replacing, write_atomically


@pytest.mark.parametrize("error", [KeyboardInterrupt(), OSError(errno.ENOSPC, "the disk is full")])
def test_an_error_while_writing_leaves_the_old_file_alone(tmp_path: Path, error: BaseException) -> None:
    path = tmp_path / "file.txt"
    write_atomically(path, b"old")

    def write_half() -> None:
        with replacing(path) as partial:
            partial.write_bytes(b"half")
            raise error

    with pytest.raises(type(error)) as caught:
        write_half()
    assert str(caught.value) in ("", f"[Errno {errno.ENOSPC}] the disk is full: {str(path)!r}")
    assert path.read_bytes() == b"old"
    with pytest.raises(IsADirectoryError, match=f"directory: {str(tmp_path)!r}$"):
        write_atomically(tmp_path, b"new")
    assert list(tmp_path.iterdir()) == [path]


def test_what_a_killed_writer_left_is_removed(tmp_path: Path) -> None:
    kept = tmp_path / ".posse-notes"
    kept.touch()
    (tmp_path / f".posse-{'0123456789abcdef'}.safetensors").write_bytes(b"half")
    remove_unfinished(tmp_path)
    assert list(tmp_path.iterdir()) == [kept]
