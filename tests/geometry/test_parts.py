"""The parts that things belong to: names, votes, what is refused."""

import numpy as np
import pytest

from strokestyle.geometry.parts import MAX_NAME, Parts, part_name


def test_names_are_one_line_that_xml_can_hold():
    assert part_name(" left\t\n  wheel ") == "left wheel"
    assert part_name("a\x00 \x07 b\ud800c\ufffe\U0001f58c") == "a bc\U0001f58c"
    assert part_name("") == part_name(" \n\x01") == ""
    assert part_name('"><script>') == '"><script>'


def test_long_names_are_cut_and_stay_apart():
    one, other = part_name(500 * "x" + "1"), part_name(500 * "x" + "2")
    assert len(one) == len(other) == MAX_NAME and one != other and part_name(one) == one
    assert part_name(MAX_NAME * "y") == MAX_NAME * "y"
    assert len(part_name(90 * "a" + " " + 90 * "b")) <= MAX_NAME


def test_things_are_of_the_parts_that_names_say():
    parts = Parts.of_names(["b", "", "a", "b"], ("c", "b"))
    assert parts.names == ("b", "a") and parts.index.tolist() == [0, -1, 1, 0]
    assert [parts.name(i) for i in range(len(parts))] == ["b", "", "a", "b"]
    assert Parts.of_names(["a ", " a"]).index.tolist() == [0, 0]
    assert Parts.of_names(["", "\x00"]) is None and Parts.of_names([]) is None


def test_pieces_belong_to_the_part_that_most_of_them_is_of():
    parts = Parts(("a", "b"), [0, 0, 1, 1, 1, -1, -1, 0, 1, 0])
    assert parts.vote(np.array([0, 2, 5, 8, 10])).index.tolist() == [
        0,
        1,
        -1,
        0,
    ]  # of equals the one painted first
    assert parts.vote(np.array([0, 10])).index.tolist() == [0]
    assert len(Parts(("a",), []).vote(np.array([0]))) == 0
    rng = np.random.default_rng(0)
    index, cuts = rng.integers(-1, 5, 400), np.unique(np.r_[0, rng.integers(1, 400, 60), 400])
    voted = Parts(tuple("abcde"), index).vote(cuts)
    counts = [
        np.bincount(index[a:b] + 1, minlength=6) for a, b in zip(cuts[:-1], cuts[1:], strict=True)
    ]
    assert voted.index.tolist() == [count.argmax() - 1 for count in counts]


def test_lines_are_cut_where_they_run_on_in_another_part():
    long, short = [0] * 10 + [1] * 12, [1] * 10 + [0] * 3 + [1] * 10 + [-1] * 2
    index = np.array([*long, *short, *[2] * 5, *[0] * 9, *[-1] * 4, *[1] * 9])
    offsets = np.cumsum([0, len(long), len(short), 5, 22])
    along = 3.0 * np.concatenate([np.arange(n) for n in np.diff(offsets)])
    made = Parts(("a", "b", "c"), index).cut(offsets, along, least=20.0)
    rows, new = made.rows, made.offsets
    assert made.line.tolist() == [0, 0, 1, 2, 3, 3] and made.parts.index.tolist() == [
        0,
        1,
        1,
        2,
        0,
        1,
    ]
    assert made.whole.tolist() == [False, False, True, True, False, False]
    pieces = [rows[a:b].tolist() for a, b in zip(new[:-1], new[1:], strict=True)]
    assert pieces[0] == list(range(11)) and pieces[1] == list(
        range(10, 22)
    )  # they share the point where they meet
    assert pieces[2] == list(range(22, 47)) and pieces[3] == list(range(47, 52))
    assert pieces[4][-1] == pieces[5][0] == 52 + 11  # in the middle of a short stretch between
    none = Parts(("a",), []).cut(np.array([0]), np.zeros(0))
    assert len(none.rows) == len(none.parts) == len(none.line) == len(
        none.whole
    ) == 0 and none.offsets.tolist() == [0]


def test_pieces_make_up_the_lines_whatever_they_are():
    rng = np.random.default_rng(1)
    for _ in range(50):
        offsets = np.r_[0, np.cumsum(rng.integers(2, 40, 6))]
        index = np.repeat(rng.integers(-1, 3, 60), rng.integers(1, 9, 60))[: offsets[-1]]
        index = np.r_[index, np.zeros(offsets[-1] - len(index), int)]
        along = np.concatenate([np.sort(rng.uniform(0, 90, n)) for n in np.diff(offsets)])
        parts = Parts(("a", "b", "c"), index)
        made = parts.cut(offsets, along, least=15.0)
        new = made.offsets
        assert (np.diff(new) >= 2).all() and len(made.parts) == len(made.line) == len(new) - 1
        for i in range(6):
            mine = [
                made.rows[a:b]
                for a, b, line in zip(new[:-1], new[1:], made.line, strict=True)
                if line == i
            ]
            assert all(a[-1] == b[0] for a, b in zip(mine[:-1], mine[1:], strict=True))
            whole = np.concatenate([mine[0], *(piece[1:] for piece in mine[1:])])
            assert whole.tolist() == list(range(offsets[i], offsets[i + 1]))


def test_taking_keeps_names():
    parts = Parts(("a", "b"), [0, 1, -1])
    assert parts.take(np.array([2, 0])).index.tolist() == [-1, 0] and parts.take(
        [True, False, True]
    ).names == (
        "a",
        "b",
    )


@pytest.mark.parametrize(
    "names, index",
    [
        (("a", "a"), [0]),
        (("",), [0]),
        (("a\n",), [0]),
        (("a",), [1]),
        (("a",), [-2]),
        ((), [0]),
        (("a",), [[0]]),
    ],
)
def test_what_is_no_part_is_refused(names, index):
    with pytest.raises(ValueError, match="Parts"):
        Parts(names, index)
