"""The file format: options, names, units, and the attributes that make a stroke readable."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass, fields
from typing import Any, NamedTuple
from urllib.parse import quote, unquote

from .markup import number

FORMAT = 4
MM_PER_PX = 25.4 / 96.0  # CSS pixels
TEXTURES = ("auto", "vector", "image", "none")
MAX_TONES = 8
LAYERS = ("kind", "part", "none")
PAPERS = {  # mm, upright
    "A0": (841, 1189), "A1": (594, 841), "A2": (420, 594), "A3": (297, 420), "A4": (210, 297),
    "A5": (148, 210), "A6": (105, 148),
    "LETTER": (215.9, 279.4), "LEGAL": (215.9, 355.6), "TABLOID": (279.4, 431.8),
}  # fmt: skip

UNITS = {"mm": 1.0, "cm": 10.0, "in": 25.4, "pt": 25.4 / 72, "px": MM_PER_PX}
LICENSES = {
    "CC0-1.0": "https://creativecommons.org/publicdomain/zero/1.0/",
    **{
        f"CC-{terms.upper()}-4.0": f"https://creativecommons.org/licenses/{terms}/4.0/"
        for terms in ("by", "by-sa", "by-nd", "by-nc", "by-nc-sa", "by-nc-nd")
    },
}

INKSCAPE_NAMESPACE = "http://www.inkscape.org/namespaces/inkscape"

RDF_NAMESPACES = {
    "xmlns:rdf": "http://www.w3.org/1999/02/22-rdf-syntax-ns#",
    "xmlns:cc": "http://creativecommons.org/ns#",
    "xmlns:dc": "http://purl.org/dc/elements/1.1/",
}


class Data:
    """Names of the attributes that say what a file of ours draws.

    docs/svg-format.md says what each means.
    """

    # of the root
    FORMAT = "data-ss-format"
    GENERATOR = "data-ss-generator"
    SIZE = "data-ss-size"
    PAGE = "data-ss-page"
    OPTIONS = "data-ss-options"
    PARTS = "data-ss-parts"
    WAS = "data-ss-was"
    # of a layer
    HIDDEN = "data-ss-hidden"
    # of a stroke; the kind also of a group of one kind
    CLASS = "data-ss-class"
    PART = "data-ss-part"
    TRACK = "data-ss-track"
    PATH = "data-ss-path"
    WIDTH = "data-ss-width"
    CLOSED = "data-ss-closed"
    OPACITY = "data-ss-opacity"
    MARGIN = "data-ss-margin"
    AT = "data-ss-at"
    RINGS = "data-ss-rings"
    SPINE = "data-ss-spine"
    SWELL = "data-ss-swell"
    TEXTURE = "data-ss-texture"
    STRIP = "data-ss-strip"


DATA = "data-ss-"  # what all of these begin with
ATTRIBUTES = {name: value for name, value in vars(Data).items() if name.isupper()}
TRACK_NAME = re.compile(r"[\w.-]{1,100}", re.ASCII)  # what a stroke's track may be called
STROKE_CLASS, CURVE_CLASS, PART_CLASS = "stroke", "curve", "part"  # of elements and of layers
TONE_CLASS = "tone"  # of the shapes of a textured stroke behind the first, which has its data
PAPER_ID = "paper"  # of the rectangle behind everything

# how a stroke is told
PATH_SLACK = 0.06  # px a centre line may be off where its attribute leaves points out
WIDTH_SLACK = 0.004  # px a width may be off where its attribute leaves points out
SHARE_DECIMALS = 5  # of a place along a stroke, as a share of its length
WIDTH_DECIMALS = 3
LANDMARK_DECIMALS = 3
MARGIN_DECIMALS = 4

# how its texture is drawn
TONE_UNIT = (
    0.15  # px of path data; polygons have even numbers of it: the middles of sides are whole
)
# svgo works a transform into every number of a path that has no style; MuPDF does not know all that
# may be said in one, so this says nothing
TONE_LOOK = {"style": "opacity:1", "transform": f"scale({number(TONE_UNIT, 4)})"}
IMAGE_LEVELS_GRAIN = 10  # of opacity in one ink: grain hides coarse steps and costs many bytes
IMAGE_LEVELS_SOFT = 32  # soft tone shows them
IMAGE_COLORS = 128  # of a drawing in more than one ink; a stroke holds those that it uses
STRIP_LEVELS, STRIP_COLORS = 16, 16  # what 4 bits a texel hold
STRIP_LEVELS_FEW = 6  # beside a few tones, which need no more: half the text

FORMAT_CONSTANTS = {  # what a program that writes such files besides this one must know
    "FORMAT": FORMAT,
    "DATA": DATA,
    "ATTRIBUTES": ATTRIBUTES,
    "STROKE_CLASS": STROKE_CLASS,
    "TONE_CLASS": TONE_CLASS,
    "PAPER_ID": PAPER_ID,
    "PATH_SLACK": PATH_SLACK,
    "WIDTH_SLACK": WIDTH_SLACK,
    "SHARE_DECIMALS": SHARE_DECIMALS,
    "WIDTH_DECIMALS": WIDTH_DECIMALS,
    "LANDMARK_DECIMALS": LANDMARK_DECIMALS,
    "MARGIN_DECIMALS": MARGIN_DECIMALS,
    "TONE_UNIT": TONE_UNIT,
    "MAX_TONES": MAX_TONES,
    "IMAGE_LEVELS_GRAIN": IMAGE_LEVELS_GRAIN,
    "IMAGE_LEVELS_SOFT": IMAGE_LEVELS_SOFT,
    "IMAGE_COLORS": IMAGE_COLORS,
    "STRIP_LEVELS": STRIP_LEVELS,
    "STRIP_COLORS": STRIP_COLORS,
    "STRIP_LEVELS_FEW": STRIP_LEVELS_FEW,
}


def usual_rings(closed: bool) -> int:
    """Count the rings of a stroke's outline where it does not cross itself."""
    return 2 if closed else 1


class Limit(NamedTuple):
    """The most that is read of something, and of what."""

    value: int
    what: str


LIMITS = {  # of a file that is read as a drawing; those of any file are in files.py
    "strokes": Limit(20_000, "strokes, and names of parts"),
    "path_characters": Limit(1_000_000, "characters of a centre line, or of its widths"),
    "parts_characters": Limit(1_000_000, "characters of the list of parts that are looked at"),
    "place": Limit(1_000_000, "px from the canvas's origin, and of the canvas's sides"),
    "texels": Limit(64_000_000, "texels of a drawing, all strips as wide as the widest"),
    "texels_read": Limit(8_000_000, "texels of the strips that are read off what is drawn"),
    "strip_texels": Limit(2_000_000, "texels of a strip that is told"),
    "image_pixels": Limit(4_000_000, "pixels of an image"),
    "pixels_read": Limit(40_000_000, "pixels of all images"),
    "rings": Limit(20_000, "rings of a tone that are read the short way"),
    "looks": Limit(200_000_000, "looks at a texel for a tone, and at a tone's edge at its height"),
}


@dataclass(frozen=True)
class SvgOptions:
    """How a drawing is written as SVG.

    Parameters
    ----------
    texture : "none": a filled outline per stroke in its flat ink. "vector": the texture in a few
        tones, as paths. "image": a raster of each stroke. "auto": vector for grain in one ink,
        image for soft or coloured texture, else none.
    tones : how many, 1 to 8, of "vector"
    texture_res : pixels of those rasters per pixel of the drawing
    decimals : of every coordinate
    tolerance : pixels between an outline and the exact one
    layers : "kind", one group (an Inkscape layer) per line kind, and in it one for each named part
        of the shape; "part", one per part, and in it one for each kind; "none", the strokes lie in
        the root, in painting order
    title, description, author : words about the drawing
    license : the name of a Creative Commons licence (LICENSES), a URL, or other words
    background : "#rrggbb" or a CSS colour's name for a rectangle behind everything; None leaves the
        page clear
    page_size : a name of PAPERS, turned as the canvas lies, or "WxHmm" (cm, in, pt, px); the canvas
        is fitted into it and centred. None: the canvas, at 96 pixels an inch
    inkscape_lpe : flat strokes are PowerStrokes besides: other programs show our outline, Inkscape
        edits the widths
    plotter : centre lines only, in mm, in an order of little travel; nothing can be read back from
        such a file

    Raises
    ------
    ValueError
        on a name that is not known, or a number that makes no picture.
    """

    texture: str = "auto"
    tones: int = 3
    texture_res: float = 1.75
    decimals: int = 2
    tolerance: float = 0.1
    layers: str = "kind"
    title: str = ""
    description: str = ""
    author: str = ""
    license: str = ""
    background: str | None = None
    page_size: str | None = None
    inkscape_lpe: bool = False
    plotter: bool = False

    def __post_init__(self):
        if self.texture not in TEXTURES:
            raise ValueError(f"texture must be one of {', '.join(TEXTURES)}, got {self.texture!r}")
        if not 1 <= self.tones <= MAX_TONES:
            raise ValueError(f"tones must lie between 1 and {MAX_TONES}, got {self.tones}")
        if not 0.1 <= self.texture_res <= 16:
            raise ValueError(
                "the texture's resolution must lie between 0.1 and 16 px per px, "
                f"got {self.texture_res}"
            )
        if not 0 <= self.decimals <= 6:
            raise ValueError(f"decimals must lie between 0 and 6, got {self.decimals}")
        if not 0 < self.tolerance <= 100:
            raise ValueError(
                "the tolerance of an outline must lie above 0 and below 100 px, "
                f"got {self.tolerance}"
            )
        if self.layers not in LAYERS:
            raise ValueError(f"layers must be one of {', '.join(LAYERS)}, got {self.layers!r}")
        if self.background is not None:
            check_color(self.background)
        if self.inkscape_lpe and self.texture not in ("none", "auto"):
            raise ValueError("PowerStrokes are flat: write them with texture none")
        page_size_mm(self.page_size, (1, 1))

    def to_text(self) -> str:
        """What no element tells, as `data-ss-options`."""
        return " ".join(
            f"{name}={quote(str(getattr(self, name)), safe='#')}"
            for name in WRITTEN
            if self._given(name)
        )

    def _given(self, name: str) -> bool:
        return getattr(self, name) != DEFAULTS[name] or name == "texture"

    @classmethod
    def from_text(cls, text: str, **known) -> SvgOptions:
        """The options that `to_text` wrote.

        Names and values that this version does not know are left out.
        """
        types: dict[str, Callable[[str], Any]] = {
            "texture_res": float,
            "tolerance": float,
            "decimals": int,
            "tones": int,
            "inkscape_lpe": _flag,
            "plotter": _flag,
        }
        for name, _, value in (part.partition("=") for part in text[:4000].split()):
            if name in WRITTEN:
                try:
                    cls(**{name: types.get(name, str)(unquote(value))})
                except ValueError:
                    continue
                known[name] = types.get(name, str)(unquote(value))
        return cls(**known)


def _flag(text: str) -> bool:
    return text == "True"


ELSEWHERE = ("title", "description", "author", "license")  # told by elements of their own
WRITTEN = tuple(field.name for field in fields(SvgOptions) if field.name not in ELSEWHERE)
DEFAULTS = {field.name: field.default for field in fields(SvgOptions)}


def check_color(text: str) -> None:
    """Raise ValueError unless `text` is #rgb, #rrggbb or the name of a CSS colour."""
    from PIL import ImageColor  # its map has the 148 names of CSS Color Module Level 4

    if text.lower() in ImageColor.colormap:
        return
    if not re.fullmatch(r"#[0-9a-fA-F]{3}|#[0-9a-fA-F]{6}", text):
        raise ValueError(f"a colour is #rrggbb or a name such as ivory, got {text!r}")


def page_size_mm(name: str | None, size: tuple[int, int]) -> tuple[float, float] | None:
    """A page size as (width, height) in mm, for a canvas of `size`; None stays None.

    Raises ValueError.
    """
    if name is None:
        return None
    if name.upper() in PAPERS:
        short, long = PAPERS[name.upper()]
        return (long, short) if size[0] > size[1] else (short, long)
    match = re.fullmatch(
        r"([0-9]+\.?[0-9]*)x([0-9]+\.?[0-9]*)(mm|cm|in|pt|px)", name.strip().lower()
    )
    across, down = (float(match[k]) * UNITS[match[3]] if match else 0.0 for k in (1, 2))
    if not all(1.0 <= side <= 100_000 for side in (across, down)):
        names = ", ".join(key.title() for key in PAPERS)
        raise ValueError(f"a page size is one of {names}, or for instance 210x297mm; got {name!r}")
    return across, down
