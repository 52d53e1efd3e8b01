"""Files are written as a whole or not at all, and nowhere but where they are named."""

import errno
import threading
from pathlib import Path

import pytest

from posse_baselines.files import read_json, remove_unfinished, replacing, write_atomically


def test_files_of_writers_at_once_are_whole(tmp_path: Path) -> None:
    path, contents = tmp_path / "file", [bytes([k]) * 200_000 for k in range(4)]
    path.write_bytes(contents[0])

    def write(content: bytes) -> None:
        for _ in range(20):
            write_atomically(path, content)

    writers = [threading.Thread(target=write, args=(content,)) for content in contents]
    for writer in writers:
        writer.start()
    while any(writer.is_alive() for writer in writers):
        assert path.read_bytes() in contents
    assert path.read_bytes() in contents
    assert list(tmp_path.iterdir()) == [path]


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
    assert getattr(caught.value, "filename", str(path)) == str(path)
    assert path.read_bytes() == b"old"
    assert list(tmp_path.iterdir()) == [path]


def test_what_a_killed_writer_left_is_removed(tmp_path: Path) -> None:
    kept = tmp_path / ".posse-notes"
    kept.touch()
    (tmp_path / f".posse-{'0123456789abcdef'}.safetensors").write_bytes(b"half")
    remove_unfinished(tmp_path)
    assert list(tmp_path.iterdir()) == [kept]


@pytest.mark.parametrize("text", ["[" * 100_000, "{", "9" * 5000, ""])
def test_json_that_cannot_be_read(tmp_path: Path, text: str) -> None:
    (tmp_path / "file.json").write_text(text)
    with pytest.raises(ValueError, match=r"nested too deeply|Expecting|digits"):
        read_json(tmp_path / "file.json")
