"""Read the artist's drawing from an image: ink told from paper, and a soft stroke mask.

No paper describes this stage; the ICCV paper only asks for "a binary mask, anti-aliased" (sec. 4).
What is done here: the ground is a smooth field of block medians; opacity is the least that explains
a pixel's difference from its ground, on a scale where the drawing's strongest ink is opaque; the
mask is that opacity, closed over the grain just as far as it takes.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy import ndimage
from scipy.spatial import cKDTree

from ..geometry.threads import at_once
from .ground import ground_field, printed_lines
from .image_file import Scan, read_image
from .layout import Placing, lay, sheet_placings, whole_placings
from .pencil import pencil_lines
from .registration import Homography, Registration, register
from .sheet import Sheet, find_sheet

# The numbers below were set by hand; no ablation of them is kept.

# ink, as opacity in [0, 1]
MIN_OPACITY = 2.0 / 255.0  # what 8 bits cannot tell from nothing
GRAIN_SPREADS = 5.0  # median deviations of the ground's grain (3.4 sigma) that are not yet ink
CLEAN_GROUND = 0.01  # of the floor so found: under it the ground has no grain
SURE_INK, SURE_INK_FLOORS, INK_REACH = (
    0.15,
    2.0,
    5,
)  # ink of a grainy ground lies within 5 px of this
PRINT_LEFT = 0.6  # of a printed line's opacity, that may be left of it
VISIBLE_INK = 0.08  # opacity of what counts as a stroke
MIN_INK_SHARE, MAX_INK_SHARE = 2e-4, 0.5  # of the sheet, in a drawing of lines
STRONGEST = 0.98  # quantile of the ink's opacity that is taken for opaque
FAINT_INK = 0.15  # opacity below which colour leans on the neighbourhood
STEADY_SIGMA = 2.0  # px, of that neighbourhood

# mask
SHARP = 0.5  # px, the least Gaussian before a local peak is looked for
GRAIN_SIGMAS = (0.0, 0.7, 1.0, 1.4, 1.8, 2.3, 2.8)  # px; blurs tried, until the mask holds together
CUT = 0.33  # of the local peak: near the extent that the eye takes for the stroke, wider than half
FULL = 0.9  # of the local peak: where clean ink, which is not blurred, is all stroke
PEAK_SIZE, PEAK_SIGMA, MIN_PEAK = 17, 4.0, 0.1  # px, px, opacity: of the local peak
# mean share of the local peak by which ink deep in a stroke differs from it: clean below this; and
EVEN, MIN_DEEP = 0.03, 0.2  # the share of the ink that must lie deep for that to be told
# mean share by which a line's ink changes along its middle, likewise: of flat ink 0.09 at most, on
STEADY = 0.095  # lines of 1 px already; of a medium that needs closing 0.11 at least
ALONG_SIGMA, ALONG_SPAN = 0.7, 3.0  # px: what a middle is seen under, and is compared with along it
MAX_LITTER, SPECK = 0.004, 40  # share of the mask's area, and px of area, see _litter
BLOT, MIN_BLOT = 0.25, 8.0  # of the mask, and px of area: less ink than that is no stroke

# agreement with the curves
NEAR = 14.0  # px at 768; ink farther than this from every curve does not belong to one
FAR_REFUSED, FAR_WARNED = 0.45, 0.12  # shares of such ink
BARE_WARNED = 0.5  # share of the curves without ink
BETTER_LAYOUT = 0.01  # share of far ink by which another layout must be better
NO_DRAWING = 2.0  # share of far ink that stands for a layout in which no lines are seen
SCREEN = 256  # px, longer side of the drawings on which layouts are compared
SHEET_SOUGHT = 0.03  # of far ink: a drawing with less of it lies on its curves and is not cropped


@dataclass(frozen=True)
class Exemplar:
    """One drawing at the size of its view.

    Parameters
    ----------
    rgb : (H, W, 3) float32 in [0, 1], the ink laid on a white ground
    alpha : (H, W) float32 in [0, 1], opacity of the ink; rgb = alpha * ink + (1 - alpha)
    ink : (H, W, 3) float32, colour of the ink where there is some, white elsewhere
    mask : (H, W) float32, soft stroke mask, 1 = stroke, closed over the grain of the medium
    paper : (3,) float32, mean colour of the ground that was taken away
    registration : how it was laid on its curves; None where nobody asked
    notes : what was taken off it, for the user
    """

    rgb: np.ndarray
    alpha: np.ndarray
    ink: np.ndarray
    mask: np.ndarray
    paper: np.ndarray
    registration: Registration | None = None
    notes: tuple[str, ...] = ()

    def __post_init__(self):
        shape = np.shape(self.alpha)
        rgb = shape + (3,)
        shapes = {"rgb": rgb, "alpha": shape, "ink": rgb, "mask": shape, "paper": (3,)}
        for name, want in shapes.items():
            value = np.asarray(getattr(self, name), np.float32)
            if value.shape != want or not np.isfinite(value).all():
                raise ValueError(
                    f"Exemplar.{name} must be finite, of shape {want}, got {value.shape}"
                )
            object.__setattr__(self, name, value)


@dataclass(frozen=True)
class Agreement:
    """How a drawing and the curves lie together.

    Parameters
    ----------
    far_ink : share of the ink that lies farther than `near` from every curve
    bare_curve : share of the curves' points with no ink within `near`
    near : px
    """

    far_ink: float
    bare_curve: float
    near: float


@dataclass(frozen=True)
class _Laid:
    """A drawing laid on a view and registered, and how well that went."""

    placing: Placing
    exemplar: Exemplar
    agreement: Agreement


@dataclass(frozen=True)
class _Screened:
    """A layout, the share of ink that it leaves far from the curves, and what it gave, if kept."""

    placing: Placing
    far_ink: float
    laid: _Laid | None = None


def load_exemplar(
    path: str | Path,
    width: int,
    height: int,
    curve_points: np.ndarray,
    layer: str | None = None,
) -> tuple[Exemplar, str]:
    """Read a drawing and lay it on a view of `width` x `height` px, where it belongs on the curves.

    A file of the view's proportions is resampled as it is. Any other is tried three ways (whole
    scan inside the view, view inside the scan, stretched) and stays where most ink lies near the
    view's curves, `curve_points` (N, 2). Where that leaves ink far from them, a sheet that lies on
    a table is sought in it. Where a shift, turn, scale or homography of some per cent clearly
    brings the ink onto the curves, the scan is moved by it. `layer` names the one to read of a file
    with layers; None reads the merged picture.

    Returns the exemplar and a note for the user, empty where there is nothing to say.
    Raises ValueError, naming the file, where it is blank, all ink, or no drawing of these curves.
    """
    file = read_image(path, (width, height), layer)
    laid, notes = _placed(file, width, height, str(path), curve_points)
    notes += laid.exemplar.notes
    registration, agreement = laid.exemplar.registration, laid.agreement
    if registration is not None and registration.moved is not None:
        notes.append(f"registered with the curves: {registration}")
    if agreement.far_ink > FAR_REFUSED:
        raise ValueError(
            f"{path}: {100 * agreement.far_ink:.0f} % of its ink lies farther than "
            f"{agreement.near:.0f} px from every curve: not a drawing of this shape from this "
            "camera? Draw over the template that `strokestyle extract` writes, and fit with the "
            "same view or camera"
        )
    if agreement.far_ink > FAR_WARNED or agreement.bare_curve > BARE_WARNED:
        notes.append(
            f"{100 * agreement.far_ink:.0f} % of the ink lies farther than {agreement.near:.0f} px "
            f"from every curve and {100 * agreement.bare_curve:.0f} % of the curves have no ink "
            "near: are view, camera and line options those of the template it was drawn over?"
        )
    return laid.exemplar, "; ".join(notes)


def _laid(file: Scan, placing: Placing, name: str, curve_points: np.ndarray) -> _Laid:
    """Lay a file on a view, once more where its ink shows that it is to be moved.

    Raises ValueError where there is no drawing of lines.
    """
    exemplar = separate(lay(file, placing), file.transparent, name)
    registration = register(exemplar.mask, curve_points)
    if registration.moved is not None:
        placing = replace(placing, map=registration.moved.after(placing.map))
        exemplar = separate(lay(file, placing), file.transparent, name)
    exemplar = _without_pencil(replace(exemplar, registration=registration), curve_points)
    return _Laid(placing, exemplar, agree(exemplar, curve_points))


def _without_pencil(exemplar: Exemplar, curve_points: np.ndarray) -> Exemplar:
    """The exemplar in ink alone, where pencil lies under it."""
    pencil = pencil_lines(exemplar.alpha, exemplar.mask, curve_points)
    if pencil is None:
        return exemplar
    alpha = np.where(pencil, 0.0, exemplar.alpha)
    return replace(
        exemplar,
        alpha=alpha,
        rgb=alpha[..., None] * exemplar.ink + (1.0 - alpha[..., None]),
        mask=stroke_mask(alpha),
        notes=(*exemplar.notes, "pencil under the ink was left out"),
    )


def _placed(
    file: Scan, width: int, height: int, name: str, curve_points: np.ndarray
) -> tuple[_Laid, list[str]]:
    """Choose how to lay a file on a view, by small pictures of it, and say so.

    Raises ValueError where there is no drawing of lines.
    """
    whole, reduced = whole_placings(file, width, height), _Reduced.of(file)
    if len(whole) == 1:
        try:
            laid = _laid(file, whole[0], name, curve_points)
            best = _Screened(whole[0], laid.agreement.far_ink, laid)
        except ValueError:
            best = _Screened(whole[0], NO_DRAWING)
    else:
        best = _best(_screened(reduced, one, name, curve_points) for one in whole)
    if best.far_ink > SHEET_SOUGHT and not file.transparent:
        sheet = find_sheet(file.rgba[..., :3])
        if sheet is not None:
            best = _on_sheet(sheet, best, reduced, name, curve_points)
            share = f"a sheet of paper found that fills {100 * sheet.share:.0f} % of it"
    laid = best.laid or _laid(file, best.placing, name, curve_points)
    if best.placing.sheet is not None:
        return laid, [f"{share}; what lies around it is left out"]
    if len(whole) == 1:
        return laid, []
    how = f"{file.width} x {file.height} px drawing {best.placing.name}"
    return laid, [f"{how} to the {width} x {height} view"]


def _on_sheet(
    sheet: Sheet, whole: _Screened, reduced: _Reduced, name: str, curve_points: np.ndarray
) -> _Screened:
    """The best way to lay a photograph's sheet on the view, or the whole where none is better."""
    best, size = whole, whole.placing.map.size
    for turns in range(4):
        tried = sheet_placings(sheet, round(size[0]), round(size[1]), turns)
        found = _best(_screened(reduced, one, name, curve_points) for one in tried)
        if found.far_ink < FAR_REFUSED:
            best = _best([best, found])
        if best.far_ink < FAR_WARNED:
            break  # it lies upright
    return best


def _best(tried: Iterable[_Screened]) -> _Screened:
    """The first of those by which no other is clearly better; no more are tried than it takes."""
    best = None
    for one in tried:
        if best is None or one.far_ink < best.far_ink - BETTER_LAYOUT:
            best = one
        if best.far_ink <= BETTER_LAYOUT:
            break
    assert best is not None  # there is one layout at least
    return best


@dataclass(frozen=True)
class _Reduced:
    """A file with its pixels averaged over squares of `every` x `every` px, to try layouts on."""

    file: Scan
    every: int

    @classmethod
    def of(cls, file: Scan) -> _Reduced:
        every = max(1, int(min(file.rgba.shape[:2]) / (2 * SCREEN)))
        if every == 1:
            return cls(file, every)
        h, w = (side // every * every for side in file.rgba.shape[:2])
        squares = file.rgba[:h, :w].reshape(h // every, every, w // every, every, 4)
        return cls(replace(file, rgba=squares.mean(axis=(1, 3))), every)


def _screened(
    reduced: _Reduced, placing: Placing, name: str, curve_points: np.ndarray
) -> _Screened:
    """Try a layout on a small picture."""
    size, every = np.array(placing.map.size), reduced.every
    small = np.rint(size * min(1.0, SCREEN / size.max()))
    matrix = np.diag([*(small / size), 1.0]) @ placing.map.matrix @ np.diag([every, every, 1.0])
    shrunk = replace(
        placing,
        map=Homography(matrix, (float(small[0]), float(small[1]))),
        sheet=None if placing.sheet is None else placing.sheet / every,
    )
    try:
        laid = _laid(reduced.file, shrunk, name, curve_points * small / size)
    except ValueError:
        return _Screened(placing, NO_DRAWING)
    return _Screened(placing, laid.agreement.far_ink)


def agree(exemplar: Exemplar, curve_points: np.ndarray) -> Agreement:
    """Measure how a drawing and the points of curves (N, 2) px lie together."""
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


def separate(scan: np.ndarray, transparent: bool = False, name: str = "drawing") -> Exemplar:
    """Tell the ink of a scan from its ground.

    Parameters
    ----------
    scan : (H, W, 4) straight RGBA in [0, 1]
    transparent : whether its ground is what is clear in it
    name : of the drawing, for errors

    Raises ValueError where there is no ink, or more than a drawing of lines can hold.
    """
    notes: tuple[str, ...] = ()
    if transparent:
        rgb, opacity = scan[..., :3], scan[..., 3]
        ground, mean_ground, floor = None, np.ones(3), MIN_OPACITY
    else:
        rgb = scan[..., :3] * scan[..., 3:] + (1.0 - scan[..., 3:])
        ground = ground_field(rgb)
        mean_ground = ground.mean(axis=(0, 1))
        printed = printed_lines(rgb, ground)
        if printed is not None:
            ground = ground * printed
        opacity, floor = _least_opacity(rgb, ground, mean_ground)
        if printed is not None:
            # what printed lines leave where they are stronger than on average
            left = PRINT_LEFT * (1.0 - printed.min(axis=-1))
            opacity = np.where(opacity > left, opacity, 0.0)
            notes = ("its ruling was taken off",)
    opacity = np.where(opacity > floor, opacity, 0.0)
    if floor > CLEAN_GROUND:
        # the strongest of the grain passes the floor too, but stands away from all ink
        sure = opacity > max(SURE_INK, SURE_INK_FLOORS * floor)
        opacity = opacity * ndimage.binary_dilation(sure, iterations=INK_REACH)
    held = opacity > max(VISIBLE_INK, floor)
    _check_ink(float(held.mean()), floor, mean_ground, name)
    strongest = float(np.quantile(opacity[held], STRONGEST))
    alpha = np.clip(opacity / max(strongest, 1e-3), 0, 1)

    def coloured() -> tuple[np.ndarray, np.ndarray]:
        raw = rgb if ground is None else _ink_over(rgb, ground, alpha, mean_ground)
        ink = _steady_ink(raw, alpha)
        return ink, alpha[..., None] * ink + (1.0 - alpha[..., None])

    mask, (ink, laid) = at_once(lambda: stroke_mask(alpha), coloured)
    return Exemplar(laid, alpha, ink, mask, mean_ground, notes=notes)


def _least_opacity(
    rgb: np.ndarray, ground: np.ndarray, mean_ground: np.ndarray
) -> tuple[np.ndarray, float]:
    """The least opacity (H, W) with which some ink over this ground gives these pixels.

    Returns it with the floor under which it is grain. A dark ground takes light ink; on a light
    one what is lighter is grain.
    """
    opacity = ((ground - rgb) / np.maximum(ground, 1e-3)).max(axis=-1)
    if mean_ground.mean() < 0.5:
        lighter = ((rgb - ground) / np.maximum(1.0 - ground, 1e-3)).max(axis=-1)
        opacity = np.maximum(opacity, lighter)
    deviation = float(np.median(np.abs(opacity - np.median(opacity))))
    return opacity.clip(0, 1), max(MIN_OPACITY, GRAIN_SPREADS * deviation)


def _check_ink(share: float, floor: float, mean_ground: np.ndarray, name: str) -> None:
    """Raise ValueError where too little or too much of a scan is ink for a drawing of lines."""
    if share < MIN_INK_SHARE and floor <= 0.5:
        if mean_ground.max() < 0.15:
            tone = "black"
        else:
            tone = "white" if mean_ground.min() > 0.97 else "of one tone"
        raise ValueError(
            f"{name}: no strokes found: the sheet is all {tone}, or its ink too faint to tell "
            "from it"
        )
    if share > MAX_INK_SHARE or floor > 0.5:
        raise ValueError(
            f"{name}: no paper to be found between its marks: a picture rather than a line "
            "drawing? Expected strokes on a mostly empty sheet"
        )


def _ink_over(
    rgb: np.ndarray, ground: np.ndarray, alpha: np.ndarray, mean_ground: np.ndarray
) -> np.ndarray:
    """The ink's colour (H, W, 3) that with opacity `alpha` over the ground gives the pixels."""
    ink = np.clip(ground + (rgb - ground) / np.maximum(alpha, 1e-3)[..., None], 0, 1)
    if mean_ground.mean() >= 0.5:
        # taken for white paper in its light, which fell on the ink as well
        ink = np.clip(ink / np.maximum(ground, 1e-3), 0, 1)
    return ink


def stroke_mask(alpha: np.ndarray, shows_grain: np.ndarray | None = None) -> np.ndarray:
    """Opacity (H, W) -> soft mask (H, W) of what the strokes cover, holes of the grain closed.

    Clean ink, which leaves few specks and pinholes, is all of one opacity or changes little along
    its lines, needs no closing, and its anti-aliased edges are kept as they are. A grainy medium
    is blurred by the least of GRAIN_SIGMAS that leaves few specks and pinholes, then cut at CUT of
    its local peak, one pixel soft. Where holes may be the drawing's own,
    `shows_grain` (H, W) bool is where they are not.
    """
    where = np.ones(alpha.shape, bool) if shows_grain is None else shows_grain
    sigma, smooth, peak = _closed(alpha, where)
    if sigma:
        slope = np.maximum(np.hypot(*np.gradient(smooth)), 0.02)
        mask = np.clip(0.5 + (smooth - CUT * peak) / slope, 0, 1)
    else:
        mask = np.clip(smooth / (FULL * peak), 0, 1)
    label, count = ndimage.label(mask > BLOT, np.ones((3, 3)))
    if count:
        area = np.bincount(label.ravel(), weights=mask.ravel())
        mask = mask * ((area >= MIN_BLOT)[label] | (label == 0))
    return mask.astype(np.float32)


def _closed(alpha: np.ndarray, where: np.ndarray) -> tuple[float, np.ndarray, np.ndarray]:
    """The Gaussian, px, that closes ink (H, W) over its grain; 0 where it is clean.

    With the ink after it, and its local peak. Looked at is the grain `where` (H, W) bool it shows.
    """
    sharp = _local_peak(alpha, SHARP)
    clean = _unevenness(alpha, sharp) < EVEN or _unsteadiness(alpha, sharp) < STEADY
    for sigma in (0.0,) if clean else GRAIN_SIGMAS:
        smooth = ndimage.gaussian_filter(alpha, sigma) if sigma else alpha
        peak = sharp if sigma <= SHARP else _local_peak(alpha, sigma)
        if _litter(smooth > CUT * peak, where) < MAX_LITTER:
            break
    return sigma, smooth, peak


def _local_peak(alpha: np.ndarray, sigma: float) -> np.ndarray:
    """The highest opacity (H, W) around every pixel, after a blur of `sigma` px."""
    peak = ndimage.maximum_filter(ndimage.gaussian_filter(alpha, sigma), size=PEAK_SIZE)
    return np.maximum(ndimage.gaussian_filter(peak, PEAK_SIGMA), MIN_PEAK)


def _unevenness(alpha: np.ndarray, peak: np.ndarray) -> float:
    """How far ink (H, W) that has ink all around it differs from its local `peak`, as a share.

    The paper between crossing lines, and short dashes, are as small as grain; but the ink of a
    grainy medium is uneven. 1 where hardly any ink lies that deep, so that nothing can be told.
    """
    inside = alpha > CUT * peak
    deep = ndimage.binary_erosion(inside, np.ones((3, 3)))
    if deep.sum() < MIN_DEEP * max(int(inside.sum()), 1):
        return 1.0
    return float(np.abs(alpha / peak - 1)[deep].mean())


def _unsteadiness(alpha: np.ndarray, peak: np.ndarray) -> float:
    """How far ink (H, W) differs, in the middle of its lines, from what it is along them.

    As a share of it. That is told of lines too thin to have anything deep inside, too: where the
    pixels' size, and no grain, takes ink off them, it takes as much a few pixels on.
    """
    seen = ndimage.gaussian_filter(alpha, ALONG_SIGMA)
    peaks = [
        (seen >= np.roll(seen, 1, axis)) & (seen >= np.roll(seen, -1, axis)) for axis in (0, 1)
    ]
    middle = (peaks[0] | peaks[1]) & (seen > CUT * peak)
    if not middle.any():
        return 1.0
    count = ndimage.gaussian_filter(1.0 * middle, ALONG_SPAN)
    mean = ndimage.gaussian_filter(seen * middle, ALONG_SPAN) / np.maximum(count, 1e-6)
    return float(np.abs(seen / np.maximum(mean, 1e-6) - 1.0)[middle].mean())


def _litter(inside: np.ndarray, where: np.ndarray) -> float:
    """Share of a binary mask that is specks, or lacks because of pinholes; both under SPECK px.

    Counted is what lies `where` (H, W) bool, wholly.
    """
    total = 0
    for region in (inside, ~inside):
        label, count = ndimage.label(region)
        if count:
            area = np.bincount(label.ravel())[1:]
            whole = area == np.bincount(label[where], minlength=count + 1)[1:]
            total += area[whole & (area < SPECK)].sum()
    return total / max(int((inside & where).sum()), 1)


def _steady_ink(ink: np.ndarray, alpha: np.ndarray) -> np.ndarray:
    """Steady the ink's colour (H, W, 3) where it is faint, and so mostly noise.

    It leans on the neighbourhood there; white where there is none.
    """
    weight = ndimage.gaussian_filter(alpha, STEADY_SIGMA)
    near = np.stack(
        [ndimage.gaussian_filter(ink[..., k] * alpha, STEADY_SIGMA) for k in range(3)], axis=-1
    )
    near = np.where(weight[..., None] > 1e-4, near / np.maximum(weight, 1e-4)[..., None], 1.0)
    own = np.clip(alpha / FAINT_INK, 0, 1)[..., None]
    return np.clip(own * ink + (1 - own) * near, 0, 1)
