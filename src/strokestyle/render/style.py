"""Style: what was learned from one drawing, and how it draws a view.

Lengths inside a style are pixels of the canvas it was learned on; `draw` scales them to the canvas it is given.
No torch in here: what drawing takes of it is a sum of tanh, and its import costs more than all the rest of a drawing.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, field, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from scipy import ndimage

from .. import __version__
from ..drawing.edit import cut_at_parts
from ..drawing.strokes import Drawing, Strokes
from ..extract.view import View
from ..geometry.curves import KINDS, Curves, arc_length, blurred, owner, simplify, tangents
from ..geometry.parts import Pieces
from ..model_file import read_model, write_model
from .plan import Planned, plan_strokes
from .texture_bank import TextureBank, synthesise

if TYPE_CHECKING:
    from .neural_strokes import PaperStyle

FORMAT = 2

# How much a kind matters to the shape: one number, so that a kind that the exemplar lacks lies between its neighbours.
PROMINENCE = dict.fromkeys(KINDS, 0.0) | {"contour": 1.0, "boundary": 1.0, "crease": 0.5, "intersection": 0.5}
ENDS = (10.0, 40.0, 120.0)  # px, scales on which a stroke's ends are felt
SHORT = 0.3  # of a stroke's length, and never a longer scale than this
BENDS = ((6.0, 20.0), (14.0, 45.0))  # px, scale of measuring a bend and the radius at which it counts half
SURFACE = ("depth", "n_dot_v", "view_curvature", "normal_x", "normal_y")  # read off the maps
FEATURES = (
    *(f"start_{n:.0f}" for n in ENDS), *(f"end_{n:.0f}" for n in ENDS),
    "before", "after", "past_start", "past_end", "along", "log_length",
    *(f"bend_{n:.0f}" for n, _ in BENDS), *(f"turn_{n:.0f}" for n, _ in BENDS),
    "depth", "n_dot_v", "view_curvature", "facing_x", "facing_y", "height", "tangent_x", "tangent_y", "prominence",
)  # fmt: skip
SMOOTHINGS = (3.0, 6.0, 12.0, 24.0)  # px, Gaussian scales by which the hand may round a curve off
CUTS = (3.0, 6.0, 12.0)  # px, tolerances with which it may cut a curve straight
HAIR = 0.5  # px; thickness is learned as log(thickness + HAIR), where a habit is a factor and nothing is not infinite
MOVES = (*(f"smooth_{n:.0f}" for n in SMOOTHINGS), *(f"cut_{n:.0f}" for n in CUTS), "inflate")


@dataclass(frozen=True)
class StyleConfig:
    """What a style needs to know beside its weights. Lengths in px of a canvas whose longer side is `size`.

    Defaults: spacing as in the authors' code; the others measured on drawings by hand-like simulation (DESIGN.md).
    """

    size: int = 768
    spacing: float = 3.0
    join: float = 10.0
    corner: float = 65.0
    extend: float = 24.0
    hidden: int = 8


@dataclass(frozen=True)
class Hand:
    """How a hand strays from what it means to draw: residuals of the training strokes, to be drawn from.

    Parameters
    ----------
    stray : (R, 2) float32, residual across the stroke, px, and of log(thickness + HAIR)
    offsets : (S+1,) int64, one sequence per training stroke, points `spacing` apart
    """

    stray: np.ndarray
    offsets: np.ndarray


@dataclass(frozen=True)
class SumOfCurves:
    """What a `model.AdditiveNet` has learned, features (N, P) -> (N,).

    slope, shift, weight (P, h) float32, line (P,) float32, base () float32
    """

    slope: np.ndarray
    shift: np.ndarray
    weight: np.ndarray
    line: np.ndarray
    base: np.ndarray

    def __call__(self, points: np.ndarray) -> np.ndarray:
        curves = np.tanh(points[:, :, None] * self.slope + self.shift) * self.weight
        return curves.sum(axis=(1, 2)) + points @ self.line + self.base


@dataclass(frozen=True)
class Style:
    """A learned style.

    Parameters
    ----------
    config : StyleConfig
    network : SumOfCurves, features -> log(thickness + HAIR)
    moves : (M,) float32, how much of each of MOVES the hand makes
    centre, spread, low, high : (P,) float64, of FEATURES over the training strokes
    hand : Hand or None
    bank : the medium, or None for flat ink
    color : (4,) float64, the flat ink where there is no texture
    about : provenance: strokestyle version, preset, seed, exemplar
    """

    config: StyleConfig
    network: SumOfCurves
    moves: np.ndarray
    centre: np.ndarray
    spread: np.ndarray
    low: np.ndarray
    high: np.ndarray
    hand: Hand | None = None
    bank: TextureBank | None = None
    color: np.ndarray = field(default_factory=lambda: np.array([0.0, 0.0, 0.0, 1.0]))
    about: dict = field(default_factory=dict)

    def normalise(self, features: np.ndarray) -> np.ndarray:
        """Features (N, P) -> within the range seen in training, centred and scaled."""
        return (np.clip(features, self.low, self.high) - self.centre) / self.spread

    def draw(self, view: View, seed: int = 0) -> Drawing:
        """Draw a view. The same seed gives the same drawing; another one, another hand's luck."""
        size = (view.camera.width, view.camera.height)
        strokes, features, scale, pieces = self.strokes(view, seed)
        rng_seed = int(np.random.SeedSequence([seed, 1]).generate_state(1)[0])
        color, texture = np.tile(self.color, (len(strokes), 1)), None
        if self.bank is not None and len(strokes):
            texture, color = synthesise(self.bank, strokes, features, rng_seed)
        if scale != 1.0:
            strokes = replace(strokes, xy=strokes.xy * scale, thickness=strokes.thickness * scale)
            if texture is not None:
                texture = replace(texture, margin=texture.margin * scale)
        drawing = Drawing(strokes, size, color, texture)
        return drawing if pieces is None else cut_at_parts(drawing, pieces)

    def strokes(self, view: View, seed: int = 0) -> tuple[Strokes, np.ndarray, float, Pieces | None]:
        """Strokes in px of the style's own canvas, their normalised features (N, P), the view's px per such px, and the
        pieces of one part each that they are to be cut into."""
        scale = max(view.camera.width, view.camera.height) / self.config.size
        planned = plan(view, self.config, scale)
        surface = planned.carry(surface_at(view, self.config.spacing))
        features = self.normalise(point_features(planned, surface, self.config))
        if not len(planned):
            return Strokes(np.zeros((0, 2)), [], [0], [], []), features, scale, None
        frame = Frame.of(planned, surface, self.config.spacing)
        xy, swell = place(frame, self.moves), self.network(features)
        if self.hand is not None:
            stray = wander(self.hand, planned.offsets, np.random.default_rng(np.random.SeedSequence([seed, 0])))
            xy, swell = xy + stray[:, :1] * frame.across, swell + stray[:, 1]
        thickness = np.maximum(np.exp(swell) - HAIR, 0.0)
        rows, offsets, kept = lifted(thickness, planned.offsets)
        strokes = Strokes(xy[rows], thickness[rows], offsets, planned.kind[kept], np.zeros(len(kept), bool))
        pieces = None
        if view.parts is not None:
            step = np.diff(arc_length(xy[rows], offsets), prepend=0.0)
            step[offsets[:-1]] = step[planned.beyond[rows] > 0] = 0.0  # what runs past an end lies on nothing
            pieces = view.parts.take(planned.source[rows, 0]).cut(offsets, np.cumsum(step))
        return strokes, features[rows], scale, pieces


# ------------------------------------------------------------------------------------------- from a view to numbers


def plan(view: View, config: StyleConfig, scale: float = 1.0) -> Planned:
    """The strokes to be drawn, in px of the style's canvas."""
    curves = view.curves
    if scale != 1.0:
        curves = Curves(curves.xy / scale, curves.offsets, curves.kind, curves.closed)
    return plan_strokes(curves, config.spacing, config.join, config.corner, config.extend)


def point_features(planned: Planned, surface: np.ndarray, config: StyleConfig) -> np.ndarray:
    """FEATURES at every point of planned strokes, (N, P) float64. Curve features as in the paper (arc length, tangent)
    and those of the stroke's making; surface features as in the paper, SURFACE (N, 5) where the curve lies."""
    if not len(planned):
        return np.zeros((0, len(FEATURES)))
    maps = along_strokes(surface, planned.offsets, 6.0, config.spacing)
    which, within = owner(planned.offsets), planned.beyond == 0
    along = arc_length(planned.xy, planned.offsets)
    begin = np.full(len(planned), np.inf)
    end = np.full(len(planned), -np.inf)
    np.minimum.at(begin, which[within], along[within])
    np.maximum.at(end, which[within], along[within])
    from_start, to_end, length = along - begin[which], end[which] - along, np.maximum(end - begin, 1e-6)[which]
    before, after = np.maximum(-from_start, 0), np.maximum(-to_end, 0)
    # on a stroke too short for them, tapers shrink with it
    columns = [np.exp(-np.maximum(from_start, 0) / np.minimum(n, SHORT * length)) for n in ENDS]
    columns += [np.exp(-np.maximum(to_end, 0) / np.minimum(n, SHORT * length)) for n in ENDS]
    columns += [
        before / 24.0,
        after / 24.0,
        from_start < 0,
        to_end < 0,
        np.clip(from_start / length, 0, 1),
        np.log(length / 100.0),
    ]
    turns = [curvature(planned, sigma, config.spacing) * radius for sigma, radius in BENDS]
    columns += [turn**2 / (1 + turn**2) for turn in turns]
    columns += [turn / np.sqrt(1 + turn**2) for turn in turns]
    depth = maps[:, 0]
    near, far = np.percentile(depth[within], [3, 97])
    columns += [np.clip((depth - near) / max(far - near, 1e-6), 0, 1), maps[:, 1], maps[:, 2]]
    columns += list((maps[:, 3:] / np.sqrt((maps[:, 3:] ** 2).sum(axis=1, keepdims=True) + 0.04)).T)
    y = planned.xy[:, 1]
    top, bottom = y[within].min(), y[within].max()
    columns += [np.clip((y - top) / max(bottom - top, 1e-6), 0, 1)]
    smooth = along_strokes(planned.xy, planned.offsets, 4.0, config.spacing, pin=True)
    columns += list(tangents(smooth, planned.offsets).T)
    columns += [np.array([PROMINENCE[kind] for kind in KINDS])[planned.kind][which]]
    return np.stack(columns, axis=1)


def surface_at(view: View, spacing: float) -> np.ndarray:
    """SURFACE at the curves' points (M, 5): the mean of both sides of a line, for a crease has two normals.

    On an occluding contour the normal is known better than a pixel can show it: at right angles to the line and to the
    view, out of the shape.
    """
    curves = view.curves
    t = tangents(curves.xy, curves.offsets, curves.closed)
    across = np.stack([-t[:, 1], t[:, 0]], axis=1)
    three = np.concatenate([curves.xy + k * across for k in (-1.5, 0, 1.5)])
    out = view.at_curves(SURFACE, three).reshape(3, len(across), len(SURFACE)).mean(axis=0, dtype=np.float64)
    outward = along_strokes((out[:, 3:] * across).sum(axis=1), curves.offsets, 10.0, spacing)
    contour = (curves.kind == KINDS.index("contour"))[owner(curves.offsets)]
    out[contour, 1] = 0.0
    out[contour, 3:] = (np.where(outward < 0, -1.0, 1.0)[:, None] * across)[contour]
    return out


def along_strokes(
    values: np.ndarray, offsets: np.ndarray, sigma: float, spacing: float, pin: bool = False
) -> np.ndarray:
    """Gaussian of `sigma` px along every stroke. `pin` reflects through the end points, so that these stay."""
    out = np.empty_like(values)
    for a, b in zip(offsets[:-1], offsets[1:], strict=True):
        if pin:
            out[a:b] = blurred(values[a:b], sigma / spacing)
        else:
            out[a:b] = ndimage.gaussian_filter1d(values[a:b], sigma / spacing, axis=0, mode="nearest")
    return out


def curvature(planned: Planned, sigma: float, spacing: float) -> np.ndarray:
    """Signed curvature (N,), 1/px, of the strokes smoothed by `sigma` px; positive where turning to (-t_y, t_x)."""
    heading = tangents(along_strokes(planned.xy, planned.offsets, sigma, spacing, pin=True), planned.offsets)
    first, last = planned.offsets[:-1], planned.offsets[1:] - 1
    before, after = np.arange(len(heading)) - 1, np.arange(len(heading)) + 1
    before[first], after[last] = first, last
    a, b = heading[before], heading[after]
    turn = np.arctan2(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0], (a * b).sum(axis=1))
    return turn / (spacing * np.maximum(after - before, 1))


@dataclass(frozen=True)
class Frame:
    """Planned strokes: where they lie, which way is along and across, and the moves open to the hand.

    xy (N, 2), along (N, 2), across (N, 2), moves (N, M, 2) px, offsets (C+1,), within (N,) bool; in `fit` as tensors
    """

    xy: np.ndarray
    along: np.ndarray
    across: np.ndarray
    moves: np.ndarray
    offsets: np.ndarray
    within: np.ndarray

    @classmethod
    def of(cls, planned: Planned, surface: np.ndarray, spacing: float) -> Frame:
        """`surface` is SURFACE at the strokes' points, (N, 5)."""
        smooth = along_strokes(planned.xy, planned.offsets, 4.0, spacing, pin=True)
        t = tangents(smooth, planned.offsets)
        across = np.stack([-t[:, 1], t[:, 0]], axis=1)
        moves = moves_of(planned, surface[:, 3:], spacing)
        return cls(planned.xy, t, across, moves, planned.offsets, planned.beyond == 0)


def moves_of(planned: Planned, normals: np.ndarray, spacing: float) -> np.ndarray:
    """The displacement (N, M, 2), px, of each of MOVES at full strength. Points past an end go with it."""
    out = np.zeros((len(planned.xy), len(MOVES), 2))
    within = planned.beyond == 0
    for a, b in zip(planned.offsets[:-1], planned.offsets[1:], strict=True):
        inner = np.flatnonzero(within[a:b]) + a
        a_in, b_in = inner[0], inner[-1] + 1
        p, ends = planned.xy[a_in:b_in], np.array([0, b_in - a_in])
        for k, sigma in enumerate(SMOOTHINGS):
            out[a_in:b_in, k] = along_strokes(p, ends, sigma, spacing, pin=True) - p
        q = along_strokes(p, ends, 4.0, spacing, pin=True)
        s = np.arange(len(p), dtype=np.float64)
        for k, tolerance in enumerate(CUTS, len(SMOOTHINGS)):
            keep = simplify(q, tolerance)
            out[a_in:b_in, k] = np.stack([np.interp(s, keep, q[keep, i]) for i in (0, 1)], axis=1) - p
        out[a_in:b_in, -1] = along_strokes(normals[a_in:b_in], ends, 12.0, spacing)
        out[a:a_in], out[b_in:b] = out[a_in], out[b_in - 1]
    return out


def place(frame: Frame, moves):
    """Where the hand means to draw, (N, 2) px; arrays or tensors."""
    return frame.xy + (frame.moves * moves[:, None]).sum(1)


# --------------------------------------------------------------------------------------------------------- the hand


def wander(hand: Hand, offsets: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """A sequence of residuals (N, 2) for every stroke, cut from the training strokes' and faded into one another."""
    lengths = np.diff(hand.offsets)
    out = np.zeros((offsets[-1], 2))
    if not len(lengths):
        return out
    fade = 8
    for a, b in zip(offsets[:-1], offsets[1:], strict=True):
        n, at = b - a, 0
        while at < n:
            want = n - at
            weight = np.minimum(lengths, want).astype(float)
            i = rng.choice(len(lengths), p=weight / weight.sum())
            take = int(min(lengths[i], want))
            first = int(hand.offsets[i] + rng.integers(lengths[i] - take + 1))
            piece = hand.stray[first : first + take]
            if rng.random() < 0.5:
                piece = piece * [-1, 1]
            over = min(fade, at, take) if at else 0
            ramp = (np.arange(over) + 0.5)[:, None] / max(over, 1)
            start = a + at - over
            # faded by square roots, so that the spread stays
            out[start : start + over] = np.sqrt(1 - ramp) * out[start : start + over] + np.sqrt(ramp) * piece[:over]
            out[start + over : start + take] = piece[over:]
            at += take - over
            if take <= over:
                break
    return out


def lifted(thickness: np.ndarray, offsets: np.ndarray, least: float = 0.5) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Leave out the ends that are too thin to see: rows kept, their offsets, and the strokes kept."""
    rows, counts, kept = [], [0], []
    for i, (a, b) in enumerate(zip(offsets[:-1], offsets[1:], strict=True)):
        seen = np.flatnonzero(thickness[a:b] >= least)
        if len(seen) < 2:
            continue
        first, last = max(seen[0] - 1, 0), min(seen[-1] + 1, b - a - 1)
        rows.append(np.arange(a + first, a + last + 1))
        counts.append(len(rows[-1]))
        kept.append(i)
    rows = np.concatenate(rows) if rows else np.zeros(0, np.int64)
    return rows, np.cumsum(counts), np.array(kept, np.int64)


# ------------------------------------------------------------------------------------------------------------ files


def save_style(path: str | Path, style: Style | PaperStyle) -> None:
    """Write a model file: only arrays and plain values, read back without running code. Whole or not at all."""
    payload = {"format": FORMAT, "strokestyle": __version__, "about": dict(style.about)}
    write_model(path, payload | (_state(style) if isinstance(style, Style) else {"paper": style.state()}))


def _state(style: Style) -> dict:
    return {
        "config": asdict(style.config),
        "network": asdict(style.network),
        "moves": style.moves,
        "features": {
            "names": list(FEATURES),
            **{name: getattr(style, name) for name in ("centre", "spread", "low", "high", "color")},
        },
        "hand": None if style.hand is None else asdict(style.hand),
        "texture": None if style.bank is None else asdict(style.bank),
    }


def load_style(path: str | Path, device: str = "cpu") -> Style | PaperStyle:
    """Read a model file. `device` is where the networks of a PaperStyle go; a Style has nothing to gain from one.

    Raises ValueError, naming the file, where it is no model, is cut short, damaged, or of a newer version; OSError
    where it cannot be read.
    """
    payload = read_model(path)
    if not isinstance(payload.get("format"), int) or "strokestyle" not in payload:
        raise ValueError(f"{path}: not a strokestyle model; expected a file written by `strokestyle fit`")
    if payload["format"] > FORMAT:
        raise ValueError(
            f"{path}: written by strokestyle {payload['strokestyle']} (format {payload['format']}); this is "
            f"{__version__} (format {FORMAT}): update strokestyle"
        )
    if "paper" in payload or device not in ("auto", "cpu"):
        from .devices import pick_device
        from .neural_strokes import PaperStyle

        place = pick_device(device)
    try:
        if "paper" in payload:
            return PaperStyle.from_state(payload["paper"], payload["about"], place)
        return _unpack_style(payload)
    except (KeyError, TypeError, RuntimeError, AttributeError) as error:
        raise ValueError(f"{path}: a damaged strokestyle model ({error}); write it again") from None


def _unpack_style(payload: dict) -> Style:
    known = {f.name for f in fields(StyleConfig)}
    config = {key: value for key, value in payload["config"].items() if key in known}
    config = StyleConfig(**{key: tuple(value) if isinstance(value, list) else value for key, value in config.items()})
    statistics = payload["features"]
    if tuple(statistics["names"]) != FEATURES:
        raise KeyError("its features are not those of this version")
    return Style(
        config=config,
        network=SumOfCurves(**payload["network"]),
        moves=payload["moves"],
        hand=None if payload["hand"] is None else Hand(**payload["hand"]),
        bank=None if payload["texture"] is None else TextureBank(**payload["texture"]),
        about=payload["about"],
        **{name: statistics[name] for name in ("centre", "spread", "low", "high", "color")},
    )
