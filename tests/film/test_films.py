"""Films of pixels: times that do not drift, colours that do not flicker, files whole or not at
all."""

import io
import shutil
import subprocess
from fractions import Fraction

import numpy as np
import pytest
from PIL import Image, ImageSequence

from strokestyle.film.changes import changed_box
from strokestyle.film.films import check_film, write_film
from strokestyle.film.gif import Palette, reduced
from strokestyle.film.pictures import Pictures
from strokestyle.film.timing import durations, rate_of

RGB = (".gif", ".apng", ".png", ".webp")
LOSSLESS = (".apng", ".png", ".webp")
PROGRAM = shutil.which("ffmpeg")
with_ffmpeg = pytest.mark.skipif(PROGRAM is None, reason="no program: ffmpeg")


def strokes(count=7, size=(61, 41), colours=2):
    """Pictures (h, w, 4) uint8 of a line that moves: its ink in so many shades, edges soft."""
    y, x = np.mgrid[: size[1], : size[0]]
    shades = np.linspace(20, 90, colours)
    made = []
    for i in range(count):
        away = np.abs(y - 8 - i - 0.3 * x)
        alpha = np.clip(3 - away, 0, 1)
        ink = shades[(x * colours) // size[0]]
        rgba = np.stack([ink, 0.5 * ink, 255 - ink, 255 * alpha], axis=2)
        made.append(np.rint(rgba).astype(np.uint8))
    return made


def on_white(rgba):
    alpha = rgba[..., 3:] / 255
    colour = np.rint(rgba[..., :3] * alpha + 255 * (1 - alpha)).astype(np.uint8)
    return np.concatenate([colour, np.full_like(rgba[..., :1], 255)], axis=2)


@pytest.fixture
def pictures():
    """Makes Pictures of arrays."""
    made = []

    def of(arrays, held=None):
        made.append(Pictures())
        for i, array in enumerate(arrays):
            file = io.BytesIO()
            Image.fromarray(array).save(file, "PNG")
            made[-1].add(file.getvalue(), held[i] if held else 1)
        return made[-1]

    yield of
    for one in made:
        one.__exit__()


def read(path):
    """(arrays RGBA, durations ms, loop) of a film, as pillow reads it."""
    with Image.open(path) as film:
        arrays, times = [], []
        for frame in ImageSequence.Iterator(film):
            arrays.append(np.asarray(frame.convert("RGBA")))
            times.append(frame.info["duration"])
        return arrays, times, film.info.get("loop")


# ------------------------------------------------------------------------------------------- times


@pytest.mark.parametrize("fps", [12, 12.5, 24, 23.976, 29.97, 7, 50, 3.3])
@pytest.mark.parametrize("unit", [100, 1000])
def test_no_rounding_of_times_adds_up(fps, unit):
    rate = rate_of(fps)
    held = [1, 2, 1, 1, 3] * 40
    times = durations(held, rate, unit)
    ends, exact = np.cumsum(times), np.cumsum(held) * unit / float(rate)
    assert np.abs(ends - exact).max() <= 0.5 + 1e-6 and min(times) >= 1


def test_a_rate_is_the_fraction_that_was_meant():
    assert rate_of(12) == 12 and rate_of(12.5) == Fraction(25, 2)
    assert rate_of(23.976) == Fraction(24000, 1001) and rate_of(29.97) == Fraction(30000, 1001)
    for wrong in (0, 0.09, -1, 241, float("nan"), float("inf")):
        with pytest.raises(ValueError, match="frames a second"):
            rate_of(wrong)


# ---------------------------------------------------------------------------------- read by others


@pytest.mark.parametrize("suffix", RGB)
@pytest.mark.parametrize("held", [None, [2, 2, 2, 1, 2, 2, 1]])
def test_a_film_read_back_has_its_pictures_its_times_and_no_end(pictures, tmp_path, suffix, held):
    arrays = [on_white(a) for a in strokes()]
    path = tmp_path / f"film{suffix}"
    write_film(path, pictures(arrays, held), rate_of(12))
    found, times, loop = read(path)
    assert len(found) == len(arrays) and loop == 0
    assert sum(times) == pytest.approx(1000 * sum(held or [1] * 7) / 12, abs=5.1)
    if suffix in LOSSLESS:
        assert all(np.array_equal(a, b) for a, b in zip(found, arrays, strict=True))
    if suffix == ".gif":
        assert set(times) <= {80, 90, 160, 170}
    if suffix in (".apng", ".png"):
        assert times[0] == pytest.approx((held or [1])[0] * 1000 / 12, rel=1e-6)
    assert [p.name for p in tmp_path.iterdir()] == [path.name]  # and nothing beside it


def test_a_gif_of_few_colours_loses_nothing(pictures, tmp_path):
    arrays = [on_white(a) for a in strokes(colours=3)]
    arrays = [np.where((a[..., 2:3] < 200), a, 255).astype(np.uint8) for a in arrays]
    assert len(np.unique(np.concatenate([a.reshape(-1, 4) for a in arrays]), axis=0)) < 60
    write_film(tmp_path / "f.gif", pictures(arrays), rate_of(12))
    found, _, _ = read(tmp_path / "f.gif")
    assert all(np.array_equal(a, b) for a, b in zip(found, arrays, strict=True))


def test_a_gif_of_many_colours_has_one_palette_and_no_dither(pictures, tmp_path):
    still = on_white(strokes(1, (120, 90), 60)[0])
    moving = [still.copy() for _ in range(5)]
    for i, picture in enumerate(moving):
        picture[2:6, 10 * i : 10 * i + 6] = (10, 200 - 3 * i, 30, 255)
    write_film(tmp_path / "f.gif", pictures(moving), rate_of(10))
    found, _, _ = read(tmp_path / "f.gif")
    stays = (np.ptp(np.stack(moving), axis=0) == 0).all(axis=2)
    assert (np.ptp(np.stack(found)[:, stays], axis=0) == 0).all()  # what keeps still does not boil
    assert np.abs(found[0].astype(int) - moving[0]).max() < 16
    white = (still[..., :3] == 255).all(axis=2) & stays
    assert (found[0][white] == 255).all()
    data = (tmp_path / "f.gif").read_bytes()
    assert data[10] & 0x80 and data.count(b"\x21\xf9\x04") == 5


def test_colours_that_stand_for_many_are_near_to_them():
    rng = np.random.default_rng(0)
    ink, paper = np.array([30, 40, 90]), np.array([255, 250, 240])
    t = rng.random((4000, 1))
    colours = np.unique(np.rint(ink + t * (paper - ink)), axis=0)
    count = np.ones(len(colours), int)
    count[-1] = 10**6
    chosen = reduced(colours, count, 32)
    assert len(chosen) <= 32 and (chosen == colours[-1]).all(axis=1).any()
    gap = np.abs(colours[:, None] - chosen[None]).max(axis=2).min(axis=1)
    assert gap.max() <= 8


@pytest.mark.parametrize("fps", [0.1, 50])
def test_the_slowest_and_the_fastest_film(pictures, tmp_path, fps):
    arrays = [on_white(a) for a in strokes(3)]
    for suffix in RGB:
        write_film(tmp_path / f"f{suffix}", pictures(arrays, [2, 2, 2]), rate_of(fps))
        assert read(tmp_path / f"f{suffix}")[1] == pytest.approx([2000 / fps] * 3)


@pytest.mark.parametrize(
    "fps, times", [(60, [3, 4, 3, 2]), (90, [2, 2, 2, 2]), (100, [2, 2, 2, 2]), (24, [8, 9, 8, 4])]
)
def test_a_gif_lasts_as_long_as_its_frames(pictures, tmp_path, fps, times):
    film = pictures([on_white(a) for a in strokes(4)], [2, 2, 2, 1])
    if fps == 100:  # no time is left to lend the last picture
        with pytest.warns(UserWarning, match=r"all last 0.08 s, not 0.07"):
            write_film(tmp_path / "f.gif", film, rate_of(fps))
    else:
        write_film(tmp_path / "f.gif", film, rate_of(fps))
        assert sum(times) == round(700 / fps)
    assert read(tmp_path / "f.gif")[1] == [10 * time for time in times]


def test_pictures_that_are_alike_take_their_time(pictures, tmp_path):
    one, other = (on_white(a) for a in strokes(2))
    for suffix in RGB:
        write_film(tmp_path / f"f{suffix}", pictures([one, one, one, other]), rate_of(8))
        found, times, _ = read(tmp_path / f"f{suffix}")
        assert sum(times) == pytest.approx(500, abs=1)
        assert len(found) == 4 and all(np.array_equal(a, one) for a in found[:3])
        write_film(tmp_path / f"f{suffix}", pictures([one] * 5), rate_of(10))
        found, times, loop = read(tmp_path / f"f{suffix}")
        assert times == [100] * 5 and loop == 0 and np.array_equal(found[4], one)


@pytest.mark.parametrize("suffix", RGB)
def test_transparent_films_stay_so(pictures, tmp_path, suffix):
    arrays = strokes(4)
    write_film(tmp_path / f"f{suffix}", pictures(arrays), rate_of(12), transparent=True)
    found, _, _ = read(tmp_path / f"f{suffix}")
    for a, b in zip(found, arrays, strict=True):
        if suffix == ".gif":
            assert np.array_equal(a[..., 3] > 0, b[..., 3] >= 128)
        else:
            assert np.array_equal(a[..., 3], b[..., 3])
            assert np.array_equal(a[b[..., 3] > 0], b[b[..., 3] > 0])


def test_one_picture_is_a_film(pictures, tmp_path):
    arrays = [on_white(strokes(1)[0])]
    for suffix in RGB:
        write_film(tmp_path / f"f{suffix}", pictures(arrays), rate_of(12))
        with Image.open(tmp_path / f"f{suffix}") as film:
            assert np.array_equal(np.asarray(film.convert("RGBA")), arrays[0])


def test_the_box_that_changes():
    a = np.zeros((9, 11, 3), np.uint8)
    b = a.copy()
    assert changed_box(a, b) == (0, 0, 1, 1)
    b[2:5, 3:10, 1] = 1
    assert changed_box(a, b) == (3, 2, 10, 5) and changed_box(a[..., 1], b[..., 1]) == (3, 2, 10, 5)


# ------------------------------------------------------------------------------- what cannot be


def test_what_cannot_be_written_is_said_before(tmp_path):
    with pytest.raises(ValueError, match=r"f.gif: a GIF shows at most 50 frames a second, not 60"):
        check_film(tmp_path / "f.gif", rate_of(60))
    with pytest.raises(ValueError, match=r"f.bmp: a film is .html, .gif"):
        check_film(tmp_path / "f.bmp", rate_of(12))
    check_film(tmp_path / "f.webp", rate_of(60))


@pytest.mark.parametrize("suffix", RGB)
def test_a_film_that_fails_leaves_nothing(pictures, tmp_path, suffix, monkeypatch):
    path = tmp_path / f"f{suffix}"
    path.write_bytes(b"before")
    film = pictures([on_white(a) for a in strokes()])
    arrays = Pictures.arrays

    def cut_short(self, mode="RGB"):
        yield from list(arrays(self, mode))[:4]
        raise OSError("the disk is full")

    monkeypatch.setattr(Pictures, "arrays", cut_short)
    with pytest.raises(OSError, match="the disk is full"):
        write_film(path, film, rate_of(12))
    assert path.read_bytes() == b"before" and len(list(tmp_path.iterdir())) == 1


def test_no_pictures_are_no_film(pictures, tmp_path):
    for suffix in RGB:
        with pytest.raises(ValueError, match="at least one picture"):
            write_film(tmp_path / f"f{suffix}", pictures([]), rate_of(12))
    assert not list(tmp_path.iterdir())


def test_pictures_are_of_one_size(pictures):
    with pytest.raises(ValueError, match="the first is of"):
        pictures([strokes(1)[0], strokes(1, (30, 30))[0]])


def test_a_palette_keeps_a_place_for_what_does_not_change(pictures):
    palette = Palette.of(pictures([on_white(a) for a in strokes(colours=80)]), False)
    assert 2 < len(palette.colours) <= 255


# ------------------------------------------------------------------------------------------ ffmpeg


@pytest.mark.parametrize("suffix", [".mp4", ".webm"])
def test_video_without_ffmpeg_is_one_line(tmp_path, monkeypatch, suffix):
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(ValueError, match=r"needs ffmpeg, which is not installed.*write .gif"):
        check_film(tmp_path / f"f{suffix}", rate_of(12))


def fake_ffmpeg(folder, run):
    """A program that says it has all encoders, and runs a shell script for the rest."""
    path = folder / "ffmpeg"
    path.write_text(
        f'#!/bin/sh\nif [ "$2" = -encoders ]; then echo " V libx264 x"; exit; fi\n{run}\n'
    )
    path.chmod(0o755)


def test_video_gets_every_frame_that_is_held(pictures, tmp_path, monkeypatch):
    fake_ffmpeg(tmp_path, 'for last; do :; done\n/bin/cat > "$last"; echo "$@" > "$0.asked"')
    monkeypatch.setenv("PATH", str(tmp_path))
    film = pictures([on_white(a) for a in strokes(3)], [2, 1, 2])
    write_film(tmp_path / "f.mp4", film, rate_of(23.976))
    assert (tmp_path / "f.mp4").read_bytes().count(b"IHDR") == 5
    asked = (tmp_path / "ffmpeg.asked").read_text()
    for word in ("-framerate 24000/1001", "-pix_fmt yuv420p", "+faststart", "pad=62:42"):
        assert word in asked


def test_what_ffmpeg_says_is_told_and_no_film_is_left(pictures, tmp_path, monkeypatch):
    fake_ffmpeg(tmp_path, "echo half > x; echo first >&2; echo no such codec >&2; exit 1")
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.chdir(tmp_path)
    with pytest.raises(ValueError, match="f.mp4: ffmpeg failed: no such codec"):
        write_film(tmp_path / "f.mp4", pictures([on_white(strokes(1)[0])]), rate_of(12))
    with pytest.raises(ValueError, match="an ffmpeg with libvpx-vp9"):
        check_film(tmp_path / "f.webm", rate_of(12))
    assert not (tmp_path / "f.mp4").exists() and not list(tmp_path.glob(".f.mp4*"))


@with_ffmpeg
@pytest.mark.parametrize("suffix", [".mp4", ".webm"])
def test_a_video_is_what_players_want(pictures, tmp_path, suffix):
    path = tmp_path / f"f{suffix}"
    arrays = [on_white(a) for a in strokes(6)]
    write_film(path, pictures(arrays, [2] * 6), rate_of(12))
    done = subprocess.run([PROGRAM, "-i", path, "-f", "null", "-"], capture_output=True, text=True)
    assert "yuv420p(tv, bt709" in done.stderr and "62x42" in done.stderr  # 61 x 41, made even
    assert "12 fps" in done.stderr and "frame=   12" in done.stderr
    raw = subprocess.run(
        [PROGRAM, "-v", "error", "-i", path, "-vf", "scale=in_color_matrix=bt709",
         "-f", "rawvideo", "-pix_fmt", "rgb24", "-"],
        capture_output=True, check=True,
    ).stdout  # fmt: skip
    shown = np.frombuffer(raw, np.uint8).reshape(12, 42, 62, 3)
    assert np.abs(shown[::2, :41, :61].astype(int) - np.stack(arrays)[..., :3]).mean() < 6
    if suffix == ".mp4":
        data = path.read_bytes()
        assert data.index(b"moov") < data.index(b"mdat")
