"""What is learned from drawings whose making is known."""

import os
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
from small_views import a_view

from strokestyle.drawing.raster import rasterise
from strokestyle.drawing.strokes import Drawing, Strokes
from strokestyle.fit.exemplar import separate
from strokestyle.fit.report import fit_report
from strokestyle.fit.train import PRESETS, fit_drawing, fit_style
from strokestyle.render.style_file import load_style, save_style

QUICK = replace(PRESETS["quick"], steps=60, trace_steps=30)


def drawn(view, thickness, shift=0.0, color=(0.1, 0.1, 0.1, 1.0)):
    """The view's curves drawn `thickness` (N,) px wide, moved down by `shift` px."""
    c = view.curves
    strokes = Strokes(
        c.xy + [0, shift], np.broadcast_to(thickness, len(c.xy)), c.offsets, c.kind, c.closed
    )
    drawing = Drawing(strokes, (96, 96), np.tile(color, (len(strokes), 1)))
    rgb = rasterise(drawing, 1.0, (1.0, 1.0, 1.0)).astype(np.float32) / 255
    return separate(np.dstack([rgb, np.ones(rgb.shape[:2], np.float32)]))


@pytest.mark.parametrize("thickness", [2.0, 7.0])
def test_an_even_pen_is_learned(thickness):
    view = a_view()
    strokes = fit_style(view, drawn(view, thickness), QUICK, device="cpu").draw(view).strokes
    inner = strokes.thickness[(strokes.xy[:, 0] > 20) & (strokes.xy[:, 0] < 76)]
    assert abs(np.median(inner) - thickness) < 0.15 * thickness + 0.3


def test_thickness_by_kind_of_line_is_learned():
    view = a_view()
    thickness = np.where(np.arange(len(view.curves.xy)) < view.curves.offsets[1], 8.0, 3.0)
    strokes = fit_style(view, drawn(view, thickness), QUICK, device="cpu").draw(view).strokes
    upper, lower = (
        np.median(strokes.thickness[strokes.xy[:, 1] < 50]),
        np.median(strokes.thickness[strokes.xy[:, 1] > 50]),
    )
    assert abs(upper - 8) < 1.5 and abs(lower - 3) < 1


def test_flat_ink_keeps_its_colour():
    view = a_view()
    drawing = fit_style(
        view, drawn(view, 5.0, color=(0.6, 0.2, 0.1, 1.0)), QUICK, device="cpu"
    ).draw(view)
    rgb = rasterise(drawing, 1.0, (1.0, 1.0, 1.0)).astype(float) / 255
    assert np.abs(np.median(rgb[rgb.min(axis=2) < 0.3], axis=0) - [0.6, 0.2, 0.1]).max() < 0.05


def test_the_same_seed_learns_the_same_style_and_a_file_keeps_it(tmp_path):
    view = a_view()
    styles = [fit_style(view, drawn(view, 5.0), QUICK, seed=2, device="cpu") for _ in range(2)]
    for i, style in enumerate(styles):
        save_style(tmp_path / f"{i}.pt", style)
    assert (tmp_path / "0.pt").read_bytes() == (tmp_path / "1.pt").read_bytes()
    one, two = styles[0].draw(view, seed=1), load_style(tmp_path / "0.pt").draw(view, seed=1)
    assert np.array_equal(one.strokes.xy, two.strokes.xy)
    assert np.array_equal(one.strokes.thickness, two.strokes.thickness)


def test_the_sheet_shows_drawing_mask_and_what_was_learned():
    view, exemplar = a_view(), drawn(a_view(), 5.0)
    sheet = fit_report(view, exemplar, fit_drawing(view, exemplar, QUICK, device="cpu"))
    assert sheet.shape == (96, 4 * 96, 3)
    assert np.array_equal(sheet[:, :96], exemplar.rgb)
    pale = 1 - 0.55 * (1 - sheet[:, 192:288])  # all of it on lines: no marks
    assert np.abs(sheet[:, 96:192] - pale).mean() < 0.03


def test_a_drawing_of_another_size_and_an_empty_one_are_refused():
    view = a_view()
    exemplar = drawn(view, 5.0)
    small = replace(
        exemplar, **{n: getattr(exemplar, n)[:50] for n in ("rgb", "alpha", "ink", "mask")}
    )
    with pytest.raises(ValueError, match="resample"):
        fit_style(view, small, QUICK, device="cpu")
    with pytest.raises(ValueError, match="no strokes"):
        fit_style(view, replace(exemplar, mask=np.zeros_like(exemplar.mask)), QUICK, device="cpu")
    with pytest.raises(ValueError, match="device"):
        fit_style(view, exemplar, QUICK, device="tpu")


@pytest.mark.parametrize("module", ["strokestyle.fit", "strokestyle.render", "strokestyle.cli.fit"])
def test_threads_are_told_how_to_wait_before_torch_is_imported(module):
    """A package alone is enough, and costs no import of torch."""
    code = f"""
import os, sys
import {module}
if "cli" in "{module}":
    import strokestyle.fit.config
assert "torch" not in sys.modules
print(os.environ["OMP_WAIT_POLICY"], os.environ["GOMP_SPINCOUNT"])
"""
    names = ("OMP_WAIT_POLICY", "GOMP_SPINCOUNT")
    bare = {name: value for name, value in os.environ.items() if name not in names}
    done = subprocess.run([sys.executable, "-c", code], env=bare, capture_output=True, text=True)
    assert done.stdout.split() == ["PASSIVE", "30000"], done.stderr
