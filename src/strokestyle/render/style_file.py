"""Model files: save a style, load a style."""

from __future__ import annotations

from dataclasses import asdict, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from .. import __version__
from ..files import read_model, write_model
from .choice import LineChoice
from .config import StyleConfig
from .features import FEATURES, FeatureScaling
from .overshoots import Overshoots
from .residuals import Residuals
from .restating import Restating
from .style import Style, SumOfCurves
from .texture_bank import TextureBank

if TYPE_CHECKING:
    from .neural_strokes import NeuralStrokesStyle

# 4: features of the nib, overshoots; 3: fields are called what the classes call them; 2, 3 are read
FORMAT = 4
# What the settings of format 2 are called now.
CONFIG_OF_FORMAT_2 = {
    "join": "join_gap",
    "corner": "corner_angle",
    "extend": "max_overshoot",
    "hidden": "hidden_units",
}


def save_style(path: str | Path, style: Style | NeuralStrokesStyle) -> None:
    """Write a model file: arrays and plain values only, read back without running code.

    It is written whole or not at all. Raises OSError, naming the file, where it cannot be written.
    """
    payload = {"format": FORMAT, "strokestyle": __version__, "about": dict(style.about)}
    payload["choice"] = None if style.choice is None else style.choice.state()
    if isinstance(style, Style):
        write_model(path, payload | _state(style))
    else:
        write_model(path, payload | {"paper": style.state()})


def _state(style: Style) -> dict:
    return {
        "config": asdict(style.config),
        "log_width": asdict(style.log_width),
        "displacement": style.displacement,
        "features": asdict(style.scaling) | {"names": list(style.scaling.names)},
        "residuals": None if style.residuals is None else asdict(style.residuals),
        "texture": None if style.bank is None else asdict(style.bank),
        "color": style.color,
        "overshoots": None if style.overshoots is None else asdict(style.overshoots),
        "restating": None if style.restating is None else asdict(style.restating),
    }


def load_style(path: str | Path, device: str = "cpu") -> Style | NeuralStrokesStyle:
    """Read a model file.

    `device` is where the networks of a NeuralStrokesStyle go; a Style has nothing to gain from one.

    Raises
    ------
    ValueError
        naming the file, where it is no model, is cut short, damaged, or of a newer version.
    OSError
        where it cannot be read.
    """
    payload = read_model(path)
    if not isinstance(payload.get("format"), int) or "strokestyle" not in payload:
        raise ValueError(
            f"{path}: not a strokestyle model; expected a file written by `strokestyle fit`"
        )
    if payload["format"] > FORMAT:
        raise ValueError(
            f"{path}: written by strokestyle {payload['strokestyle']} "
            f"(format {payload['format']}); this is {__version__} (format {FORMAT}): "
            "update strokestyle"
        )
    if "paper" in payload or device not in ("auto", "cpu"):
        from .devices import pick_device
        from .neural_strokes import NeuralStrokesStyle

        place = pick_device(device)
    try:
        choice = None if payload.get("choice") is None else LineChoice.from_state(payload["choice"])
        if "paper" in payload:
            state, about = payload["paper"], payload["about"]
            return replace(NeuralStrokesStyle.from_state(state, about, place), choice=choice)
        style = _unpack_style(payload if payload["format"] > 2 else _from_format_2(payload))
        return replace(style, choice=choice)
    except (KeyError, TypeError, RuntimeError, AttributeError, IndexError) as error:
        raise ValueError(f"{path}: a damaged strokestyle model ({error}); write it again") from None


def _unpack_style(payload: dict) -> Style:
    known = {f.name for f in fields(StyleConfig)}
    config = {key: value for key, value in payload["config"].items() if key in known}
    names = tuple(payload["features"]["names"])
    if not set(names) <= set(FEATURES):
        raise KeyError("its features are not those of this version")
    scaling = payload["features"] | {"names": names}
    residuals, texture = payload["residuals"], payload["texture"]
    # from format 4 on, though not in all of it
    overshoots, restating = payload.get("overshoots"), payload.get("restating")
    return Style(
        config=StyleConfig(**config),
        log_width=SumOfCurves(**payload["log_width"]),
        displacement=payload["displacement"],
        scaling=FeatureScaling(**scaling),
        residuals=None if residuals is None else Residuals(**residuals),
        bank=None if texture is None else TextureBank(**texture),
        color=payload["color"],
        about=payload["about"],
        overshoots=None if overshoots is None else Overshoots(**overshoots),
        restating=None if restating is None else Restating(**restating),
    )


def _from_format_2(payload: dict) -> dict:
    """Put what a file of format 2 holds under the names of format 3."""
    features = dict(payload["features"])
    residuals = payload["hand"]
    if residuals is not None:
        residuals = {"values": residuals["stray"], "offsets": residuals["offsets"]}
    texture = payload["texture"]
    return payload | {
        "config": {CONFIG_OF_FORMAT_2.get(k, k): value for k, value in payload["config"].items()},
        "log_width": payload["network"],
        "displacement": payload["moves"],
        "color": features.pop("color"),
        "features": features,
        "residuals": residuals,
        "texture": None if texture is None else _texture_of_format_2(texture),
    }


def _texture_of_format_2(texture: dict) -> dict:
    """The same for a texture: its rows' properties were columns of one table."""
    row: np.ndarray = texture["row"]
    return {
        "rgba": texture["rgba"],
        "offsets": texture["offsets"],
        "width": row[:, 0],
        "ends": row[:, 1:3],
        "occlusion": row[:, 3],
        "appearance": texture["look"],
        "local_ink": texture["tone"],
        "predicted_ink": texture["fitted"],
        "weights": texture["weights"],
        "scale": texture["scale"],
        "noise": texture["noise"],
        "margin": float(texture["margin"][0]),
        "flat": bool(texture["flat"][0] > 0.5),
    }
