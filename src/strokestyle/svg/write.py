"""Write drawings as SVG that illustrators keep working in.

docs/svg-format.md says what its attributes mean.
"""

from __future__ import annotations

import base64
import gzip
import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from itertools import count
from pathlib import Path

import numpy as np
import resvg_py

from ..drawing.outline import outlines
from ..drawing.ribbon import overlaps, ribbon
from ..drawing.strokes import Drawing, order_of_kinds, paint_order
from ..files import write_bytes
from ..geometry.curves import KINDS, Curves
from ..geometry.parts import Parts
from .centre_lines import plotter_svg
from .document import LayerItem, Page, document, drawing_data, layered
from .format import (
    CURVE_CLASS,
    DATA,
    STRIP_LEVELS,
    STRIP_LEVELS_FEW,
    STROKE_CLASS,
    TONE_CLASS,
    TONE_LOOK,
    TRACK_NAME,
    Data,
    SvgOptions,
    usual_rings,
)
from .images import stroke_images
from .ink import Inks, inks
from .kept import DrawnStroke, Kept, kept_strokes
from .landmarks import fine_line, landmarks
from .markup import Element, hex_color, number, polyline_path, printable, rings_path
from .path_data import page_length, parse_numbers
from .png import with_resolution
from .power_stroke import EFFECT, effect, power_strokes, swell
from .strip_image import strips_png
from .stroke_data import edge_at, knots_of, places_at, stroke_data
from .tones import ToneShape, tone_shapes, tones

CSS_DPI = 96.0  # pixels an inch
MAX_PIXELS = 200_000_000  # of a PNG; A0 at 300 an inch has 139 million, and takes 1.2 GB
PAGE_SIDES = re.compile(r'\s(?:width|height)="[^"]*"')
SAME_INK = 2.5 / 255  # colours nearer than this are one
NEAR_INK = 24 / 255  # and nearer than this not far off
ID = re.compile(r"[A-Za-z_][\w.-]{0,99}", re.ASCII)
RESERVED = re.compile(f"paper|layer-({'|'.join(KINDS)})")
RESERVED_WITH_PARTS = re.compile("paper|(layer|part)-.*")


def write_svg(
    drawing: Drawing,
    options: SvgOptions | None = None,
    *,
    ids: Sequence[str] | None = None,
    kept: Kept | None = None,
    strips: bool = False,
    **changes,
) -> str:
    """Write a drawing as SVG text; the same drawing gives the same text.

    Parameters
    ----------
    options : how to write it
    ids : (C,) names for the strokes; those that are empty, repeated or no names are made new. None:
        s000, s001 ... in painting order; of a drawing of an animation, by their tracks
    kept : `SvgFile.kept` of the file that the drawing comes from: strokes that nobody changed since
        are written as they were in it
    strips : write every stroke's strip, as `data-ss-strip` where it can be read off what is drawn,
        and all data on its outermost element: for `page_html`
    changes : fields of SvgOptions, in place of those of `options`

    Raises
    ------
    ValueError
        on options that do not hold.
    """
    options = replace(options or SvgOptions(), **changes)
    if options.plotter:
        return plotter_svg(drawing, options)
    ink = _inks(drawing, options)
    options = resolve_texture(drawing, options, ink)
    order = paint_order(drawing, options.layers)
    strokes = kept_strokes(drawing, options, kept or {})
    new = order[[i not in strokes for i in order.tolist()]]
    strokes |= zip(new.tolist(), _drawn(drawing, options, new, ink), strict=True)
    if ink is not None:
        told = _told_strips(drawing, options, strokes, new, strips)
        strokes |= {i: _with_attributes(strokes[i], strip) for i, strip in told.items()}
    names = _names(order, ids or _ids_of_tracks(drawing.track), drawing.parts is not None)
    items = [_item(drawing, i, names[i], strokes[i], strips) for i in order.tolist()]
    layers = options.layers
    content = [item.element for item in items] if layers == "none" else layered(items, layers)
    effects = [
        effect(names[i], strokes[i].offset_points)
        for i in order.tolist()
        if strokes[i].offset_points
    ]
    page = Page.of_canvas(drawing.size, options)
    data = drawing_data(drawing.size, page, options, _used_parts(drawing, items))
    return document(content, page, options, data, effects)


def write_frames(
    drawings: Iterable[Drawing], options: SvgOptions | None = None, **changes
) -> Iterator[str]:
    """Write the drawings of an animation as SVG texts, one after the other.

    All are written alike: what `texture` "auto" means is decided by the first that has texture.
    Arguments and errors are those of `write_svg`.
    """
    options = replace(options or SvgOptions(), **changes)
    for drawing in drawings:
        if drawing.texture is not None and options.texture == "auto":
            options = resolve_texture(drawing, options)
        yield write_svg(drawing, options)


def _used_parts(drawing: Drawing, items: list[LayerItem]) -> list[str]:
    """The names of the parts that have strokes, in painting order."""
    if drawing.parts is None:
        return []
    used = {item.part for item in items}
    return [name for name in drawing.parts.names if name in used]


def _with_attributes(stroke: DrawnStroke, more: dict[str, str]) -> DrawnStroke:
    element = replace(stroke.element, attributes=more | stroke.element.attributes)
    return replace(stroke, element=element)


def _told_strips(
    drawing: Drawing,
    options: SvgOptions,
    strokes: dict[int, DrawnStroke],
    new: np.ndarray,
    every: bool,
) -> dict[int, dict[str, str]]:
    """The attribute that holds the strip of each stroke that needs one.

    What is drawn shows the texture, and is where a reader finds it, but for strokes that lie on
    themselves; `every`: the page, which does not read it there, wants those of the others too.
    """
    assert drawing.texture is not None  # asked of drawings whose texture is shown
    margin = drawing.texture.margin
    lying = [i for i in new.tolist() if _overlaps(drawing, i, margin[i])]
    told = {i for i, stroke in strokes.items() if Data.TEXTURE in stroke.element.attributes}
    others = sorted(strokes.keys() - told.union(lying)) if every else []
    few = STRIP_LEVELS_FEW if options.texture == "vector" else STRIP_LEVELS
    return {
        i: {name: base64.b64encode(strip).decode("ascii")}
        for name, index, levels in (
            (Data.TEXTURE, lying, few),
            (Data.STRIP, others, STRIP_LEVELS),
        )
        for i, strip in zip(index, strips_png(drawing, index, levels), strict=True)
    }


def _item(drawing: Drawing, i: int, name: str, stroke: DrawnStroke, strips: bool) -> LayerItem:
    part = "" if drawing.parts is None else drawing.parts.name(i)
    given = {"id": name, "class": STROKE_CLASS, **stroke.element.attributes}
    if part:
        given[Data.PART] = printable(part)
    track = "" if drawing.track is None else drawing.track[i]
    if TRACK_NAME.fullmatch(track):
        given[Data.TRACK] = track
    if stroke.offset_points:
        given["inkscape:path-effect"] = f"#{EFFECT}{name}"
    kind = KINDS[drawing.strokes.kind[i]]
    element = replace(stroke.element, attributes=given)
    if not strips:
        element = _with_data_on_first_shape(element)
    if any(shape.tag == "path" for shape in element.children):
        # a stroke that was scaled keeps its transform: where there are but paths, svgo works it
        # into theirs, and rounds the product to as many decimals as it had (1.5 x .15 is .2)
        named = (Element("desc", {}, text=kind), *element.children)
        element = replace(element, children=named)
    return LayerItem(element, kind, part)


def _with_data_on_first_shape(stroke: Element) -> Element:
    """A stroke whose group may be taken apart: its data stand on the first shape in it."""
    if not stroke.children:
        return stroke
    group = {k: value for k, value in stroke.attributes.items() if not k.startswith(DATA)}
    data = {k: value for k, value in stroke.attributes.items() if k.startswith(DATA)}
    first, *others = stroke.children
    shapes = [replace(first, attributes=data | first.attributes)]
    shapes += [replace(tone, attributes={"class": TONE_CLASS} | tone.attributes) for tone in others]
    return replace(stroke, attributes=group, children=tuple(shapes))


def resolve_texture(drawing: Drawing, options: SvgOptions, ink: Inks | None = None) -> SvgOptions:
    """Give the options with the texture that `write_svg` will choose for this drawing.

    `ink` are the inks of its texture, where they are known.
    """
    texture = options.texture
    if options.inkscape_lpe or drawing.texture is None:
        texture = "none"
    elif texture == "auto":
        texture = "vector" if (ink or inks(drawing.texture)).of_grain else "image"
    return replace(options, texture=texture)


def _inks(drawing: Drawing, options: SvgOptions) -> Inks | None:
    """The inks of a drawing whose texture is to be shown."""
    flat = options.texture == "none" or options.inkscape_lpe
    return None if flat or drawing.texture is None else inks(drawing.texture)


def _ids_of_tracks(track: Sequence[str] | None) -> list[str] | None:
    """The ids that strokes of an animation have in all its drawings: s012 of the track 12."""
    if track is None:
        return None
    padded = (re.sub("^[0-9]+", lambda number: number[0].zfill(3), name) for name in track)
    return [f"s{name}" if name else "" for name in padded]


def _names(order: np.ndarray, ids: Sequence[str] | None, parts: bool) -> list[str]:
    """An id for each stroke, (C,); none that groups may have, of which `parts` makes more."""
    digits = max(3, len(str(max(len(order) - 1, 0))))
    given = ids if ids is not None else [""] * len(order)
    reserved = RESERVED_WITH_PARTS if parts else RESERVED
    usable = [bool(ID.fullmatch(name)) and not reserved.fullmatch(name) for name in given]
    taken = {name for name, use in zip(given, usable, strict=True) if use}
    fresh = (name for place in count() if (name := f"s{place:0{digits}d}") not in taken)
    names, used = [""] * len(order), set()
    for i in order.tolist():
        names[i] = given[i] if usable[i] and given[i] not in used else next(fresh)
        used.add(names[i])
    return names


def _drawn(
    drawing: Drawing, options: SvgOptions, index: np.ndarray, ink: Inks | None
) -> Iterator[DrawnStroke]:
    """The strokes of `index`, drawn anew."""
    texture = None if ink is None else drawing.texture
    if ink is None or texture is None:
        strokes = _outlined(drawing, options, index)
    elif options.texture == "vector":
        strokes = _toned(drawing, options, index, ink)
    else:
        strokes = _pictured(drawing, options, index, ink)
    knots = knots_of(drawing.strokes)
    for i, stroke in zip(index.tolist(), strokes, strict=True):
        data = stroke_data(drawing, i, options.decimals, knots, texture is not None)
        yield _with_attributes(stroke, data)


def _overlaps(drawing: Drawing, i: int, margin: float) -> bool:
    """Whether what is drawn of stroke i hides some of its texture."""
    xy = drawing.strokes.xy[drawing.strokes.rows(i)]
    step, way = np.diff(xy, axis=0), xy[-1] - xy[0]
    ahead = step @ way >= 0.5 * np.hypot(*step.T) * np.hypot(*way)
    if ahead.all() and way.any():  # most strokes, and at once
        return False
    return overlaps(ribbon(drawing.strokes, i, margin), margin)


def save_svg(
    path: str | Path, drawing: Drawing, options: SvgOptions | None = None, **changes
) -> None:
    """Write a drawing as `write_svg` does to a file, whole or not at all.

    `changes` are further arguments of `write_svg`. The file is compressed where its suffix is
    .svgz. Raises OSError, which names it.
    """
    write_text(path, write_svg(drawing, options, **changes))


def write_text(path: str | Path, text: str) -> None:
    """Write SVG text to an .svg or .svgz file, whole or not at all. Raises OSError."""
    write_bytes(path, svg_bytes(text, str(path).lower().endswith(".svgz")))


def svg_bytes(text: str, compressed: bool = False) -> bytes:
    """SVG text as a file holds it, gzipped in an .svgz."""
    data = text.encode("utf-8")
    return gzip.compress(data, 9, mtime=0) if compressed else data


def plain_svg(
    curves: Curves,
    size: tuple[int, int],
    *,
    decimals: int = 2,
    title: str = "",
    description: str = "",
    background: str | None = None,
    hidden: Curves | None = None,
    parts: Parts | None = None,
    hidden_parts: Parts | None = None,
) -> str:
    """Write plain curves as SVG text: black lines 1 px wide, one path a curve, a layer per kind.

    Those that are `hidden` are thin and dashed, on layers of their own beneath: hidden-contour and
    so on. `parts` and `hidden_parts`, of each curve, make a layer of each part in those.
    """
    options = SvgOptions(
        decimals=decimals, title=title, description=description, background=background
    )
    pen = {
        "fill": "none",
        "stroke": "#000000",
        "stroke-width": "1",
        "stroke-linecap": "round",
        "stroke-linejoin": "round",
    }
    dashes = {"stroke-width": "0.5", "stroke-linecap": "butt", "stroke-dasharray": "4 2.5"}
    content: list[Element] = []
    if hidden is not None and len(hidden):
        items = _curve_items(hidden, hidden_parts, "h", decimals)
        content += layered(items, "kind", pen | dashes | {Data.HIDDEN: "1"}, prefix="hidden-")
    content += layered(_curve_items(curves, parts, "k", decimals), "kind", pen)
    return document(content, Page.of_canvas(size, options), options)


def _curve_items(
    curves: Curves, parts: Parts | None, letter: str, decimals: int
) -> list[LayerItem]:
    """Curves as path elements in painting order, their ids of a letter and a number."""
    items, digits = [], max(3, len(str(max(len(curves) - 1, 0))))
    for place, i in enumerate(order_of_kinds(curves.kind, parts).tolist()):
        d = polyline_path(curves[i], decimals, bool(curves.closed[i]))
        given = {"id": f"{letter}{place:0{digits}d}", "class": CURVE_CLASS, "d": d}
        part = "" if parts is None else parts.name(i)
        items.append(LayerItem(Element("path", given), KINDS[curves.kind[i]], part))
    return items


def png_from_svg(
    text: str,
    scale: float = 1.0,
    background: str | None = "#ffffff",
    within: int | None = None,
) -> bytes:
    """Draw SVG text as PNG bytes at `scale` px a px, by resvg; or as large as fits `within` px.

    At a scale it has as many pixels as the page has, rounded, and tells its resolution: 96 times
    `scale` pixels an inch. A `background` of None leaves it clear.

    Raises ValueError where resvg cannot read the text, and on more than MAX_PIXELS pixels.
    """
    size = None
    if within is None and (size := _page_pixels(text, scale)):
        # resvg takes whole pixels of the page at its own size, and enlarges those
        start = text.index("<svg") + len("<svg")
        end = text.index(">", start)
        root = PAGE_SIDES.sub("", text[start:end])
        if _fills_page(text[start:end]):
            root = f' preserveAspectRatio="none"{root}'  # or rounding would leave an edge clear
        text = f'{text[:start]} width="{size[0]}" height="{size[1]}"{root}{text[end:]}'
    png = bytes(
        resvg_py.svg_to_bytes(
            svg_string=text,
            background=background,
            zoom=scale if within is None and size is None else None,
            width=within,
            height=within,
            dpi=96.0,
        )
    )
    return png if within is not None else with_resolution(png, CSS_DPI * scale)


def _fills_page(root: str) -> bool:
    """Whether the viewBox among a root's attributes is as wide for its height as the page is."""
    given = _page_attributes(root)
    sides = [page_length(given, name) or 0.0 for name in ("width", "height")]
    box = parse_numbers(given["viewBox"], "viewBox")
    if len(box) != 4 or "preserveAspectRatio" in root:
        return False
    return bool(np.isclose(sides[0] * box[3], sides[1] * box[2], rtol=1e-3))


def _page_attributes(root: str) -> dict[str, str]:
    return dict(re.findall(r'\s(width|height|viewBox)="([^"]*)"', root))


def _page_pixels(text: str, scale: float) -> tuple[int, int] | None:
    """The page (width, height) of SVG text in pixels; None where it has no size of its own."""
    root = re.search(r"<svg\b[^>]*>", text)
    given = _page_attributes(root[0] if root else "")
    sides = [page_length(given, name) for name in ("width", "height")]
    if None in sides or "viewBox" not in given:
        return None
    width, height = (max(1, round(scale * side)) for side in sides if side is not None)
    if width * height > MAX_PIXELS:
        raise ValueError(
            f"a PNG of {width} x {height} pixels is too large: draw it at a smaller scale, or as "
            f"PDF; {MAX_PIXELS // 1_000_000} million pixels are the most"
        )
    return width, height


# ----------------------------------------------------------------- what fills a stroke, by encoding


def _outlined(drawing: Drawing, options: SvgOptions, index: np.ndarray) -> Iterator[DrawnStroke]:
    """Strokes as their outlines."""
    made = dict(
        zip(index.tolist(), outlines(drawing.strokes, options.tolerance, index), strict=True)
    )
    # a ring that is filled to its middle stays a path: Inkscape would turn its inside out, a hole
    spined = [
        i for i, rings in made.items() if not drawing.strokes.closed[i] or len(rings) > 1
    ] * options.inkscape_lpe
    skeletons = dict(zip(spined, power_strokes(drawing.strokes, options, spined), strict=True))
    for i, rings in made.items():
        given = {Data.AT: edge_at(fine_line(rings[0]))} if rings else {}
        if len(rings) != usual_rings(bool(drawing.strokes.closed[i])):
            given[Data.RINGS] = str(len(rings))
        given |= {"fill-rule": "nonzero", "d": rings_path(rings, options.decimals)}
        skeleton = skeletons.get(i)
        if skeleton is None:
            yield DrawnStroke(Element("path", given))
            continue
        given["inkscape:original-d"] = skeleton.d
        given[Data.SPINE] = places_at(landmarks(skeleton.line))  # Inkscape draws the outline anew
        given[Data.SWELL] = number(swell(skeleton.offset_points), 2)
        yield DrawnStroke(Element("path", given), skeleton.offset_points)


def _toned(
    drawing: Drawing, options: SvgOptions, index: np.ndarray, ink: Inks
) -> Iterator[DrawnStroke]:
    """Strokes as groups of a few tones, the lightest beneath."""
    made = tone_shapes(tones(drawing, index, options.tones, options.tolerance, ink))
    for i, shapes in zip(index.tolist(), made, strict=True):
        at = {Data.AT: edge_at(shapes[0].edge)} if shapes else {}
        yield DrawnStroke(Element("g", at, _tone_paths(shapes, drawing.color[i, :3])))


def _tone_paths(shapes: list[ToneShape], ink: np.ndarray) -> tuple[Element, ...]:
    """Tones as paths; the one nearest to the stroke's `ink` has that ink.

    So programs see the stroke's fill in use.
    """
    stray = [float(np.abs(shape.color - ink).max()) for shape in shapes]
    paths = []
    for shape, off in zip(shapes, stray, strict=True):
        same = off < SAME_INK or off == min(stray) < NEAR_INK
        fill = {} if same else {"fill": hex_color(shape.color)}
        fill |= {"fill-opacity": number(shape.opacity, 2), **TONE_LOOK, "d": shape.d}
        paths.append(Element("path", fill))
    return tuple(paths)


def _pictured(
    drawing: Drawing, options: SvgOptions, index: np.ndarray, ink: Inks
) -> Iterator[DrawnStroke]:
    """Strokes as groups of an image, whose opacity is the stroke's shape."""
    for picture in stroke_images(drawing, index, options.texture_res, ink):
        if picture is None:
            yield DrawnStroke(Element("g", {}))
            continue
        given = {
            name: number(getattr(picture, name), max(options.decimals, 3))
            for name in ("x", "y", "width", "height")
        }
        href = "data:image/png;base64," + base64.b64encode(picture.png).decode("ascii")
        given |= {"preserveAspectRatio": "none", "xlink:href": href}
        at = {Data.AT: places_at(picture.corners)}
        yield DrawnStroke(Element("g", at, (Element("image", given),)))
