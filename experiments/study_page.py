"""The page that asks a worker: one HTML file with its drawings inside, which needs no network."""

from __future__ import annotations

import base64
import hashlib
import io
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from dataset import DataSet, read_image
from PIL import Image
from study_plan import Comparison, Questionnaire, Shown, Study

from strokestyle.viewer.page import filled, json_text, page_text, policy

FOLDER = Path(__file__).parent / "study"
ARTIST = "artist"  # the method whose drawings are the data set's own


@dataclass(frozen=True)
class Pictures:
    """All that a study shows, as PNG files without a word in them.

    examples : {style: A, the drawing that the style was learned from}
    curves : {shape: B, the plain curves}
    drawings : {(method, style, shape): X or Y}
    """

    examples: dict[str, bytes]
    curves: dict[str, bytes]
    drawings: dict[tuple[str, str, str], bytes]

    def digest(self) -> str:
        """The name of a study of these pictures: 12 hexadecimal digits."""
        hashed = hashlib.sha256()
        for kind in (self.examples, self.curves, self.drawings):
            for name in sorted(kind):
                hashed.update(repr(name).encode() + hashlib.sha256(kind[name]).digest())
        return hashed.hexdigest()[:12]


def gather(out: Path, data: DataSet, methods: list[str], styles: list[str]) -> Pictures:
    """Collect the pictures of a study, all at the size of OUT's.

    out : OUT/<method>/<style>/<shape>.png, as compare_methods.py writes them
    styles : all of the data set's, where empty

    Raises ValueError, naming the file, where a drawing is missing or of another size than the
    others.
    """
    if unknown := sorted(set(styles) - set(data.styles())):
        raise ValueError(f"{data.root}: there is no style {unknown[0]} with its training drawing")
    tests = {style: data.tests(style) for style in styles or data.styles()}
    wanted = [(m, s, shape) for m in methods for s, shapes in tests.items() for shape in shapes]
    if not wanted:
        raise ValueError(f"{data.root}: no style has a training drawing and another to test it on")
    paths = {each: drawing_path(out, data, *each) for each in wanted}
    if absent := [path for path in paths.values() if not path.exists()]:
        raise ValueError(f"{absent[0]}: there is no such drawing ({len(absent)} are missing)")
    drawn = [path for each, path in paths.items() if each[0] != ARTIST]
    sized = DataSet(data.root, data.train, max(image_size((drawn or list(paths.values()))[0])))
    for path, (*_, shape) in zip(
        drawn, (each for each in wanted if each[0] != ARTIST), strict=True
    ):
        check_size(path, sized.sheet(shape).size)
    return Pictures(
        {style: png(sized.lesson(style).drawing) for style in tests},
        {shape: png(sized.sheet(shape).plain) for shape in sorted({s for *_, s in wanted})},
        {each: png(read_image(path, sized.sheet(each[2]).size)) for each, path in paths.items()},
    )


def drawing_path(out: Path, data: DataSet, method: str, style: str, shape: str) -> Path:
    """Where a method's drawing is; the artist's are the data set's."""
    if method == ARTIST:
        return data.drawing_path(style, shape)
    return out / method / style / f"{shape}.png"


def image_size(path: Path) -> tuple[int, int]:
    """Width and height of an image, px. Raises ValueError, naming the file, where it is none."""
    try:
        with Image.open(path) as image:
            image.load()
            return image.size
    except (OSError, SyntaxError, ValueError):
        raise ValueError(f"{path}: cannot be read as an image") from None


def check_size(path: Path, size: tuple[int, int]) -> None:
    """Raise ValueError, naming the file, unless it is an image of that size."""
    if (found := image_size(path)) != size:
        raise ValueError(
            f"{path}: is {found[0]} x {found[1]} px, and its sheet is {size[0]} x {size[1]}; "
            "drawings that are compared have one size"
        )


def png(image: np.ndarray) -> bytes:
    """Write an image in [0, 1], grey or RGB, as PNG, nothing but its pixels."""
    file = io.BytesIO()
    Image.fromarray(np.rint(255 * np.clip(image, 0, 1)).astype(np.uint8)).save(file, "PNG")
    return file.getvalue()


def comparisons(pictures: Pictures, ours: str, others: list[str]) -> list[Comparison]:
    """All that can be asked of these pictures."""
    tests = [(style, shape) for method, style, shape in pictures.drawings if method == ours]
    return [Comparison(style, shape, other) for style, shape in tests for other in others]


def questionnaire_page(
    study: Study, sheet: Questionnaire, pictures: Pictures, send_to: str | None = None
) -> str:
    """Make the page of a questionnaire.

    Its data hold pictures by numbers that a hash of them decides, and questions by tokens: no names
    of methods, styles or shapes.

    send_to : whom the worker is asked to send the answers to; None: whoever sent the page
    """
    asked = [pictures_of(study, shown, pictures) for shown in sheet.shown]
    held = sorted(
        {each for four in asked for each in four}, key=lambda data: hashlib.sha256(data).digest()
    )
    number = {data: i for i, data in enumerate(held)}
    data = {
        "study": study.name,
        "questionnaire": sheet.name,
        "secret": sheet.secret,
        "sendTo": send_to,
        "pictures": ["data:image/png;base64," + base64.b64encode(p).decode("ascii") for p in held],
        "questions": [
            {"id": shown.token, "sheets": [number[each] for each in four]}
            for shown, four in zip(sheet.shown, asked, strict=True)
        ],
    }
    script = '"use strict";\n' + page_text("page.js", FOLDER)
    style = page_text("page.css", FOLDER)
    parts = {
        "policy": policy([script], style, "img-src data:"),
        "style": style,
        "script": script,
        "data": json_text(data),
    }
    return filled(page_text("page.html", FOLDER), parts)


def pictures_of(study: Study, shown: Shown, pictures: Pictures) -> list[bytes]:
    """A, B, X and Y of a question."""
    asked = study.comparisons[shown.comparison]
    pair = [pictures.drawings[m, asked.style, asked.shape] for m in (study.ours, asked.other)]
    return [
        pictures.examples[asked.style],
        pictures.curves[asked.shape],
        *pair[:: 1 - 2 * shown.flipped],
    ]
