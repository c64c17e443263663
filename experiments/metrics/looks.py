"""What networks see in drawings, worked out once for each drawing and kept on disk."""

import hashlib
import json
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from metrics.inception import Inception
from metrics.lpips import Lpips
from metrics.marks import marks_distance, marks_of
from metrics.patches import SIDE, inked_patches
from metrics.weights import save_arrays
from strokestyle.files import write_bytes

VERSION = "1"  # of what is kept; another one is not read


class Looks:
    """The features of images, and distances by them, kept in a folder.

    They are found again by what is in the images, not by names, so that a folder may be used for
    drawings that come and go. Images are (H, W, 3) float32 in [0, 1]. Networks are loaded when
    something is first asked of them; then `NoWeights` may be raised."""

    def __init__(self, folder: Path, device: str = "cpu"):
        self.folder, self.device = Path(folder), device
        self.folder.mkdir(parents=True, exist_ok=True)
        self._nets: dict[str, Lpips | Inception] = {}
        self._numbers_file = self.folder / "numbers.json"
        self._numbers: dict[str, float] = {}
        if self._numbers_file.exists():
            self._numbers = json.loads(self._numbers_file.read_text())

    def whole(self, image: np.ndarray) -> np.ndarray:
        """Inception's features of a drawing: (2048,)."""
        return self._kept("whole", image, lambda: self._inception().features(image[None]))[0]

    def patches(self, image: np.ndarray) -> np.ndarray:
        """Inception's features of a drawing's patches with ink: (N, 2048)."""
        return self._kept(
            "patches", image, lambda: self._inception().features(inked_patches(image), SIDE)
        )

    def lpips(self, network: str, a: np.ndarray, b: np.ndarray) -> float:
        """LPIPS of two drawings through "alexnet" or "vgg16"."""
        return self._number(network, [a, b], lambda: self._lpips(network).distance(a, b))

    def marks(self, a: Sequence[np.ndarray], b: Sequence[np.ndarray]) -> float:
        """How far the marks of two sets of drawings are apart."""

        def look() -> float:
            net = self._lpips("alexnet")
            return marks_distance(
                *(np.concatenate([marks_of(net, image) for image in images]) for images in (a, b))
            )

        return self._number(f"marks {len(a)}", [*a, *b], look)

    def save(self) -> None:
        """Write the distances down; features are written when they are made."""
        write_bytes(self._numbers_file, json.dumps(self._numbers, indent=0).encode())

    def _number(self, kind: str, images: list[np.ndarray], look: Callable[[], float]) -> float:
        key = f"{VERSION} {kind} {digest(*images)}"
        if key not in self._numbers:
            self._numbers[key] = look()
        return self._numbers[key]

    def _kept(self, kind: str, image: np.ndarray, look: Callable[[], np.ndarray]) -> np.ndarray:
        path = self.folder / f"{kind}-{VERSION}-{digest(image)}.npz"
        if not path.exists():
            save_arrays(path, {"features": look()})
        with np.load(path, allow_pickle=False) as file:
            return file["features"]

    def _lpips(self, network: str) -> Lpips:
        if network not in self._nets:
            self._nets[network] = Lpips(network, self.device)
        return self._nets[network]  # type: ignore[return-value]

    def _inception(self) -> Inception:
        if "inception" not in self._nets:
            self._nets["inception"] = Inception(self.device)
        return self._nets["inception"]  # type: ignore[return-value]


def digest(*images: np.ndarray) -> str:
    """Name images by what is in them."""
    sha = hashlib.sha256()
    for image in images:
        sha.update(f"{image.shape} {image.dtype}".encode())
        sha.update(np.ascontiguousarray(image).data)
    return sha.hexdigest()[:32]
