"""Which lines a style draws: laws applied, what they say of strange views, and model files."""

from dataclasses import replace

import numpy as np
import pytest
from known_law import blobs
from small_styles import plain_style

from strokestyle.extract.pipeline import view_of_lines
from strokestyle.geometry.curves import KINDS, Curves, owner
from strokestyle.render import choice as choice_module
from strokestyle.render.choice import (
    COLUMNS,
    choose_lines,
    learn_choice,
    leaves_nothing,
    line_columns,
    unknown_kinds,
)
from strokestyle.render.style_file import load_style, save_style

VIEW = blobs(3)
CONTOUR, CREASE, VALLEY, RIDGE = (KINDS.index(k) for k in ("contour", "crease", "valley", "ridge"))
IS_CONTOUR = (VIEW.curves.kind == CONTOUR)[owner(VIEW.curves.offsets)]
CONTOURS_ONLY = learn_choice(VIEW, IS_CONTOUR)


def with_kinds(view, crease):
    kind = np.where(view.curves.kind == CREASE, crease, view.curves.kind)
    return replace(view, curves=replace(view.curves, kind=kind))


def test_columns_are_finite_and_of_the_style_s_canvas():
    columns = line_columns(VIEW)
    assert columns.shape == (len(VIEW.curves.xy), len(COLUMNS)) and np.isfinite(columns).all()
    length = columns[VIEW.curves.offsets[:-1], COLUMNS.index("length")]
    assert np.exp(length) == pytest.approx(VIEW.curves.lengths())
    half = line_columns(VIEW, 2.0)[VIEW.curves.offsets[:-1], COLUMNS.index("length")]
    assert half == pytest.approx(length - np.log(2.0))
    # outside of a blob the light of its own side shines
    light = columns[IS_CONTOUR, COLUMNS.index("light_0_0")]
    assert np.corrcoef(light, VIEW.curves.xy[IS_CONTOUR, 0] % 120)[0, 1] > 0.9


def test_all_drawn_is_no_choice_and_none_drawn_neither():
    assert learn_choice(VIEW, np.ones(len(IS_CONTOUR), bool)) is None
    assert learn_choice(VIEW, np.zeros(len(IS_CONTOUR), bool)) is None
    assert learn_choice(VIEW.only(np.zeros(len(IS_CONTOUR), bool)), np.zeros(0, bool)) is None


def test_lines_left_out_at_random_are_no_law():
    """Of what nothing foretells, no more is left out than was."""
    rng = np.random.default_rng(0)
    out = rng.random(len(VIEW.curves)) < 0.2
    choice = learn_choice(VIEW, ~out[owner(VIEW.curves.offsets)])
    other = blobs(9)
    assert choose_lines(other, choice).curves.lengths().sum() > 0.7 * other.curves.lengths().sum()


def test_one_short_line_left_out_is_an_accident():
    drawn = owner(VIEW.curves.offsets) != 1
    assert VIEW.curves.kind[1] == CREASE
    assert len(choose_lines(VIEW, learn_choice(VIEW, drawn)).curves) == len(VIEW.curves)


def test_where_hardly_a_line_is_one_to_draw_all_are_and_that_is_told(monkeypatch):
    monkeypatch.setattr(choice_module, "LEAST_LEFT", 0.2)
    creases = VIEW.only(~IS_CONTOUR)
    assert leaves_nothing(creases, CONTOURS_ONLY)
    assert len(choose_lines(creases, CONTOURS_ONLY).curves) == len(creases.curves)
    scrap = ~IS_CONTOUR
    scrap[np.flatnonzero(IS_CONTOUR)[: int(0.1 * scrap.sum())]] = True
    nearly = VIEW.only(scrap)
    assert np.isin(CONTOUR, nearly.curves.kind) and leaves_nothing(nearly, CONTOURS_ONLY)
    assert len(choose_lines(nearly, CONTOURS_ONLY).curves) == len(nearly.curves)
    assert not leaves_nothing(VIEW, CONTOURS_ONLY) and not leaves_nothing(creases, None)
    assert not leaves_nothing(VIEW.only(np.zeros(len(IS_CONTOUR), bool)), CONTOURS_ONLY)


def test_kinds_that_the_exemplar_lacked():
    """Who draws contours only draws no ridges; who leaves out valleys still draws creases."""
    ridges = with_kinds(VIEW, RIDGE)
    left = choose_lines(ridges, CONTOURS_ONLY)
    assert (left.curves.kind == CONTOUR).all()
    assert unknown_kinds(ridges, left, CONTOURS_ONLY) == ["ridge"]
    assert unknown_kinds(VIEW, choose_lines(VIEW, CONTOURS_ONLY), CONTOURS_ONLY) == []
    kind = VIEW.curves.kind.copy()
    kind[1:9:2] = VALLEY  # beside creases, which are drawn
    mixed = replace(VIEW, curves=replace(VIEW.curves, kind=kind))
    choice = learn_choice(mixed, (kind != VALLEY)[owner(VIEW.curves.offsets)])
    assert len(choose_lines(VIEW, choice).curves) == 18
    assert not (choose_lines(mixed, choice).curves.kind == VALLEY).any()
    sections = with_kinds(VIEW, KINDS.index("section"))
    assert len(choose_lines(sections, choice).curves) == 18


def test_where_nothing_would_be_left_all_is_drawn():
    creases = VIEW.only(~IS_CONTOUR)
    assert len(choose_lines(creases, CONTOURS_ONLY).curves) == 9
    none = VIEW.only(np.zeros(len(IS_CONTOUR), bool))
    assert len(choose_lines(none, CONTOURS_ONLY).curves) == 0
    flat = view_of_lines(VIEW.curves, 360, 360)  # no surface: the lines of a drawing
    assert len(choose_lines(flat, CONTOURS_ONLY).curves) == 18


def test_optional_lines_are_drawn_by_no_one_else():
    optional = np.arange(18) < 4
    view = replace(VIEW, optional=optional)
    assert len(choose_lines(view, None).curves) == 14
    assert (choose_lines(view, CONTOURS_ONLY).curves.kind == CONTOUR).sum() == 7
    taken_up = learn_choice(view, np.ones(len(IS_CONTOUR), bool))
    assert taken_up.required is None and len(choose_lines(view, taken_up).curves) == 18
    assert len(plain_style(360).draw(view).strokes) < len(plain_style(360).draw(VIEW).strokes)


def test_a_view_of_some_of_its_lines():
    view = replace(VIEW, strength=np.linspace(0, 1, len(IS_CONTOUR)))
    keep = IS_CONTOUR.copy()
    keep[10:20] = False
    left = view.only(keep)
    assert np.array_equal(left.strength, view.strength[keep])
    assert len(left.curves) == 10 and left.curves.lengths().sum() < view.curves.lengths().sum()
    assert left.maps["plain"].sum() != view.maps["plain"].sum()
    assert view.only(np.ones(len(keep), bool)) is view
    with pytest.raises(ValueError, match="View.optional must be finite, of shape"):
        replace(view, optional=np.zeros(3, bool))


def test_a_model_keeps_its_choice(tmp_path):
    style = replace(plain_style(360), choice=CONTOURS_ONLY)
    save_style(tmp_path / "m.pt", style)
    back = load_style(tmp_path / "m.pt")
    drawn, all_lines = back.draw(VIEW), back.draw(VIEW, choice="all")
    assert np.array_equal(drawn.strokes.xy, style.draw(VIEW).strokes.xy)
    assert (drawn.strokes.kind == CONTOUR).all() and (all_lines.strokes.kind == CREASE).any()
    again = back.draw(back.choose(VIEW), choice="all")
    assert np.array_equal(again.strokes.xy, drawn.strokes.xy)
    save_style(tmp_path / "n.pt", back)
    assert (tmp_path / "n.pt").read_bytes() == (tmp_path / "m.pt").read_bytes()


def test_a_larger_canvas_has_the_same_lines():
    curves = Curves(2 * VIEW.curves.xy, VIEW.curves.offsets, VIEW.curves.kind, VIEW.curves.closed)
    maps = replace(
        VIEW.maps,
        values=VIEW.maps.values.repeat(2, 1).repeat(2, 2),
        covered=VIEW.maps.covered.repeat(2, 0).repeat(2, 1),
    )
    twice = replace(
        VIEW, camera=replace(VIEW.camera, width=720, height=720), curves=curves, maps=maps
    )
    long = (VIEW.curves.lengths() > 60)[owner(VIEW.curves.offsets)]
    choice = learn_choice(VIEW, long)
    assert len(choose_lines(twice, choice, 2.0).curves) == len(choose_lines(VIEW, choice).curves)
