"""The page that plays a film: what it holds, and what it does in a headless browser."""

import base64
import io
import json
import re
import zlib

import numpy as np
import pytest
from browsers import in_both_browsers, in_browser
from PIL import Image

from strokestyle.drawing.strokes import Drawing, Strokes
from strokestyle.film.page import FilmPage
from strokestyle.film.timing import rate_of
from strokestyle.svg.write import write_svg

SIZE, COUNT = (80, 60), 8
HOSTILE = "</script><script>window.harm = 1</script>&\"'<b>"


def bar(i, **options):
    """An upright bar at 10 + 8 i px, as SVG."""
    x = 10.0 + 8 * i
    strokes = Strokes([[x, 10], [x, 50]], [4.0, 4.0], [0, 2], [0], [False])
    drawing = Drawing(strokes, SIZE, np.array([[0.1, 0.1, 0.1, 1.0]]))
    return write_svg(drawing, title=f"bar {i}", **options)


def write(path, count=COUNT, held=1, loop=True, title="bars", ground=None, fps=10, **options):
    with FilmPage(title, rate_of(fps), loop, ground) as page:
        for i in range(count):
            page.add(bar(i, **options), SIZE, held)
        page.write(path)
    return path


@pytest.fixture
def page(browser, tmp_path):
    """A film of 8 bars, paused at the first."""
    browser.open(write(tmp_path / "film.html"), 900, 600)
    pause(browser)
    yield browser
    assert browser.troubles() == []


def pause(browser):
    browser.run("pause(); go(0)")
    shows(browser, 0)


def shows(browser, i):
    browser.wait_for(f"canvas.dataset.drawing === '{i}' && current === {i} && !asked")


def pixels(browser):
    """The stage as it is painted, (h, w, 4) uint8."""
    data = browser.run("document.getElementById('picture').toDataURL('image/png')")
    return np.asarray(Image.open(io.BytesIO(base64.b64decode(data.split(",")[1]))).convert("RGBA"))


def at_bar(picture, i):
    """The colour in the middle of where bar i stands."""
    height, width = picture.shape[:2]
    return picture[height // 2, int((10 + 8 * i) / SIZE[0] * width)].astype(int)


# ----------------------------------------------------------------------------------------- the file


def test_the_page_stands_alone(tmp_path):
    text = write(tmp_path / "film.html", title=HOSTILE).read_text()
    outside = re.sub(r'<script type="application/json".*?</script>', "", text, flags=re.S)
    assert not re.findall(r"\bhttps?://", outside) and "@import" not in outside
    assert text.count("<script") == 2 and "default-src 'none'" in text and "unsafe" not in text
    data = json.loads(re.search(r'id="data">(.*?)</script>', text, re.S)[1])
    assert data["title"] == HOSTILE and data["size"] == list(SIZE) and data["fps"] == 10
    for i, frame in enumerate(data["frames"]):
        assert zlib.decompress(base64.b64decode(frame), -15).decode() == bar(i)
    assert len(text) < 40_000


def test_a_page_without_drawings_is_refused(tmp_path):
    with pytest.raises(ValueError, match=r"x.html: a film needs at least one drawing"):
        write(tmp_path / "x.html", count=0)
    assert not list(tmp_path.iterdir())


# ------------------------------------------------------------------------------------ it is played


@in_both_browsers
def test_it_plays_by_itself_round_and_round_and_asks_the_network_for_nothing(browser, tmp_path):
    browser.open(write(tmp_path / "film.html", fps=30), 900, 600)
    assert browser.run("playing")
    for i in (5, 1):  # past the end, and from the beginning again
        browser.wait_for(f"current === {i}")
    browser.key(" ")
    assert not browser.run("playing")
    addresses = [a for a in browser.requests() if not a.startswith("blob:")]
    assert len(addresses) <= 1 and all(name.startswith("file:") for name in addresses)
    assert browser.troubles() == []


@in_both_browsers
def test_the_stage_shows_the_drawing_that_is_wanted(page):
    for i in (0, 5, 3):
        page.run(f"go({i})")
        shows(page, i)
        picture = pixels(page)
        assert [k for k in range(COUNT) if at_bar(picture, k)[3] > 128] == [i]
        assert page.run("document.getElementById('place').textContent") == f"{i + 1} / 8"


@in_both_browsers
def test_slider_arrows_and_buttons_scrub(page):
    page.run("""const s = document.getElementById('scrub');
        s.value = '4'; s.dispatchEvent(new Event('input', {bubbles: true}))""")
    shows(page, 4)
    for key, wanted in (("ArrowRight", 5), ("ArrowLeft", 4), (".", 5), (",", 4), ("End", 7),
                        ("ArrowRight", 0), ("ArrowLeft", 7), ("Home", 0)):  # fmt: skip
        page.key(key)
        shows(page, wanted)
    page.run("document.getElementById('forward').click()")
    shows(page, 1)
    assert page.run("document.getElementById('scrub').value") == "1"
    assert page.run("document.getElementById('scrub').getAttribute('aria-valuetext')") == (
        "frame 2 / 8"
    )


@in_browser
def test_speed_is_that_of_the_clock(page):
    """By the page's own clock, which the test turns: no test asserts on time."""
    ticks = """(() => {
        playing = true; position = current = shown = clock = 0; last = 1000;
        const seen = [];
        const ask = window.requestAnimationFrame; window.requestAnimationFrame = () => 1;
        for (let k = 1; k <= 20; k++) {
            shown = current; tick(1000 + 50 * k); seen.push(current);
        }
        window.requestAnimationFrame = ask; asked = 0; playing = false; showPlaying();
        return seen.join(' ');
    })()"""
    page.run("for (let i = 0; i < 8; i++) picture(i)")
    page.wait_for("pictures.size === 8")
    assert page.run(ticks).split() == [str(k // 2 % 8) for k in range(1, 21)]  # 10 fps, 20 Hz
    page.run("document.getElementById('speed').value = '1'; showValues()")
    assert page.run(ticks).split() == [str(k % 8) for k in range(1, 21)]
    assert page.run("document.querySelector('label.slide output').textContent") == "20 fps"
    page.run("document.querySelector('input[value=pingpong]').click()")
    assert page.run(ticks).split() == [str(min(k % 14, 14 - k % 14)) for k in range(1, 21)]
    page.run("document.querySelector('input[value=once]').click()")
    assert page.run(ticks).split() == [str(min(k, 7)) for k in range(1, 21)]
    page.run("go(0)")


@in_both_browsers
def test_onion_skin_shows_neighbours_red_before_and_blue_after(page):
    page.run("go(4)")
    shows(page, 4)
    plain = pixels(page)
    assert at_bar(plain, 3)[3] == at_bar(plain, 5)[3] == 0
    page.key("o")
    page.wait_for("canvas.dataset.skins === '4'")
    skinned = pixels(page)
    for i, red in ((2, True), (3, True), (5, False), (6, False)):
        r, _, b, alpha = at_bar(skinned, i)
        assert 20 < alpha < 200 and (r > b) == red
    assert at_bar(skinned, 3)[3] > at_bar(skinned, 2)[3]  # the nearer, the stronger
    assert np.array_equal(at_bar(skinned, 4), at_bar(plain, 4))
    assert at_bar(skinned, 1)[3] == 0
    page.run("""const n = document.getElementById('after');
        n.value = '0'; n.dispatchEvent(new Event('input', {bubbles: true}))""")
    page.wait_for("canvas.dataset.skins === '2'")
    assert at_bar(pixels(page), 5)[3] == 0
    page.run("document.getElementById('before').value = '3'; go(0)")
    page.wait_for("canvas.dataset.drawing === '0' && canvas.dataset.skins === '3'")
    assert at_bar(pixels(page), 7)[3] > at_bar(pixels(page), 5)[3] > 0  # the last comes before
    page.key("o")
    page.wait_for("canvas.dataset.skins === '0'")


@in_browser
def test_a_film_with_two_ends_has_no_neighbours_beyond_them(browser, tmp_path):
    browser.open(write(tmp_path / "film.html", loop=False), 900, 600)
    pause(browser)
    browser.key("o")
    browser.wait_for("canvas.dataset.skins === '2'")
    browser.key("ArrowLeft")
    shows(browser, 0)
    assert browser.run("ending()") == "pingpong" and browser.troubles() == []


@in_both_browsers
def test_a_saved_drawing_is_the_frames_file(page):
    page.run("go(6)")
    shows(page, 6)
    page.run("document.getElementById('save').click()")
    target = page.downloads / "bars-006.svg"
    page.wait_for(lambda: target.exists() and target.stat().st_size > 0)
    assert target.read_text() == bar(6)


@in_browser
def test_background_is_the_drawings_own_or_another(browser, tmp_path):
    path = write(tmp_path / "film.html", ground="#ffeecc", background="#ffeecc")
    browser.open(path, 900, 600)
    pause(browser)
    assert at_bar(pixels(browser), 3)[3] == 0  # the paper is the sheet's: skins shine through
    ground = "getComputedStyle(document.getElementById('sheet')).backgroundColor"
    assert browser.run(ground) == "rgb(255, 238, 204)"
    browser.run("document.querySelector('input[value=none]').click()")
    assert browser.run("document.getElementById('sheet').className") == "none"
    browser.run("document.querySelector('input[value=colour]').click()")
    assert browser.run(ground) == "rgb(244, 236, 216)"
    assert browser.troubles() == []


@in_browser
def test_drawings_on_twos_are_held(browser, tmp_path):
    browser.open(write(tmp_path / "film.html", count=3, held=2), 900, 600)
    pause(browser)
    browser.key("ArrowRight")
    shows(browser, 1)
    assert browser.run("document.getElementById('place').textContent") == "3–4 / 6"
    assert browser.run("document.getElementById('scrub').max") == "2"
    assert browser.troubles() == []


@in_both_browsers
@pytest.mark.parametrize("width, height", [(360, 640), (900, 600)])
def test_all_controls_are_on_the_screen_and_have_names(browser, tmp_path, width, height):
    browser.open(write(tmp_path / "film.html"), width, height, density=2)
    pause(browser)
    for name in ("picture", "play", "scrub", "save", "back", "forward", "place"):
        left, top, right, bottom = browser.run(f"""(() => {{
            const box = document.getElementById('{name}').getBoundingClientRect();
            return [box.left, box.top, box.right, box.bottom];
        }})()""")
        assert 0 <= left < right <= width and 0 <= top < bottom <= height, name
    assert browser.run("document.documentElement.scrollWidth") <= width
    unnamed = browser.run("""[...document.querySelectorAll('button, input, canvas')].filter((one) =>
        !(one.getAttribute('aria-label') || one.textContent.trim() || one.labels?.length))
        .map((one) => one.outerHTML).join()""")
    assert unnamed == ""
    sharp = browser.run("canvas.width / canvas.getBoundingClientRect().width")
    assert sharp == pytest.approx(2, rel=0.02)


@in_browser
def test_one_drawing_is_a_film_without_play(browser, tmp_path):
    browser.open(write(tmp_path / "film.html", count=1), 900, 600)
    shows(browser, 0)
    assert browser.run("document.getElementById('play').disabled") and not browser.run("playing")
    assert browser.troubles() == []
