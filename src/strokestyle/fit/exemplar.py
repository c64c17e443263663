"""The artist's drawing, read from any image file: paper told from ink, ink colour from opacity, and a soft stroke mask.

No paper describes this stage; the paper only asks for "a binary mask, anti-aliased" (sec. 4). What is done here:
paper = a smooth field of block medians; opacity = the least that explains a pixel's difference from its paper, on a
scale where the drawing's strongest ink is opaque; mask = that opacity, closed over the grain just as far as it takes.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from PIL import Image, ImageOps
from scipy import ndimage
from scipy.spatial import cKDTree

from .registration import Similarity, register

MAX_PIXELS = 200_000_000
BLOCK = 48  # px; paper colour is taken per block
GRAIN_SIGMAS = (
    0.0,
    0.7,
    1.0,
    1.4,
    1.8,
    2.3,
    2.8,
)  # px; blurs tried, in order, until the mask holds together
CUT = 0.33  # of the local peak: near the extent that the eye takes for the stroke, wider than half height
LITTER, SPECK = 0.004, 40  # share of the mask's area, and px of area, see _litter
NEAR = 14.0  # px at 768; ink farther than this from every curve does not belong to one
FAR_REFUSED, FAR_WARNED = 0.45, 0.12  # shares of such ink


@dataclass(frozen=True)
class Exemplar:
    """One drawing at the size of its view.

    Parameters
    ----------
    rgb : (H, W, 3) float32 in [0, 1], the ink laid on white paper
    alpha : (H, W) float32 in [0, 1], opacity of the ink; rgb = alpha * ink + (1 - alpha)
    ink : (H, W, 3) float32, colour of the ink where there is some, white elsewhere
    mask : (H, W) float32, soft stroke mask, 1 = stroke, closed over the grain of the medium
    paper : (3,) float32, mean colour of the paper that was taken away
    """

    rgb: np.ndarray
    alpha: np.ndarray
    ink: np.ndarray
    mask: np.ndarray
    paper: np.ndarray

    def __post_init__(self):
        shape = np.shape(self.alpha)
        for name, want in (
            ("rgb", shape + (3,)), ("alpha", shape), ("ink", shape + (3,)), ("mask", shape), ("paper", (3,))
        ):  # fmt: skip
            value = np.asarray(getattr(self, name), np.float32)
            if value.shape != want or not np.isfinite(value).all():
                raise ValueError(
                    f"Exemplar.{name} must be finite, of shape {want}, got {value.shape}"
                )
            object.__setattr__(self, name, value)


@dataclass(frozen=True)
class Agreement:
    """How a drawing and the curves lie together."""

    far_ink: float  # share of the ink that lies farther than `near` px from every curve
    bare_curve: float  # share of the curves' length with no ink within `near` px
    near: float  # px


def read_image(path: str | Path) -> tuple[np.ndarray, bool]:
    """An image file -> (H, W, 4) float32 straight RGBA in [0, 1], and whether its paper is transparent.

    PNG, JPEG, TIFF and whatever else pillow reads; 8 or 16 bits, grey, palette, RGB, CMYK, with or without alpha.
    Raises ValueError, naming the file, where it is not an image, is cut short or too large; OSError where unreadable.
    """
    path = Path(path)
    if path.is_dir():
        raise ValueError(f"{path}: a folder; expected an image of the drawing (PNG, JPEG or TIFF)")
    if path.stat().st_size == 0:
        raise ValueError(
            f"{path}: the file is empty; expected an image of the drawing (PNG, JPEG or TIFF)"
        )
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            with Image.open(path) as image:
                if image.width * image.height > MAX_PIXELS:
                    raise ValueError(
                        f"{path}: {image.width} x {image.height} pixels is too large; scale it below "
                        f"{MAX_PIXELS // 1_000_000} megapixels"
                    )
                image.load()
                image = ImageOps.exif_transpose(image)
                if (
                    image.mode.startswith("I") or image.mode == "F"
                ):  # 16-bit and float greys: pillow would clip them
                    grey = np.asarray(image, np.float32)
                    top = 65535.0 if image.mode.startswith("I") else 1.0
                    grey = np.clip(
                        grey / (255.0 if grey.max(initial=0) <= 255 and top > 1 else top), 0, 1
                    )
                    rgba = np.stack([grey] * 3 + [np.ones_like(grey)], axis=-1)
                else:
                    rgba = np.asarray(image.convert("RGBA"), np.float32) / 255.0
    except Image.DecompressionBombError:
        raise ValueError(f"{path}: too many pixels for a drawing; scale it down") from None
    except (OSError, SyntaxError, EOFError) as error:
        if isinstance(error, (FileNotFoundError, PermissionError)):
            raise
        raise ValueError(
            f"{path}: not a readable image ({_short(error)}); expected PNG, JPEG or TIFF"
        ) from None
    if min(rgba.shape[:2]) < 16:
        raise ValueError(
            f"{path}: {rgba.shape[1]} x {rgba.shape[0]} pixels is too small to learn from"
        )
    clear = rgba[..., 3] < 0.5
    return rgba, bool(
        clear.mean() > 0.4
    )  # a transparent margin round an opaque sheet is not transparent paper


def load_exemplar(
    path: str | Path, width: int, height: int, curve_points: np.ndarray
) -> tuple[Exemplar, str]:
    """Read a drawing and lay it on a view of `width` x `height` px, where it belongs on the curves.

    A file of the view's proportions is resampled as it is. Any other is tried three ways (whole sheet inside the view,
    view inside the sheet, stretched) and stays where most ink lies near the view's curves, `curve_points` (N, 2). Where
    a shift, turn or scale of some per cent clearly brings the ink onto the curves, the sheet is moved by it.

    Returns the exemplar and a note for the user, empty where there is nothing to say.
    Raises ValueError, naming the file, where it is blank, all ink, or no drawing of these curves.
    """
    rgba, transparent = read_image(path)
    note, best = "", None
    layouts = [
        (name, _lay(rgba, width, height, name)) for name in _layouts(rgba.shape, width, height)
    ]
    for name, sheet in layouts:
        exemplar = separate(sheet, transparent, str(path))
        moved = register(exemplar.mask, curve_points)
        if moved is not None:
            exemplar = separate(_moved(sheet, moved), transparent, str(path))
        agreement = agree(exemplar, curve_points)
        if best is None or agreement.far_ink < best[1].far_ink - 0.01:
            best = (exemplar, agreement, name, moved)
    exemplar, agreement, name, moved = best
    if len(layouts) > 1:
        note = f"{rgba.shape[1]} x {rgba.shape[0]} px drawing {name} to the {width} x {height} view"
    if moved is not None:
        note += f"{'; ' if note else ''}registered with the curves: {moved}"
    if agreement.far_ink > FAR_REFUSED:
        raise ValueError(
            f"{path}: {100 * agreement.far_ink:.0f} % of its ink lies farther than {agreement.near:.0f} px from every "
            "curve: not a drawing of this shape from this camera? Draw over the sheet that `strokestyle extract` "
            "writes, and give fit the same view or --camera"
        )
    if agreement.far_ink > FAR_WARNED or agreement.bare_curve > 0.5:
        far, bare = 100 * agreement.far_ink, 100 * agreement.bare_curve
        note += ("; " if note else "") + (
            f"{far:.0f} % of the ink lies farther than {agreement.near:.0f} px from every curve and {bare:.0f} % of "
            "the curves have no ink near: are view, camera and line options those of the sheet it was drawn over?"
        )
    return exemplar, note


def agree(exemplar: Exemplar, curve_points: np.ndarray) -> Agreement:
    """Measure how much ink lies far from every curve point (N, 2), and how many points are without ink."""
    near = NEAR * max(exemplar.mask.shape) / 768.0
    y, x = np.nonzero(exemplar.mask > 0.5)
    weight = exemplar.alpha[y, x]
    if not len(curve_points) or not len(x):
        return Agreement(1.0, 1.0, near)
    ink = np.stack([x, y], axis=1) + 0.5
    to_curve, _ = cKDTree(curve_points).query(ink, distance_upper_bound=near)
    to_ink, _ = cKDTree(ink).query(curve_points, distance_upper_bound=near)
    return Agreement(
        float(weight[np.isinf(to_curve)].sum() / weight.sum()), float(np.isinf(to_ink).mean()), near
    )


def separate(sheet: np.ndarray, transparent: bool = False, name: str = "drawing") -> Exemplar:
    """Tell the ink of a sheet (H, W, 4), straight RGBA, from its paper.

    Raises ValueError, naming `name`, where there is no ink, or more than a drawing of lines can hold.
    """
    if transparent:
        least, rgb, mean_paper = sheet[..., 3], sheet[..., :3], np.ones(3)
        floor = 2.0 / 255.0
    else:
        rgb = sheet[..., :3] * sheet[..., 3:] + (1.0 - sheet[..., 3:])
        paper = ground_field(rgb)
        mean_paper = paper.mean(axis=(0, 1))
        # the least opacity with which some ink in [0, 1] over this paper gives this pixel
        least = ((paper - rgb) / np.maximum(paper, 1e-3)).max(axis=-1)
        if (
            mean_paper.mean() < 0.5
        ):  # a dark sheet takes light ink; on a light one what is lighter is grain
            least = np.maximum(least, ((rgb - paper) / np.maximum(1.0 - paper, 1e-3)).max(axis=-1))
        floor = max(
            2.0 / 255.0, 5.0 * float(np.median(np.abs(least - np.median(least))))
        )  # 3.4 sigma of the grain
        least = least.clip(0, 1)
    least = np.where(least > floor, least, 0.0)
    if (
        floor > 0.01
    ):  # the strongest of the grain passes the floor too, but stands away from all ink
        least = least * ndimage.binary_dilation(least > max(0.15, 2.0 * floor), iterations=5)
    held = least > max(0.08, floor)
    share = float(held.mean())
    if share < 2e-4 and floor <= 0.5:
        tone = (
            "black"
            if mean_paper.max() < 0.15
            else "white"
            if mean_paper.min() > 0.97
            else "of one tone"
        )
        raise ValueError(
            f"{name}: no strokes found: the sheet is all {tone}, or its ink too faint to tell from it"
        )
    if share > 0.5 or floor > 0.5:
        raise ValueError(
            f"{name}: no paper to be found between its marks: a picture rather than a line drawing? "
            "Expected strokes on a mostly empty sheet"
        )
    strongest = float(np.quantile(least[held], 0.98))
    alpha = np.clip(least / max(strongest, 1e-3), 0, 1)
    if transparent:
        ink = rgb
    else:
        ink = np.clip(paper + (rgb - paper) / np.maximum(alpha, 1e-3)[..., None], 0, 1)
        if (
            mean_paper.mean() >= 0.5
        ):  # taken for white paper in its light, which fell on the ink as well
            ink = np.clip(ink / np.maximum(paper, 1e-3), 0, 1)
    ink = _steady_ink(ink, alpha)
    laid = alpha[..., None] * ink + (1.0 - alpha[..., None])
    return Exemplar(laid, alpha, ink, stroke_mask(alpha), mean_paper)


def ground_field(rgb: np.ndarray) -> np.ndarray:
    """The paper's colour under every pixel of (H, W, 3): block medians, blocks of ink mended, smoothly interpolated."""
    height, width = rgb.shape[:2]
    down, across = max(1, round(height / BLOCK)), max(1, round(width / BLOCK))
    rows = np.linspace(0, height, down + 1).astype(int)
    cols = np.linspace(0, width, across + 1).astype(int)
    blocks = np.array(
        [
            [
                np.median(rgb[a:b, c:d].reshape(-1, 3), axis=0)
                for c, d in zip(cols[:-1], cols[1:], strict=True)
            ]
            for a, b in zip(rows[:-1], rows[1:], strict=True)
        ]
    )
    overall = np.median(blocks.reshape(-1, 3), axis=0)
    off = np.abs(blocks - ndimage.median_filter(blocks, size=(5, 5, 1), mode="nearest")).max(
        axis=-1
    )
    blocks[off > 0.005 + 6.0 * np.median(off)] = np.nan  # ink, not paper, holds the median of these
    for channel in range(3):
        layer = blocks[..., channel]
        bad = np.isnan(layer)
        if bad.all():
            layer[:] = overall[channel]
        elif bad.any():
            nearest = ndimage.distance_transform_edt(
                bad, return_distances=False, return_indices=True
            )
            layer[bad] = layer[tuple(i[bad] for i in nearest)]
    blocks = ndimage.gaussian_filter(blocks, (0.7, 0.7, 0), mode="nearest")
    y = np.interp(np.arange(height) + 0.5, 0.5 * (rows[:-1] + rows[1:]), np.arange(down))
    x = np.interp(np.arange(width) + 0.5, 0.5 * (cols[:-1] + cols[1:]), np.arange(across))
    grid = np.meshgrid(y, x, indexing="ij")
    field = [
        ndimage.map_coordinates(blocks[..., k], grid, order=1, mode="nearest") for k in range(3)
    ]
    return np.stack(field, axis=-1).astype(np.float32)


def stroke_mask(alpha: np.ndarray) -> np.ndarray:
    """Opacity (H, W) -> soft mask (H, W) of the area that the strokes cover, holes of the grain closed.

    Clean ink needs no closing and its anti-aliased edges are kept as they are. A grainy medium is blurred by the least
    of GRAIN_SIGMAS that leaves few specks and pinholes, then cut at CUT of its local peak, one pixel soft.
    """
    for sigma in GRAIN_SIGMAS:
        smooth = ndimage.gaussian_filter(alpha, sigma) if sigma else alpha
        peak = ndimage.maximum_filter(ndimage.gaussian_filter(alpha, max(sigma, 0.5)), size=17)
        peak = np.maximum(ndimage.gaussian_filter(peak, 4.0), 0.1)
        inside = smooth > CUT * peak
        if _litter(inside) < LITTER:
            break
    if sigma:
        slope = np.maximum(np.hypot(*np.gradient(smooth)), 0.02)
        mask = np.clip(0.5 + (smooth - CUT * peak) / slope, 0, 1)
    else:
        mask = np.clip(smooth / (0.9 * peak), 0, 1)
    label, count = ndimage.label(mask > 0.25, np.ones((3, 3)))
    if count:
        area = np.bincount(label.ravel(), weights=mask.ravel())
        mask = mask * ((area >= 8.0)[label] | (label == 0))  # single specks are no strokes
    return mask.astype(np.float32)


def _litter(inside: np.ndarray) -> float:
    """Share of a binary mask that is specks, or lacks because of pinholes; both under SPECK px of area."""
    total = 0
    for part in (inside, ~inside):
        label, count = ndimage.label(part)
        if count:
            area = np.bincount(label.ravel())[1:]
            total += area[area < SPECK].sum()
    return total / max(int(inside.sum()), 1)


def _steady_ink(ink: np.ndarray, alpha: np.ndarray) -> np.ndarray:
    """Ink colour where it is faint is mostly noise: lean on the neighbourhood there; white where there is none."""
    weight = ndimage.gaussian_filter(alpha, 2.0)
    near = np.stack([ndimage.gaussian_filter(ink[..., k] * alpha, 2.0) for k in range(3)], axis=-1)
    near = np.where(weight[..., None] > 1e-4, near / np.maximum(weight, 1e-4)[..., None], 1.0)
    own = np.clip(alpha / 0.15, 0, 1)[..., None]
    return np.clip(own * ink + (1 - own) * near, 0, 1)


def _layouts(shape: tuple, width: int, height: int) -> tuple[str, ...]:
    """Ways to lay a sheet on the view: one where the proportions agree within half a per cent."""
    if abs(np.log(shape[1] / shape[0] * height / width)) < 0.005:
        return ("scaled",)
    return ("fitted", "cropped", "stretched")


def _lay(rgba: np.ndarray, width: int, height: int, layout: str) -> np.ndarray:
    """Resample a sheet (h, w, 4) to (height, width, 4), premultiplied so that clear pixels bleed no colour."""
    h, w = rgba.shape[:2]
    scale = {"fitted": min(width / w, height / h), "cropped": max(width / w, height / h)}.get(
        layout
    )
    if (w, h) == (width, height):
        return rgba
    new_w, new_h = (
        (width, height) if scale is None else (max(1, round(w * scale)), max(1, round(h * scale)))
    )
    premultiplied = _premultiplied(rgba)
    resize = Image.Resampling.LANCZOS
    planes = [
        np.asarray(Image.fromarray(premultiplied[..., k]).resize((new_w, new_h), resize))
        for k in range(4)
    ]
    out = np.stack(planes, axis=-1).clip(0, 1)
    if (new_w, new_h) != (
        width,
        height,
    ):  # pad with the sheet's own edge (its paper), or cut, about the centre
        dx, dy = width - new_w, height - new_h
        out = out[max(0, -dy // 2) :, max(0, -dx // 2) :][:height, :width]
        pad_y, pad_x = height - out.shape[0], width - out.shape[1]
        edge = np.median(np.concatenate([out[0], out[-1], out[:, 0], out[:, -1]]), axis=0)
        full = np.broadcast_to(edge, (height, width, 4)).copy()
        full[pad_y // 2 : pad_y // 2 + out.shape[0], pad_x // 2 : pad_x // 2 + out.shape[1]] = out
        out = full
    return _straight(out)


def _moved(sheet: np.ndarray, moved: Similarity) -> np.ndarray:
    return _straight(moved.warp(_premultiplied(sheet)).clip(0, 1))


def _premultiplied(rgba: np.ndarray) -> np.ndarray:
    return np.concatenate([rgba[..., :3] * rgba[..., 3:], rgba[..., 3:]], axis=-1)


def _straight(premultiplied: np.ndarray) -> np.ndarray:
    alpha = premultiplied[..., 3:]
    rgb = np.where(alpha > 1e-3, premultiplied[..., :3] / np.maximum(alpha, 1e-3), 1.0).clip(0, 1)
    return np.concatenate([rgb, alpha], axis=-1).astype(np.float32)


def _short(error: Exception) -> str:
    text = str(error).splitlines()[0] if str(error) else type(error).__name__
    return text if len(text) < 100 else text[:97] + "..."
