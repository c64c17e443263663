"""Views in files: .npz holds all of a view, .json its camera and curves for other programs."""

from __future__ import annotations

import json
import zipfile
import zlib
from pathlib import Path

import numpy as np

from .. import files as limits
from ..files import write_arrays
from ..geometry.affine import MAX_NUMBER, fit_box
from ..geometry.curves import KINDS, Curves, clean_curves, kind_named
from ..geometry.parts import Parts
from .camera import Camera
from .feature_maps import FeatureMaps
from .view import View

FORMAT = 1
CURVE_ARRAYS = ("xy", "offsets", "kind", "closed")


def save_view(path: str | Path, view: View) -> None:
    """Write a view as .npz, whole or not at all."""
    curves, maps = view.curves, view.maps
    arrays = {
        "strokestyle_view": np.array(FORMAT),
        "camera": np.array(json.dumps(view.camera.to_dict())),
        **{name: getattr(curves, name) for name in CURVE_ARRAYS},
        "names": np.array(maps.names), "values": maps.values.astype(np.float16), "covered": np.packbits(maps.covered),
        "scale": maps.scale,
    }  # fmt: skip
    if len(view.hidden):
        arrays |= {f"hidden_{name}": getattr(view.hidden, name) for name in CURVE_ARRAYS}
    if view.parts is not None:
        arrays |= {"part_names": np.array(view.parts.names, str), "part": view.parts.index}
    if view.hidden_parts is not None:
        arrays |= {
            "part_names": np.array(view.hidden_parts.names, str),
            "hidden_part": view.hidden_parts.index,
        }
    write_arrays(path, arrays)


def load_view(path: str | Path) -> View:
    """Read what `save_view` wrote. Raises ValueError, naming the file, on anything else; OSError where unreadable."""
    path = Path(path)
    try:
        with open(path, "rb") as handle, np.lib.npyio.NpzFile(handle) as file:
            if "strokestyle_view" not in file.files:
                raise ValueError("not a view saved by `strokestyle extract`")
            if int(file["strokestyle_view"]) > FORMAT:
                raise ValueError("written by a newer strokestyle; update, or extract it again")
            camera = Camera.from_dict(json.loads(str(file["camera"])))
            curves = Curves(*(file[name] for name in CURVE_ARRAYS))
            shape, bits = (camera.height, camera.width), np.unpackbits(file["covered"])
            covered = bits[: shape[0] * shape[1]].astype(bool).reshape(shape)
            scale = file["scale"] if "scale" in file.files else None
            hidden = Curves.empty()
            if "hidden_xy" in file.files:
                hidden = Curves(*(file[f"hidden_{name}"] for name in CURVE_ARRAYS))
            maps = FeatureMaps(tuple(map(str, file["names"])), file["values"], covered, scale)
            parts = {
                f"{name}s": Parts(tuple(map(str, file["part_names"])), file[name])
                for name in ("part", "hidden_part")
                if name in file.files
            }
            return View(camera, curves, maps, hidden, **parts)
    except (zipfile.BadZipFile, EOFError, KeyError, zlib.error, TypeError) as error:
        raise ValueError(
            f"{path}: not a view, or a damaged one ({error}); extract it again"
        ) from None
    except ValueError as error:
        if "pickled" in str(error):
            raise ValueError(f"{path}: not a view saved by `strokestyle extract`") from None
        raise ValueError(f"{path}: {error}") from None


def view_to_json(view: View) -> dict:
    """Camera, curves and what the surface is like along them, for other programs. Points in pixels, two decimals."""
    curves = view.curves
    names = ("depth", "n_dot_v", "view_curvature", "normal_x", "normal_y")
    scale = np.array([view.maps.scale[view.maps.names.index(name)] for name in names])
    fields = view.at_curves(names) * scale

    def ragged(curves, values, digits):
        flat = np.round(np.asarray(values, np.float64), digits).tolist()
        return [flat[a:b] for a, b in zip(curves.offsets[:-1], curves.offsets[1:], strict=True)]

    content = {
        "format": "strokestyle-curves-1",
        "camera": view.camera.to_dict(),
        "size": [view.camera.width, view.camera.height],
        "step": float(np.round(np.median(np.hypot(*np.diff(curves.xy, axis=0).T)), 2))
        if len(curves)
        else 0.0,
        "curves": ragged(curves, curves.xy, 2),
        "kinds": [KINDS[k] for k in curves.kind],
        "closed": curves.closed.tolist(),
        "fields": {
            name: ragged(curves, column, 4)
            for name, column in zip(
                ("depth", "ndotv", "curvature", "nx", "ny"), fields.T, strict=True
            )
        },
    }
    if len(view.hidden):
        content["hidden"] = {
            "curves": ragged(view.hidden, view.hidden.xy, 2),
            "kinds": [KINDS[k] for k in view.hidden.kind],
            "closed": view.hidden.closed.tolist(),
        }
    for target, parts in (
        (content, view.curve_parts),
        (content.get("hidden"), view.hidden_curve_parts),
    ):
        if parts is not None:
            target["parts"] = [parts.name(i) for i in range(len(parts))]
    return content


def read_curves_json(data: bytes, size: tuple[int, int]) -> Curves:
    wanted = '"curves": [[[x, y], ...], ...]'
    if data.count(b"[") > 8 * limits.MAX_POINTS:  # before millions of lists are made of them
        raise ValueError(f"more than {8 * limits.MAX_POINTS} lists: simplify the curves first")
    try:
        content = json.loads(data)
    except RecursionError:
        raise ValueError(
            f"its lists are nested too deep; a file of curves is a JSON object with {wanted}"
        ) from None
    except ValueError as error:  # JSONDecodeError, UnicodeDecodeError, a number of too many digits
        raise ValueError(f"not a file of curves (JSON expected: {error})") from None
    if not isinstance(content, dict) or "curves" not in content:
        found = _keys(content) if isinstance(content, dict) else _a(content)
        raise ValueError(
            f"no curves in it, but {found}; a file of curves is a JSON object with {wanted}"
        )
    lines = content["curves"]
    if not isinstance(lines, list):
        raise ValueError(f'"curves" must be a list of lists of points, {wanted}; got {_a(lines)}')
    if len(lines) > limits.MAX_CURVES:
        raise ValueError(
            f"{len(lines)} curves are more than {limits.MAX_CURVES}: simplify them first"
        )
    lines = [_points(line, i) for i, line in enumerate(lines)]

    kinds = content.get("kinds")
    if kinds is None:
        kinds = ["other"] * len(lines)
    if (
        not isinstance(kinds, list)
        or len(kinds) != len(lines)
        or not all(isinstance(kind, str) for kind in kinds)
    ):
        found = f"a list of {len(kinds)}" if isinstance(kinds, list) else _a(kinds)
        raise ValueError(
            f'"kinds" must be a list of names, one for each of the {len(lines)} curves; got {found}'
        )
    other = KINDS.index("other")
    kind = np.array([other if (k := kind_named(name)) is None else k for name in kinds], np.int64)

    closed = content.get("closed")
    if closed is not None:
        if (
            not isinstance(closed, list)
            or len(closed) != len(lines)
            or not all(isinstance(c, bool) for c in closed)
        ):
            raise ValueError(
                f'"closed" must be a list of true and false, one for each of the {len(lines)} curves'
            )
        # other programs leave out the point that closes a curve: it is our convention that repeats it
        lines = [
            np.concatenate([line, line[:1]])
            if c and len(line) > 2 and (line[0] != line[-1]).any()
            else line
            for line, c in zip(lines, closed, strict=True)
        ]
        closed = np.array(closed, bool)

    counts = np.array([len(line) for line in lines], np.int64)
    if counts.sum() > limits.MAX_POINTS:
        raise ValueError(
            f"{counts.sum()} points are more than {limits.MAX_POINTS}: simplify the curves first"
        )
    a, _, _, d, e, f = fit_box(
        (0.0, 0.0, *_json_size(content.get("size"), size)), (0.0, 0.0, *size)
    )
    xy = np.concatenate([np.zeros((0, 2)), *lines]) * (a, d) + (e, f)
    return clean_curves(xy, np.r_[0, np.cumsum(counts)], kind, closed)


def _points(line, i: int) -> np.ndarray:
    """One curve of a JSON file, (n, 2)."""
    try:
        points = np.asarray(line)
    except (ValueError, OverflowError):  # ragged
        points = np.zeros(0, object)
    if isinstance(line, list) and not line:
        return np.zeros((0, 2))
    if points.dtype.kind not in "iuf" or points.ndim != 2 or points.shape[1] != 2:
        raise ValueError(f"curve {i} must be a list of points [x, y], each two numbers in pixels")
    points = points.astype(np.float64)
    bad = ~(np.abs(points) <= MAX_NUMBER).all(axis=1)
    if bad.any():
        k = int(bad.argmax())
        raise ValueError(
            f"curve {i}, point {k} is {points[k].tolist()}: coordinates must be finite, in pixels"
        )
    return points


def _json_size(found, canvas: tuple[int, int]) -> tuple[float, float]:
    if found is None:
        return canvas
    numbers = isinstance(found, list) and all(
        isinstance(v, (int, float)) and not isinstance(v, bool) for v in found
    )
    if not (numbers and len(found) == 2 and all(1 / MAX_NUMBER <= v <= MAX_NUMBER for v in found)):
        raise ValueError(
            f'"size" must be [width, height] in pixels, both above 0; got {json.dumps(found)[:60]}'
        )
    return float(found[0]), float(found[1])


def _a(value) -> str:
    names = {
        dict: "an object",
        list: "a list",
        str: "a text",
        bool: "true or false",
        type(None): "null",
    }
    return names.get(type(value), "a number")


def _keys(content: dict) -> str:
    names = ", ".join(json.dumps(key)[:30] for key in list(content)[:4])
    return (
        "an empty object"
        if not content
        else f"an object with {names}{', ...' * (len(content) > 4)}"
    )
