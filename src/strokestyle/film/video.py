"""Write MP4 and WebM through ffmpeg, where it is installed."""

from __future__ import annotations

import functools
import io
import shutil
import subprocess
import tempfile
from fractions import Fraction

from PIL import Image

from .pictures import Pictures

# of each suffix: the encoder, and how it is asked for
CODECS = {
    ".mp4": ("libx264", ("-preset", "slow", "-crf", "16", "-movflags", "+faststart")),
    ".webm": ("libvpx-vp9", ("-b:v", "0", "-crf", "24", "-row-mt", "1")),
}
FORMATS = {".mp4": "mp4", ".webm": "webm"}
MATRIX = "scale=out_color_matrix=bt709:out_range=tv"
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
    path: str, pictures: Pictures, rate: Fraction, suffix: str, transparent: bool = False
) -> None:
    """Write pictures as a film of one of CODECS through ffmpeg: 4:2:0, sides made even.

    Parameters
    ----------
    rate : frames a second
    suffix : of CODECS, which says what is written
    transparent : whether pictures are, and are to be laid on white

    Raises
    ------
    ValueError
        where ffmpeg is missing or fails: its last words.
    """
    check_encoder(suffix)
    encoder, asked = CODECS[suffix]
    command = [
        shutil.which("ffmpeg") or "ffmpeg", "-hide_banner", "-loglevel", "error", "-y",
        "-f", "image2pipe", "-c:v", "png", "-framerate", f"{rate.numerator}/{rate.denominator}",
        "-i", "-", "-an", "-vf", filters(*pictures.size), "-c:v", encoder, *asked,
        "-pix_fmt", "yuv420p", *COLOURS, "-f", FORMATS[suffix], path,
    ]  # fmt: skip
    with tempfile.TemporaryFile() as words:
        process = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, stderr=words
        )
        try:
            _feed(process, pictures, transparent)
        except BaseException:
            process.kill()
            process.wait()
            raise
        if process.wait():
            words.seek(0)
            said = words.read().decode("utf-8", "replace").strip().splitlines()
            raise ValueError(f"ffmpeg failed: {said[-1] if said else 'it said nothing'}")


def filters(width: int, height: int) -> str:
    """Ask ffmpeg for BT.709, and for even sides, as 4:2:0 wants them: edges are repeated."""
    right, bottom = width % 2, height % 2
    if not (right or bottom):
        return MATRIX
    wider = f"pad={width + right}:{height + bottom}"
    return f"{wider},fillborders=right={right}:bottom={bottom}:mode=smear,{MATRIX}"


def _feed(process: subprocess.Popen, pictures: Pictures, transparent: bool) -> None:
    """Send every frame, those that are held as often as they are shown."""
    assert process.stdin is not None
    try:
        for png, held in zip(pictures.pngs, pictures.held, strict=True):
            png = _on_white(png) if transparent else png
            for _ in range(held):
                process.stdin.write(png)
        process.stdin.close()
    except BrokenPipeError:  # it has stopped, and says why
        pass


def _on_white(png: bytes) -> bytes:
    """Lay a PNG on white."""
    with Image.open(io.BytesIO(png), formats=["PNG"]) as image:
        white = Image.new("RGBA", image.size, "white")
        white.alpha_composite(image.convert("RGBA"))
    file = io.BytesIO()
    white.convert("RGB").save(file, "PNG", compress_level=1)
    return file.getvalue()
