"""Variants of the paper's model and of ours: what each cannot see, and that it learns."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from ablations import METHODS
from ablations.ours import learn_network_texture
from ablations.paper import learn
from dataset import Lesson, Sheet
from PIL import Image
from small_views import SIZE, TINY, a_drawing, a_view

from strokestyle.fit.checkpoint import Checkpoint
from strokestyle.fit.neural_strokes import Exercise, Networks, PatchSampler, train
from strokestyle.fit.train import PRESETS, fit_drawing, fit_style
from strokestyle.render.neural_strokes import Paths, view_maps

CPU = torch.device("cpu")
PAPERS = [name for name in METHODS if name.startswith("paper") and name != "paper_20th"]
PATCH = 24 * 768 / SIZE  # on the paper's canvas, to be 24 px on this one


def tiny(name, **changed):
    """A variant's settings with a schedule of a few steps of the smallest patches."""
    variant = METHODS[name].reduced
    few = {f: getattr(TINY, f) for f in TINY.__dataclass_fields__ if f.endswith(("steps", "decay"))}
    config = replace(variant.config, patches=(PATCH,), batch=2, **(few | changed))
    return replace(variant, width=4, config=config)


def networks(name):
    return Networks.untrained(METHODS[name].reduced.networks, 3, CPU)


def reversed_curves(view):
    """The same curves, each drawn from its other end, and the last of them first."""
    order = np.arange(len(view.curves.xy))[::-1]
    return replace(view, curves=replace(view.curves, xy=view.curves.xy[order]))


class Losses(list):
    """Takes what a training loop reports."""

    total = 0

    def __call__(self, stage, step, steps, losses):
        self.append((stage, {key: float(value) for key, value in losses.items()}))

    def of(self, stage, name):
        return [losses[name] for where, losses in self if where == stage]


@pytest.fixture(scope="module")
def lesson(tmp_path_factory):
    view = a_view()
    drawing = a_drawing(view)
    path = tmp_path_factory.mktemp("lesson") / "drawing.png"
    Image.fromarray(np.uint8(255 * drawing.rgb)).save(path)
    return Lesson("tiny", Sheet("lines", view), drawing.rgb, path)


@pytest.mark.parametrize("name", PAPERS)
def test_each_variant_learns(name):
    """Its geometry, and where its texture network is not the paper's, that too."""
    losses, painted = Losses(), name in ("paper", "paper_no_surface_features")
    variant = tiny(name, geometry_steps=40, texture_steps=40 if painted else 1, rate=1e-2)
    made = Networks.untrained(variant.networks, 0, CPU)
    exercise = Exercise.of(a_view(), a_drawing(a_view(), 7.0), CPU)
    train(made, exercise, variant.on(SIZE), 0, losses, Checkpoint())
    stages = [("geometry", "mask"), ("texture", "color")]
    for loss in (losses.of(*stage) for stage in stages[: 1 + painted]):
        # of many steps: what a patch shows moves the loss of its step as much as learning does
        assert np.mean(loss[len(loss) // 2 :]) < 0.9 * np.mean(loss[:3])


def test_the_papers_model_is_what_fit_trains(lesson):
    variant = replace(tiny("paper", geometry_steps=1, texture_steps=1), width=64)
    painter = learn(lesson, variant, 4, "cpu")
    state = painter.args[0].state()
    exemplar = lesson.exemplar()
    fitted = fit_style(lesson.sheet.view, exemplar, variant.on(SIZE), seed=4, device="cpu").state()
    for name, network in fitted.items():
        assert all(np.array_equal(value, state[name][key]) for key, value in network.items())
    image = painter(lesson.sheet, 0)
    assert image.shape == (SIZE, SIZE, 3) and image.dtype == np.uint8


def test_without_surface_features_nothing_is_seen_of_the_maps():
    view = a_view()
    paths, maps = Paths.of(view), view_maps(view)
    other = torch.cat([torch.rand_like(maps[:, :-1]), maps[:, -1:]], dim=1)
    for name, alike in (("paper_no_surface_features", True), ("paper", False)):
        made = networks(name)
        with torch.no_grad():
            drawn = [made.geometry.draw(m, paths)[1] for m in (maps, other)]
            painted = [made.texture(m) for m in (maps, other)]
        assert torch.equal(*drawn) == alike and torch.equal(*painted) == alike


def test_without_strokes_curves_are_not_seen_but_in_the_plain_raster():
    view, made = a_view(), networks("paper_no_strokes")
    maps = view_maps(view)
    none = Paths(torch.zeros(0, 7), torch.zeros(1, dtype=torch.int64), torch.zeros(0).long())
    with torch.no_grad():
        raster, displacement = made.geometry.draw(maps, Paths.of(view))
        assert torch.equal(raster, made.geometry.draw(maps, none)[0])
        maps[:, -1] = 1.0
        assert not torch.equal(raster, made.geometry.draw(maps, none)[0])
    assert raster.shape == (1, SIZE, SIZE) and not displacement.any()


def test_without_curve_features_a_point_has_what_its_pixel_has():
    """However the curve runs through it; the paper's model asks the points before and after."""
    view = a_view()
    maps, paths = view_maps(view), Paths.of(view)
    cut = Paths(paths.points[::2], torch.tensor([0, 13, 26]), paths.image[::2])
    for name, alike in (("paper_no_curve_features", True), ("paper", False)):
        with torch.no_grad():
            whole, half = (networks(name).geometry(maps, p)[0] for p in (paths, cut))
        assert torch.allclose(whole[::2], half, atol=1e-6) == alike


def test_settings_differ_in_what_is_left_out_alone():
    paper = METHODS["paper"].full
    assert paper.config == PRESETS["paper"] and paper.on(768) == PRESETS["paper"]
    assert METHODS["paper_no_regularisation"].full == replace(
        paper, config=replace(paper.config, smoothness=0.0)
    )
    crop = METHODS["paper_one_crop"].full
    assert crop.config == replace(paper.config, patches=(128,))
    assert list(PatchSampler.of(a_view(), crop.on(SIZE)).corners) == [24]
    assert crop.on(256).patches == (44,)
    for name in PAPERS:
        assert METHODS[name].reduced.config.texture_steps == 900
    twentieth = METHODS["paper_20th"].reduced
    assert twentieth.width == 64 and twentieth.on(256) == replace(
        PRESETS["paper"], patches=(24, 44, 64, 84), batch=4, schedule=0.05
    )


def test_without_correspondence_strokes_stay_on_their_curves():
    view = a_view()
    drawn = replace(view, curves=replace(view.curves, xy=view.curves.xy + [0.0, 4.0]))
    for name, still in (("ours_no_correspondence", True), ("ours_quick", False)):
        config = METHODS[name].reduced.config
        learned = fit_drawing(view, a_drawing(drawn), config, device="cpu").learned
        moved = np.hypot(*learned.alignment.shift.T)
        assert (moved.max() == 0.0) == still and (still or np.median(moved) > 2.0)


def test_our_strokes_are_painted_by_the_papers_network(lesson):
    settings = METHODS["ours_network_texture"].reduced
    settings = replace(settings, texture=tiny("paper"), canvas=None)
    painter = learn_network_texture(lesson, settings, 0, "cpu")
    image = painter(lesson.sheet, 0)
    far = lesson.sheet.view.maps["plain"][:24].max() == 0
    assert image.shape == (SIZE, SIZE, 3) and (not far or (image[:16] == 255).all())
    assert np.array_equal(image, learn_network_texture(lesson, settings, 0, "cpu")(lesson.sheet, 0))
