"""Nothing is half-written: the old file stays until the new one is whole."""

import errno

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


def test_errors_of_the_disk_name_the_file_that_was_to_be(tmp_path):
    path = tmp_path / "a.svg"

    def full(name):
        raise OSError(errno.ENOSPC, "No space left on device")  # what writing to a file raises

    with pytest.raises(OSError, match="a.svg") as told:
        replace_file(path, full)
    assert (told.value.errno, told.value.filename) == (errno.ENOSPC, str(path))
    with pytest.raises(OSError) as told:
        write_bytes(tmp_path / (252 * "a" + ".svg"), b"")
    assert told.value.filename.endswith("aa.svg") and told.value.filename2 is None
    assert not list(tmp_path.iterdir())


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
