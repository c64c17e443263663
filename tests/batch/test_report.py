"""The page that tells what became of a batch: what is found, what it says, and what it does."""

import base64
import io
import os
import re
from html.parser import HTMLParser
from urllib.parse import unquote, urlsplit

import pytest
from browsers import in_browser
from command import refused, run
from PIL import Image

from strokestyle.batch.journal import NAME
from strokestyle.batch.outcome import Outcome
from strokestyle.batch.report import THUMBNAILS, Entry, duration, find_entries, megabytes, thumbnail

SQUARE = (
    '<svg xmlns="http://www.w3.org/2000/svg" width="{0}" height="{1}">'
    '<rect width="{0}" height="{1}" fill="{2}"/></svg>'
)
NAMES = (
    "<b>.obj",
    "\"'&amp; <img src=x onerror='window.harm=1'>.obj",
    "日本 🖌.obj",
    "a?b#c%20.ply",
)


def write_svg(path, color="red", size=(90, 60)):
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(SQUARE.format(*size, color), encoding="utf-8")
    return str(path)


def write_journal(folder, *outcomes):
    folder.mkdir(parents=True, exist_ok=True)
    text = "".join(outcome.to_json(str(folder)) + "\n" for outcome in outcomes)
    (folder / NAME).write_text(text)


@pytest.fixture
def batch(tmp_path):
    """Drawings of shapes whose names are of all sorts, one that failed, one that is gone."""
    out = tmp_path / "out <1>"
    outcomes = []
    for k, name in enumerate(NAMES):
        drawing = write_svg(out / f"{name[:-4]}.svg", f"#{20 * k:02d}0000")
        memory, told = (100.0 + k, ("of no width",)) if k else (None, ())
        outcomes.append(
            Outcome(
                f"in/{name}", drawing, (drawing,), seconds=4 - k, lines=k, strokes=10 * k,
                memory_mb=memory, warnings=told, attempts=1 + k // 3,
            )
        )  # fmt: skip
    bad = Outcome("in/bad.obj", str(out / "bad.svg"), error="in/bad.obj: <i>", failure="error")
    gone = Outcome("in/gone.obj", str(out / "gone.svg"), (str(out / "gone.svg"),), seconds=1)
    write_journal(out, *outcomes, bad, gone)
    return out


class Page(HTMLParser):
    """The cards, links and texts of a page."""

    def __init__(self, text):
        super().__init__()
        self.cards, self.links, self.images, self.tags, self.inside = [], [], [], [], ""
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        self.tags.append(tag)
        attrs = dict(attrs)
        if tag == "article":
            self.cards.append(attrs)
        if tag == "a":
            self.links.append(attrs["href"])
        if tag == "img":
            self.images.append(attrs["src"])


def made(folder, output, *words):
    done = run("report", folder, "-o", output, *words)
    assert done.exit_code == 0, done.stderr
    return output.read_text(encoding="utf-8")


# ------------------------------------------------------------------------------------ what is found


def test_the_journal_comes_first_then_what_it_says_nothing_of(batch):
    write_svg(batch / "older.svg")
    entries = find_entries(batch)
    told = [f"in/{name}" for name in (*NAMES, "bad.obj", "gone.obj")]
    assert [entry.name for entry in entries] == [*told, "older.svg"]
    assert [entry.failed for entry in entries] == 4 * [False] + [True, True, False]
    assert entries[-1].outcome is None


def test_frames_are_one_entry_where_none_is_missing(tmp_path):
    for name in ("a-000", "a-001", "a-002", "b-001", "b-002", "c-000", "sub/a-000", "sub/a-001"):
        write_svg(tmp_path / f"{name}.svg")
    entries = find_entries(tmp_path)
    names = ["a.svg", "b-001.svg", "b-002.svg", "c-000.svg", os.path.join("sub", "a.svg")]
    assert [entry.name for entry in entries] == names
    assert [len(entry.drawings) for entry in entries] == [3, 1, 1, 1, 2]


def test_what_is_drawn_is_told_from_the_steps_of_it(tmp_path):
    names = ("x.svg", "x-1-curves.svg", "x-000.svg", "x-001.svg", "x-1-curves.png", "x-sheet.png")
    files = tuple(str(tmp_path / name) for name in names)
    entry = Entry("x", files, Outcome("x.obj", files[0], files))
    assert [os.path.basename(name) for name in entry.drawings] == [
        "x.svg",
        "x-000.svg",
        "x-001.svg",
    ]


@pytest.mark.parametrize(
    "prepare, words",
    [
        (lambda folder: None, ["no such folder"]),
        (lambda folder: folder.write_text(""), ["no folder"]),
        (lambda folder: folder.mkdir(), ["no drawing", NAME]),
        (lambda folder: write_journal(folder) or (folder / NAME).write_text("{}\n"), [NAME]),
    ],
)
def test_folders_of_which_there_is_nothing_to_report(prepare, words, tmp_path):
    prepare(tmp_path / "out")
    refused("report", tmp_path / "out", "-o", tmp_path / "x.html", words=["out", *words])
    assert not (tmp_path / "x.html").exists()


def test_no_drawing_is_overwritten(batch):
    drawing = next(batch.glob("*.svg"))
    before = drawing.read_bytes()
    refused("report", batch, "-o", drawing, words=["is the input"])
    journal = (batch / NAME).read_bytes()
    refused("report", batch, "-o", batch / NAME, words=[NAME, "is the input"])
    assert (batch / NAME).read_bytes() == journal
    assert drawing.read_bytes() == before


# --------------------------------------------------------------------------------------- pictures


def test_a_thumbnail_fits_and_is_of_the_drawing(tmp_path):
    wide = write_svg(tmp_path / "wide.svg", "#00ff00", (900, 300))
    image = Image.open(io.BytesIO(thumbnail(Entry("wide", (wide,)), 60)))
    assert image.size == (60, 20) and image.format == "WEBP"
    assert image.getpixel((30, 10))[1] > 240


def test_a_preview_is_used_while_it_is_as_new_as_the_drawing(tmp_path):
    drawing = write_svg(tmp_path / "x.svg", "#00ff00")
    Image.new("RGBA", (90, 60), (0, 0, 255, 255)).save(tmp_path / "x.png")
    entry = Entry("x", (drawing, str(tmp_path / "x.png")))
    for age, channel in ((0, 2), (1, 2), (-1, 1)):
        time = os.path.getmtime(drawing) + age
        os.utime(tmp_path / "x.png", (time, time))
        assert Image.open(io.BytesIO(thumbnail(entry, 30))).getpixel((15, 10))[channel] > 240


def test_what_cannot_be_shown_has_no_picture(tmp_path):
    (tmp_path / "cut.svg").write_text("<svg")
    (tmp_path / "other.svgz").write_bytes(b"\x1f\x8b damaged")
    page = made(tmp_path, tmp_path / "x.html")
    assert page.count("no picture of it") == 2 and not Page(page).images


# ----------------------------------------------------------------------------------------- the page


def test_a_page_names_and_links_files_of_any_name(batch, tmp_path):
    output = tmp_path / "pages" / "report.html"
    output.parent.mkdir()
    page = Page(made(batch, output))
    assert [card["data-name"] for card in page.cards[:4]] == [f"in/{name}" for name in NAMES]
    files = {unquote(urlsplit(link).path) for link in page.links}
    assert not any(urlsplit(link).scheme or "?" in link or "#" in link for link in page.links)
    assert {(output.parent / name).resolve() for name in files} == set(batch.glob("*.svg"))
    assert page.tags.count("img") == 4 and "b" not in page.tags and "i" not in page.tags
    assert run("report", batch, "-o", "-").stdout.count("<article") == 6


def test_a_page_counts_and_times(batch, tmp_path):
    page = made(batch, tmp_path / "report.html", "--title", "Six & <more>")
    assert "<h1>Six &amp; &lt;more&gt;</h1>" in page
    figures = dict(re.findall(r"<dt>([^<]+)</dt><dd>([^<]+)</dd>", page))
    assert figures["drawn"] == "4" and figures["failed"] == "2"
    assert figures["time, all together"] == "11 s" and figures["slowest"] == "4.0 s"
    assert figures["median"] == "2.0 s" and figures["strokes"] == "60"
    assert figures["with warnings"] == "3" and figures["most memory"] == "103 MB"
    assert "<li>in/bad.obj: &lt;i&gt;</li>" in page
    assert "its files are not there any more" in page and "2 attempts" in page


def test_many_have_smaller_thumbnails(tmp_path):
    for count, size in ((1, THUMBNAILS[0][1]), (THUMBNAILS[0][0] + 1, THUMBNAILS[1][1])):
        for k in range(count):
            write_svg(tmp_path / "out" / f"{k}.svg", size=(900, 900))
        page = Page(made(tmp_path / "out", tmp_path / "x.html"))
        data = base64.b64decode(page.images[0].partition(",")[2])
        assert Image.open(io.BytesIO(data)).size == (size, size)


@pytest.mark.parametrize(
    "seconds, text",
    [(0, "0.00 s"), (0.4242, "0.42 s"), (3.21, "3.2 s"), (9.97, "10 s"), (59.6, "1 min 0 s"),
     (200, "3 min 20 s"), (7500, "2 h 5 min")],
)  # fmt: skip
def test_times_as_a_person_says_them(seconds, text):
    assert duration(seconds) == text


def test_sizes_as_a_person_says_them():
    assert (megabytes(0), megabytes(12_300), megabytes(3_440_000)) == ("0 kB", "12 kB", "3.4 MB")


@in_browser
def test_the_page_is_searched_sorted_and_filtered(batch, tmp_path, browser):
    made(batch, tmp_path / "report.html")
    visible = (
        "[...document.querySelectorAll('article')].filter((card) => !card.hidden)"
        ".map((card) => card.dataset.name.slice(3, 6))"
    )
    browser.open(tmp_path / "report.html")
    assert browser.run(visible) == [name[:3] for name in (*NAMES, "bad", "gon")]
    browser.run("find('search').value = '日'; find('search').dispatchEvent(new Event('input'))")
    assert browser.run(visible) == ["日本 "]
    assert browser.run("find('shown').textContent") == "1 of 6"
    browser.run("find('search').value = ''; find('search').dispatchEvent(new Event('input'))")
    browser.run("document.querySelector('[data-show=failed]').click()")
    assert browser.run(visible) == ["bad", "gon"]
    browser.run("document.querySelector('[data-show=all]').click()")
    sort = "find('sort').value = '{}'; find('sort').dispatchEvent(new Event('change'))"
    browser.run(sort.format("memory"))  # what has none is last
    assert browser.run(visible) == ["a?b", "日本 ", "\"'&", "<b>", "bad", "gon"]
    browser.run("find('turn').click()")
    assert browser.run(visible) == ["\"'&", "日本 ", "a?b", "<b>", "bad", "gon"]
    loaded = "[...document.images].every((image) => image.complete && image.naturalWidth > 0)"
    assert browser.run(loaded) and browser.run("window.harm") is None
    assert browser.troubles() == []
    assert all(url.startswith(("file:", "data:")) for url in browser.requests())
