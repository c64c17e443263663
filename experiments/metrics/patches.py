"""Patches of drawings that hold ink: many looks at the marks of a few drawings.

A dozen drawings are too few for FID, and most of a drawing is paper. So the same distances are
measured of patches too: squares of a quarter of the drawing's longer side (64 px of 256), half a
patch apart, those whose mean ink is at least 1 %. Each is brought to 128 px (twice as large at 256
px), so that a stroke is as wide as the edges that the network was trained to see, and the network's
last maps are averaged over what is left of them (2 x 2).

Sources: the single-image FID of Shaham, Dekel & Michaeli, SinGAN, ICCV 2019, sec. 3.1, compares the
inner statistics of one image; Chai et al., Any-resolution training for high-resolution image
synthesis, ECCV 2022, sec. 4, measure FID of patches, as here."""

import numpy as np

INK = 0.01  # the least mean of 1 - min(R, G, B)
SIDE = 128  # px, at which a patch is looked at


def inked_patches(image: np.ndarray) -> np.ndarray:
    """Cut the patches that hold ink out of a drawing (H, W, 3) in [0, 1]: (N, p, p, 3)."""
    side = max(1, round(max(image.shape[:2]) / 4))
    step = max(1, side // 2)
    windows = np.lib.stride_tricks.sliding_window_view(image, (side, side), axis=(0, 1))
    windows = windows[::step, ::step].reshape(-1, 3, side, side)  # (row, column, channel, ..)
    held = 1 - windows.min(1).mean((1, 2)) >= INK
    return windows[held].transpose(0, 2, 3, 1)
