"""The texture of a stroke, read off what its file draws: closed forms, two roads, damage."""

import base64
import io
import re

import numpy as np
import pytest
from PIL import Image
from svg_programs import small

from strokestyle.drawing.raster import rasterise
from strokestyle.drawing.ribbon import overlaps, ribbon, strip_points
from strokestyle.drawing.strokes import Drawing, Strokes, Texture
from strokestyle.geometry.affine import IDENTITY
from strokestyle.svg.png import encode_png
from strokestyle.svg.read import read_svg, read_svg_file
from strokestyle.svg.read_texture import MAX_PIXELS, Budget, Shape, covered, drawn_strip
from strokestyle.svg.write import png_from_svg, write_svg

SQUARE = "M2 2L6 2 6 6 2 6Z"
HOLED = "M0 0H9V9H0ZM3 3V6H6V3Z"


def line(*points, thickness=4.0, closed=False):
    xy = np.array(points, float)
    return Strokes(xy, np.full(len(xy), thickness), [0, len(xy)], [0], [closed])


def circle(radius, turns=1.0, thickness=4.0, closed=True):
    angle = np.linspace(0, 2 * np.pi * turns, 64)
    xy = 50 + radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    if closed:
        xy[-1] = xy[0]
    return Strokes(xy, np.full(64, thickness), [0, 64], [0], [closed])


def shape(d, fill="#ff0000", opacity=1.0, matrix=IDENTITY):
    return Shape("path", {"d": d}, matrix, fill, opacity)


def picture(data, **box):
    box = {"x": "0", "y": "0", "width": "10", "height": "4"} | box
    return Shape("image", {**box, "href": "data:image/png;base64," + data}, IDENTITY, "#000", 1.0)


def text_of(rgba):
    buffer = io.BytesIO()
    Image.fromarray(rgba).save(buffer, "PNG")
    return base64.b64encode(buffer.getvalue()).decode()


# -------------------------------------------------------------------------------------------- paths


def test_points_inside_and_outside_and_in_holes():
    points = np.array([[4, 4], [1, 4], [7, 7], [2.01, 5.99]])
    assert covered(SQUARE, points, Budget()).tolist() == [True, False, False, True]
    assert covered(HOLED, points, Budget()).tolist() == [False, True, True, True]
    assert covered(SQUARE + HOLED, points[:1], Budget()).tolist() == [True]  # nonzero: 1 + 1 - 1
    assert not covered("", points, Budget()).any() and not covered("none", points, Budget()).any()


def test_both_readers_of_tones_see_what_resvg_draws():
    text = write_svg(small("grain"), texture="vector")
    y, x = np.mgrid[0:400, 0:480].reshape(2, -1)
    at = (np.stack([x, y], axis=1) + 0.5) / 4 / 0.15
    for d in re.findall(r' d="([^"]*)"', text)[:6]:
        assert re.fullmatch("[-Mmqtz0-9 ]*", d)
        ours, general = covered(d, at, Budget()), covered(d.replace("M", "M0 0M", 1), at, Budget())
        assert (ours != general).mean() < 1.5e-3  # at their edges
        head = (
            '<svg xmlns="http://www.w3.org/2000/svg" '
            'viewBox="0 0 120 100" width="120" height="100">'
        )
        page = f'{head}{{}}{d}"/></svg>'
        drawn = png_from_svg(page.format('<path transform="scale(.15)" d="'), 4.0)
        dark = np.asarray(Image.open(io.BytesIO(drawn)).convert("L")).reshape(-1) < 128
        assert (ours != dark).mean() < 2e-3 and 0.001 < ours.mean() < 0.5


def test_tones_are_laid_over_one_another():
    # the ribbon of a line from (2, 4) to (8, 4), width 4: from 0 to 10 and from 2 to 6
    band = ribbon(line([2, 4], [8, 4]), 0, 0.0)
    strip = drawn_strip(
        [shape("M0 0H10V8H0Z", "#ff0000", 0.5), shape("M5 0H10V8H5Z", "#0000ff", 0.5)],
        band,
        IDENTITY,
        Budget(),
    )
    assert strip.shape == (15, 6, 4)
    assert (strip[:7] == [255, 0, 0, 128]).all() and (strip[8:] == [85, 0, 170, 191]).all()
    nothing = drawn_strip([], band, IDENTITY, Budget())
    assert nothing.shape == (15, 6, 4) and not nothing.any()


def test_a_shape_is_followed_through_its_transforms_and_the_strokes():
    band = ribbon(line([2, 4], [8, 4]), 0, 0.0)
    half = drawn_strip([shape("M0 0H5.1V8H0Z")], band, IDENTITY, Budget())
    scaled = drawn_strip(
        [shape("M0 0H51V80H0Z", matrix=(0.1, 0, 0, 0.1, 0, 0))], band, IDENTITY, Budget()
    )
    moved = drawn_strip([shape("M100 0H105.1V8H100Z")], band, (1, 0, 0, 1, 100, 0), Budget())
    assert half[:8, :, 3].all() and not half[8:, :, 3].any()
    assert np.array_equal(half, scaled) and np.array_equal(half, moved)
    assert not drawn_strip(
        [shape("M0 0H5.1V8H0Z", matrix=(0, 0, 0, 0, 0, 0))], band, IDENTITY, Budget()
    ).any()  # which shows nothing
    for budget in (Budget(texels=89), Budget(looks=100)):
        with pytest.raises(ValueError, match="too intricate"):
            drawn_strip([shape("M0 0H5.1V8H0Z")], band, IDENTITY, budget)


# ------------------------------------------------------------------------------------------- images


def test_an_image_on_the_texels_is_the_strip():
    band = ribbon(line([2, 2], [8, 2]), 0, 0.0)
    rgba = np.random.default_rng(1).integers(60, 200, (4, 10, 4)).astype(np.uint8)
    strip = drawn_strip([picture(text_of(rgba))], band, IDENTITY, Budget())
    assert np.abs(strip.astype(int) - rgba.swapaxes(0, 1)).max() <= 1
    rgba[..., :3] = [10, 20, 30]  # one ink: only its opacity is looked up
    strip = drawn_strip([picture(text_of(rgba))], band, IDENTITY, Budget())
    assert (strip[..., :3] == [10, 20, 30]).all() and np.abs(
        strip[..., 3] - rgba.swapaxes(0, 1)[..., 3].astype(int)
    ).max() <= 1
    outside = drawn_strip([picture(text_of(rgba), y="100")], band, IDENTITY, Budget())
    assert not outside[..., 3].any()


def test_a_strip_has_the_resolution_of_its_image():
    band = ribbon(line([2, 2], [8, 2]), 0, 0.0)
    for pixels, rows in ((30, 30), (10, 10), (2, 5), (400, 40)):  # between 0.5 and 4 a px
        rgba = np.full((round(0.4 * pixels), pixels, 4), 255, np.uint8)
        assert len(drawn_strip([picture(text_of(rgba))], band, IDENTITY, Budget())) == rows


def test_images_elsewhere_are_not_looked_at():
    band = ribbon(line([2, 2], [8, 2]), 0, 0.0)
    for href in (
        "http://example.org/a.png",
        "file:///etc/passwd",
        "data:image/svg+xml;base64,AAAA",
        "",
    ):
        one = Shape("image", {"href": href}, IDENTITY, "#000", 1.0)
        assert not drawn_strip([one], band, IDENTITY, Budget()).any()


def test_a_stroke_whose_image_became_another_sort_is_flat_ink():
    text = write_svg(small("grain"), texture="image")
    got = read_svg(text.replace("data:image/png", "data:image/jpeg"))
    assert got.texture is None and len(got.strokes) == 5
    mixed = read_svg(text.replace("data:image/png", "data:image/jpeg", 1))
    assert mixed.texture is not None and (np.diff(mixed.texture.offsets) > 1).all()
    strip = mixed.texture.rgba[: mixed.texture.offsets[1], :, 3]
    assert strip.max() == pytest.approx(0.8 * 255, abs=1)


def test_faint_strokes_have_as_many_levels():
    drawn = small("grain")
    rgba = drawn.texture.rgba.copy()
    rgba[..., 3] //= 8
    faint = Drawing(
        drawn.strokes, drawn.size, drawn.color, Texture(rgba, drawn.texture.offsets, 1.5)
    )
    alphas = [
        len(np.unique(read_svg(write_svg(d, texture="image")).texture.rgba[..., 3]))
        for d in (drawn, faint)
    ]
    assert alphas[1] > 20 and alphas[0] > 20


def test_damaged_images_are_named():
    band = ribbon(line([2, 2], [8, 2]), 0, 0.0)
    huge = encode_png(np.zeros((2, 2), np.uint8), None)
    huge = huge[:16] + (9000).to_bytes(4, "big") * 2 + huge[24:]
    assert 9000 * 9000 > MAX_PIXELS
    for data, found in (
        ("?", "base64"),
        ("AAAA", "no PNG"),
        (base64.b64encode(huge).decode(), "9000 x 9000"),
    ):
        with pytest.raises(ValueError, match=found):
            drawn_strip([picture(data)], band, IDENTITY, Budget())
    good = text_of(np.zeros((4, 4, 4), np.uint8))
    with pytest.raises(ValueError, match="too intricate"):
        drawn_strip([picture(good)] * 3, band, IDENTITY, Budget(pixels=40))
    with pytest.raises(ValueError, match="damaged"):
        drawn_strip([picture(good[:60])], band, IDENTITY, Budget())
    assert not drawn_strip([picture(good, width="0")], band, IDENTITY, Budget()).any()


# ----------------------------------------------------------------------- which strokes need a strip


@pytest.mark.parametrize(
    "strokes, over",
    [
        (line([0, 0], [50, 0], [90, 5]), False),
        (line([0, 0], [1, 0]), False),
        (line([0, 0], [40, 0], [40, 3], [0, 3]), True),  # turns back within its width
        (line([0, 0], [40, 0], [40, 12], [0, 12]), False),  # and beside it
        (line([0, 0], [60, 0], [60, 40], [30, 40], [30, -40]), True),  # crosses itself
        (circle(20), False),
        (circle(20, thickness=30), False),
        (circle(20, turns=1.5, closed=False), True),  # comes round again
    ],
)
def test_which_strokes_lie_on_themselves(strokes, over):
    assert overlaps(ribbon(strokes, 0, 1.0), 1.0) == over


def textured(strokes, rng=4):
    n = 200
    rgba = np.zeros((n, 8, 4), np.uint8)
    rgba[..., 3] = (
        np.random.default_rng(rng).integers(0, 256, (n // 4, 2)).repeat(4, axis=0).repeat(4, axis=1)
    )
    return Drawing(strokes, (100, 100), [[0, 0, 0, 1]], Texture(rgba, [0, n], 1.0))


@pytest.mark.parametrize("encoding", ["vector", "image"])
def test_only_strokes_that_hide_texture_keep_it_as_an_attribute(encoding):
    beside = write_svg(textured(line([10, 10], [50, 10], [90, 15])), texture=encoding)
    crossing = write_svg(
        textured(line([10, 50], [70, 50], [70, 90], [40, 90], [40, 10])), texture=encoding
    )
    assert "data-ss-texture" not in beside and "data-ss-texture" in crossing
    files = [read_svg_file(text) for text in (beside, crossing)]
    every, again = (
        write_svg(file.drawing, file.options, kept=file.kept, strips=True) for file in files
    )
    assert "data-ss-texture" not in every and every.count("data-ss-strip") == 1
    for text, page in ((beside, every), (crossing, again)):  # which has all data on groups
        file = read_svg_file(re.sub(' data-ss-strip="[^"]*"', "", page))
        assert write_svg(file.drawing, file.options, kept=file.kept) == text


def test_the_look_that_a_hand_gave_a_stroke_is_read():
    text = write_svg(textured(line([10, 50], [90, 50], thickness=8)), texture="vector")
    paths = re.findall(r"\n<path [^>]*/>", text)
    assert len(paths) == 3
    without = read_svg(text.replace(paths[2], "")).texture.rgba  # the darkest tone deleted
    assert read_svg(text).texture.rgba[..., 3].max() > without[..., 3].max() > 0
    red = read_svg(
        text.replace(paths[0], paths[0].replace('style="', 'style="fill:#ff0000;'))
    ).texture.rgba
    assert (red[..., 0] > 200).any() and not (read_svg(text).texture.rgba[..., 0] > 200).any()
    drawn = text.replace(
        paths[2],
        '\n<path class="tone" transform="scale(.15)" fill="#00ff00" d="M0 300h700v60h-700z"/>',
    )
    at = strip_points(ribbon(read_svg(text).strokes, 0, 1.0), 12, 9)
    assert np.ptp(at[..., 1]) > 7  # which the new bar covers in part only
    green = read_svg(drawn).texture.rgba[..., 1] > 250
    assert 0.2 < green.mean() < 0.9


CROSSING = line([10, 50], [70, 50], [70, 90], [40, 90], [40, 10])


def ungrouped(text):
    """As Inkscape's Ungroup leaves it: what a group had, its shapes have."""
    return re.sub(
        r'<g id="[^"]*" class="stroke" (fill="#[0-9a-f]*")>\s*(.*?)\s*</g>',
        lambda group: re.sub("<(path|image) ", rf"<\1 {group[1]} ", group[2]),
        text,
        flags=re.DOTALL,
    )


def inked(color, strokes=CROSSING):
    drawing = textured(strokes)
    drawing.texture.rgba[..., :3] = color
    return Drawing(strokes, drawing.size, [[*np.divide(color, 255), 1]], drawing.texture)


@pytest.mark.parametrize("encoding", ["vector", "image"])
def test_a_strip_that_is_told_has_the_ink_that_is_drawn(encoding):
    text = write_svg(inked([180, 60, 20]), texture=encoding)
    assert "data-ss-texture" in text
    want = read_svg(text)
    got = read_svg(ungrouped(text))
    assert np.array_equal(got.texture.rgba, want.texture.rgba)
    assert got.color == pytest.approx(want.color, abs=0.002)
    recoloured = read_svg(text.replace('fill="#b43c14"', 'fill="#0000ff"')).texture.rgba
    assert (recoloured[..., 2] == (255 if encoding == "vector" else 20)).all()  # images stay


@pytest.mark.parametrize("encoding", ["vector", "image"])
@pytest.mark.parametrize("strokes", [CROSSING, line([10, 50], [90, 50])])
def test_shapes_without_their_group_may_be_made_paler(encoding, strokes):
    text = ungrouped(write_svg(inked([255, 0, 40], strokes), texture=encoding))
    paler = text.replace(' style="opacity:1"', "")
    paler = re.sub("<(path|image) ", r'<\1 style="opacity:.5" ', paler)
    full, half = (read_svg(each) for each in (text, paler))
    assert half.color == pytest.approx(full.color * [1, 1, 1, 0.5], abs=0.003)
    if encoding == "image" or strokes is CROSSING:  # paler tones over one another: more than half
        alpha = full.texture.rgba[..., 3] / 2.0
        assert half.texture.rgba[..., 3] == pytest.approx(alpha, abs=1)
    assert (
        np.abs(rasterise(half, 2.0, (1, 1, 1)).astype(float) - _shown(paler)).mean()
        < 0.2 * (255 - _shown(text)).mean() + 1
    )


def _shown(text):
    return np.asarray(Image.open(io.BytesIO(png_from_svg(text, 2.0))).convert("RGB")).astype(float)


def test_tones_behind_another_stroke_are_not_taken_for_its_own():
    two = Strokes(
        [[10, 50], [90, 50], [50, 5], [50, 95]], np.full(4, 6.0), [0, 2, 4], [0, 0], [False] * 2
    )
    rgba = np.concatenate([textured(CROSSING, rng).texture.rgba for rng in (4, 5)])
    drawing = Drawing(two, (100, 100), [[0, 0, 0, 1]] * 2, Texture(rgba, [0, 200, 400], [1.0] * 2))
    text = ungrouped(write_svg(drawing, texture="vector", layers="none"))
    data = re.findall(r"<path [^>]*data-ss-path[^>]*/>", text)
    file = read_svg_file(text)
    assert len(data) == len(file.ids) == 2 and file.lost_tones == 0
    file = read_svg_file(text.replace(data[1], ""))
    assert len(file.ids) == 1 and file.lost_tones == file.foreign_shapes == 2
    # moved together, written into the coordinates, they are still the stroke's
    moved = re.sub('transform="scale', 'transform="translate(30 40)scale', text)
    assert read_svg_file(moved).lost_tones == 0


def test_an_image_has_its_pixels_however_large_it_was_made():
    text = write_svg(inked([0, 0, 0], line([10, 50], [90, 50])), texture="image")
    scaled = text.replace("<image ", '<image transform="scale(20)" ')
    group = text.replace('<g id="s000"', '<g id="s000" transform="scale(20)"')
    got, want = (read_svg(each) for each in (scaled, group))
    assert got.strokes.xy == pytest.approx(want.strokes.xy)
    assert got.texture.rgba.shape == want.texture.rgba.shape
