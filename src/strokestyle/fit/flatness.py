"""Tell flat ink from a medium with a texture.

Flat ink has one tone, and edges that a lens, a scanner or the pixels' size may have blurred. Where
its strokes have an inside, that is even; where they are too thin to have one, it still runs evenly
along them. Compared is the drawing itself with that, not with strokes drawn anew, since a trace
that lies a little beside its ink, or is a little too thin, is no texture.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import ndimage
from scipy.special import ndtr

from ..drawing.ribbon import across
from ..geometry.curves import owner
from ..render.texture_bank import (
    ROWS,
    Rows,
    TextureBank,
    smooth_rows,
    solid_ink,
    stroke_ink,
)

# Chosen on ten media, drawn at 768, 400, 300 and 256 px, one as JPEG. Of flat ink tones ranged over
# 0.11 at most, the shape of lines over 0.15, and the ink along them changed by 0.040; of each of
# the others tones ranged over 0.23 at least, or the ink changed by 0.065. A fineliner whose
# pressure comes and goes was paler by 0.32, flat pens by 0.09 at most.
RANGE = 0.05, 0.95  # quantiles, from and to which a range goes
UNEVEN = 0.16  # of the ink's contrast: the range of tones inside the strokes
ODD = 0.2  # of the opacity: the same for the difference from even lines with blurred edges
RAGGED = 0.053  # of the ink across a stroke: its mean change within SLOW px along
PALE, PALEST, TRACE = 0.2, 0.1, 0.1  # of the opacity; quantile of rows; of the usual ink
MAX_BLUR = 1.4  # px, sigma of edges, as of a drawing enlarged threefold; softer is a medium
BLURS = (0.35, 0.5, 0.7, 1.0, 1.4, 2.0, 2.8, 4.0)  # px, tried
DEEP, LEAST_DEEP, MOST_DEEP = 1.5, 1.5, 2.1  # of the blur, and px from the edge: that is inside
SIGHT = 0.5  # px, sigma under which a tone is looked at
FAST, SLOW = 0.5, 4.0  # px along a stroke
MIN_FORETOLD = 0.05  # opacity: of less nothing can be said
OUT_OF_EDGE = 0.5  # of the blur, from a line's edge: there its opacity is steady
MIN_INSIDE = 150.0  # px of area, less inside than which tells nothing
MAX_OCCLUSION = 0.2  # of rows that are looked at
PAST_ENDS = 1.0  # px from an end where a stroke is whole
TRUE_OPACITY = 0.8  # quantile, over the wider half of the rows, of the highest opacity in each


@dataclass(frozen=True)
class Evenness:
    """How even the ink of a drawing's strokes is.

    Parameters
    ----------
    uneven : range of tones inside the strokes, of the ink's contrast; 0 where they have no inside
    odd : range of the opacity about that of even lines, of the ink's opacity
    ragged : mean change of the ink along the strokes, of the ink
    pale : by how much the palest tenth of the strokes is paler than a line as thin would be
    blur : px, sigma of the edges
    """

    uneven: float
    odd: float
    ragged: float
    pale: float
    blur: float

    @property
    def flat(self) -> bool:
        """Whether that is flat ink."""
        even = self.uneven <= UNEVEN and self.odd <= ODD and self.pale <= PALE
        return even and self.ragged <= RAGGED and self.blur <= MAX_BLUR


def evenness(bank: TextureBank, rows: Rows, strips: np.ndarray) -> Evenness:
    """Measure how even the ink of training strips (R, A, 4), premultiplied, is.

    Parameters
    ----------
    bank : made of them
    rows : theirs
    strips : where `bank.occlusion` is low, the strokes' own ink
    """
    seen = (rows.ends.min(axis=1) > PAST_ENDS) & (bank.occlusion < MAX_OCCLUSION)
    if strips[..., 3].max(initial=0.0) < MIN_FORETOLD:  # no ink to speak of is no flat ink
        return Evenness(0.0, 0.0, 0.0, 1.0, 0.0)
    if not seen.any():
        return Evenness(0.0, 0.0, 0.0, 0.0, 0.0)
    line = _Line.of(bank, rows, strips[..., 3], seen)
    blur = min(BLURS, key=line.misfit)
    deep = np.clip(DEEP * blur, LEAST_DEEP, MOST_DEEP)
    inside = line.inside(deep)
    uneven = 0.0
    if inside.sum() / ROWS**2 >= MIN_INSIDE:
        uneven = _range_of_tones(bank, rows, strips, inside)
    return Evenness(uneven, line.odd(blur), line.ragged(), line.pale(blur), blur)


@dataclass(frozen=True)
class _Line:
    """The strips' opacity as lines of one ink.

    Parameters
    ----------
    alpha : (r, A), rows that are looked at
    aside : (r, A) px from the line's middle
    ink : (r, 2) px of ink across, as it changes fast and slowly along
    opacity : of the ink
    seen : (R,) bool, which rows they are
    """

    alpha: np.ndarray
    aside: np.ndarray
    ink: np.ndarray
    opacity: float
    seen: np.ndarray

    @classmethod
    def of(cls, bank: TextureBank, rows: Rows, alpha: np.ndarray, seen: np.ndarray) -> _Line:
        columns = alpha.shape[1]
        half = 0.5 * rows.width + bank.margin
        aside = across(columns) * half[:, None]
        area = alpha * (2.0 * half / columns)[:, None]
        sums = np.stack([area.sum(axis=1), (area * aside).sum(axis=1)], axis=1)
        trust = 1.001 - bank.occlusion
        fast = smooth_rows(sums, rows.offsets, FAST * ROWS, trust)
        slow = smooth_rows(sums[:, :1], rows.offsets, SLOW * ROWS, trust)
        middle = fast[:, 1] / np.maximum(fast[:, 0], 1e-6)
        ink = np.stack([fast[:, 0], slow[:, 0]], axis=1)
        wide = seen & (ink[:, 1] >= np.median(ink[seen, 1]))  # of thin lines a blur takes the peak
        steady = ndimage.gaussian_filter1d(alpha[wide], SIGHT * ROWS, axis=1)  # splines overshoot
        opacity = float(np.quantile(steady.max(axis=1), TRUE_OPACITY))
        return cls(alpha[seen], (aside - middle[:, None])[seen], ink[seen], opacity, seen)

    @property
    def half(self) -> np.ndarray:
        """(r, 1) px, half the thickness of a line of this ink."""
        return 0.5 * self.ink[:, :1] / max(self.opacity, 1e-6)

    def misfit(self, blur: float) -> float:
        """Mean difference from even lines whose edges are blurred by `blur` px."""
        return float(np.abs(self._off(blur)).mean())

    def odd(self, blur: float) -> float:
        """Range of the difference from even lines of that blur, between the strokes' edges."""
        within = np.abs(self.aside) < self.half - OUT_OF_EDGE * blur
        if not within.any():
            return 0.0
        off = ndimage.gaussian_filter(self._off(blur), SIGHT * ROWS)[within]
        low, high = np.quantile(off, RANGE)
        return float((high - low) / max(self.opacity, 1e-6))

    def _off(self, blur: float) -> np.ndarray:
        """(r, A) opacity beside that of even lines whose edges are blurred by `blur` px."""
        return self.alpha - self.opacity * self.cover(blur)

    def cover(self, blur: float) -> np.ndarray:
        """(r, A) in [0, 1], how even lines whose edges are blurred by `blur` px cover the paper."""
        edges = [ndtr((self.aside + side * self.half) / blur) for side in (1.0, -1.0)]
        return edges[0] - edges[1]

    def inside(self, deep: float) -> np.ndarray:
        """(R, A) bool, texels farther than `deep` px from the edges."""
        out = np.zeros((len(self.seen), self.alpha.shape[1]), bool)
        out[self.seen] = np.abs(self.aside) < self.half - deep
        return out

    def ragged(self) -> float:
        """Mean change of the ink along the lines, of the ink."""
        return float(np.abs(np.diff(self.ink, axis=1)).sum() / max(self.ink[:, 1].sum(), 1e-6))

    def pale(self, blur: float) -> float:
        """How much paler the palest rows are than lines with as much ink, blurred by `blur` px.

        Where a hand presses less, flat ink gets thinner; another medium as broad, and paler.
        """
        inked = self.ink[:, 1] > TRACE * np.median(self.ink[:, 1])
        if not inked.any():
            return 0.0
        foretold = self.opacity * self.cover(blur)[inked].max(axis=1)
        share = self.alpha[inked].max(axis=1) / np.maximum(foretold, MIN_FORETOLD)
        return float(1.0 - np.quantile(share, PALEST))


def _range_of_tones(bank: TextureBank, rows: Rows, strips: np.ndarray, inside: np.ndarray) -> float:
    """How far tones `inside` (R, A) range about those of flat ink, of the ink's contrast."""
    predicted = solid_ink(bank.predicted_ink.astype(np.float64), bank)
    ink = stroke_ink(rows, predicted)[owner(rows.offsets)]
    flat = np.maximum((ink[:, 3:] * (1.0 - ink[:, :3])).mean(axis=1), 1e-3)[:, None]
    darkness = strips[..., 3] - strips[..., :3].mean(axis=2)
    off = ndimage.gaussian_filter(darkness, SIGHT * ROWS) / flat
    low, high = np.quantile(off[inside], RANGE)
    return float(high - low)
