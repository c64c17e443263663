"""Frames made by hand, of lines that move, and styles with chance and grain to draw them in."""

from dataclasses import replace

import numpy as np

from strokestyle.extract.camera import Camera
from strokestyle.geometry.curves import Curves, arc
from strokestyle.motion.frames import Frame
from strokestyle.motion.lay import kinds_of_tracks, lay_frame, lift_frame, steady_cuts
from strokestyle.render.features import FEATURES, SURFACE
from strokestyle.render.overshoots import Overshoots
from strokestyle.render.plan import Planned, plan_strokes
from strokestyle.render.residuals import Residuals
from strokestyle.render.texture_bank import END, OWN_REGRESSORS, TextureBank
from tests.small_styles import plain_style

SIZE = 192
CAMERA = Camera([0, 0, 3], [0, 0, 0], [0, 1, 0], 30, SIZE, SIZE)


def a_grain(lengths=(160, 120, 90), columns=16, margin=1.5, width=4.0):
    """Strips of one ink whose opacity is noise, a few rows wide."""
    rng, total = np.random.default_rng(5), sum(lengths)
    noise = rng.random((total + 4, columns + 4))
    alpha = sum(noise[i : i + total, j : j + columns] for i in range(3) for j in range(3)) / 9
    rgba = np.zeros((total, columns, 4), np.uint8)
    rgba[..., :3] = (40, 30, 30)
    rgba[..., 3] = np.rint(255 * np.clip(2.5 * alpha - 0.6, 0, 1))
    ink = np.tile([rgba[..., 3].mean() / 255, *(rgba[0, 0, :3] / 255)], (total, 1))
    known = len(FEATURES) + OWN_REGRESSORS
    ends = np.full((total, 2), END)
    begins = np.r_[0, np.cumsum(lengths)]
    for a, b in zip(begins[:-1], begins[1:], strict=True):
        from_start = (np.arange(b - a) + 0.5) / 2 - 0.5 * width - margin
        ends[a:b] = np.minimum(np.stack([from_start, from_start[::-1]], axis=1), END)
    return TextureBank(
        rgba=rgba,
        offsets=begins,
        width=np.full(total, width, np.float32),
        ends=ends.astype(np.float32),
        occlusion=np.zeros(total, np.float32),
        appearance=rng.normal(size=(total, 3)).astype(np.float32),
        local_ink=ink.astype(np.float32),
        predicted_ink=ink.astype(np.float32),
        weights=np.zeros((2 * known + 1, 4), np.float32),
        scale=np.ones((2, known), np.float32),
        noise=np.full(4, 0.1, np.float32),
        margin=margin,
        flat=False,
    )


def some_residuals():
    """Smooth waves of 1 px and a tenth of the width, in sequences of different lengths."""
    rows = [np.sin(np.arange(n) / (3 + k)) for k, n in enumerate((30, 50, 41, 25))]
    values = np.stack([np.concatenate(rows), 0.1 * np.concatenate([-r for r in rows])], axis=1)
    return Residuals(values.astype(np.float32), np.cumsum([0] + [len(r) for r in rows]))


def a_hand(**fields):
    """A style with residuals, overshoots and grain."""
    past = np.array([2.0, 5.0, 9.0, 7.0, 4.0], np.float32)
    given = {
        "residuals": some_residuals(),
        "overshoots": Overshoots(past, past + 1),
        "bank": a_grain(),
    }
    return replace(plain_style(SIZE), **(given | fields))


def a_line(track, xy, place=0.0, presence=1.0, kind=0):
    return track, np.asarray(xy, float), place, presence, kind


def straight(x0, x1, y, n=100):
    return np.stack([np.linspace(x0, x1, n), np.full(n, float(y))], axis=1)


def a_frame(style, *lines, camera=CAMERA, parts=None):
    """A frame of lines (`a_line`): each is one stroke, its place px from where it begins."""
    config, made = style.config, []
    for track, xy, place, presence, kind in lines:
        curve = Curves(xy, np.array([0, len(xy)]), np.array([kind]), np.zeros(1, bool))
        plan = plan_strokes(
            curve, config.spacing, corner_angle=180.0, max_overshoot=config.max_overshoot
        )
        back = slice(None, None, -1 if (plan.xy[-1] - plan.xy[0]) @ (xy[-1] - xy[0]) < 0 else 1)
        along = arc(plan.xy[back])
        begin = along[np.flatnonzero(plan.overshoot[back] == 0)[0]]
        points = (plan.xy[back], plan.overshoot[back], along - begin + place)
        made.append((track, kind, *points, np.full(len(along), presence)))
    xy, overshoot, place, presence = (
        np.concatenate([np.zeros((0, 2) if k == 2 else 0), *(one[k] for one in made)])
        for k in (2, 3, 4, 5)
    )
    count = len(xy)
    planned = Planned(
        xy,
        np.cumsum([0] + [len(one[2]) for one in made]),
        np.array([one[1] for one in made], np.int8),
        np.zeros((count, 2), np.int64),
        np.zeros(count),
        overshoot,
    )
    surface = np.zeros((count, len(SURFACE)))
    track = np.array([one[0] for one in made], np.int64)
    return Frame(camera, planned, surface, track, place, presence, parts)


def laid_alone(style, frame, chance):
    """The strokes of a frame that is alone in its animation, before they are given texture."""
    lifted = lift_frame(style, frame, 0, kinds_of_tracks([frame]), chance)
    return lay_frame(style, lifted, 0, None, *steady_cuts(style, [lifted]), chance)
