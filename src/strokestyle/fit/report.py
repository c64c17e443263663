"""Say what a fit was learned from, and show it: the drawing with marks, and what was learned."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from PIL import Image, ImageDraw, ImageFont
from scipy.spatial import cKDTree

from ..drawing.raster import rasterise
from ..drawing.strokes import Drawing
from ..extract.view import View
from ..geometry.curves import arc_length
from ..geometry.threads import each
from .exemplar import Exemplar
from .learn import Learned
from .own_ink import ASTRAY, nearest_strokes, unexplained_ink
from .train import Fitted

# Colours that the colour-blind tell apart (Okabe and Ito 2008)
MARKS = {
    "on no line": (0.90, 0.62, 0.0),
    "hatching": (0.80, 0.47, 0.65),
    "blot": (0.0, 0.62, 0.45),
    "line not drawn": (0.0, 0.45, 0.70),
    "not believed": (0.84, 0.0, 0.0),
}
PALE = 0.55  # what is left of the ink's darkness under the marks
DASH = 4.0  # px on and off
LETTERS = 0.022  # of the longer side
MIN_LEGEND = 200  # px: on a smaller canvas a legend would hide the drawing
SAME = 1.0  # px: a curve this near to one that was drawn is that one

# What is worth a line on the terminal. A trace errs by some per cent of the ink, and by a px.
MUCH_OFF_LINES, MUCH_TAKEN_OFF = 0.05, 0.02  # of the ink
FAR_OFF = 2.0  # px at 768: as far as lines of clean drawings lie from their curves by manner alone
REFERENCE = 768.0  # px


@dataclass(frozen=True)
class Account:
    """What became of a drawing's ink, in shares of it, and how its lines lay.

    Parameters
    ----------
    on_lines : under the strokes as they were traced
    hatching, blots : taken off, not learned from
    elsewhere : the rest, which no stroke explains
    off : px, median by which the drawing's lines lay beside their curves for no reason of manner
    manner : whether a manner of placing them could be told from that
    """

    on_lines: float
    hatching: float
    blots: float
    elsewhere: float
    off: float
    manner: bool

    def words(self, size: int) -> list[str]:
        """What of this is worth telling the artist, of a canvas whose longer side is `size` px."""
        said = []
        taken = [
            f"{100 * share:.0f} % {name}"
            for name, share in (("hatching", self.hatching), ("filled in", self.blots))
            if share >= MUCH_TAKEN_OFF
        ]
        if taken:
            said.append(f"of its ink {' and '.join(taken)}, which is not learned yet")
        if self.elsewhere >= MUCH_OFF_LINES:
            said.append(f"{100 * self.elsewhere:.0f} % of its ink lies on no line of this view")
        if self.off >= FAR_OFF * size / REFERENCE:
            manner = "" if self.manner else ", too far to tell how its lines are meant to be placed"
            said.append(f"its lines lie {self.off:.1f} px beside the curves{manner}")
        return said


def account(exemplar: Exemplar, learned: Learned) -> Account:
    """Count what of a drawing was learned from."""
    mask, ink = exemplar.mask, learned.ink
    total = max(float(mask.sum()), 1e-9)
    hatching, blots = (
        float((mask * part).sum()) / total for part in (ink.hatching, ink.blots & ~ink.hatching)
    )
    elsewhere = float((mask * ink_on_no_line(exemplar, learned)).sum()) / total
    moved = np.hypot(*learned.alignment.shift.T)[learned.alignment.explained]
    return Account(
        on_lines=max(0.0, 1.0 - hatching - blots - elsewhere),
        hatching=hatching,
        blots=blots,
        elsewhere=elsewhere,
        off=float(np.median(moved)) if len(moved) else 0.0,
        manner=bool(learned.alignment.free.any()),
    )


def ink_on_no_line(exemplar: Exemplar, learned: Learned) -> np.ndarray:
    """Find the ink, (H, W) bool, that lies on no stroke as traced, and is no hatching or blot."""
    nearest = nearest_strokes(learned.strokes, exemplar.mask.shape[::-1], reach=ASTRAY)
    return unexplained_ink(nearest, exemplar.mask) & ~learned.ink.taken_off


def fit_report(view: View, exemplar: Exemplar, fitted: Fitted) -> np.ndarray:
    """Show the exemplar, the exemplar with marks, the drawn mask and the drawing side by side.

    (H, 4 W, 3) float32 in [0, 1], on white. Marks are what `MARKS` names; the paper's networks
    do not tell what they learned from, and the second picture is the mask.
    """
    drawing = fitted.style.draw(view, seed=0)
    flat = replace(
        drawing, color=np.tile([0.0, 0.0, 0.0, 1.0], (len(drawing.strokes), 1)), texture=None
    )
    if fitted.learned is None:
        marked = np.repeat(1 - exemplar.mask[..., None], 3, axis=2)
    else:
        marked = marked_drawing(view, exemplar, fitted, fitted.learned)
    panels = [exemplar.rgb, marked, *each(_on_white, (flat, drawing))]
    return np.concatenate(panels, axis=1).astype(np.float32)


def marked_drawing(view: View, exemplar: Exemplar, fitted: Fitted, learned: Learned) -> np.ndarray:
    """Mark in a pale mask what was not learned from: (H, W, 3) float32 in [0, 1]."""
    picture = np.repeat(1.0 - PALE * exemplar.mask[..., None], 3, axis=2)
    found = {
        "on no line": ink_on_no_line(exemplar, learned),
        "hatching": learned.ink.hatching,
        "blot": learned.ink.blots,
    }
    for name, where in found.items():
        picture[where] = MARKS[name]
    image = Image.fromarray(np.rint(picture * 255).astype(np.uint8))
    pen = ImageDraw.Draw(image)
    dashes = _lines_not_drawn(view, fitted.lines.view)
    for dash in dashes:
        pen.line([tuple(point) for point in dash], fill=_byte("line not drawn"), width=1)
    for x, y in learned.rejected:
        pen.ellipse([x - 1, y - 1, x + 1, y + 1], fill=_byte("not believed"))
    shown = [name for name, where in found.items() if where.any()]
    shown += ["line not drawn"] * bool(dashes) + ["not believed"] * bool(len(learned.rejected))
    if min(image.size) >= MIN_LEGEND:
        _legend(pen, shown, max(10.0, LETTERS * max(image.size)))
    return np.asarray(image, np.float32) / 255.0


def _lines_not_drawn(view: View, drawn: View) -> list[np.ndarray]:
    """Dashes (n, 2), px, along the lines of a view that are not among those that were `drawn`."""
    curves, dashes = view.curves, []
    along = arc_length(curves.xy, curves.offsets)
    near = np.full(len(curves.xy), np.inf)
    if len(drawn.curves.xy):
        near, _ = cKDTree(drawn.curves.xy).query(curves.xy)
    for i, (a, b) in enumerate(zip(curves.offsets[:-1], curves.offsets[1:], strict=True)):
        if view.optional is not None and view.optional[i]:
            continue
        left = near[a:b] > SAME
        on = left & (along[a:b] // DASH % 2 == 0)
        edges = np.flatnonzero(np.diff(np.r_[False, on, False].astype(int)))
        dashes += [
            curves.xy[a + first : a + min(last + 1, b - a)]
            for first, last in zip(edges[::2], edges[1::2], strict=True)
        ]
    return [dash for dash in dashes if len(dash) > 1]


def _legend(pen: ImageDraw.ImageDraw, names: list[str], size: float) -> None:
    """Name the marks in the picture's upper left corner, in letters of `size` px."""
    font = ImageFont.load_default(size)
    for row, name in enumerate(names):
        x, y = size / 2, size * (0.5 + 1.4 * row)
        pen.rectangle([x, y + 0.2 * size, x + 0.8 * size, y + size], fill=_byte(name))
        pen.text((x + 1.4 * size, y), name, fill=(60, 60, 60), font=font)


def _byte(name: str) -> tuple[int, ...]:
    return tuple(round(255 * channel) for channel in MARKS[name])


def _on_white(drawing: Drawing) -> np.ndarray:
    return rasterise(drawing, 1.0, (1.0, 1.0, 1.0)).astype(np.float32) / 255.0
