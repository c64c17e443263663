"""Lines on closed-form surfaces, rtsc's segments, and chains that hold together."""

import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import shapes
from scipy.spatial import cKDTree

from strokestyle.extract import lines as line_choice
from strokestyle.extract import segments as lines
from strokestyle.extract.camera import Camera, fit_camera
from strokestyle.extract.chain import chain_segments
from strokestyle.extract.line_options import LineOptions
from strokestyle.extract.lines import feature_curves
from strokestyle.extract.surface_curves import SurfaceCurves
from strokestyle.extract.view_curvature import ViewFields
from strokestyle.geometry.curves import KINDS
from strokestyle.geometry.kinds import KIND_TABLE, SURFACE_KINDS
from strokestyle.mesh.surface import make_surface

SHARED = os.environ.get("STROKESTYLE_SHARED")
needs_oracles = pytest.mark.skipif(
    not SHARED, reason="STROKESTYLE_SHARED is not set: no segments of rtsc"
)


def camera(eye=(0.8, 0.6, 2.5), up=(0, 1, 0)):
    return Camera(eye, (0, 0, 0), up, 30, 256, 256)


def only(kind, **options):
    return LineOptions(
        kinds=(kind,), **{"smooth": 0.0, "hysteresis": 0.0, "sharpness": 0.0, **options}
    )


def lengths(surface, curves):
    points = curves.points(surface)
    step = np.linalg.norm(np.diff(points, axis=0), axis=1)
    step[curves.offsets[1:-1] - 1] = 0.0
    return np.add.reduceat(np.r_[step, 0.0], curves.offsets[:-1]) if len(curves) else np.zeros(0)


def check(surface, curves):
    """What must hold for any curves: they lie on the mesh, run through neighbouring faces, and
    closed ones close.
    """
    assert np.allclose(curves.bary.sum(axis=1), 1) and (curves.bary > -1e-12).all()
    assert (curves.strength >= 0).all() and (curves.strength <= 1).all()
    points, last = curves.points(surface), curves.offsets[1:] - 1
    for i in range(len(curves)):
        rows = slice(curves.offsets[i], curves.offsets[i + 1])
        p, face = points[rows], curves.face[rows]
        # each piece lies in the face of its first row: so does its end
        a, b, c = (surface.vertices[surface.faces[face[:-1], k]] for k in range(3))
        away = np.einsum("ij,ij->i", p[1:] - a, surface.face_normals[face[:-1]])
        longest = np.max(
            [np.linalg.norm(q - r, axis=1) for q, r in ((a, b), (b, c), (c, a))], axis=0
        )
        assert np.abs(away).max() < 1e-9
        assert (np.linalg.norm(np.diff(p, axis=0), axis=1) <= longest + 1e-9).all()
        assert (np.linalg.norm(np.diff(p, axis=0), axis=1) > 0).all()
    assert np.allclose(points[curves.offsets[:-1][curves.closed]], points[last[curves.closed]])


# ------------------------------------------------------------------------------- closed form


def test_the_contour_of_a_sphere_is_one_circle():
    surface = make_surface(*shapes.sphere(4))
    eye = np.array([1.0, 0.8, 1.5])
    curves = feature_curves(surface, camera(eye), LineOptions(smooth=0.0))
    check(surface, curves)
    assert len(curves) == 1 and curves.closed.all() and KINDS[curves.kind[0]] == "contour"
    points = curves.points(surface)
    distance = np.linalg.norm(eye)
    assert (
        np.abs(points @ eye / distance - 0.25 / distance).max() < 1e-3
    )  # the polar plane of the eye
    assert lengths(surface, curves)[0] == pytest.approx(
        2 * np.pi * 0.5 * np.sqrt(1 - (0.5 / distance) ** 2), rel=5e-3
    )
    assert (curves.strength == 1).all()
    height = points @ camera(eye).axes[1]
    assert (
        height[0] == height.min()
    )  # a loop starts at the top of the picture (the y axis of the image points down)


def test_a_contour_keeps_the_facing_side_to_its_left():
    surface = make_surface(*shapes.sphere(3))
    eye = np.array([0.0, 0.0, 3.0])
    segments = lines.contour_segments(surface, ViewFields.of(surface, eye), LineOptions()).shown
    points = segments.points(surface)
    left = np.cross(surface.face_normals[segments.face], points[:, 1] - points[:, 0])
    corner = surface.vertices[surface.faces[segments.face]] - points[:, :1]
    higher = ViewFields.of(surface, eye).n_dot_v[surface.faces[segments.face]] >= 0
    assert ((np.einsum("sci,si->sc", corner, left) >= 0) == higher).all()
    points = feature_curves(surface, camera(eye), only("contour")).points(surface)
    turning = np.cross(points[:-1], points[1:])[:, 2]
    assert (turning > 0).all()  # counter-clockwise seen from the eye


def test_contours_of_a_torus_are_trimmed_where_they_cannot_be_seen():
    surface = make_surface(*shapes.torus(1, 0.4, 96, 48))
    view = camera((0, 1.2, 2.5))
    whole = feature_curves(surface, view, only("contour", trim=False))
    trimmed = feature_curves(surface, view, only("contour"))
    check(surface, trimmed)
    assert whole.closed.all() and len(whole) == 2
    assert not trimmed.closed.all()
    assert 0.5 < lengths(surface, trimmed).sum() / lengths(surface, whole).sum() < 0.95
    fields = ViewFields.of(surface, view.eye)
    assert trimmed.interpolate(surface, fields.radial_curvature(surface)).min() > -1e-9
    assert np.abs(trimmed.interpolate(surface, fields.n_dot_v)).max() < 1e-9


def test_the_inside_of_an_open_surface_keeps_its_contours():
    """A bowl whose normals point into its hollow has a negative radial curvature, and yet the
    same contour.
    """
    bowl = shapes.sphere(4)
    faces = bowl.faces[bowl.vertices[bowl.faces][:, :, 2].mean(axis=1) < 0.5]
    total = []
    for winding in (faces, faces[:, ::-1]):
        surface = make_surface(bowl.vertices, winding)
        curves = feature_curves(surface, camera((0, 2.0, 1.2)), LineOptions(smooth=0.0))
        assert {KINDS[k] for k in curves.kind} == {"contour", "boundary"}
        total.append(lengths(surface, curves)[curves.kind == 0].sum())
    assert total[0] == pytest.approx(total[1]) and total[0] > 1


def test_a_boundary_is_one_closed_curve():
    surface = make_surface(*shapes.plane(6))
    curves = feature_curves(surface, camera(), only("boundary"))
    check(surface, curves)
    assert len(curves) == 1 or not curves.closed.any()
    assert lengths(surface, curves).sum() == pytest.approx(4)
    tube = make_surface(*shapes.cylinder())
    rims = feature_curves(tube, camera(), only("boundary"))
    assert len(rims) == 2 and rims.closed.all()


def test_a_ridge_lies_on_its_crest():
    shape = shapes.ridge(61)
    surface = make_surface(*shape)
    curves = feature_curves(surface, camera(), only("ridge", ridge=0.05))
    check(surface, curves)
    points = surface.original(curves.points(surface))
    crest = np.abs(points[:, 0] - 0.2 * points[:, 1]) / np.hypot(1, 0.2)
    inner = np.abs(points[:, :2]).max(axis=1) < 0.8
    assert np.median(crest[inner]) < 2e-3
    assert lengths(surface, curves).max() > 0.9
    upside_down = make_surface(shape.vertices * [1, 1, -1], shape.faces)
    valleys = feature_curves(upside_down, camera(), only("valley", valley=0.02))
    assert lengths(upside_down, valleys).max() > 0.9
    assert not len(feature_curves(upside_down, camera(), only("ridge", ridge=0.3)))


def test_strength_of_a_ridge_is_neural_contours_formula():
    surface = make_surface(*shapes.ridge(61))
    options = only("ridge", ridge=0.05)
    curves = feature_curves(surface, camera(), options)
    k = curves.interpolate(surface, np.abs(surface.k1))
    assert np.allclose(
        curves.strength, np.maximum(0, 1 - options.ridge / (surface.feature_size * k)), atol=1e-9
    )
    assert curves.strength.max() > 0.3


@pytest.mark.parametrize(
    "z, first, second, expected",
    [
        (lambda x: -x * x / 2, lambda x: -x, lambda x: 0 * x - 1, 3.0),  # parabola
        (lambda x: np.sqrt(2 - x * x), lambda x: -x / np.sqrt(2 - x * x),
         lambda x: -2 / (2 - x * x) ** 1.5, 0.0),
        (lambda x: -np.sqrt(1 + x * x), lambda x: -x / np.sqrt(1 + x * x),
         lambda x: -1 / (1 + x * x) ** 1.5, 6.0),
        (lambda x: np.sqrt(9 - 4 * x * x), lambda x: -4 * x / np.sqrt(9 - 4 * x * x),
         lambda x: -36 / (9 - 4 * x * x) ** 1.5, 2.25),  # ellipse, twice as high as wide
    ],
)  # fmt: skip
def test_sharpness_of_conics(z, first, second, expected):
    """-k'' / k^3 at the tip is 3 e^2: 0 on a circle, 3 on a parabola, 6 on the right-angled
    hyperbola.
    """
    shape = shapes.height_field(
        lambda x, y: z(x),
        lambda x, y: (first(x), 0 * x),
        lambda x, y: (second(x), 0 * x, 0 * x),
        n=81,
    )
    surface = make_surface(*shape)
    tip = np.abs(shape.vertices[:, 0]) < 0.05
    tip &= np.abs(shape.vertices[:, 1]) < 0.9
    sharp = lines.sharpness(surface, surface.dcurv[:, 0], np.arange(len(surface.faces)))
    assert np.allclose(sharp[tip], expected, atol=0.2)
    for least in (1, 3, 13):
        curves = feature_curves(surface, camera(), only("ridge", ridge=0.01, sharpness=least))
        on_tip = np.abs(curves.points(surface)[:, 0]) < 0.02
        assert on_tip.any() == (expected > 0.5 * least)


def test_an_exact_extremum_is_no_trouble():
    """A cylinder's curvature is constant: every derivative is exactly or nearly 0."""
    options = LineOptions(
        SURFACE_KINDS, smooth=0.0, ridge=0, valley=0, apparent=0, suggestive=0, hysteresis=0
    )
    for shape, rims in ((shapes.cylinder(), 2), (shapes.plane(), 1)):
        surface = make_surface(*shape)
        curves = feature_curves(surface, camera(), options)
        check(surface, curves)
        boundary = curves.take(curves.kind == KINDS.index("boundary"))
        assert len(boundary) == rims and boundary.closed.all()


def test_suggestive_contours_lie_where_the_radial_curvature_vanishes():
    wavy = shapes.height_field(
        lambda x, y: 0.1 * np.cos(4 * x) + 0.05 * y * y,
        lambda x, y: (-0.4 * np.sin(4 * x), 0.1 * y),
        lambda x, y: (-1.6 * np.cos(4 * x), 0 * x, 0 * x + 0.1),
        n=81,
    )
    surface = make_surface(*wavy)
    view = camera((2.5, 0.3, 2.0))
    curves = feature_curves(surface, view, only("suggestive"))
    check(surface, curves)
    assert lengths(surface, curves).max() > 0.5
    fields = ViewFields.of(surface, view.eye)
    assert np.abs(curves.interpolate(surface, fields.radial_curvature(surface))).max() < 1e-6
    assert curves.interpolate(surface, fields.radial_derivative(surface)).min() > 0
    # Neural Contours' formula, at the ends that are not cut to the threshold
    q = surface.feature_size**2 * curves.interpolate(surface, fields.radial_derivative(surface))
    facing = curves.interpolate(surface, fields.n_dot_v)
    q = np.maximum(q - 0.01 * facing, 0)
    whole = (curves.bary == 0).any(axis=1)
    assert np.allclose(curves.strength[whole], (q / (q + 0.03 * facing))[whole], atol=1e-9)
    assert whole.mean() > 0.5


def test_derivative_of_the_radial_curvature():
    """Along the view, on a torus, against finite differences on the torus itself."""
    big, small, eye = 1.0, 0.4, np.array([2.0, 1.5, 3.0])
    shape = shapes.torus(big, small, 192, 96)
    surface = make_surface(*shape)
    around = np.cross(shape.pdir1, shape.normals)
    a = np.arctan2(shape.vertices[:, 2], shape.vertices[:, 0])
    t = np.arctan2(shape.vertices[:, 1], np.hypot(*shape.vertices[:, [0, 2]].T) - big)

    def radial(a, t):
        """kr, and the view's tangential direction and its length, at angles (a, t)."""
        outward = np.stack([np.cos(a), 0 * a, np.sin(a)], 1)
        normal = np.cos(t)[:, None] * outward + np.sin(t)[:, None] * [0, 1, 0]
        tube = -np.sin(t)[:, None] * outward + np.cos(t)[:, None] * [0, 1, 0]
        turn = np.stack([-np.sin(a), 0 * a, np.cos(a)], 1)
        view = eye - (big * outward + small * normal)
        view /= np.linalg.norm(view, axis=1, keepdims=True)
        u, v = (np.einsum("ij,ij->i", view, d) for d in (tube, turn))
        return (
            (u * u / small + v * v * np.cos(t) / (big + small * np.cos(t))) / (u * u + v * v),
            u,
            v,
        )

    kr, u, v = radial(a, t)
    sine = np.hypot(u, v)
    assert np.allclose(np.abs(np.einsum("ij,ij->i", around, shape.normals)), 0)
    h = 1e-5
    da, dt = v / sine / (big + small * np.cos(t)) * h, u / sine / small * h
    slope = (radial(a + da, t + dt)[0] - radial(a - da, t - dt)[0]) / (2 * h)
    fields = ViewFields.of(surface, eye / surface.scale)
    good = sine > 0.2
    unit = surface.scale
    assert np.allclose(
        (fields.radial_curvature(surface) / unit)[good], (kr * sine**2)[good], atol=0.02
    )
    found = fields.radial_derivative(surface) / unit**2
    assert np.abs(found - slope * sine)[good].max() < 0.03 * np.abs(slope[good]).max()


def test_the_derivative_tensor_is_contracted_whole():
    surface = make_surface(*shapes.sphere(2))
    tensor = np.random.default_rng(3).normal(size=surface.dcurv.shape)
    view = ViewFields.of(replace(surface, dcurv=tensor), np.array([1.0, 2.0, 3.0]))
    p, q, r, s = tensor.T
    full = np.stack([p, q, q, r, q, r, r, s], 1).reshape(-1, 2, 2, 2)
    w = np.stack([view.u, view.v], 1)
    expected = np.einsum("vijk,vi,vj,vk->v", full, w, w, w) / (w * w).sum(
        axis=1
    )  # k1 = k2: nothing turns
    assert np.allclose(view.radial_derivative(replace(surface, dcurv=tensor)), expected)


def test_slopes_along_a_direction_are_foreshortened():
    surface = make_surface(*shapes.plane(9))
    value = surface.vertices @ [2.0, 1.0, 0.0]
    direction = np.tile([1.0, 0.0, 0.0], (len(value), 1))
    slope = lines.foreshortened_slope(
        surface, value, direction, np.full(len(value), -0.5), np.arange(len(surface.faces))
    )
    inner = np.abs(surface.vertices).max(axis=1) < 0.49
    assert np.allclose(slope[inner], 4.0)


def test_flat_parts_have_no_suggestive_rims():
    """Half flat, half rising: all of the flat half has kr = 0, which is no line."""
    z = lambda x, y: 0.2 * np.maximum(x, 0) ** 2  # noqa: E731
    shape = shapes.height_field(
        z, lambda x, y: (0 * x, 0 * x), lambda x, y: (0 * x, 0 * x, 0 * x), n=21
    )
    surface = make_surface(*shape)
    assert (surface.k1[shape.vertices[:, 0] < -0.2] == 0).all() and surface.k1.any()
    curves = feature_curves(surface, camera((-1.5, 0.1, 1.5)), only("suggestive", suggestive=0.0))
    assert not len(curves)


def test_view_dependent_curvature():
    """Seen head on it is the largest squared curvature; towards the contour it grows without
    bound, across it.
    """
    surface = make_surface(*shapes.sphere(4))
    fields = ViewFields.of(surface, np.array([0.0, 0.0, 1e3]))
    curvature, direction = fields.view_curvature(surface)
    facing = fields.n_dot_v > 0.05
    expected = (
        2.0 / fields.n_dot_v[facing]
    ) ** 2  # radius 1/2; a singular value is stretched by 1 / n.v
    assert np.allclose(curvature[facing], expected, rtol=1e-3)
    slanted = facing & (fields.n_dot_v < 0.9)
    radial = (
        surface.vertices[slanted]
        * [1, 1, 0]
        / np.linalg.norm(surface.vertices[slanted, :2], axis=1)[:, None]
    )
    tangent = (
        radial
        - np.einsum("ij,ij->i", radial, surface.normals[slanted])[:, None]
        * surface.normals[slanted]
    )
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    assert np.abs(np.einsum("ij,ij->i", tangent, direction[slanted])).min() > 0.999


# -------------------------------------------------------------------------------- hard edges


def by_kind(surface, curves):
    length = lengths(surface, curves)
    return {KINDS[k]: length[curves.kind == k].sum() for k in np.unique(curves.kind)}


@pytest.mark.parametrize("n", [2, 5])
def test_a_cube_has_six_contour_edges_and_three_creases(n):
    surface = make_surface(*shapes.cube(n))
    curves = feature_curves(surface, camera((1.5, 1.2, 2.5)), LineOptions())
    check(surface, curves)
    assert by_kind(surface, curves) == pytest.approx({"contour": 6, "crease": 3})
    contour = curves.take(curves.kind == 0)
    assert contour.closed.tolist() in ([True], []) or len(contour) <= 6
    without = feature_curves(surface, camera((1.5, 1.2, 2.5)), only("crease"))
    assert by_kind(surface, without) == pytest.approx({"crease": 12})


def test_a_cylinder_with_lids():
    """Its outline is one closed curve: half of each rim, and the two straight sides, joined
    exactly.
    """
    side = shapes.cylinder(around=64, rows=5)
    n, rim = len(side.vertices), np.arange(64)
    fan = lambda ring, tip: np.stack([ring, np.roll(ring, -1), np.full(64, tip)], 1)  # noqa: E731
    points = np.vstack([side.vertices, [[0, -1, 0], [0, 1, 0]]])
    surface = make_surface(points, np.vstack([side.faces, fan(rim, n), fan(n - 64 + rim, n + 1)]))
    curves = feature_curves(surface, camera((0.5, 1.5, 3)), LineOptions(smooth=0.0))
    check(surface, curves)
    contour = curves.take(curves.kind == 0)
    assert len(contour) == 1 and contour.closed.all()
    assert {KINDS[k] for k in curves.kind} == {"contour", "crease"}
    total = by_kind(surface, curves)
    circle = 0.5 * np.pi  # the box's longest side is 1
    assert total["crease"] == pytest.approx(0.5 * circle, rel=0.2)
    assert total["contour"] == pytest.approx(2 + circle, rel=0.1)


def test_hollow_creases_are_no_contours():
    """The inner edge of an L-shaped step can hide nothing."""
    outline = np.array([[0, 0], [2, 0], [2, 1], [1, 1], [1, 2], [0, 2.0]])
    points = np.vstack([np.c_[outline, np.zeros(6)], np.c_[outline, np.ones(6)]])
    lid = np.array([[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 5]])
    i, j = np.arange(6), (np.arange(6) + 1) % 6
    walls = np.vstack([np.stack([i, j, j + 6], 1), np.stack([i, j + 6, i + 6], 1)])
    surface = make_surface(points, np.vstack([lid[:, ::-1], lid + 6, walls]))
    for eye, drawn in (
        ((2.5, -0.3, 1.5), False),
        ((-0.3, 2.5, 1.5), False),
        ((2.5, 2.5, 1.5), True),
    ):
        curves = feature_curves(surface, camera(eye), LineOptions())
        check(surface, curves)
        points = surface.original(curves.points(surface))
        inner = np.isclose(points[:, :2], 1).all(axis=1)
        both = inner[:-1] & inner[1:]
        both[curves.offsets[1:-1] - 1] = False
        along = np.searchsorted(curves.offsets, np.flatnonzero(both), side="right") - 1
        assert [KINDS[curves.kind[i]] for i in along] == ["crease"] * drawn


def test_a_one_sided_surface_has_no_crease_where_its_winding_ends():
    surface = make_surface(*shapes.moebius(80, 5))
    curves = feature_curves(surface, camera(), LineOptions(("boundary", "crease")))
    check(surface, curves)
    assert {KINDS[k] for k in curves.kind} == {"boundary"}
    assert len(curves) == 1 and curves.closed.all()


def test_creases_by_angle():
    angle = np.radians(50)
    eaves = [[np.cos(angle), y, -np.sin(angle)] for y in (0, 2)]
    points = np.vstack([[[-1, 0, 0], [0, 0, 0], [0, 2, 0], [-1, 2, 0]], eaves])
    roof = make_surface(points, [[0, 1, 2], [0, 2, 3], [1, 4, 5], [1, 5, 2]])
    for limit, count in ((45, 1), (55, 0)):
        assert len(feature_curves(roof, camera(), only("crease", crease=limit))) == count


# -------------------------------------------------------------------------------------- rtsc


def near(a, b, step=1e-4):
    """Share of the length of segments a (S, 2, 3) that lies within 1e-4 of segments b."""

    def sample(segments):
        length = np.linalg.norm(segments[:, 1] - segments[:, 0], axis=1)
        count = np.maximum(np.ceil(length / step), 1).astype(int)
        row = np.repeat(np.arange(len(segments)), count)
        t = (np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count) + 0.5) / count[row]
        return segments[row, 0] + t[:, None] * (segments[row, 1] - segments[row, 0]), (
            length / count
        )[row]

    (p, weight), (q, _) = sample(a), sample(b)
    return weight[cKDTree(q).query(p)[0] < 1e-4 + 0.5 * step].sum() / weight.sum()


@needs_oracles
@pytest.mark.parametrize("name", ["spot", "woman", "fandisk"])
def test_rtsc_draws_the_same_segments(name):
    theirs = np.load(Path(SHARED) / "oracles" / "rtsc" / f"{name}.npz")
    surface = make_surface(theirs["vertices"], theirs["faces"], crease=180, rtsc=True)
    view = ViewFields.of(surface, theirs["eye"])
    front = (view.n_dot_v > 0)[surface.faces].any(axis=1)
    at = dict(suggestive=0.01, ridge=0.1, valley=0.1, apparent=0.1, sharpness=0.0)
    found = {
        "contour": lines.contour_segments(surface, view, LineOptions(**at)).shown,
        "contour_untrimmed": lines.contour_segments(
            surface, view, LineOptions(**at, trim=False)
        ).shown,
        "suggestive": lines.suggestive_segments(surface, view, LineOptions(**at)),
        "apparent": lines.apparent_segments(surface, view, LineOptions(**at, trim=False)),
        "ridge": lines.ridge_segments(surface, LineOptions(**at)),
        "valley": lines.valley_segments(surface, LineOptions(**at)),
    }
    for kind, segments in found.items():
        if kind in ("ridge", "valley"):  # rtsc skips faces that look away
            segments = segments.take(front[segments.face])
        expected = theirs[f"{kind}_seg"].astype(float)
        expected = expected[np.isfinite(expected).all(axis=(1, 2))]
        ours = segments.points(surface)
        assert np.isfinite(ours).all()
        assert near(ours, expected) > 0.99 and near(expected, ours) > 0.99, kind
    assert not len(lines.boundary_segments(surface, LineOptions()))


# ---------------------------------------------------------------------------------- chaining


def bumpy():
    shape = shapes.sphere(4)
    d = shape.vertices
    radius = (
        1
        + 0.15 * np.sin(5 * d[:, 0]) * np.cos(4 * d[:, 1] + 1)
        + 0.1 * np.sin(6 * d[:, 2] + d[:, 0])
    )
    return make_surface(d * radius[:, None], shape.faces)


ALL = LineOptions(SURFACE_KINDS, ridge=0.1, smooth=0.0, hysteresis=0.0, sharpness=0.0)


def test_chains_hold_all_segments_and_nothing_else():
    surface = bumpy()
    view = ViewFields.of(surface, camera().eye)
    finders = {
        "contour": lambda *given: lines.contour_segments(*given).shown,
        "crease": lambda *given: lines.crease_segments(*given).shown,
        "suggestive": lines.suggestive_segments,
        "apparent": lines.apparent_segments,
    }
    for kind, find in finders.items():
        segments = find(surface, view, ALL)
        curves = feature_curves(
            surface, camera(), LineOptions((kind, "contour"), smooth=0.0, hysteresis=0.0)
        )
        curves = curves.take(curves.kind == KINDS.index(kind))
        check(surface, curves)
        p = segments.points(surface)
        assert lengths(surface, curves).sum() == pytest.approx(
            np.linalg.norm(p[:, 1] - p[:, 0], axis=1).sum()
        )
        if kind != "crease":
            assert len(curves) < 0.25 * len(segments)


def test_untrimmed_contours_of_closed_surfaces_are_closed():
    surface = bumpy()
    curves = feature_curves(surface, camera(), only("contour", trim=False))
    assert curves.closed.all() and len(curves) >= 1


def test_the_order_of_faces_does_not_matter():
    surface = bumpy()
    rng = np.random.default_rng(0)
    order = rng.permutation(len(surface.faces))
    other = make_surface(surface.vertices, surface.faces[order])
    a, b = (feature_curves(s, camera(), ALL) for s in (surface, other))
    assert len(a) == len(b)
    assert np.allclose(np.sort(lengths(surface, a)), np.sort(lengths(other, b)), atol=1e-9)
    starts = [c.points(s)[c.offsets[:-1][c.closed]] for s, c in ((surface, a), (other, b))]
    assert np.allclose(*(p[np.lexsort(p.T)] for p in starts), atol=1e-9)


def test_the_same_twice():
    surface = bumpy()
    a, b = (feature_curves(surface, camera(), ALL) for _ in range(2))
    assert all(
        np.array_equal(getattr(a, name), getattr(b, name))
        for name in SurfaceCurves.__dataclass_fields__
    )
    assert (np.diff(a.kind) >= 0).all()


def segments_between(nodes, places):
    """Segments along the edges of a mesh that has a vertex at each of `places`, in made-up
    triangles.
    """
    nodes = np.asarray(nodes)
    points = np.array(
        [[places[a], places[b], np.add(places[a], places[b]) / 2 + [0, 0, 1]] for a, b in nodes],
        float,
    )
    surface = make_surface(points.reshape(-1, 3), np.arange(3 * len(nodes)).reshape(-1, 3))
    faces = np.arange(len(nodes))
    corner = surface.original(surface.vertices)[surface.faces]  # winding may have been turned
    ends = np.array([[places[a], places[b]] for a, b in nodes], float)
    bary = np.isclose(ends[:, :, None], corner[:, None]).all(axis=3).astype(float)
    return surface, lines.Segments(0, faces, bary, nodes, np.ones(nodes.shape))


PLACES = {
    0: (0, 0, 0),
    1: (1, 0, 0),
    2: (2, 0.1, 0),
    3: (1, 1, 0),
    4: (0, 1, 0),
    5: (3, 0, 0),
    6: (1, -1, 0),
}


@pytest.mark.parametrize(
    "nodes, counts, closed",
    [
        ([[0, 1], [1, 2], [2, 5]], [4], [False]),
        ([[5, 2], [0, 1], [2, 1]], [4], [False]),
        ([[0, 1], [1, 3], [3, 4], [4, 0]], [5], [True]),
        ([[1, 0], [1, 3], [4, 3], [4, 0]], [5], [True]),
        ([[0, 1], [1, 2], [1, 3]], [2, 3], [False, False]),  # a T: the straight pair goes on
        ([[0, 1], [1, 2], [1, 3], [6, 1]], [3, 3], [False, False]),  # a crossing: both go on
        ([[0, 1], [1, 3], [1, 6], [1, 2], [2, 5]], [3, 4], [False, False]),
        ([[0, 1]], [2], [False]),
        ([[0, 1], [3, 4]], [2, 2], [False, False]),
    ],
)
def test_chaining(nodes, counts, closed):
    surface, segments = segments_between(nodes, PLACES)
    curves = chain_segments(surface, segments, np.array([0.0, 1, 0]), 0.0)
    assert sorted(np.diff(curves.offsets)) == counts and curves.closed.tolist() == closed


def test_chaining_of_many_rings_and_lines_at_once():
    """Long chains in random order and direction, against what they were made from."""
    rng = np.random.default_rng(1)
    sizes, rings = rng.integers(3, 60, 40), rng.random(40) < 0.5
    nodes, base = [], 0
    for size, ring in zip(sizes, rings, strict=True):
        run = base + np.arange(size)
        nodes += [[run[i], run[(i + 1) % size]] for i in range(size if ring else size - 1)]
        base += size
    nodes = np.array(nodes)[rng.permutation(len(nodes))]
    nodes = np.where(rng.random(len(nodes))[:, None] < 0.5, nodes, nodes[:, ::-1])
    angle = rng.random(base)
    places = {
        i: (np.cos(6.28 * angle[i]), np.sin(6.28 * angle[i]), 3.0 * i / base) for i in range(base)
    }
    surface, segments = segments_between(nodes, places)
    curves = chain_segments(surface, segments, np.array([0.0, 1, 0]), 0.0)
    assert sorted(np.diff(curves.offsets)) == sorted(sizes + rings)
    assert curves.closed.sum() == rings.sum()
    points = curves.points(surface)
    for i in np.flatnonzero(curves.closed):
        ring = points[curves.offsets[i] : curves.offsets[i + 1]]
        assert ring[0, 1] == ring[:, 1].max() and np.array_equal(ring[0], ring[-1])


def test_hysteresis_keeps_weak_parts_of_strong_lines():
    surface = bumpy()
    weak = feature_curves(surface, camera(), only("ridge", ridge=0.05))
    some = feature_curves(surface, camera(), only("ridge", ridge=0.05, hysteresis=0.5))
    assert 0 < len(some) < len(weak)
    assert some.strength.min() < 0.4
    assert (np.maximum.reduceat(some.strength, some.offsets[:-1]) >= 0.5).all()


# --------------------------------------------------------------------------------------- zoo


EYES = [(0, 0, 3), (0, 0, 0.0001), (0.3, 0.2, 0.1), (0.5, 0.5, 0.5), (0, 3, 0.001), (1e6, 0, 1e6)]


@pytest.mark.parametrize("eye", EYES)
@pytest.mark.parametrize(
    "name", ["sphere", "cube", "plane", "moebius", "triangle", "islands", "soup"]
)
def test_nothing_much_is_no_trouble(name, eye):
    rng = np.random.default_rng(2)
    mesh = {
        "sphere": shapes.sphere(1), "cube": shapes.cube(3), "plane": shapes.plane(),
        "moebius": shapes.moebius(20, 3),
        "triangle": (np.eye(3), [[0, 1, 2]]),
        "islands": (rng.normal(size=(60, 3)), np.arange(60).reshape(-1, 3)),
        "soup": (rng.normal(size=(30, 3)), rng.integers(0, 30, size=(90, 3))),
    }[name]  # fmt: skip
    surface = make_surface(*mesh)
    view = Camera(eye, (0.01, 0, -0.5), (0, 1, 0), 40, 64, 64)
    for options in (LineOptions(SURFACE_KINDS), ALL, LineOptions(())):
        curves = feature_curves(surface, view, options)
        check(surface, curves)
        assert {KINDS[k] for k in curves.kind} <= set(options.kinds)


def test_named_views_of_a_bumpy_sphere():
    surface = bumpy()
    for name in ("front", "side", "top"):
        curves = feature_curves(surface, fit_camera(surface.vertices, name), LineOptions())
        check(surface, curves)
        assert "contour" in {KINDS[k] for k in curves.kind}


# -------------------------------------------------------------------------------- validation


@pytest.mark.parametrize(
    "options, message",
    [
        ({"kinds": ("outline",)}, "line kind 'outline' is none of contour"),
        ({"ridge": -1.0}, "line option ridge"),
        ({"valley": np.nan}, "line option valley"),
        ({"hysteresis": 1.5}, "hysteresis"),
        ({"follow": 0.5}, "follow"),
        ({"crease": 200.0}, "crease"),
    ],
)
def test_options_must_make_sense(options, message):
    with pytest.raises(ValueError, match=message):
        LineOptions(**options)


def test_detail_is_one_knob():
    surface = bumpy()
    kinds = LineOptions(SURFACE_KINDS, smooth=0.02)
    found = [
        feature_curves(surface, camera(), kinds.detailed(detail))
        for detail in (0.3, 0.6, 1.0, 2.0, 4.0)
    ]
    total = [lengths(surface, curves).sum() for curves in found]
    assert (np.diff(total) > 0).all()
    assert kinds.detailed(1.0) == kinds
    for bad in (0.0, -1.0, np.nan, 100.0):
        for range_ in ((bad,), (1.0, bad), (bad, 1.0)):
            with pytest.raises(ValueError, match="detail must lie between"):
                kinds.detailed(*range_)
    with pytest.raises(ValueError, match=r"runs from LOW to HIGH, got 2\.\.1"):
        kinds.detailed(2.0, 1.0)


def test_soft_lines_are_weak_between_slivers():
    """The same ridge, with edges of one length and with the grid's rows 30 times as far apart
    as its columns.
    """
    strength = []
    for rows in (61, 3):
        ridge, keep = shapes.ridge(), np.linspace(0, 60, rows).astype(int)
        vertices = ridge.vertices.reshape(61, 61, 3)[keep].reshape(-1, 3)
        surface = make_surface(vertices, shapes.grid(rows, 61)[:, ::-1])
        curves = feature_curves(surface, camera((0, 0, 3)), only("ridge", ridge=0.01))
        strength.append(curves.strength.max(initial=0.0))
    assert strength[0] > 0.5 and strength[1] == 0.0
    assert (line_choice.trust_in_shape(make_surface(*shapes.sphere(3))) == 1.0).all()


def test_a_range_of_detail_follows_the_lines_of_its_low_end():
    surface = bumpy()
    kinds = LineOptions(("suggestive", "ridge", "valley", "apparent"), smooth=0.02, trim=False)
    assert kinds.detailed(0.7, 0.7) == kinds.detailed(0.7)
    few, followed = (
        feature_curves(surface, camera(), kinds.detailed(0.7, high)) for high in (0.7, 2.0)
    )
    # all of what the thresholds of both ends let through, in the fields as they are smoothed for
    # the low end
    many = feature_curves(
        surface, camera(), replace(kinds.detailed(0.7, 2.0).followed(), hysteresis=0.0)
    )
    for kind in np.unique(many.kind):
        part = {
            name: c.take(c.kind == kind)
            for name, c in (("few", few), ("followed", followed), ("many", many))
        }
        size = {name: lengths(surface, c).sum() for name, c in part.items()}
        assert size["few"] <= size["followed"] <= size["many"] and (size["few"] > 0.0) == (
            size["followed"] > 0.0
        )
        assert np.isin(part["few"].face, part["followed"].face).all()
        for i in range(len(part["followed"])):  # each of them has its reason
            rows = slice(*part["followed"].offsets[i : i + 2])
            assert np.isin(part["followed"].face[rows], part["few"].face).any()
    assert lengths(surface, few).sum() < 0.97 * lengths(surface, followed).sum()
    assert len(followed) < len(many)


def test_kinds_are_put_in_order():
    assert LineOptions(("valley", "contour", "valley")).kinds == ("contour", "valley")


@pytest.mark.parametrize(
    "change, message",
    [
        ({"bary": np.zeros((3, 2))}, "SurfaceCurves.face"),
        ({"offsets": [0, 1, 3]}, "SurfaceCurves.offsets"),
        ({"kind": [0, 1]}, "SurfaceCurves.kind"),
        ({"kind": [99]}, "SurfaceCurves.kind"),
        ({"strength": [0, np.nan, 0]}, "not finite"),
    ],
)
def test_curves_refuse_what_does_not_fit(change, message):
    good = dict(
        face=[0, 0, 0], bary=np.eye(3), offsets=[0, 3], kind=[0], closed=[False], strength=[1, 1, 1]
    )
    assert len(SurfaceCurves(**good)) == 1
    with pytest.raises(ValueError, match=message):
        SurfaceCurves(**{**good, **change})


def test_empty_curves():
    empty = SurfaceCurves.empty()
    surface = make_surface(*shapes.cube())
    assert len(empty) == 0 and empty.points(surface).shape == (0, 3)
    assert (
        len(SurfaceCurves.concatenate([empty, empty])) == 0
        and len(SurfaceCurves.concatenate([])) == 0
    )
    assert len(empty.take(np.zeros(0, bool))) == 0


def test_lines_that_follow_the_camera_are_found_for_each_view():
    assert {kind.name for kind in KIND_TABLE if kind.follows_camera} == {
        "contour",
        "crease",
        *line_choice._SOFT_VIEW_KINDS,
    }
