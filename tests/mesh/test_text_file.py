"""Numbers in text: what is read quickly is what Python reads."""

import numpy as np
import pytest

from strokestyle.mesh.text_file import plain_decimals, read_numbers


@pytest.mark.parametrize("form", ["%.1f", "%.3f", "%.6f", "%+.9f", "%.8g", "%d"])
def test_plain_decimals_are_read_to_the_last_digit(form):
    random = np.random.default_rng(0)
    values = random.normal(size=4000) * 10.0 ** random.integers(0, 4, 4000)
    words = [word for word in (form % value for value in values) if "e" not in word]
    found = plain_decimals(" ".join(words).encode())
    assert found is not None and found.tolist() == [float(word) for word in words]


def test_forms_of_decimals():
    text = b"\n -.5\t+.25 3. 0.1\r\n7 -0.30 999999999999999 "
    assert plain_decimals(text).tolist() == [-0.5, 0.25, 3.0, 0.1, 7.0, -0.3, 999999999999999.0]


@pytest.mark.parametrize(
    "text",
    ["", " ", ".", "- .5", "1.5e3", "1.0-2.0", "1-2 .", "1.2.3 4", "x1.0", "1.0 nan.", "1_0.0",
     "+-5.0", "0x1.8", "0.1234567890123456", "1,5"],
)  # fmt: skip
def test_what_is_no_plain_decimal_is_left_to_others(text):
    assert plain_decimals(text.encode()) is None


def test_numbers_end_at_the_first_word_that_is_none():
    values, problem = read_numbers(b"1.5 2\n3.25 x 4")
    assert values.tolist() == [1.5, 2.0, 3.25] and problem == "line 2: 'x' is not a number"
