"""Files of the user's: what is written follows no link and replaces nothing but files; locks leave what they lie in as it is."""

from __future__ import annotations

import errno
import os
import socket
from pathlib import Path

import pytest

import ncgen
from ncgen.files import contents, locked, opened, put, write_text, writing


@pytest.fixture
def special(tmp_path, monkeypatch):
    """{kind: a path that is no ordinary file}."""
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "folder").mkdir()
    monkeypatch.chdir(tmp_path)  # the name of a socket is short
    with socket.socket(socket.AF_UNIX) as listening:
        listening.bind("socket")
        yield {
            "a pipe": tmp_path / "pipe",
            "a folder": tmp_path / "folder",
            "a device": Path("/dev/zero"),
            "a socket|No such device": tmp_path / "socket",
        }


def test_only_ordinary_files_are_opened(special, tmp_path):
    """Nothing waits for whoever might write into a pipe, and a device, which never ends, is not read."""
    for kind, path in special.items():
        with pytest.raises(OSError, match=kind):
            opened(path)
    for name in ("no\0file", "x" * 5000, "missing"):
        with pytest.raises(OSError, match="name|No such file"):
            opened(tmp_path / name)
    (tmp_path / "file").write_bytes(b"abc")
    (tmp_path / "link").symlink_to("file")
    assert contents(tmp_path / "link", 3) == b"abc"
    with pytest.raises(OSError, match="more than 2 bytes"):
        contents(tmp_path / "file", 2)


def test_a_lock_changes_nothing(tmp_path):
    """A link to a file of the user's, which opening for writing would empty; a file with text in it; a pipe."""
    letter, lock = tmp_path / "letter.txt", tmp_path / ".lock"
    letter.write_text("dear")
    lock.symlink_to(letter)
    with pytest.raises(OSError, match="it is a symbolic link") as caught, locked(lock):
        pass
    assert caught.value.errno == errno.ELOOP and letter.read_text() == "dear"
    with locked(letter) as ours, locked(letter) as theirs:
        assert ours and not theirs
    assert letter.read_text() == "dear"
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(OSError, match="it is a pipe"), locked(tmp_path / "pipe"):
        pass


def test_writing_follows_no_link_and_replaces_files_only(tmp_path):
    """What stands under a guessable temporary name stays, and so do a folder, a pipe and a device where a file should be."""
    letter = tmp_path / "letter.txt"
    letter.write_text("dear")
    (tmp_path / "link.txt").symlink_to(letter)
    write_text(tmp_path / "link.txt", "new")
    assert letter.read_text() == "dear" and (tmp_path / "link.txt").read_text() == "new"
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "folder").mkdir()
    for path, kind in ((tmp_path / "pipe", "a pipe"), (tmp_path / "folder", "a folder"), (Path("/dev/null"), "a device")):
        with pytest.raises(OSError, match=f"{kind} stands there"):
            put(path, b"", ".x.")
        with pytest.raises(ncgen.NcgenError, match=f"cannot be written: {kind} stands there; choose another"):
            write_text(path, "")
    with pytest.raises(ncgen.NcgenError, match="no file can have this name"):
        write_text(tmp_path / "a\0b", "")
    with pytest.raises(KeyError), writing(tmp_path / "half.txt") as file:
        file.write(b"half")
        raise KeyError
    assert {path.name for path in tmp_path.iterdir()} == {"letter.txt", "link.txt", "pipe", "folder"}
