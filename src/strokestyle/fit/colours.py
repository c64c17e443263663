"""Colours of a file, by its profile or chromaticities, as sRGB."""

from __future__ import annotations

import io

import numpy as np
from PIL import Image, ImageCms

from .raster import Raster

SAME = 1.01  # of 255: what a conversion moves colours at most where there is nothing to convert
SRGB_GAMMA = 1 / 2.2
SRGB_PRIMARIES = (0.3127, 0.329, 0.64, 0.33, 0.3, 0.6, 0.15, 0.06)
SRGB_TO_XYZ = np.array(
    [[0.4124564, 0.3575761, 0.1804375], [0.2126729, 0.7151522, 0.072175],
     [0.0193339, 0.119192, 0.9503041]]
)  # fmt: skip
BRADFORD = np.array(
    [[0.8951, 0.2664, -0.1614], [-0.7502, 1.7135, 0.0367], [0.0389, -0.0685, 1.0296]]
)
WHITE_D65 = np.array([0.95047, 1.0, 1.08883])


def to_srgb(colours: np.ndarray, raster: Raster) -> tuple[np.ndarray, str]:
    """Convert straight colours (h, w, n) in [0, 1] of a raster to (h, w, 3) float32 sRGB.

    Returns them with a note for the user, empty where there is nothing to say.
    """
    space = raster.space
    if space == "LAB":
        return _transformed(colours, "LAB", ImageCms.createProfile("LAB")), ""
    profile, note = _profile(raster)
    if profile is not None:
        try:
            return _by_profile(colours, space, profile), note
        except ImageCms.PyCMSError:
            note = "its colour profile is damaged, and left out"
    if space == "CMYK":
        image = Image.fromarray(_bytes(colours), "CMYK").convert("RGB")
        return np.asarray(image, np.float32) / 255.0, note or (
            "CMYK without a colour profile: its inks are taken as plain ones"
        )
    if profile is None and raster.gamma:
        colours = _by_chromaticity(colours, raster.gamma, raster.primaries)
    return np.broadcast_to(colours, colours.shape[:2] + (3,)).astype(np.float32), note


def _profile(raster: Raster) -> tuple[ImageCms.ImageCmsProfile | None, str]:
    """The profile of a raster where there is one that says what its samples mean, and a note."""
    if not raster.profile:
        return None, ""
    try:
        profile = ImageCms.ImageCmsProfile(io.BytesIO(raster.profile))
        space = profile.profile.xcolor_space.strip()
    except (OSError, ValueError, ImageCms.PyCMSError):
        return None, "its colour profile is damaged, and left out"
    means = {"GRAY": "L", "RGB": "RGB", "CMYK": "CMYK"}.get(space, space)
    if means == raster.space or (means, raster.space) == ("RGB", "L"):
        return profile, ""
    return None, f"its colour profile is one of {space} colours, its pixels are not: left out"


def _by_profile(colours: np.ndarray, space: str, profile: ImageCms.ImageCmsProfile) -> np.ndarray:
    """Colours (h, w, n) by a profile, as sRGB; as they are where it is sRGB itself."""
    if space == "L":  # a curve, at the precision of the numbers
        ramp = np.linspace(0, 1, 256, dtype=np.float32)
        rgb = profile.profile.xcolor_space.strip() == "RGB"
        grey = np.repeat(ramp[None, :, None], 3 if rgb else 1, axis=2)
        table = _transformed(grey, "RGB" if rgb else "L", profile)[0]
        if np.abs(table - ramp[:, None]).max() * 255 <= SAME:
            return np.repeat(colours, 3, axis=-1)
        planes = [np.interp(colours[..., 0], ramp, table[:, k]) for k in range(3)]
        return np.stack(planes, axis=-1).astype(np.float32)
    if space == "RGB":
        steps = np.linspace(0, 1, 16, dtype=np.float32)
        grid = np.stack(np.meshgrid(steps, steps, steps), axis=-1).reshape(16, -1, 3)
        if np.abs(_transformed(grid, space, profile) - grid).max() * 255 <= SAME:
            return colours
    return _transformed(colours, space, profile)


def _transformed(colours: np.ndarray, space: str, profile: object) -> np.ndarray:
    """Colours (h, w, n) through littleCMS, at 8 bits a sample: white to white, black to black.

    Greys are not to be optimised: it puts a coarse table in place of their curve, which is 7 of
    255 off in the darks of a linear one.
    """
    flags = ImageCms.Flags.BLACKPOINTCOMPENSATION
    if space == "L":
        flags |= ImageCms.Flags.NOOPTIMIZE
    samples = _bytes(colours)
    if space == "LAB":
        samples ^= np.array([0, 128, 128], np.uint8)  # shifted to signed
    image = Image.fromarray(samples[..., 0] if space == "L" else samples, space)
    transform = ImageCms.buildTransform(
        profile,  # type: ignore[arg-type]
        ImageCms.createProfile("sRGB"),
        space,
        "RGB",
        renderingIntent=ImageCms.Intent.RELATIVE_COLORIMETRIC,
        flags=flags,
    )
    done = ImageCms.applyTransform(image, transform)
    assert done is not None  # None is for work in place
    return np.asarray(done, np.float32) / 255.0


def _bytes(colours: np.ndarray) -> np.ndarray:
    return (colours.clip(0, 1) * 255.0 + 0.5).astype(np.uint8)


def _by_chromaticity(colours: np.ndarray, gamma: float, primaries: tuple[float, ...]) -> np.ndarray:
    """Colours (h, w, 1 or 3) of a PNG's gAMA and cHRM chunks, as sRGB.

    PNG specification, third edition, 11.3.2.1 and 11.3.2.2; adapted to D65 by Bradford's matrix.
    """
    same = len(primaries) != len(SRGB_PRIMARIES) or np.allclose(
        primaries, SRGB_PRIMARIES, atol=0.004
    )
    if same and abs(np.log(gamma / SRGB_GAMMA)) < 0.02:
        return colours
    linear = colours.astype(np.float64) ** (1.0 / gamma)
    if not same and colours.shape[-1] == 3:
        linear = linear @ (np.linalg.inv(SRGB_TO_XYZ) @ _to_xyz(primaries)).T
    linear = linear.clip(0, 1)
    return np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)


def _to_xyz(primaries: tuple[float, ...]) -> np.ndarray:
    """(3, 3) from linear RGB of these primaries to CIE XYZ under D65."""
    xyz = np.array([[x / y, 1.0, (1 - x - y) / y] for x, y in np.reshape(primaries, (4, 2))])
    white, colours = xyz[0], xyz[1:].T
    matrix = colours * np.linalg.solve(colours, white)
    scale = (BRADFORD @ WHITE_D65) / (BRADFORD @ white)
    return np.linalg.inv(BRADFORD) @ (scale[:, None] * BRADFORD) @ matrix
