"""Films by the suffix of their files."""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path

from ..files import replace_file
from . import gif
from .apng import write_apng
from .gif import write_gif
from .pictures import Pictures
from .timing import NoSuchRate, rate_of
from .video import CODECS, check_encoder, write_video
from .webp import write_webp

WRITERS = {".gif": write_gif, ".apng": write_apng, ".png": write_apng, ".webp": write_webp}
PAGE = ".html"
FILM_SUFFIXES = (PAGE, *WRITERS, *CODECS)


def check_film(path: str | Path, rate: Fraction) -> None:
    """Raise ValueError, naming `path`, where such a film cannot be written: before long work.

    It is a NoSuchRate where another rate would do.
    """
    suffix = Path(path).suffix.lower()
    try:
        if suffix in CODECS:
            check_encoder(suffix)
        elif suffix == ".gif":
            gif.check_rate(rate)
        elif suffix not in FILM_SUFFIXES:
            raise ValueError(f"a film is {', '.join(FILM_SUFFIXES)}")
    except NoSuchRate as error:
        raise NoSuchRate(f"{path}: {error}") from None
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None


def write_film(
    path: str | Path,
    pictures: Pictures,
    rate: Fraction | float,
    transparent: bool = False,
) -> None:
    """Write pictures as the film that the suffix of `path` says, whole or not at all.

    Parameters
    ----------
    rate : frames a second, as `rate_of` reads them
    transparent : keep the pictures' transparency; a video has none, and is white there

    Raises
    ------
    ValueError
        naming `path`, where the film cannot be written, or there are no pictures
    OSError
        where the file cannot.
    """
    suffix = Path(path).suffix.lower()
    if suffix not in (*WRITERS, *CODECS):
        raise ValueError(f"{path}: a film of pixels is {', '.join((*WRITERS, *CODECS))}")

    if not len(pictures):
        raise ValueError(f"{path}: a film needs at least one picture")

    def write(name: str) -> None:
        if suffix in CODECS:
            write_video(name, pictures, rate_of(rate), suffix, transparent)
        else:
            WRITERS[suffix](name, pictures, rate_of(rate), transparent)

    try:
        replace_file(path, write)
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None
