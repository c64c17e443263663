"""Curves that another program drew, laid on the canvas: a .json, or an SVG."""

from __future__ import annotations

import re
from pathlib import Path

from .. import files as limits
from ..extract.view_file import read_curves_json
from ..files import limited
from ..geometry.curves import Curves
from ..svg.clip_paths import count_clips_of_letters
from ..svg.read_curves import read_curves_svg
from ..svg.style_sheet import name_rules, styles_of

_UNREAD = re.compile(
    rb"""\b(?:(mask|transform-box)\s*[:=]\s*["']?\s*(?!none|view-box)[\w#(-]"""
    rb"""|(clip-path)\s*[:=]\s*["']?\s*(?!none|inherit|initial|unset|url\(\s*(?:&quot;|["'])?#)"""
    rb"[\w#(-])"
)


def unread_properties(path: str | Path) -> dict[str, int]:
    """Count what an .svg or .svgz file says that `load_curves` does not look at, by its name.

    Masks and transform boxes, clip paths of letters and of CSS's shapes, and rules of style sheets
    that it does not understand. A .json file has none. Raises ValueError where the file is no SVG
    or too large, OSError where it cannot be read.
    """
    if Path(path).suffix.lower() == ".json":
        return {}
    with open(path, "rb") as file:
        data = limited(file.read(limits.MAX_BYTES + 1))
    names = [(name or clip).decode() for name, clip in _UNREAD.findall(data)]
    counts = {name: names.count(name) for name in sorted(set(names))}
    if letters := count_clips_of_letters(data):
        counts["clipPath of letters"] = letters
    styles = styles_of(data)
    if styles is not None and styles.unread:
        counts[f"rules of style sheets ({name_rules(styles.unread)})"] = len(styles.unread)
    return counts


def load_curves(path: str | Path, size: tuple[int, int], tolerance: float = 0.1) -> Curves:
    """Read the curves of a .json, .svg or .svgz file onto a canvas.

    The file's page is scaled to the canvas without distortion, and centred where their proportions
    differ. Curves are not resampled, and cut at the file's clip paths only. Curves without two
    distinct points are left out, and so is an SVG's background: a closed shape that runs along the
    page's edge. A curve is closed where its last point is its first.

    A .json file, such as `strokestyle extract` writes, has "curves" [[[x, y], ...], ...] and
    perhaps "kinds" [name, ...], "closed" [true, ...] and "size" [width, height]; without a size its
    coordinates are the canvas's pixels. In an .svg file every subpath of path, line, polyline,
    polygon, rect, circle and ellipse is a curve, of the kind that its own or its nearest ancestor's
    label, id or class names; of one of our own strokes it is the centre line. What `use` draws of
    the same file is drawn; definitions, what attributes or style sheets hide, shapes that have
    neither fill nor stroke, and our own layers of hidden lines are skipped.

    Parameters
    ----------
    size : (width, height) of the canvas, pixels
    tolerance : pixels of the canvas between a curve and its chords

    Raises
    ------
    ValueError
        on a file that is neither, is damaged, too large or unsafe, or has no usable curve.
    OSError
        where the file cannot be read.
    """
    path = Path(path)
    suffix = path.suffix.lower()
    if suffix not in (".json", ".svg", ".svgz"):
        found = f"not from {suffix}" if suffix else "and this name has no such ending"
        raise ValueError(f"{path}: curves are read from a .json or .svg file, {found}")
    with open(path, "rb") as file:
        data = file.read(limits.MAX_BYTES + 1)
    try:
        if suffix == ".json":
            return read_curves_json(limited(data), size)
        return read_curves_svg(limited(data), size, tolerance)
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None
