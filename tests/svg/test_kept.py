"""Strokes that were read and not changed are written as they were.

What was changed is drawn anew.
"""

from dataclasses import replace

import numpy as np
from svg_programs import small

from strokestyle.drawing.edit import thicken
from strokestyle.drawing.strokes import Drawing, Strokes, Texture
from strokestyle.geometry.curves import KINDS
from strokestyle.svg.kept import kept_strokes
from strokestyle.svg.read import read_svg_file
from strokestyle.svg.write import write_svg


def read_again(drawing, **options):
    return read_svg_file(write_svg(drawing, **options))


def still(file, drawing):
    """The strokes of a drawing that are kept of a file."""
    return sorted(kept_strokes(drawing, file.options, file.kept))


def test_strips_that_were_widened_twice_are_those_that_were_read():
    file = read_again(small("grain"))
    only = file.drawing.strokes.kind == KINDS.index("contour")
    once = thicken(file.drawing, 2.0, only)
    twice = thicken(once, 1.7, only)
    columns = [made.texture.rgba.shape[1] for made in (file.drawing, once, twice)]
    assert columns[0] < columns[1] < columns[2]
    unchanged = np.flatnonzero(~only).tolist()
    assert still(file, once) == still(file, twice) == unchanged


def test_a_texture_that_was_changed_is_not_kept_on_as_many_columns_or_on_more():
    file = read_again(small("grain"))
    texture = file.drawing.texture
    fainter = texture.rgba.copy()
    rows = slice(*texture.offsets[1:3])
    fainter[rows, :, 3] //= 2
    changed = replace(file.drawing, texture=replace(texture, rgba=fainter))
    assert still(file, changed) == [0, 2, 3, 4]
    wide = replace(changed, texture=replace(texture, rgba=fainter.repeat(2, axis=1)))
    assert still(file, wide) == [0, 2, 3, 4]
    assert still(file, file.drawing) == [0, 1, 2, 3, 4]


def test_other_options_draw_anew_and_those_of_the_page_do_not():
    file = read_again(small(None))
    other = [replace(file.options, **change) for change in ({"decimals": 3}, {"title": "a"})]
    assert [len(kept_strokes(file.drawing, options, file.kept)) for options in other] == [0, 5]


def test_two_strokes_on_one_line_keep_their_own_textures():
    line = np.array([[10.0, 10], [60, 10], [110, 20]])
    strokes = Strokes(np.tile(line, (2, 1)), np.full(6, 8.0), [0, 3, 6], [0, 0], [False] * 2)
    rgba = np.zeros((240, 12, 4), np.uint8)
    rgba[:120, 3:9, 3], rgba[120:, 3:9, 3] = 90, 200
    texture = Texture(rgba, [0, 120, 240], 1.0)
    file = read_again(Drawing(strokes, (120, 60), np.tile([0, 0, 0, 1.0], (2, 1)), texture))
    found = kept_strokes(file.drawing, file.options, file.kept)
    assert sorted(found) == [0, 1] and found[0] != found[1]
    text = write_svg(file.drawing, file.options, kept=file.kept)
    assert read_svg_file(text).kept == file.kept
