"""Check the metrics against values that others have published: theirs and ours, side by side.

    python experiments/check_metrics.py

All are of the examples in the documentation of torchmetrics, whose images are noise of a known
seed. There the network is made after the seed is set, and its first weights are drawn and then
thrown away; so as many numbers are drawn here before the images. It takes a minute or two."""

import sys
from collections.abc import Callable

import numpy as np
import torch
from metrics.frechet import frechet_distance
from metrics.inception import Inception
from metrics.kid import kid
from metrics.lpips import Lpips
from metrics.weights import NoWeights, load_arrays

# numbers that torchvision's VGG16 with its classifier, and five heads, are begun with
VGG16_BEGINNING = 138_357_544 + 64 + 128 + 256 + 512 + 512
CLASSIFIER = 2048 * 1008 + 1008  # of Inception


def seeded(drawn: int) -> None:
    """Seed torch as the examples do, and draw what their networks were begun with."""
    torch.manual_seed(123)
    while drawn > 0:
        torch.rand(min(drawn, 10_000_000))
        drawn -= 10_000_000


def lpips_of_noise(signed: bool) -> float:
    """LPIPS (VGG16) of ten pairs of noise, 100 px, in [-1, 1], or in [0, 1] and taken for that."""
    net = Lpips("vgg16")
    seeded(VGG16_BEGINNING)
    first, second = (torch.rand(10, 3, 100, 100).permute(0, 2, 3, 1).numpy() for _ in range(2))
    if not signed:  # v is taken for an image of [-1, 1], which (v + 1) / 2 is in [0, 1]
        first, second = (first + 1) / 2, (second + 1) / 2
    return float(np.mean([net.distance(a, b) for a, b in zip(first, second, strict=True)]))


def features_of_noise() -> dict[int, list[np.ndarray]]:
    """Inception's features, 64 and 2048, of twice a hundred images of noise."""
    net, found = Inception(), {64: [], 2048: []}
    arrays = load_arrays("inception")
    seeded(sum(v.size for name, v in arrays.items() if name.endswith("/weight")) + CLASSIFIER)
    shape = (100, 3, 299, 299)
    sets = [
        torch.randint(low, high, shape, dtype=torch.uint8) for low, high in ((0, 200), (100, 255))
    ]
    for images in sets:
        means = []
        with torch.no_grad():
            for some in images.split(10):
                means.append(net.first_maps((some.float() - 128) / 128).mean((2, 3)).numpy())
        found[64].append(np.concatenate(means))
        found[2048].append(net.features(images.permute(0, 2, 3, 1).numpy() / np.float32(255)))
    return found


def main() -> None:
    """Print one line for each value."""
    print("| value | published | here |\n| --- | --- | --- |", flush=True)
    lines: list[tuple[str, str, Callable[[], float]]] = [
        (
            "LPIPS, VGG, noise in [-1, 1] (torchmetrics 0.10)",
            "0.3493",
            lambda: lpips_of_noise(True),
        ),
        ("LPIPS, VGG, noise in [0, 1] (torchmetrics 0.7)", "0.3566", lambda: lpips_of_noise(False)),
    ]
    try:
        for name, published, measure in lines:
            print(f"| {name} | {published} | {measure():.4f} |", flush=True)
        noise = features_of_noise()
    except NoWeights as error:
        sys.exit(str(error))
    print(f"| FID, 64 features (torchmetrics 1.4) | 12.7202 | {frechet_distance(*noise[64]):.4f} |")
    print(f"| KID (torchmetrics 1.4) | 0.0337 ± 0.0023 | {kid(*noise[2048]):.4f} |")


if __name__ == "__main__":
    main()
