"""The table of the kinds of line: files hold its numbers, so that its order may not change."""

from strokestyle.geometry.kinds import (
    HARD_KINDS,
    KIND_TABLE,
    KINDS,
    PRIORITY,
    SHARP_KINDS,
    SOFT_KINDS,
    SURFACE_KINDS,
)


def test_kinds_keep_the_numbers_that_files_hold():
    names = "contour boundary crease suggestive ridge valley apparent intersection other section"
    assert names.split() == list(KINDS)


def test_every_kind_on_a_surface_is_hard_or_soft_and_edges_of_the_mesh_are_hard():
    assert set(HARD_KINDS) | set(SOFT_KINDS) == set(SURFACE_KINDS) == set(KINDS) - {"other"}
    assert not set(HARD_KINDS) & set(SOFT_KINDS)
    assert set(SHARP_KINDS) == set(HARD_KINDS) - {"contour"}
    assert SOFT_KINDS == ("suggestive", "ridge", "valley", "apparent")


def test_lines_of_the_shape_outweigh_its_shading():
    prominence = {kind.name: kind.prominence for kind in KIND_TABLE}
    assert min(prominence[name] for name in HARD_KINDS) > max(prominence[n] for n in SOFT_KINDS)
    assert all(kind.weight > 0.0 for kind in KIND_TABLE)


def test_a_style_draws_a_section_as_a_contour_and_it_comes_before_all():
    prominence = {kind.name: kind.prominence for kind in KIND_TABLE}
    assert prominence["section"] == prominence["contour"]
    assert PRIORITY[0] == "section" and PRIORITY[1:] == tuple(n for n in KINDS if n != "section")
