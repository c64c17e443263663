"""Write MP4 and WebM through ffmpeg, where it is installed."""

from __future__ import annotations

import functools
import shutil
import subprocess
import tempfile
from fractions import Fraction

from .pictures import Pictures

# of each suffix: the encoder, and how it is asked for
CODECS = {
    ".mp4": ("libx264", ("-preset", "slow", "-crf", "16", "-movflags", "+faststart")),
    ".webm": ("libvpx-vp9", ("-b:v", "0", "-crf", "24", "-row-mt", "1")),
}
FORMATS = {".mp4": "mp4", ".webm": "webm"}
# sides are made even, as 4:2:0 wants it, by a row and a column of the edge's colour
FILTERS = "pad=ceil(iw/2)*2:ceil(ih/2)*2:color={},scale=out_color_matrix=bt709:out_range=tv"
COLOURS = ("-colorspace", "bt709", "-color_primaries", "bt709", "-color_trc", "iec61966-2-1")


def check_encoder(suffix: str) -> None:
    """Raise ValueError unless ffmpeg is there and can write such a film. Ask before long work."""
    encoder, _ = CODECS[suffix]
    program = shutil.which("ffmpeg")
    name = suffix[1:].upper() if suffix == ".mp4" else "WebM"
    if program is None:
        raise ValueError(
            f"{name} needs ffmpeg, which is not installed (https://ffmpeg.org): install it, or "
            "write .gif, .apng or .webp"
        )
    if encoder not in encoders(program):
        raise ValueError(
            f"{name} needs an ffmpeg with {encoder}, which {program} has not: install another, or "
            "write .gif, .apng or .webp"
        )


@functools.cache
def encoders(program: str) -> frozenset[str]:
    """Ask ffmpeg which encoders it has."""
    asked = subprocess.run(
        [program, "-hide_banner", "-encoders"],
        stdin=subprocess.DEVNULL,
        capture_output=True,
        check=False,
    )
    words = (line.split() for line in asked.stdout.decode("utf-8", "replace").splitlines())
    return frozenset(found[1] for found in words if len(found) > 1)


def write_video(
    path: str, pictures: Pictures, rate: Fraction, suffix: str, background: str = "white"
) -> None:
    """Write pictures as a film of one of CODECS through ffmpeg: 4:2:0, sides made even.

    Parameters
    ----------
    rate : frames a second
    suffix : of CODECS, which says what is written
    background : what ffmpeg calls the colour of a row and column that makes a side even

    Raises
    ------
    ValueError
        where there are no pictures, or ffmpeg is missing or fails: its last words.
    """
    if not len(pictures):
        raise ValueError("a film needs at least one picture")
    check_encoder(suffix)
    encoder, asked = CODECS[suffix]
    command = [
        shutil.which("ffmpeg") or "ffmpeg", "-hide_banner", "-loglevel", "error", "-y",
        "-f", "image2pipe", "-c:v", "png", "-framerate", f"{rate.numerator}/{rate.denominator}",
        "-i", "-", "-an", "-vf", FILTERS.format(background), "-c:v", encoder, *asked,
        "-pix_fmt", "yuv420p", *COLOURS, "-f", FORMATS[suffix], path,
    ]  # fmt: skip
    with tempfile.TemporaryFile() as words:
        process = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, stderr=words
        )
        try:
            _feed(process, pictures)
        except BaseException:
            process.kill()
            process.wait()
            raise
        if process.wait():
            words.seek(0)
            said = words.read().decode("utf-8", "replace").strip().splitlines()
            raise ValueError(f"ffmpeg failed: {said[-1] if said else 'it said nothing'}")


def _feed(process: subprocess.Popen, pictures: Pictures) -> None:
    """Send every frame, those that are held as often as they are shown."""
    assert process.stdin is not None
    try:
        for png, held in zip(pictures.pngs, pictures.held, strict=True):
            for _ in range(held):
                process.stdin.write(png)
        process.stdin.close()
    except BrokenPipeError:  # it has stopped, and says why
        pass
