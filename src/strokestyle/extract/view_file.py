"""Views in files: .npz holds all of a view, .json its camera and curves for other programs."""

from __future__ import annotations

import json
import zipfile
import zlib
from pathlib import Path
from typing import Any

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
OF_LINES = ("strength", "optional")  # what may be known of the lines besides
JSON_WANTED = '"curves": [[[x, y], ...], ...]'
JSON_FIELDS = {  # maps told along the curves, and their names in the file
    "depth": "depth",
    "n_dot_v": "ndotv",
    "view_curvature": "curvature",
    "normal_x": "nx",
    "normal_y": "ny",
}


def save_view(path: str | Path, view: View) -> None:
    """Write a view as .npz, whole or not at all."""
    curves, maps = view.curves, view.maps
    arrays = {
        "strokestyle_view": np.array(FORMAT),
        "camera": np.array(json.dumps(view.camera.to_dict())),
        **{name: getattr(curves, name) for name in CURVE_ARRAYS},
        "names": np.array(maps.names),
        "values": maps.values.astype(np.float16),
        "covered": np.packbits(maps.covered),
        "scale": maps.scale,
    }
    arrays |= {name: getattr(view, name) for name in OF_LINES if getattr(view, name) is not None}
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
    """Read a view that `save_view` wrote.

    Raises
    ------
    ValueError
        naming the file, on anything else
    OSError
        where the file cannot be read.
    """
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
            known: dict[str, Any] = {
                f"{name}s": Parts(tuple(map(str, file["part_names"])), file[name])
                for name in ("part", "hidden_part")
                if name in file.files
            }
            known |= {name: file[name] for name in OF_LINES if name in file.files}
            return View(camera, curves, maps, hidden, **known)
    except (zipfile.BadZipFile, EOFError, KeyError, zlib.error, TypeError) as error:
        raise ValueError(
            f"{path}: not a view, or a damaged one ({error}); extract it again"
        ) from None
    except ValueError as error:
        if "pickled" in str(error):
            raise ValueError(f"{path}: not a view saved by `strokestyle extract`") from None
        raise ValueError(f"{path}: {error}") from None


def view_to_json(view: View) -> dict:
    """Describe a view for other programs: camera, curves, and the surface along them.

    Points are in pixels, to two decimals. Of the surface: depth in world units, n.v, the
    view-dependent curvature, and the normal's components on the screen, one number a point.
    """
    curves = view.curves
    content = {
        "format": "strokestyle-curves-1",
        "camera": view.camera.to_dict(),
        "size": [view.camera.width, view.camera.height],
        "step": float(np.round(np.median(np.hypot(*np.diff(curves.xy, axis=0).T)), 2))
        if len(curves)
        else 0.0,
        **_curves_to_json(curves),
        "fields": _surface_along_curves(view),
    }
    if len(view.hidden):
        hidden = _curves_to_json(view.hidden)
        content["hidden"] = hidden | _parts_to_json(view.hidden_curve_parts)
    return content | _parts_to_json(view.curve_parts)


def _curves_to_json(curves: Curves) -> dict:
    """Describe curves: their points, the names of their kinds, and which are closed."""
    return {
        "curves": _ragged(curves.offsets, curves.xy, 2),
        "kinds": [KINDS[k] for k in curves.kind],
        "closed": curves.closed.tolist(),
    }


def _parts_to_json(parts: Parts | None) -> dict:
    """Name the part of each curve; nothing where the shape has but one."""
    return {} if parts is None else {"parts": [parts.name(i) for i in range(len(parts))]}


def _surface_along_curves(view: View) -> dict[str, list]:
    """Read the maps of JSON_FIELDS along the curves, unscaled, to four decimals."""
    maps = view.maps
    scale = np.array([maps.scale_of(name) for name in JSON_FIELDS])
    values = view.at_curves(tuple(JSON_FIELDS)) * scale
    return {
        name: _ragged(view.curves.offsets, column, 4)
        for name, column in zip(JSON_FIELDS.values(), values.T, strict=True)
    }


def _ragged(offsets: np.ndarray, values: np.ndarray, digits: int) -> list[list]:
    """Round values (N,) or (N, d) of curves, one list a curve."""
    flat = np.round(np.asarray(values, np.float64), digits).tolist()
    return [flat[a:b] for a, b in zip(offsets[:-1], offsets[1:], strict=True)]


def read_curves_json(data: bytes, size: tuple[int, int]) -> Curves:
    """Read curves from a JSON object with "curves".

    Where it has them, "kinds", "closed" and "size" are read too.
    Curves given on a canvas of another "size" are fitted into this one.

    Parameters
    ----------
    data : the file's content; `view_to_json` describes the format
    size : (width, height) of the canvas, pixels

    Raises
    ------
    ValueError
        on anything else, on coordinates that are not finite, and on more than files.MAX_CURVES
        curves or files.MAX_POINTS points.
    """
    content = _json_object(data)
    lines = content["curves"]
    if not isinstance(lines, list):
        raise ValueError(
            f'"curves" must be a list of lists of points, {JSON_WANTED}; got {_a(lines)}'
        )
    if len(lines) > limits.MAX_CURVES:
        raise ValueError(
            f"{len(lines)} curves are more than {limits.MAX_CURVES}: simplify them first"
        )
    lines = [_points(line, i) for i, line in enumerate(lines)]
    kind = _json_kinds(content.get("kinds"), len(lines))
    closed = _json_closed(content.get("closed"), len(lines))
    if closed is not None:
        lines = [_ring(line) if c else line for line, c in zip(lines, closed, strict=True)]
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


def _json_object(data: bytes) -> dict:
    """Parse a file of curves as far as the object that holds them."""
    if data.count(b"[") > 8 * limits.MAX_POINTS:  # before millions of lists are made of them
        raise ValueError(f"more than {8 * limits.MAX_POINTS} lists: simplify the curves first")
    try:
        content = json.loads(data)
    except RecursionError:
        raise ValueError(
            "its lists are nested too deep; a file of curves is a JSON object with " + JSON_WANTED
        ) from None
    except ValueError as error:  # JSONDecodeError, UnicodeDecodeError, a number of too many digits
        raise ValueError(f"not a file of curves (JSON expected: {error})") from None
    if not isinstance(content, dict) or "curves" not in content:
        found = _keys(content) if isinstance(content, dict) else _a(content)
        raise ValueError(
            f"no curves in it, but {found}; a file of curves is a JSON object with {JSON_WANTED}"
        )
    return content


def _json_kinds(names: object, count: int) -> np.ndarray:
    """Read "kinds" as indices into KINDS, (count,); names unknown or not given are "other"."""
    if names is None:
        names = ["other"] * count
    if (
        not isinstance(names, list)
        or len(names) != count
        or not all(isinstance(name, str) for name in names)
    ):
        found = f"a list of {len(names)}" if isinstance(names, list) else _a(names)
        raise ValueError(
            f'"kinds" must be a list of names, one for each of the {count} curves; got {found}'
        )
    other = KINDS.index("other")
    return np.array([other if (k := kind_named(name)) is None else k for name in names], np.int64)


def _json_closed(flags: object, count: int) -> np.ndarray | None:
    """Read "closed", (count,) bool, or None where it is not given."""
    if flags is None:
        return None
    if (
        not isinstance(flags, list)
        or len(flags) != count
        or not all(isinstance(flag, bool) for flag in flags)
    ):
        raise ValueError(
            f'"closed" must be a list of true and false, one for each of the {count} curves'
        )
    return np.array(flags, bool)


def _ring(line: np.ndarray) -> np.ndarray:
    """Repeat the first point of a closed curve (n, 2) as its last, unless it is.

    Other programs leave out the point that closes a curve: it is our convention that repeats it.
    """
    if len(line) > 2 and (line[0] != line[-1]).any():
        return np.concatenate([line, line[:1]])
    return line


def _points(line: object, i: int) -> np.ndarray:
    """Read curve i of a JSON file, (n, 2)."""
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


def _json_size(found: object, canvas: tuple[int, int]) -> tuple[float, float]:
    """Read "size", (width, height) in pixels; where it is not given, it is the canvas's."""
    if found is None:
        return canvas
    if not (
        isinstance(found, list)
        and all(isinstance(v, (int, float)) and not isinstance(v, bool) for v in found)
        and len(found) == 2
        and all(1 / MAX_NUMBER <= v <= MAX_NUMBER for v in found)
    ):
        raise ValueError(
            f'"size" must be [width, height] in pixels, both above 0; got {json.dumps(found)[:60]}'
        )
    return float(found[0]), float(found[1])


def _a(value: object) -> str:
    """Name the sort of a JSON value, as a message has it."""
    names = {
        dict: "an object",
        list: "a list",
        str: "a text",
        bool: "true or false",
        type(None): "null",
    }
    return names.get(type(value), "a number")


def _keys(content: dict) -> str:
    """Name the first keys of a JSON object, as a message has them."""
    names = ", ".join(json.dumps(key)[:30] for key in list(content)[:4])
    return (
        "an empty object"
        if not content
        else f"an object with {names}{', ...' * (len(content) > 4)}"
    )
