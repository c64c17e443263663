"""A small view, a drawing of it, and a training schedule short enough for a test."""

from dataclasses import replace

import numpy as np

from strokestyle.drawing.raster import rasterise
from strokestyle.drawing.strokes import Drawing, Strokes
from strokestyle.extract.camera import Camera
from strokestyle.extract.feature_maps import (
    NEURAL_STROKES_MAPS,
    NORMAL_MAPS,
    FeatureMaps,
    plain_raster,
)
from strokestyle.extract.view import View
from strokestyle.fit.exemplar import separate
from strokestyle.fit.train import PRESETS
from strokestyle.geometry.curves import Curves

SIZE = 96


def a_view():
    """A wavy line and a straight one over flat maps."""
    x = np.linspace(10, 86, 26)
    curves = Curves.from_list(
        [np.stack([x, 30 + 5 * np.sin(x / 8)], 1), np.stack([x, np.full(26, 70.0)], 1)], [0, 2]
    )
    maps = np.ones((11, SIZE, SIZE), np.float32) * 0.5
    maps[-1] = plain_raster(curves, SIZE, SIZE)
    names = (*NEURAL_STROKES_MAPS, *NORMAL_MAPS, "plain")
    return View(
        Camera([0, 0, 3], [0, 0, 0], [0, 1, 0], 30, SIZE, SIZE),
        curves,
        FeatureMaps(names, maps, maps[0] > 0),
    )


def a_drawing(view, thickness=5.0):
    c = view.curves
    strokes = Strokes(c.xy, np.full(len(c.xy), thickness), c.offsets, c.kind, c.closed)
    drawing = Drawing(strokes, (SIZE, SIZE), np.tile([0.5, 0.1, 0.1, 1.0], (len(strokes), 1)))
    rgb = rasterise(drawing, 1.0, (1.0, 1.0, 1.0)).astype(np.float32) / 255
    return separate(np.dstack([rgb, np.ones(rgb.shape[:2], np.float32)]))


TINY = replace(
    PRESETS["paper"],
    patches=(24,),  # the smallest that the discriminator takes
    batch=2,
    geometry_steps=3,
    geometry_decay=1,
    texture_steps=2,
    texture_decay=1,
)
