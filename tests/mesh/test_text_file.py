"""Numbers in text: what is read quickly is what Python reads."""

import numpy as np
import pytest

from strokestyle.mesh import text_file
from strokestyle.mesh.text_file import places, plain_decimals, read_numbers, word_places


def _plain(text):
    return plain_decimals(text, *word_places(text))


def test_words_and_letters_are_found_piece_by_piece(monkeypatch):
    random = np.random.default_rng(0)
    monkeypatch.setattr(text_file, "PIECE", 7)
    for length in range(60):
        text = bytes(random.choice(list(b"ab \n"), length).astype(np.uint8))
        found = [text[a:b] for a, b in zip(*word_places(text), strict=True)]
        assert found == text.split()
        assert places(text, "\n").tolist() == [i for i in range(length) if text[i] == 10]


@pytest.mark.parametrize("form", ["%.1f", "%.3f", "%.6f", "%+.9f", "%.8g", "%d"])
def test_plain_decimals_are_read_to_the_last_digit(form):
    random = np.random.default_rng(0)
    values = random.normal(size=4000) * 10.0 ** random.integers(0, 4, 4000)
    texts = [word for word in (form % value for value in values) if "e" not in word]
    found = _plain(" ".join(texts).encode())
    assert found is not None and found.tolist() == [float(word) for word in texts]


def test_forms_of_decimals():
    text = b"\n -.5\t+.25 3. 0.1\r\n7 -0.30 999999999999999 "
    assert _plain(text).tolist() == [-0.5, 0.25, 3.0, 0.1, 7.0, -0.3, 999999999999999.0]


@pytest.mark.parametrize(
    "text",
    ["", " ", ".", "- .5", "1.5e3", "1.0-2.0", "1-2 .", "1.2.3 4", "x1.0", "1.0 nan.", "1_0.0",
     "+-5.0", "0x1.8", "0.1234567890123456", "1,5", ".-5", "1.5 .+5 2", "-.-5", "1 2 -", "1.5 +",
     "1.5 -. ", "1.5 +\n"],
)  # fmt: skip
def test_what_is_no_plain_decimal_is_left_to_others(text):
    assert _plain(text.encode()) is None


@pytest.mark.parametrize("word", [".-5", "-", "+", "-.", "+."])
@pytest.mark.parametrize("rest", ["", "\n", " 4 5\n"])
def test_signs_without_digits_are_told_of(word, rest):
    values, problem = read_numbers(f"1.5 2\n{word}{rest}".encode())
    assert values.tolist() == [1.5, 2.0] and problem == f"line 2: {word!r} is not a number"


def test_numbers_end_at_the_first_word_that_is_none():
    values, problem = read_numbers(b"1.5 2\n3.25 x 4")
    assert values.tolist() == [1.5, 2.0, 3.25] and problem == "line 2: 'x' is not a number"
