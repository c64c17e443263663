"""Nothing is half-written: the old file stays until the new one is whole."""

import pytest

from strokestyle.files import check_writable, replace_file, write_bytes


def test_a_failed_write_leaves_the_old_file_and_no_litter(tmp_path):
    path = tmp_path / "a.svg"
    write_bytes(path, b"old")

    def broken(name):
        with open(name, "wb") as file:
            file.write(b"half")
        raise RuntimeError("power cut")

    with pytest.raises(RuntimeError):
        replace_file(path, broken)
    assert path.read_bytes() == b"old"
    assert list(tmp_path.iterdir()) == [path]


def test_it_replaces(tmp_path):
    path = tmp_path / "a.svg"
    write_bytes(path, b"old")
    path.chmod(0o640)
    write_bytes(path, b"new")
    assert path.read_bytes() == b"new"
    assert path.stat().st_mode & 0o777 == 0o640
    assert list(tmp_path.iterdir()) == [path]


def test_places_that_cannot_be_written_are_named(tmp_path):
    with pytest.raises(IsADirectoryError, match="is a folder"):
        check_writable(tmp_path)
    with pytest.raises(FileNotFoundError, match="no folder"):
        write_bytes(tmp_path / "missing" / "a.svg", b"")
    file = tmp_path / "file"
    file.write_text("x")
    with pytest.raises(FileNotFoundError, match="no folder"):
        check_writable(file / "a.svg")
