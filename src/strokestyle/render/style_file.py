"""Model files: save a style, load a style."""

from __future__ import annotations

from dataclasses import asdict, fields
from pathlib import Path
from typing import TYPE_CHECKING

from .. import __version__
from ..files import read_model, write_model
from .config import StyleConfig
from .features import FEATURES
from .residuals import Residuals
from .style import Style, SumOfCurves
from .texture_bank import TextureBank

if TYPE_CHECKING:
    from .neural_strokes import NeuralStrokesStyle

FORMAT = 2


def save_style(path: str | Path, style: Style | NeuralStrokesStyle) -> None:
    """Write a model file: only arrays and plain values, read back without running code. Whole or not at all."""
    payload = {"format": FORMAT, "strokestyle": __version__, "about": dict(style.about)}
    write_model(
        path, payload | (_state(style) if isinstance(style, Style) else {"paper": style.state()})
    )


def _state(style: Style) -> dict:
    return {
        "config": asdict(style.config),
        "network": asdict(style.network),
        "moves": style.moves,
        "features": {
            "names": list(FEATURES),
            **{name: getattr(style, name) for name in ("centre", "spread", "low", "high", "color")},
        },
        "hand": None if style.hand is None else asdict(style.hand),
        "texture": None if style.bank is None else asdict(style.bank),
    }


def load_style(path: str | Path, device: str = "cpu") -> Style | NeuralStrokesStyle:
    """Read a model file. `device` is where the networks of a PaperStyle go; a Style has nothing to gain from one.

    Raises ValueError, naming the file, where it is no model, is cut short, damaged, or of a newer version; OSError
    where it cannot be read.
    """
    payload = read_model(path)
    if not isinstance(payload.get("format"), int) or "strokestyle" not in payload:
        raise ValueError(
            f"{path}: not a strokestyle model; expected a file written by `strokestyle fit`"
        )
    if payload["format"] > FORMAT:
        raise ValueError(
            f"{path}: written by strokestyle {payload['strokestyle']} (format {payload['format']}); this is "
            f"{__version__} (format {FORMAT}): update strokestyle"
        )
    if "paper" in payload or device not in ("auto", "cpu"):
        from .devices import pick_device
        from .neural_strokes import NeuralStrokesStyle

        place = pick_device(device)
    try:
        if "paper" in payload:
            return NeuralStrokesStyle.from_state(payload["paper"], payload["about"], place)
        return _unpack_style(payload)
    except (KeyError, TypeError, RuntimeError, AttributeError) as error:
        raise ValueError(f"{path}: a damaged strokestyle model ({error}); write it again") from None


def _unpack_style(payload: dict) -> Style:
    known = {f.name for f in fields(StyleConfig)}
    config = {key: value for key, value in payload["config"].items() if key in known}
    config = StyleConfig(
        **{key: tuple(value) if isinstance(value, list) else value for key, value in config.items()}
    )
    statistics = payload["features"]
    if tuple(statistics["names"]) != FEATURES:
        raise KeyError("its features are not those of this version")
    return Style(
        config=config,
        network=SumOfCurves(**payload["network"]),
        moves=payload["moves"],
        hand=None if payload["hand"] is None else Residuals(**payload["hand"]),
        bank=None if payload["texture"] is None else TextureBank(**payload["texture"]),
        about=payload["about"],
        **{name: statistics[name] for name in ("centre", "spread", "low", "high", "color")},
    )
