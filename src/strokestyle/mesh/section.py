"""Cut a surface open along planes: what lies beyond goes, and solid bodies are closed by caps."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from .caps import cap_faces
from .cut_mesh import CutMesh, Rim
from .hollows import with_hollows
from .messages import warn
from .planes import AXES, Plane, SectionPlane
from .surface import Section, Surface
from .triangles import pair_key, unit_rows


def cut_open(
    surface: Surface,
    planes: Sequence[SectionPlane],
    eye: np.ndarray,
    whole: Surface | None = None,
) -> Surface:
    """Take away all that lies beyond any of some planes, and close solid bodies by caps.

    Closed bodies are solid: a cap hides what lies behind it, holes stay holes. A body that the file
    winds the other way round than the one it lies in is a hollow in that one. Open surfaces are
    cut without a cap, and so is a room: a body wound inward round others that are wound outward.
    Faces in the plane stay where they bound what is left. All that was measured on the surface
    stays as it was; a cap is flat, and of the part that most of its rim is of.

    Parameters
    ----------
    planes : at least one
    eye : (3,) or homogeneous (4,), what tells the side where a plane does not
    whole : of whose extent percents are; by default the surface

    Returns
    -------
    Surface, in the frame of the one given, whose `section` tells where it comes from; a
    MeshWarning says so where there is no cap

    Raises
    ------
    ValueError
        where a plane misses what there is to cut.
    """
    whole = surface if whole is None else whole
    surface, body, shell = with_hollows(surface)
    mesh, placed = CutMesh.of(surface, body, surface.closed_faces & ~shell), []
    for asked in planes:
        plane = _placed(asked, whole, eye)
        _check_crossed(asked, plane, mesh.at["vertices"][mesh.faces], surface)
        mesh = cap_faces(*_below(mesh, plane), plane)
        placed.append(plane)
    left = _surface(mesh, surface, tuple(placed))
    bare = mesh.rim.any(axis=1) & ~left.closed_faces
    if (bare & ~shell[mesh.source]).any():  # caps, of source -1, have no rim of their own
        warn("it is open where it is cut, or not a solid: no cap is drawn there")
    return left


def _placed(asked: SectionPlane, whole: Surface, eye: np.ndarray) -> Plane:
    """Place a plane in the frame of a surface."""
    along = whole.vertices[:, asked.axis]
    if asked.percent:
        offset = along.min() + 0.01 * asked.offset * np.ptp(along)
    else:
        offset = (asked.offset - whole.centre[asked.axis]) / whole.scale
    finite = eye[3] if len(eye) == 4 else 1.0
    nearer = 1 if eye[asked.axis] - finite * offset >= 0.0 else -1
    return Plane(asked.axis, float(offset), asked.side or nearer)


def _check_crossed(asked: SectionPlane, plane: Plane, corners: np.ndarray, frame: Surface) -> None:
    """Raise ValueError unless there is something on both sides of a plane."""
    height = plane.height(corners.reshape(-1, 3))
    if height.min() < 0.0 < height.max():
        return
    along = frame.original(corners.reshape(-1, 3))[:, plane.axis]
    digits = 6 - int(np.ceil(np.log10(frame.scale)))  # of the file's units, for a millionth of it
    name = AXES[plane.axis]
    at = f" ({name} = {frame.original(plane.offset * np.eye(3)[[plane.axis]])[0, plane.axis]:g})"
    raise ValueError(
        f"the section {asked}{at if asked.percent else ''} misses it: it reaches from "
        f"{name} = {along.min().round(digits) + 0.0:g} to {along.max().round(digits) + 0.0:g}"
    )


# ----------------------------------------------------------------------------------------- cutting


class _Groups(NamedTuple):
    """Faces by what becomes of them at a plane.

    Parameters
    ----------
    odd : (F,) int, the corner that is alone on its side of the plane, where one is
    left, flat : indices of faces that stay as they are, below the plane and in it
    one, two : of those cut in two that have one corner below, and two
    """

    odd: np.ndarray
    left: np.ndarray
    flat: np.ndarray
    one: np.ndarray
    two: np.ndarray


def _below(mesh: CutMesh, plane: Plane) -> tuple[CutMesh, Rim]:
    """Take away what lies beyond a plane, and tell which sides lie in it.

    Vertices in the plane count as beyond it, so that each face is left as it is, cut in two along a
    line between two of its sides, or goes. But faces in the plane stay that look beyond: they bound
    what is left. Those of open surfaces stay however they look.
    """
    height = plane.height(mesh.at["vertices"])
    groups = _grouped(mesh, plane, height)
    corners, rims = _turned_first(mesh, groups.odd, [groups.one, groups.two])
    mesh, tip, ends = _with_crossings(mesh, height, corners)
    along = (height[corners[0][:, 1:]] == 0.0).all(axis=1)  # a side that lies in the plane
    rows = [groups.left, groups.flat, groups.one, groups.two, groups.two]
    faces = [
        mesh.faces[groups.left],
        mesh.faces[groups.flat],
        np.stack([corners[0][:, 0], tip[:, 0], tip[:, 1]], axis=1),
        np.stack([ends[:, 0], corners[1][:, 1], corners[1][:, 2]], axis=1),
        np.stack([ends[:, 0], corners[1][:, 2], ends[:, 1]], axis=1),
    ]
    rim = [mesh.rim[groups.left], mesh.rim[groups.flat], *_rims_of_pieces(rims, along)]
    gone = np.setdiff1d(np.arange(len(groups.odd)), np.concatenate(rows))
    shut = _sides_in_plane(mesh, gone, height)
    made = mesh.of_faces(np.concatenate(rows), np.concatenate(faces), np.concatenate(rim))
    return made, _rim(made, np.cumsum([0, *map(len, rows)]), along, shut)


def _grouped(mesh: CutMesh, plane: Plane, height: np.ndarray) -> _Groups:
    """Sort faces by how many of their corners, of `height` (V,), lie below a plane."""
    at_corner = height[mesh.faces]
    under = at_corner < 0.0
    count = under.sum(axis=1)
    odd = np.where(count == 1, under.argmax(axis=1), (~under).argmax(axis=1))
    # a corner in the plane and two below: the plane touches the face there
    pointed = (count == 2) & (at_corner[np.arange(len(odd)), odd] == 0.0)
    return _Groups(
        odd,
        np.flatnonzero((count == 3) | pointed),
        np.flatnonzero(_left_in_plane(mesh, plane, at_corner)),
        np.flatnonzero(count == 1),
        np.flatnonzero((count == 2) & ~pointed),
    )


def _rims_of_pieces(rims: list[np.ndarray], along: np.ndarray) -> list[np.ndarray]:
    """Hand rims (M, 3) of cut faces down to their pieces: the tips of some, both halves of others.

    `along` (M,) tells of which tips the side in the plane was a side of the face already.
    """
    one, two = rims
    no = np.zeros(len(two), bool)
    return [
        np.stack([one[:, 0], one[:, 1] & along, one[:, 2]], axis=1),
        np.stack([two[:, 0], two[:, 1], no], axis=1),
        np.stack([no, two[:, 2], no], axis=1),
    ]


def _left_in_plane(mesh: CutMesh, plane: Plane, at_corner: np.ndarray) -> np.ndarray:
    """Tell which faces lie in a plane and bound what is below it, (F,) bool."""
    flat = (at_corner == 0.0).all(axis=1)
    a, b, c = (mesh.at["vertices"][mesh.faces[flat, i]] for i in range(3))
    up = np.cross(b - a, c - a) @ plane.normal > 0.0
    flat[flat] = up | ~mesh.closed[flat]
    return flat


def _turned_first(
    mesh: CutMesh, odd: np.ndarray, groups: list[np.ndarray]
) -> tuple[list[np.ndarray], list[np.ndarray]]:
    """Turn the corners of faces so that the odd one is first: corners and rims of the groups."""
    order = [(odd[rows, None] + np.arange(3)) % 3 for rows in groups]
    corners = [mesh.faces[rows[:, None], at] for rows, at in zip(groups, order, strict=True)]
    rims = [mesh.rim[rows[:, None], at] for rows, at in zip(groups, order, strict=True)]
    return corners, rims


def _with_crossings(
    mesh: CutMesh, height: np.ndarray, corners: list[np.ndarray]
) -> tuple[CutMesh, np.ndarray, np.ndarray]:
    """Add a vertex where an edge from the odd corner crosses the plane, one for each edge.

    Returns
    -------
    the mesh, and of both groups of faces the vertices (M, 2) at which their sides 0 and 2 cross:
    new ones, or a corner that lies in the plane
    """
    pairs = np.concatenate(
        [np.stack([c[:, [0, 0]], c[:, 1:]], axis=2).reshape(-1, 2) for c in corners]
    )
    crossing = (height[pairs] != 0.0).all(axis=1)
    found = np.where(height[pairs[:, 0]] == 0.0, pairs[:, 0], pairs[:, 1])
    count = len(height)
    # ends in the order of their places, so that vertices of both sides of a crease come out alike
    swap = mesh.weld[pairs[:, 0]] > mesh.weld[pairs[:, 1]]
    pairs[swap] = pairs[swap, ::-1]
    key, inverse = np.unique(pair_key(count, *pairs[crossing].T), return_inverse=True)
    found[crossing] = count + inverse
    a, b = np.divmod(key, count)
    _, first, place = np.unique(
        pair_key(count, mesh.weld[a], mesh.weld[b]), return_index=True, return_inverse=True
    )
    t = height[a] / (height[a] - height[b])
    added = _between(mesh.at, a, b, t)
    made = replace(
        mesh,
        at={name: np.concatenate([old, added[name]]) for name, old in mesh.at.items()},
        weld=np.r_[mesh.weld, count + first[place]],
        origin=np.r_[mesh.origin, np.full(len(key), -1)],
    )
    tip, ends = np.split(found.reshape(-1, 2), [len(corners[0])])
    return made, tip, ends


def _sides_in_plane(mesh: CutMesh, face: np.ndarray, height: np.ndarray) -> np.ndarray:
    """Name the sides of faces (M,) that lie in a plane, by body and place: (K, 3) int."""
    ends = np.stack([mesh.faces[face], np.roll(mesh.faces[face], -1, axis=1)], axis=2)
    row, side = np.nonzero((height[ends] == 0.0).all(axis=2))
    places = np.sort(mesh.weld[ends[row, side]], axis=1)
    return np.column_stack([mesh.body[face[row]], places])


def _rim(mesh: CutMesh, start: np.ndarray, along: np.ndarray, shut: np.ndarray) -> Rim:
    """List the sides in the plane of the faces that `_below` made, group by group from `start`.

    `along` tells of the faces with one corner below which only touch the plane by a side; `shut`
    names the sides in the plane of the faces that went.
    """
    flat, one, two = (np.arange(*start[i : i + 2]) for i in (1, 2, 4))
    face = np.r_[np.repeat(flat, 3), one, two]
    side = np.r_[np.tile([0, 1, 2], len(flat)), np.ones(len(one), int), np.full(len(two), 2)]
    ends = mesh.weld[np.stack([mesh.faces[face, side], mesh.faces[face, (side + 1) % 3]], axis=1)]
    names = np.column_stack([mesh.body[face], np.sort(ends, axis=1)])
    touching = np.r_[np.ones(3 * len(flat), bool), along, np.zeros(len(two), bool)]
    lost = np.unique(np.concatenate([shut, names]), axis=0, return_inverse=True)[1].ravel()
    fresh = ~touching | np.isin(lost[len(shut) :], lost[: len(shut)])
    return Rim(face, side, fresh)


# ------------------------------------------------------------------------------ fields in between


def _between(
    at: dict[str, np.ndarray], a: np.ndarray, b: np.ndarray, t: np.ndarray
) -> dict[str, np.ndarray]:
    """Measure a surface a share t (M,) of the way from vertices a to b (M,).

    Curvatures and their derivatives are mixed as tensors of space, and read in the new tangent
    plane: principal directions have no sign, and turn.
    """
    ends = [{name: value[i] for name, value in at.items()} for i in (a, b)]

    def mixed(value: Sequence[np.ndarray]) -> np.ndarray:
        share = t.reshape(-1, *[1] * (value[0].ndim - 1))
        return (1.0 - share) * value[0] + share * value[1]

    normals = unit_rows(mixed([end["normals"] for end in ends]))
    k1, k2, pdir1 = _principal(mixed([_form(end) for end in ends]), normals)
    pdir2 = np.cross(normals, pdir1)
    frame = np.stack([pdir1, pdir2], axis=1)
    cubic = np.einsum("mai,mbj,mck,mijk->mabc", *[frame] * 3, mixed([_cubic(e) for e in ends]))
    return {
        "vertices": mixed([end["vertices"] for end in ends]),
        "normals": normals,
        "k1": k1,
        "k2": k2,
        "pdir1": pdir1,
        "pdir2": pdir2,
        "dcurv": cubic[:, [0, 0, 0, 1], [0, 0, 1, 1], [0, 1, 1, 1]],
    }


def _principal(form: np.ndarray, normals: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Find the principal curvatures (M,), the larger by size first, and its direction (M, 3).

    `form` (M, 3, 3) is read in the planes across `normals` (M, 3).
    """
    first = unit_rows(np.cross(normals, np.eye(3)[np.abs(normals).argmin(axis=1)]))
    basis = np.stack([first, np.cross(normals, first)], axis=1)  # (M, 2, 3)
    (uu, uv), (_, vv) = np.einsum("mai,mij,mbj->abm", basis, form, basis)
    mean, spread = 0.5 * (uu + vv), np.hypot(0.5 * (uu - vv), uv)
    low = mean < 0.0  # the larger by size is then the lower one
    angle = 0.5 * np.arctan2(2.0 * uv, uu - vv) + np.where(low, 0.5 * np.pi, 0.0)
    direction = np.cos(angle)[:, None] * basis[:, 0] + np.sin(angle)[:, None] * basis[:, 1]
    sign = np.where(low, -1.0, 1.0)
    return mean + sign * spread, mean - sign * spread, direction


def _form(at: dict[str, np.ndarray]) -> np.ndarray:
    """Put the second fundamental form into space, (M, 3, 3)."""
    p, q = at["pdir1"], at["pdir2"]
    one, two = (d[:, :, None] * d[:, None, :] for d in (p, q))
    return at["k1"][:, None, None] * one + at["k2"][:, None, None] * two


def _cubic(at: dict[str, np.ndarray]) -> np.ndarray:
    """Put the derivative of the second fundamental form into space, (M, 3, 3, 3)."""
    index = np.add.outer(np.add.outer([0, 1], [0, 1]), [0, 1])
    frame = np.stack([at["pdir1"], at["pdir2"]], axis=1)
    return np.einsum("mabc,mai,mbj,mck->mijk", at["dcurv"][:, index], *[frame] * 3)


def _surface(mesh: CutMesh, whole: Surface, planes: tuple[Plane, ...]) -> Surface:
    """Make the surface that is left, without the vertices that nothing uses."""
    old, corner = np.unique(mesh.faces, return_inverse=True)
    _, first, place = np.unique(mesh.weld[old], return_index=True, return_inverse=True)
    made = replace(
        whole,
        **{name: value[old] for name, value in mesh.at.items()},
        faces=corner.reshape(-1, 3),
        part=mesh.part,
        polygon=mesh.polygon,
        turned=np.zeros(len(mesh.faces), bool),
        weld=first[place],
        connectivity=None,  # type: ignore[arg-type]
    )
    rim = np.unique(made.face_edges[mesh.rim])
    return replace(made, section=Section(whole, planes, mesh.source, mesh.origin[old], rim))
