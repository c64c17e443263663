"""Lines of a surface from several sides: found once where no camera changes them, and let go."""

import gc
import weakref

import numpy as np
import pytest
import shapes

from strokestyle.extract.camera import fit_camera
from strokestyle.extract.line_options import LineOptions
from strokestyle.extract.lines import SurfaceLines, feature_curves
from strokestyle.extract.pipeline import extract_view
from strokestyle.mesh.surface import make_surface


def test_further_views_are_those_of_the_surface_alone():
    surface = make_surface(*shapes.torus(1.0, 0.4, 48))
    lines = SurfaceLines(surface)
    for side in ("10,20", "100,-30", "front"):
        camera = fit_camera(surface.vertices, side, width=200, height=160)
        a = extract_view(surface, camera, lines=lines, hidden=True)
        b = extract_view(surface, camera, hidden=True)
        for one, other in ((a.curves, b.curves), (a.hidden, b.hidden)):
            assert np.array_equal(one.xy, other.xy) and np.array_equal(one.offsets, other.offsets)
        assert np.array_equal(a.maps.values, b.maps.values)


def test_what_no_camera_changes_is_found_once(monkeypatch):
    surface = make_surface(*shapes.torus(1.0, 0.4, 24))
    lines = SurfaceLines(surface)
    camera = fit_camera(surface.vertices, "10,20")
    lines.seen_from(camera)
    kept = {
        name: id(getattr(lines, name)) for name in ("smoothed", "fixed", "near_creases", "trust")
    }
    lines.seen_from(camera.turned(40.0))
    assert kept == {name: id(getattr(lines, name)) for name in kept}


def test_nothing_keeps_a_surface_alive():
    """A batch of large meshes must not fill the memory with those that are done."""
    gone = []
    for size in (0.3, 0.4):
        surface = make_surface(*shapes.torus(1.0, size, 24))
        camera = fit_camera(surface.vertices, "10,20", width=96, height=96)
        extract_view(surface, camera, hidden=True)
        feature_curves(surface, camera)
        gone.append(weakref.ref(surface))
    del surface
    gc.collect()
    assert [reference() for reference in gone] == [None, None]


def test_lines_of_another_surface_or_other_options_are_refused():
    surface, other = (make_surface(*shapes.torus(1.0, size, 12)) for size in (0.3, 0.4))
    camera = fit_camera(surface.vertices)
    with pytest.raises(ValueError, match="same surface"):
        extract_view(surface, camera, lines=SurfaceLines(other))
    with pytest.raises(ValueError, match="options"):
        extract_view(surface, camera, LineOptions(crease=20.0), lines=SurfaceLines(surface))
