"""Arrays out of other people's pickles, without running what is in them.

A pickle may call any function that it can name. These readers hand it nothing but what builds an
array, a list or a dictionary, so that all a hostile file can do is to be refused."""

import io
import pickle
import zipfile
from typing import Any

import numpy as np


class Refused(ValueError):
    """A file asks for more than arrays."""


class _ArrayReader(pickle.Unpickler):
    """Pickled numpy arrays in nested dictionaries."""

    # where numpy 1 and 2 keep the functions that its pickles name
    MODULES = {"numpy", "numpy.core.multiarray", "numpy._core.multiarray"}
    MAKERS = {
        "ndarray": np.ndarray,
        "dtype": np.dtype,
        "_reconstruct": np.zeros(0).__reduce__()[0],
    }

    def find_class(self, module: str, name: str) -> Any:
        """Give a maker of arrays; raises `Refused` for all else."""
        if module in self.MODULES and name in self.MAKERS:
            return self.MAKERS[name]
        raise Refused(f"its pickle asks for {module}.{name}, where only arrays are expected")


class _Module:
    """Stands for any module of a TorchScript archive: BUILD fills its `__dict__`."""


class _FloatStorage:
    """The one kind of storage that is read."""


class _ScriptReader(pickle.Unpickler):
    """`data.pkl` of a TorchScript archive: modules become `_Module`, tensors become arrays."""

    def __init__(self, archive: zipfile.ZipFile, folder: str):
        super().__init__(io.BytesIO(archive.read(f"{folder}/data.pkl")))
        self.archive, self.folder = archive, folder

    def find_class(self, module: str, name: str) -> Any:
        """Give a stand-in for what the archive names; raises `Refused` for all else."""
        known = {
            "torch.FloatStorage": _FloatStorage,
            "torch._utils._rebuild_tensor_v2": _tensor,
            "torch.jit._pickle.build_intlist": list,
            "collections.OrderedDict": dict,
        }
        if module.startswith("__torch__."):
            return _Module
        if f"{module}.{name}" in known:
            return known[f"{module}.{name}"]
        raise Refused(f"its pickle asks for {module}.{name}, where only tensors are expected")

    def persistent_load(self, saved: Any) -> np.ndarray:
        """Read a storage: ("storage", type, key, device, count)."""
        kind, storage, key, _, count = saved
        if kind != "storage" or storage is not _FloatStorage or not str(key).isdigit():
            raise Refused(f"its pickle asks for storage {saved!r}")
        values = np.frombuffer(self.archive.read(f"{self.folder}/data/{key}"), "<f4")
        if values.size != count:
            raise Refused(f"storage {key} holds {values.size} numbers, not {count}")
        return values


def _tensor(storage: np.ndarray, offset: int, shape: tuple, strides: tuple, *_: Any) -> np.ndarray:
    """Cut a tensor out of its storage; only whole ones in C order are known."""
    order = np.cumprod((1, *shape[::-1]), dtype=np.int64)[:-1][::-1]
    if offset != 0 or tuple(strides) != tuple(order) or storage.size != np.prod(shape, dtype=int):
        raise Refused(f"a tensor of shape {shape} with strides {strides} is not in C order")
    return storage.reshape(shape)


def read_arrays(data: bytes) -> dict[str, np.ndarray]:
    """Read a pickle of nested dictionaries of float arrays: "a/b/c" -> array.

    Raises `Refused` if anything else is in it."""
    return dict(_leaves(_load(_ArrayReader(io.BytesIO(data)))))


def read_torchscript(data: bytes) -> dict[str, np.ndarray]:
    """Read the tensors of a TorchScript archive, none of its code: "a/b/c" -> float32 array.

    Raises `Refused` if anything else is in it."""
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            folder = next(n for n in archive.namelist() if n.endswith("/data.pkl")).split("/")[0]
            return dict(_leaves(_load(_ScriptReader(archive, folder))))
    except (zipfile.BadZipFile, StopIteration, KeyError) as error:
        raise Refused(f"it is no whole TorchScript archive ({error})") from None


def _load(reader: pickle.Unpickler) -> Any:
    try:
        return reader.load()
    except Refused:
        raise
    except Exception as error:  # a broken pickle may raise anything
        raise Refused(f"its pickle is broken ({error})") from None


def _leaves(tree: Any, prefix: str = ""):
    """Walk the arrays of nested dictionaries and modules."""
    entries = tree.__dict__ if isinstance(tree, _Module) else tree
    if not isinstance(entries, dict):
        raise Refused(f"a {type(tree).__name__} was found, where a dictionary is expected")
    for name, value in entries.items():
        if isinstance(value, np.ndarray):
            if value.dtype.kind != "f":
                raise Refused(f"{prefix}{name} is an array of {value.dtype}, not of floats")
            yield f"{prefix}{name}", value
        elif isinstance(value, dict | _Module):
            yield from _leaves(value, f"{prefix}{name}/")
