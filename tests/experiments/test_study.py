"""The perceptual study: who is asked what, what a page shows and saves, and how it is counted."""

import base64
import io
import json
import re
from collections import Counter

import numpy as np
import pytest
import study
from browsers import in_both_browsers, in_browser
from build_dataset import add_shape
from PIL import Image
from scipy.stats import binomtest
from solids import box
from study_plan import Comparison, deal, load_study, twice
from study_votes import ANSWERS, interval, parsed, seal
from study_workers import Law

SIZE = 48
INKS = {"inky_grey": 90, "pale_wash": 170}  # styles, and the grey of their lines
SHADES = {"mine_fast": 10, "rival_patch": 40, "rival_nerve": 70}  # methods, and what they add
OTHERS = ("rival_patch", "rival_nerve", "plain_copy", "artist")
MAKE = ("--ours", "mine_fast", "--others", ",".join(OTHERS), "--train", "tall")


def lines_of(root, shape, grey):
    """A shape's lines in a grey, as RGB."""
    lines = np.asarray(Image.open(root / "shapes" / shape / "template.png").convert("RGB"))
    return Image.fromarray((255 - (255 - lines.astype(int)) * (255 - grey) // 255).astype(np.uint8))


@pytest.fixture(scope="module")
def data(tmp_path_factory):
    """Three blocks, two styles, and drawings by three methods: each its own grey."""
    root = tmp_path_factory.mktemp("data")
    blocks = {"tall": (1.0, 3.0, 1.5), "flat": (4.0, 1.0, 2.0), "cube": (2.0, 2.0, 2.0)}
    for name, high in blocks.items():
        solid, mesh = box(high=high), root / "mesh.obj"
        lines = [f"v {x} {y} {z}" for x, y, z in solid.vertices]
        mesh.write_text("\n".join(lines + [f"f {a} {b} {c}" for a, b, c in solid.faces + 1]))
        add_shape(root / "shapes" / name, mesh, "three-quarter", SIZE)
        for style, grey in INKS.items():
            drawn = {root / "styles" / style / name / "drawing.png": grey}
            for k, method in enumerate(("mine_fast", *OTHERS[:3])):
                drawn[root / "out" / method / style / f"{name}.png"] = grey - 30 + 12 * k
            for path, shade in drawn.items():
                path.parent.mkdir(parents=True, exist_ok=True)
                lines_of(root, name, shade).save(path)
    return root


def made(data, folder, *words):
    assert study.main(["make", str(data / "out"), str(data), "-o", str(folder), *MAKE, *words]) == 0
    return folder


@pytest.fixture(scope="module")
def asked(data, tmp_path_factory):
    """The folder of a study: 16 comparisons, 3 votes, 4 questionnaires."""
    return made(data, tmp_path_factory.mktemp("study") / "asked")


def told(folder, sheet, choose, worker="w1", **changed):
    """Answers to a questionnaire; `choose` says x, y, neither or both for (Shown, its place)."""
    plan = load_study(folder)
    out = {
        "format": "strokestyle study answers 1",
        "study": plan.name,
        "questionnaire": plan.questionnaires[sheet].name,
        "worker": worker,
        "simulated": False,
        "answers": [
            {"question": shown.token, "answer": choose(shown, n), "seconds": 2.5}
            for n, shown in enumerate(plan.questionnaires[sheet].shown)
        ],
    } | changed
    return out | {"seal": seal(out, plan.questionnaires[sheet].secret)}


def saved(path, text):
    path.write_text(text if isinstance(text, str) else json.dumps(text), encoding="utf-8")
    return path


def ours(shown, _=0):
    """A worker who always prefers our drawing."""
    return "xy"[shown.flipped]


def read(capsys, folder, *words, code=0):
    capsys.readouterr()
    assert study.main(["read", str(folder), *map(str, words)]) == code
    return capsys.readouterr()


def counted(capsys, folder, *words):
    return json.loads(read(capsys, folder, *words, "--json").out)


# ------------------------------------------------------------------------------ who is asked what


@pytest.mark.parametrize(
    "styles, shapes, others, votes, questions",
    [(10, 3, 5, 3, 15), (31, 3, 5, 3, 15), (2, 2, 4, 3, 15), (3, 1, 5, 1, 15), (1, 7, 1, 5, 5)],
)
def test_questionnaires_are_few_hold_no_question_twice_and_are_mixed(
    styles, shapes, others, votes, questions
):
    all_of_them = [
        Comparison(f"s{s}", f"o{o}", f"m{m}")
        for s in range(styles)
        for o in range(shapes)
        for m in range(others)
    ]
    hands = deal(all_of_them, votes, questions, np.random.default_rng(0))
    assert len(hands) == -(-votes * len(all_of_them) // questions)
    assert all(len(hand) == len(set(hand)) == questions for hand in hands)
    given = Counter(n for hand in hands for n in hand)
    assert min(given[n] for n in range(len(all_of_them))) >= votes
    for hand in hands:
        for kind, count in (("style", styles), ("other", others)):
            most = max(Counter(getattr(all_of_them[n], kind) for n in hand).values())
            assert most <= -(-questions // count) + 2


def test_the_second_half_is_the_first_in_another_order_and_changed_over():
    for seed in range(20):
        shown = twice(range(15), np.random.default_rng(seed))
        first, again = shown[:15], shown[15:]
        orders = [[s.comparison for s in half] for half in (first, again)]
        assert sorted(orders[0]) == sorted(orders[1]) == list(range(15)) != orders[0]
        assert orders[0] != orders[1] and orders[0][-1] != orders[1][0]
        sides = {s.comparison: s.flipped for s in first}
        assert all(s.flipped != sides[s.comparison] for s in again)
        assert len({s.token for s in shown}) == 30
    left = [s.flipped for k in range(40) for s in twice(range(15), np.random.default_rng(k))[:15]]
    assert 0.4 < np.mean(left) < 0.6


def kinds(found):
    return tuple(found["workers"][kind] for kind in ("reliable", "unreliable", "simulated"))


# --------------------------------------------------------------------------------------- the page


def page_data(path):
    text = path.read_text(encoding="utf-8")
    return json.loads(re.search(r'id="data">(.*?)</script>', text, re.S)[1])


def image(address):
    data = base64.b64decode(address.removeprefix("data:image/png;base64,"))
    return Image.open(io.BytesIO(data))


def test_each_question_shows_what_the_key_says(asked, data):
    plan = load_study(asked)
    for sheet in plan.questionnaires:
        told = page_data(asked / sheet.page)
        for question, shown in zip(told["questions"], sheet.shown, strict=True):
            c = plan.comparisons[shown.comparison]
            a, b, x, y = (
                image(told["pictures"][i]).convert("RGB").tobytes() for i in question["sheets"]
            )
            mine, other = (y, x) if shown.flipped else (x, y)
            of_artist = data / "styles" / c.style
            path = data / "out" / c.other / c.style / f"{c.shape}.png"
            if c.other == "artist":
                path = of_artist / c.shape / "drawing.png"
            assert question["id"] == shown.token
            assert a == Image.open(of_artist / "tall" / "drawing.png").tobytes()
            curves = np.asarray(lines_of(data, c.shape, 0), int).ravel()
            assert np.abs(np.frombuffer(b, np.uint8) - curves).mean() < 0.5  # curves.json rounds
            ours_path = data / "out" / "mine_fast" / c.style / f"{c.shape}.png"
            assert mine == Image.open(ours_path).tobytes() and other == Image.open(path).tobytes()


def test_a_page_stands_alone_and_does_not_say_who_drew_what(asked):
    for path in asked.glob("*.html"):
        text = path.read_text(encoding="utf-8")
        for name in (*OTHERS, "mine_fast", *INKS, "flat", "cube", "ours"):
            assert not re.search(rf"\b{name}\b", text), name
        assert not re.search(r"\bhttps?:|@import|url\(", text) and "default-src 'none'" in text
        told = page_data(path)
        assert set(told) == {
            "study", "questionnaire", "secret", "sendTo", "pictures", "questions"
        }  # fmt: skip
        assert all(image(address).info == {} for address in told["pictures"])  # pixels, no words


def test_same_seed_same_bytes(asked, data, tmp_path):
    again, other = made(data, tmp_path / "a"), made(data, tmp_path / "b", "--seed", "1")
    names = sorted(path.name for path in asked.iterdir())
    assert names == sorted(path.name for path in again.iterdir()) and len(names) == 5
    assert all((asked / n).read_bytes() == (again / n).read_bytes() for n in names)
    assert all((asked / n).read_bytes() != (other / n).read_bytes() for n in names)


@pytest.mark.parametrize(
    "words, said",
    [
        (("--ours", "absent"), r"absent.*no such drawing \(4 are missing\)"),
        (("--others", "artist,mine_fast"), "ours not among them"),
        (("--others", "artist,artist"), "once each"),
        (("--others", "small"), "24 x 24 px, and its sheet is 48 x 48"),
        (("--others", "broken"), "broken.*cannot be read as an image"),
        (("--styles", "neon"), "no style neon"),
        (("--styles", "inky_grey"), r"8 comparisons are too few.*--questions 8"),
        (("--train", "round"), "no style has a training drawing"),
    ],
)
def test_what_cannot_be_made_gets_one_line_and_leaves_nothing(data, tmp_path, capsys, words, said):
    for method in ("small", "broken"):
        for path in (data / "out" / "mine_fast").glob("*/*.png"):
            target = data / "out" / method / path.parent.name / path.name
            target.parent.mkdir(parents=True, exist_ok=True)
            Image.open(path).resize((24, 24)).save(target)
            if method == "broken":
                target.write_bytes(target.read_bytes()[:60])
    given = ["make", str(data / "out"), str(data), "-o", str(tmp_path / "s"), *MAKE, *words]
    assert study.main(given) == 1
    error = capsys.readouterr().err
    assert re.search(said, error) and error.count("\n") == 1
    assert not list(tmp_path.iterdir())


def test_a_study_is_never_written_over(asked, data, capsys):
    key = (asked / "key.json").read_bytes()
    assert study.main(["make", str(data / "out"), str(data), "-o", str(asked), *MAKE]) == 1
    assert "is not empty" in capsys.readouterr().err and (asked / "key.json").read_bytes() == key


# -------------------------------------------------------------------------------------- the votes


def test_sides_are_undone_and_who_always_answers_left_is_unreliable(asked, tmp_path, capsys):
    good = saved(tmp_path / "good.json", told(asked, 0, ours, "w1"))
    left = saved(tmp_path / "left.json", told(asked, 1, lambda *_: "x", "w2"))
    found = counted(capsys, asked, good, left)
    assert kinds(found) == (1, 1, 0)
    rows = found["against"]
    assert sum(row["votes"] for row in rows.values()) == 15
    assert all(row["ours"]["share"] == 1 == row["ours of decided"]["high"] for row in rows.values())
    assert sum(each["votes"] for each in found["missing"]) == 48 - 15
    assert found["open"] == [f"questionnaire-00{n}.html" for n in (2, 3, 4)]
    text = read(capsys, asked, good, left).out
    assert "2 workers, 1 of them unreliable (more than 5 " in text
    assert "33 of 48 votes are missing, at 16 of 16 comparisons" in text


@pytest.mark.parametrize("wrong, reliable", [(0, 1), (5, 1), (6, 0)])
def test_more_than_5_repeated_answers_that_differ_make_a_worker_unreliable(
    asked, tmp_path, capsys, wrong, reliable
):
    """And the vote is the first answer."""
    path = saved(
        tmp_path / "a.json",
        told(asked, 0, lambda shown, n: "neither" if 15 <= n < 15 + wrong else ours(shown)),
    )
    found = counted(capsys, asked, path)
    assert found["workers"]["reliable"] == reliable
    for row in found["against"].values():
        assert row["neither"]["count"] == 0 and row["ours"]["count"] == row["votes"]


def test_what_is_wrong_with_a_file_is_told_and_the_rest_goes_on(asked, data, tmp_path, capsys):
    fine = told(asked, 0, ours)

    def but(**changed):
        return {**fine, **changed}

    def but_first(**changed):
        return but(answers=[{**fine["answers"][0], **changed}, *fine["answers"][1:]])

    other = made(
        data, tmp_path / "other", "--others", "artist,plain_copy,rival_nerve", "--questions", "5"
    )
    zoo = {
        "a_empty": ("", "is not JSON"),
        "b_binary": ("\x00\x01PNG", "is not JSON"),
        "c_cut": (json.dumps(fine)[:500], "is not JSON"),
        "d_deep": ("[" * 100_000, "is not JSON"),
        "e_list": ("[1, 2]", "is no file of answers"),
        "f_else": ({"format": "something"}, "is no file of answers"),
        "g_other": (told(other, 0, ours), "answers study"),
        "h_sheet": (but(questionnaire="099"), "no questionnaire '099'"),
        "i_kind": (but(worker=7), "'worker' is missing or is no text"),
        "j_real": (but(simulated="no"), "'simulated' is missing or is no truth value"),
        "k_open": (but_first(answer=None), "is incomplete: answer 1 "),
        "l_word": (but_first(answer="left"), "is incomplete: answer 1 "),
        "m_slow": (but_first(seconds=-1), "no number of seconds"),
        "n_nan": (but_first(seconds=float("nan")), "no number of seconds"),
        "o_half": (but(answers=fine["answers"][:15]), "15 of 30 questions have no answer"),
        "p_turned": (but(answers=fine["answers"][::-1]), "in their order"),
        "q_more": (but(answers=[*fine["answers"], fine["answers"][0]]), "in their order"),
        "r_changed": (but_first(answer="both"), "its seal does not fit"),
        "s_hidden": (told(asked, 1, ours, "w3", simulated=True) | {"simulated": False}, "seal"),
        "t_fine": (fine, None),
        "u_again": (fine, "by the worker of"),
        "v_second": (told(asked, 1, ours), "by the worker of"),
        "w_taken": (told(asked, 0, ours, "w2"), "questionnaire 001 was answered before"),
        "x_lines": (but(study="a\nb" * 99), "answers study 'a\\nba"),
        "x_lone": (but(worker="\ud800"), "its seal does not fit"),
        "x_none": (but(answers=[None] * 30), "answer 1 names no question"),
    }
    paths = [saved(tmp_path / f"{name}.json", content) for name, (content, _) in zoo.items()]
    absent = tmp_path / "z_absent.json"
    done = read(capsys, asked, *reversed(paths), absent, tmp_path, "--json")
    lines = done.err.splitlines()
    wrong = {name: said for name, (_, said) in zoo.items() if said} | {"z_absent": "cannot be read"}
    assert len(lines) == len(wrong)
    for line, (name, said) in zip(lines, wrong.items(), strict=True):
        assert line.startswith(str(tmp_path / f"{name}.json")) and said in line
    found = json.loads(done.out)
    assert found["workers"]["reliable"] == 1 and found["refused"] == lines
    none = read(capsys, asked, paths[0], code=1)
    assert none.err.count("\n") == 2 and "no file of answers can be used" in none.err


def test_an_unreliable_worker_leaves_the_questionnaire_to_the_next(asked, tmp_path, capsys):
    saved(tmp_path / "a.json", told(asked, 2, lambda *_: "y", "w1"))
    saved(tmp_path / "b.json", told(asked, 2, ours, "w2"))
    found = counted(capsys, asked, tmp_path)
    assert kinds(found) == (1, 1, 0)
    assert not found["refused"]


def test_who_says_both_throughout_is_named(asked, tmp_path, capsys):
    path = saved(tmp_path / "a.json", told(asked, 2, lambda *_: "both"))
    assert counted(capsys, asked, path)["workers"]["uniform"] == [str(path)]
    assert f"yet counted: {path}." in read(capsys, asked, path).out


@pytest.mark.parametrize("text", [None, "", "{}", '{"format": "strokestyle study 1"}', "[]"])
def test_a_damaged_key_gets_one_line(tmp_path, capsys, text):
    if text is not None:
        (tmp_path / "key.json").write_text(text)
    assert "key.json: " in read(capsys, tmp_path, tmp_path / "a.json", code=1).err


def test_intervals_are_exact():
    for count, total in ((0, 7), (7, 7), (3, 12), (60, 93), (1, 1)):
        low, high = interval(count, total)
        exact = binomtest(count, total).proportion_ci(0.95, "exact")
        assert (low, high) == pytest.approx((exact.low, exact.high), abs=1e-9)
        assert low <= count / total <= high
    assert interval(0, 9)[1] == pytest.approx(1 - 0.025 ** (1 / 9))  # no vote of nine
    assert interval(9, 9)[0] == pytest.approx(0.025 ** (1 / 9))


# -------------------------------------------------------------------------------- simulated workers


def simulated(asked, folder, *words):
    assert study.main(["simulate", str(asked), "-o", str(folder), *words]) == 0
    return folder


def test_a_known_preference_is_recovered(data, tmp_path, capsys):
    folder = made(data, tmp_path / "many", "--votes", "60")
    words = ("--preference", "0.8,artist=0.5", "--undecided", "0.1,0.2", "--noise", "0.1")
    found = counted(capsys, folder, simulated(folder, tmp_path / "answers", *words))
    law = Law({"": 0.8, "artist": 0.5}, 0.1, 0.2, 0.1)
    assert found["workers"]["unreliable"] <= 3 and found["workers"]["simulated"] == 64
    for other, row in found["against"].items():
        for kind, wanted in zip(
            ("ours", "other", "neither", "both"), law.shares(other), strict=True
        ):
            low, high = interval(row[kind]["count"], row["votes"], 0.999)
            assert low < wanted < high, (other, kind)
    assert law.shares("artist").tolist() == pytest.approx([0.34, 0.34, 0.115, 0.205])


def test_careless_workers_are_noticed_and_simulation_says_what_it_is(asked, tmp_path, capsys):
    folder = simulated(asked, tmp_path / "a", "--careless", "1", "--seed", "3")
    found = counted(capsys, asked, folder)
    assert kinds(found) == (0, 4, 4)
    assert "**Simulated: all workers are a program" in read(capsys, asked, folder).out
    again = simulated(asked, tmp_path / "b", "--careless", "1", "--seed", "3")
    other = simulated(asked, tmp_path / "c", "--careless", "1")
    for path in folder.iterdir():
        assert path.read_bytes() == (again / path.name).read_bytes()
        assert path.read_bytes() != (other / path.name).read_bytes()


def test_people_and_programs_are_not_counted_together(asked, tmp_path, capsys):
    folder = simulated(asked, tmp_path / "a")
    (folder / "simulated-001.json").unlink()
    person = saved(tmp_path / "person.json", told(asked, 0, ours))
    assert "--mix-simulated" in read(capsys, asked, folder, person, code=1).err
    assert "3 of 4 workers are" in read(capsys, asked, folder, person, "--mix-simulated").out


@pytest.mark.parametrize("words", [("--noise", "2"), ("--preference", "nobody=0.5")])
def test_a_law_that_cannot_be_gets_one_line(asked, tmp_path, capsys, words):
    assert study.main(["simulate", str(asked), "-o", str(tmp_path / "a"), *words]) == 1
    assert capsys.readouterr().err.count("\n") == 1 and not list(tmp_path.iterdir())


# --------------------------------------------------------------------------------- in the browser


def opened(browser, asked, sheet=0, **options):
    plan = load_study(asked)
    browser.open(asked / plan.questionnaires[sheet].page, **options)
    browser.run("try { localStorage.clear() } catch {}")
    browser.run("Object.assign(state, fresh()); guard = 0; find('already').hidden = true")
    browser.run("find('start').disabled = false; show(-1)")
    return plan.questionnaires[sheet]


def at(browser, n):
    """Wait for question n to take answers."""
    browser.wait_for(f"state.at === {n} && performance.now() >= ready")


def press(browser, n, answer):
    at(browser, n)
    browser.key(str(ANSWERS.index(answer) + 1))


@in_both_browsers
def test_a_worker_with_a_keyboard_alone(browser, asked, tmp_path, capsys):
    """Prefers ours, is interrupted, thinks again, cannot leave a question out, and saves."""
    sheet = opened(browser, asked)
    browser.key("ArrowRight")  # from the hint
    for n in range(4):
        press(browser, n, ours(sheet.shown[n]))
    at(browser, 4)
    browser.key("ArrowRight")  # not answered: stays
    browser.key("ArrowLeft")
    at(browser, 3)
    pressed = browser.run("choices.map((choice) => choice.ariaPressed === 'true').indexOf(true)")
    assert ANSWERS[pressed] == ours(sheet.shown[3])
    press(browser, 3, "both")
    at(browser, 4)
    browser.run("show(30)")  # the end is not reached before all is answered
    at(browser, 4)
    browser.run("save()")
    browser.open(asked / sheet.page)  # loaded again: goes on where it was
    browser.run("guard = 0")
    assert browser.run("state.at") == 4
    for n in range(4, 30):
        press(browser, n, ours(sheet.shown[n]))
    browser.wait_for("!find('end').hidden")
    browser.run("find('save').click()")
    name = browser.run("`answers-001-${state.worker.slice(0, 6)}.json`")
    target = browser.downloads / name
    browser.wait_for(lambda: target.exists() and target.stat().st_size > 0)
    assert list(browser.downloads.glob("*.json")) == [target]  # none before
    assert browser.run("find('text').value") == target.read_text(encoding="utf-8")
    found = counted(capsys, asked, target)
    assert kinds(found) == (1, 0, 0)
    assert sum(row["both"]["count"] for row in found["against"].values()) == 1
    assert sum(row["ours"]["count"] for row in found["against"].values()) == 14
    said = parsed(target)
    assert set(said) == {
        "format", "study", "questionnaire", "worker", "simulated", "answers", "seal"
    }  # fmt: skip
    assert all(0 <= each["seconds"] < 60 for each in said["answers"])
    target.unlink()
    browser.key("ArrowLeft")  # what was saved stays as it is
    assert browser.run("find('end').hidden") is False
    assert browser.troubles() == []
    assert all(address.startswith(("file:", "data:", "blob:")) for address in browser.requests())


@in_browser
def test_a_second_questionnaire_in_one_browser_is_by_the_same_worker(browser, asked):
    opened(browser, asked)
    browser.run("begin()")
    worker, plan = browser.run("state.worker"), load_study(asked)
    browser.open(asked / plan.questionnaires[1].page)
    assert browser.run("find('start').disabled && !find('already').hidden")
    assert browser.run("state.worker") == worker
    browser.run("find('somebody').click()")
    assert not browser.run("find('start').disabled") and browser.run("state.worker") != worker


@in_browser
def test_answers_pressed_twice_or_held_down_count_once(browser, asked):
    opened(browser, asked)
    browser.run("guard = 1e6; begin()")
    browser.wait_for("ready > 1e5 && ready < Infinity")
    browser.run("choices[0].click()")
    assert browser.run("state.at") == 0
    browser.run(
        "ready = 0; document.dispatchEvent(new KeyboardEvent('keydown', {key: '1', repeat: true}))"
    )
    assert browser.run("state.at") == 0
    browser.run("choices[0].click()")
    browser.wait_for("state.at === 1")


@in_browser
def test_pictures_come_near_under_a_mouse_that_rests_and_large_when_clicked(browser, asked):
    opened(browser, asked)
    browser.run("begin()")
    at(browser, 0)
    x, y = browser.run("(({x, y, width, height}) => [x + width / 4, y + height / 2])"
                       "(sheets[2].getBoundingClientRect())")  # fmt: skip
    browser.mouse("mouseMoved", x, y)
    near = "sheets.map((sheet) => sheet.classList.contains('near')).join()"
    browser.wait_for(f"{near} === 'false,true,true,true'")
    assert browser.run("sheets[3].style.getPropertyValue('--at-x')").startswith("25")
    browser.click(x, y)
    assert browser.run("find('large').open && find('large-image').alt").startswith("Drawing X")
    browser.key("ArrowRight")
    assert browser.run("find('large-image').src === STUDY.pictures[QUESTIONS[0].sheets[3]]")
    tab = "new KeyboardEvent('keydown', {key: 'Tab', bubbles: true, cancelable: true})"
    assert browser.run(f"document.activeElement.dispatchEvent({tab})")  # goes from button to button
    browser.key("1")  # answers nothing
    browser.key("Escape")
    assert browser.run("!find('large').open && state.at === 0 && state.answers[0] === null")


@in_browser
@pytest.mark.parametrize(
    "width, height", [(1280, 800), (390, 844), (360, 640), (844, 390), (1024, 600)]
)
def test_all_is_on_the_screen_and_has_names(browser, asked, width, height):
    opened(browser, asked, width=width, height=height)
    browser.run("begin()")
    at(browser, 0)
    boxes = browser.run("""[...document.querySelectorAll('#question button')].map((one) => {
        const {left, top, right, bottom} = one.getBoundingClientRect();
        return [left, top, right, bottom]; })""")
    assert len(boxes) == 10
    for left, top, right, bottom in boxes:
        assert 0 <= left < right <= width and 0 <= top < bottom <= height
    sizes = [boxes[i][2] - boxes[i][0] for i in (2, 4, 5)]  # A, X, Y: lines of one scale
    assert min(sizes) >= 130 and max(sizes) - min(sizes) < 1
    unnamed = browser.run("""[...document.querySelectorAll('button, img, progress, textarea')]
        .filter((one) => !(one.ariaLabel || one.alt || one.textContent.trim()) && one.id !==
        'large-image').map((one) => one.outerHTML).join()""")
    assert unnamed == ""
