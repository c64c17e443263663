"""Report on a folder of drawings: one HTML page, with a picture of each and what became of it."""

from __future__ import annotations

import base64
import contextlib
import hashlib
import html
import io
import os
import re
import statistics
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path
from urllib.parse import quote

from PIL import Image

from .. import __version__
from ..files import MAX_BYTES, limited
from ..svg.write import png_from_svg
from .journal import NAME, read_journal
from .outcome import Outcome
from .plan import SVG_SUFFIXES

FOLDER = Path(__file__).parent
# px of a thumbnail: of up to so many drawings
THUMBNAILS = ((60, 480), (300, 320), (None, 240))
PICTURES = (".png", ".gif", ".webp", ".apng")
QUALITY = 75
_FRAME = re.compile(r"(.*[^/\\])-([0-9]{3,})", re.DOTALL)
# what a card may be shown and sorted by, beside its name
FILTERS = {"all": "all", "drawn": "drawn", "failed": "failed", "warned": "with warnings"}
SORTS = {
    "order": "order drawn",
    "name": "name",
    "seconds": "time",
    "cpu": "processor time",
    "memory": "memory",
    "lines": "lines",
    "strokes": "strokes",
    "attempts": "attempts",
    "bytes": "size of file",
}


@dataclass(frozen=True)
class Entry:
    """One drawing, or one animation, of a report.

    Parameters
    ----------
    name : what the person knows it by
    files : all that is there of it; frames of an animation in their order
    outcome : what the journal says of it; None where it says nothing
    """

    name: str
    files: tuple[str, ...]
    outcome: Outcome | None = None

    @property
    def failed(self) -> bool:
        """Whether it was not drawn, or is not there any more."""
        return (self.outcome is not None and not self.outcome.drawn) or not self.files

    @property
    def drawings(self) -> list[str]:
        """Its drawing, or the frames that it has, as SVG: not the steps of how that came about."""
        found = [name for name in self.files if Path(name).suffix.lower() in SVG_SUFFIXES]
        if self.outcome is None:
            return found
        output = os.path.splitext(self.outcome.output)[0]
        return [
            name for name in found if output in (_without_number(name), os.path.splitext(name)[0])
        ]


def find_entries(folder: str | Path) -> list[Entry]:
    """Find what there is in a folder of drawings and in the folders in it.

    What the journals say of it comes first, in their order; then, by name, SVG files that they say
    nothing of. Files that are numbered as frames are, NAME-000.svg, NAME-001.svg, are one entry.

    Raises
    ------
    FileNotFoundError, NotADirectoryError
        where there is no such folder.
    ValueError
        where there is no drawing and no journal in it, or a journal is none.
    """
    folder = Path(folder)
    if not folder.exists():
        raise FileNotFoundError(f"{folder}: no such folder")
    if not folder.is_dir():
        raise NotADirectoryError(f"{folder}: no folder; give one that drawings were written to")
    journals = sorted(path.parent for path in folder.rglob(NAME) if path.is_file())
    told = [entry for place in journals for entry in map(_told, read_journal(place))]
    known = {os.path.abspath(name) for entry in told for name in entry.files}
    found = (str(path) for path in sorted(folder.rglob("*")) if _is_drawing(path))
    others = [name for name in found if os.path.abspath(name) not in known]
    entries = told + [_untold(names, folder) for names in _animations(others)]
    if not entries:
        raise ValueError(f"{folder}: no drawing (.svg, .svgz) and no {NAME} in this folder")
    return entries


def _without_number(name: str) -> str:
    """The name of the animation that a file may be a frame of; else its own, without suffix."""
    stem = os.path.splitext(name)[0]
    frame = _FRAME.fullmatch(stem)
    return frame[1] if frame else stem


def _told(outcome: Outcome) -> Entry:
    there = tuple(name for name in outcome.files if os.path.isfile(name))
    return Entry(outcome.shape, there, outcome)


def _untold(names: list[str], folder: Path) -> Entry:
    name = os.path.relpath(names[0], folder)
    if len(names) > 1:
        name = _without_number(name) + os.path.splitext(name)[1]
    return Entry(name, tuple(names))


def _is_drawing(path: Path) -> bool:
    return path.suffix.lower() in SVG_SUFFIXES and path.is_file()


def _animations(names: Sequence[str]) -> Iterator[list[str]]:
    """Put the frames of each animation together: numbers without a gap, from 0 on."""

    for _, group in groupby(names, lambda name: (_without_number(name), Path(name).suffix)):
        frames = list(group)
        found = [_FRAME.fullmatch(os.path.splitext(name)[0]) for name in frames]
        numbers = [int(frame[2]) if frame else None for frame in found]
        if len(frames) > 1 and numbers == list(range(len(frames))):
            yield frames
        else:
            yield from ([name] for name in frames)


# ----------------------------------------------------------------------------------------- pictures


def thumbnail(entry: Entry, size: int) -> bytes | None:
    """Draw a small picture of an entry, WebP, at most `size` px wide and high.

    From its preview, where there is one as new as the drawing, or its film, else from its drawing.
    None where it has none that can be shown.
    """
    for name in _sources(entry):
        try:
            if Path(name).suffix.lower() in SVG_SUFFIXES:
                data = png_from_svg(_svg_text(name), within=size)
                image = Image.open(io.BytesIO(data))
            else:
                image = Image.open(name)
                image.draft("RGB", (size, size))
            return _webp(image, size)
        except (ValueError, OSError, Image.DecompressionBombError, MemoryError):
            continue
    return None


def _sources(entry: Entry) -> list[str]:
    drawings = entry.drawings
    pictures = [name for name in entry.files if Path(name).suffix.lower() in PICTURES]
    if drawings:
        preview = str(Path(drawings[0]).with_suffix(".png"))
        new = preview in pictures and os.path.getmtime(preview) >= os.path.getmtime(drawings[0])
        return [preview, drawings[0]] if new else [drawings[0], *pictures[:1]]
    # of steps, the one with all of them
    return sorted(pictures, key=lambda name: "-sheet." not in name)[:1] or list(entry.files[:1])


def _svg_text(name: str) -> str:
    with open(name, "rb") as file:
        return limited(file.read(MAX_BYTES + 1)).decode("utf-8")


def _webp(image: Image.Image, size: int) -> bytes:
    small = image.convert("RGBA")
    small.thumbnail((size, size), Image.Resampling.LANCZOS)
    ground = Image.new("RGBA", small.size, "white")
    ground.alpha_composite(small)
    file = io.BytesIO()
    ground.convert("RGB").save(file, "WEBP", quality=QUALITY, method=4)
    return file.getvalue()


# ----------------------------------------------------------------------------------------- the page


def report_html(
    entries: Sequence[Entry],
    title: str,
    base: str = "",
    drawn: Callable[[Iterable[Entry]], Iterable[Entry]] = iter,
) -> str:
    """Make the page: figures, failures, and a card for each entry.

    It is one file that asks the network for nothing, and is read without scripts as well. Links go
    from the folder `base`, in which it is to lie.

    `drawn` : is given what pictures are made of, and hands it on: to show how far that is
    """
    size = next(px for most, px in THUMBNAILS if most is None or len(entries) <= most)
    short = _short_names(entries)
    cards = [
        _card(entry, name, thumbnail(entry, size), base)
        for entry, name in zip(drawn(entries), short, strict=True)
    ]
    style = f":root {{ --size: {size // 2}px; }}\n" + _text("report.css")
    script = '"use strict";\n' + _text("report.js")
    policy = (
        "default-src 'none'",
        "img-src data:",
        f"script-src '{_hash(script)}'",
        f"style-src '{_hash(style)}'",
        "base-uri 'none'",
        "form-action 'none'",
    )
    parts = {
        "policy": "; ".join(policy),
        "generator": f"strokestyle {__version__}",
        "title": html.escape(title),
        "style": style,
        "script": script,
        "figures": "".join(_figures(entries)),
        "filters": "".join(_filters(entries)),
        "sorts": "".join(_sorts(entries)),
        "size": str(size // 2),
        "failures": _failures(entries),
        "cards": "\n".join(cards),
    }
    return re.sub(r"@(\w+)@", lambda match: parts[match[1]], _text("report.html"))


def _figures(entries: Sequence[Entry]) -> Iterator[str]:
    """The figures at the top: counts, times, sizes."""
    failed = sum(entry.failed for entry in entries)
    outcomes = [entry.outcome for entry in entries if entry.outcome]
    yield _figure(f"{len(entries) - failed:,}", "drawn")
    if failed:
        yield _figure(f"{failed:,}", "failed", "bad")
    if warned := sum(bool(outcome.warnings) for outcome in outcomes):
        yield _figure(f"{warned:,}", "with warnings")
    if outcomes:
        times = [outcome.seconds for outcome in outcomes if outcome.drawn] or [0.0]
        yield _figure(duration(sum(outcome.seconds for outcome in outcomes)), "time, all together")
        yield _figure(duration(statistics.median(times)), "median")
        yield _figure(duration(max(times)), "slowest")
        yield _figure(f"{sum(outcome.strokes for outcome in outcomes):,}", "strokes")
        memory = [outcome.memory_mb for outcome in outcomes if outcome.memory_mb]
        if memory:
            yield _figure(f"{max(memory):,.0f} MB", "most memory")
        workers = {outcome.worker for outcome in outcomes if outcome.worker}
        if len(workers) > 1:
            yield _figure(f"{len(workers):,}", "workers")
    yield _figure(megabytes(sum(map(_bytes, entries))), "of files")


def _figure(value: str, what: str, kind: str = "") -> str:
    return f'<div class="{kind}"><dt>{what}</dt><dd>{value}</dd></div>'


def _filters(entries: Sequence[Entry]) -> Iterator[str]:
    """The buttons that show some of the cards: none where they would show all, or nothing."""
    kinds = [set(_kinds(entry)) | {"all"} for entry in entries]
    counts = {name: sum(name in kind for kind in kinds) for name in FILTERS}
    for name, told in FILTERS.items():
        if name == "all" or 0 < counts[name] < len(entries):
            pressed = "true" if name == "all" else "false"
            words = f'type="button" data-show="{name}" aria-pressed="{pressed}"'
            yield f"<button {words}>{told} {counts[name]:,}</button>"


def _sorts(entries: Sequence[Entry]) -> Iterator[str]:
    """What can be sorted by: what differs."""
    values = [_numbers(entry) for entry in entries]
    for name, told in SORTS.items():
        if name in ("order", "name") or len({value.get(name) for value in values}) > 1:
            yield f'<option value="{name}">{told}</option>'


def _failures(entries: Sequence[Entry]) -> str:
    lines = [_error(entry) for entry in entries if entry.failed]
    if not lines:
        return ""
    items = "".join(f"<li>{html.escape(_clean(line))}</li>" for line in lines)
    return f'<section id="failures"><h2>{len(lines):,} failed</h2><ol>{items}</ol></section>'


def _error(entry: Entry) -> str:
    if entry.outcome and entry.outcome.error:
        return entry.outcome.error
    return f"{entry.name}: its files are not there any more"


def _short_names(entries: Sequence[Entry]) -> list[str]:
    """Names without the folders that all have in common."""
    names = [entry.name for entry in entries]
    folders = [os.path.dirname(name) for name in names]
    with contextlib.suppress(ValueError):  # some absolute, some not
        common = os.path.commonpath(folders)
        return [os.path.relpath(name, common) if common else name for name in names]
    return names


def _card(entry: Entry, name: str, picture: bytes | None, base: str) -> str:
    kinds = _kinds(entry)
    data = {"name": entry.name, "is": " ".join(kinds), **_numbers(entry)}
    words = "".join(f' data-{key}="{html.escape(_clean(str(one)))}"' for key, one in data.items())
    told = "".join(f"<p{kind}>{line}</p>" for kind, line in _lines(entry, base))
    bad = ' class="bad"' if entry.failed else ""
    name, whole = html.escape(_clean(name)), html.escape(_clean(entry.name))
    return (
        f"<article{bad}{words}>{_picture(entry, picture, base)}"
        f'<div class="told"><h3 title="{whole}">{name}</h3>{told}</div></article>'
    )


def _picture(entry: Entry, picture: bytes | None, base: str) -> str:
    if picture is None:
        why = "not drawn" if entry.failed else "no picture of it"
        return f'<div class="picture empty">{why}</div>'
    data = base64.b64encode(picture).decode("ascii")
    frames = len(entry.drawings)
    note = f'<span class="frames">{frames} frames</span>' if frames > 1 else ""
    shown = (entry.drawings or list(entry.files))[0]
    alt = html.escape(_clean(entry.name))
    image = f'<img src="data:image/webp;base64,{data}" alt="{alt}" decoding="async">'
    return f'<a class="picture" href="{_link(shown, base)}">{image}{note}</a>'


def _lines(entry: Entry, base: str) -> Iterator[tuple[str, str]]:
    """What stands under a picture: (attributes, markup) of each line."""
    outcome = entry.outcome
    if entry.failed:
        yield ' class="error"', html.escape(_clean(_error(entry)))
    if outcome:
        facts = [duration(outcome.seconds)]
        if outcome.drawn:
            facts += [_counted(outcome.lines, "line"), _counted(outcome.strokes, "stroke")]
        if outcome.memory_mb:
            facts.append(f"{outcome.memory_mb:,.0f} MB")
        if outcome.attempts > 1:
            facts.append(f"{outcome.attempts} attempts")
        yield "", " · ".join(facts)
        for warning in outcome.warnings:
            yield "", "⚠ " + html.escape(_clean(warning))
    if entry.files:
        yield ' class="links"', " ".join(_links(entry, base))


def _links(entry: Entry, base: str) -> Iterator[str]:
    """Links to the files: the first and the last of many alike."""
    by_kind: dict[str, list[str]] = {}
    for name in entry.files:
        by_kind.setdefault(Path(name).suffix.lower().removeprefix("."), []).append(name)
    for kind, names in by_kind.items():
        few = names if len(names) < 3 else [names[0], names[-1]]
        texts = [Path(name).name if len(names) > 1 else kind for name in few]
        links = [
            f'<a href="{_link(name, base)}">{html.escape(_clean(text))}</a>'
            for name, text in zip(few, texts, strict=True)
        ]
        yield (" ... " if len(names) > 2 else " ").join(links)


def _kinds(entry: Entry) -> list[str]:
    warned = bool(entry.outcome and entry.outcome.warnings)
    return ["failed" if entry.failed else "drawn", *(["warned"] if warned else [])]


def _numbers(entry: Entry) -> dict[str, float]:
    """What cards are sorted by: nothing where it is not known."""
    found: dict[str, float] = {}
    outcome = entry.outcome
    if outcome:
        found |= {"seconds": outcome.seconds, "cpu": outcome.cpu_seconds}
        found |= {"lines": outcome.lines, "strokes": outcome.strokes, "attempts": outcome.attempts}
        if outcome.memory_mb:
            found["memory"] = outcome.memory_mb
    if entry.files:
        found["bytes"] = _bytes(entry)
    return {name: round(value, 3) for name, value in found.items()}


def _bytes(entry: Entry) -> int:
    return sum(os.path.getsize(name) for name in entry.files)


def duration(seconds: float) -> str:
    """Write a time: "0.42 s", "12 s", "3 min 20 s", "2 h 5 min"."""
    if seconds < 9.95:
        return f"{seconds:.2f} s" if seconds < 0.995 else f"{seconds:.1f} s"
    minutes, rest = divmod(round(seconds), 60)
    if minutes < 60:
        return f"{minutes} min {rest} s" if minutes else f"{rest} s"
    return f"{minutes // 60} h {minutes % 60} min"


def megabytes(count: int) -> str:
    """Write a size of files: "12 kB", "3.4 MB"."""
    return f"{count / 1e6:,.1f} MB" if count >= 1e6 else f"{count / 1e3:,.0f} kB"


def _counted(count: int, what: str) -> str:
    return f"{count:,} {what}{'' if count == 1 else 's'}"


def _link(name: str, base: str) -> str:
    """A link to a file from the folder `base`, whatever its name looks like."""
    try:
        path = os.path.relpath(name, base or os.curdir)
    except ValueError:  # on another drive
        return html.escape(Path(name).resolve().as_uri())
    path = path.replace(os.sep, "/")
    link = quote(os.fsencode(path))
    return html.escape(link if link.startswith("../") else f"./{link}")


def _clean(text: str) -> str:
    """Text that can be written as UTF-8, in which file names need not be."""
    return text.encode("utf-8", "replace").decode("utf-8")


def _text(name: str) -> str:
    return (FOLDER / name).read_text(encoding="utf-8")


def _hash(text: str) -> str:
    digest = hashlib.sha256(text.encode("utf-8")).digest()
    return "sha256-" + base64.b64encode(digest).decode("ascii")
