"""Model files give back what was written, and the same bytes for it; all else is one line that
names the file."""

import json
import zipfile

import numpy as np
import pytest

from strokestyle.files import VALUES, read_model, write_arrays, write_model

PAYLOAD = {
    "format": 2,
    "about": {"exemplar": "kärcher.png", "seed": 3},
    "hand": None,
    "nets": {
        "path": {
            "layers.0.weight": np.arange(6, dtype=np.float32).reshape(2, 3),
            "base": np.array(1.5),
        }
    },
    "names": ["a", "b"],
    "none": np.zeros((0, 4), np.uint8),
}


def same(a, b):
    if isinstance(a, dict):
        return a.keys() == b.keys() and all(same(a[k], b[k]) for k in a)
    if isinstance(a, np.ndarray):
        return a.dtype == b.dtype and a.shape == b.shape and np.array_equal(a, b)
    return a == b


def test_what_is_written_is_read_and_has_the_same_bytes(tmp_path):
    for name in "ab":
        write_model(tmp_path / name, PAYLOAD)
    assert same(PAYLOAD, read_model(tmp_path / "a"))
    assert (tmp_path / "a").read_bytes() == (tmp_path / "b").read_bytes()


def test_a_model_is_a_plain_zip_of_arrays(tmp_path):
    write_model(tmp_path / "m.pt", PAYLOAD)
    with np.load(tmp_path / "m.pt") as arrays:
        assert arrays["nets/path/base"] == 1.5
    with zipfile.ZipFile(tmp_path / "m.pt") as file:
        assert json.loads(file.read(VALUES))["about/exemplar"] == "kärcher.png"


def test_arrays_have_the_same_bytes_at_any_time(tmp_path):
    arrays = {"a": np.arange(6).reshape(2, 3), "b": np.array("text"), "c": np.zeros((2, 2)).T}
    write_arrays(tmp_path / "x.npz", arrays, {"note": "first"})
    with np.load(tmp_path / "x.npz") as found:
        assert all(np.array_equal(found[name], value) for name, value in arrays.items())
    with zipfile.ZipFile(tmp_path / "x.npz") as file:
        assert file.namelist() == ["note", "a.npy", "b.npy", "c.npy"]
        assert {entry.date_time[0] for entry in file.infolist()} == {1980}
        assert {entry.compress_type for entry in file.infolist()} == {zipfile.ZIP_DEFLATED}


def rewritten(path, change):
    with zipfile.ZipFile(path) as file:
        parts = {name: file.read(name) for name in file.namelist()}
    change(parts)
    with zipfile.ZipFile(path, "w") as file:
        for name, data in parts.items():
            file.writestr(name, data)


@pytest.mark.parametrize(
    "change, words",
    [
        (lambda parts: parts.pop(VALUES), "not a strokestyle model"),
        (lambda parts: parts.update({VALUES: b"{"}), "damaged"),
        (lambda parts: parts.update({VALUES: b"[]"}), "damaged"),
        (lambda parts: parts.update({VALUES: b"\xff"}), "damaged"),
        (lambda parts: parts.update({VALUES: b'{"format": 2, "format/x": 1}'}), "damaged"),
        (lambda parts: parts.update({"none.npy": b"\x93NUMPY"}), "damaged"),
        (lambda parts: parts.update({"none.npy": parts["nets/path/base.npy"][:-2]}), "damaged"),
        (lambda parts: parts.update(
            {"none.npy": parts["none.npy"].replace(b"(0, 4)", b"(9" + b"9" * 12 + b",)")}),
         "damaged"),
    ],
    ids=["no values", "half", "list", "bytes", "value as folder", "no header", "short array",
         "vast array"],
)  # fmt: skip
def test_damage_is_one_line(tmp_path, change, words):
    write_model(tmp_path / "m.pt", PAYLOAD)
    rewritten(tmp_path / "m.pt", change)
    with pytest.raises(ValueError, match=words) as error:
        read_model(tmp_path / "m.pt")
    assert str(tmp_path / "m.pt") in str(error.value) and "\n" not in str(error.value)


def test_a_flipped_bit_is_found(tmp_path):
    write_model(tmp_path / "m.pt", {"format": 2, "x": np.random.default_rng(0).random(1000)})
    data = bytearray((tmp_path / "m.pt").read_bytes())
    data[len(data) // 2] ^= 1
    (tmp_path / "m.pt").write_bytes(data)
    with pytest.raises(ValueError, match="damaged"):
        read_model(tmp_path / "m.pt")
