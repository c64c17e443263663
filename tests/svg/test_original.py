"""The file that one of another thickness was made of, in it: found again, or not at all."""

import base64
import zlib

import numpy as np
import pytest

from strokestyle import files
from strokestyle.svg import original
from strokestyle.svg.original import Original, keep_original, original_of

WAS = b'<svg data-ss-format="4"><g id="was"/></svg>'
MADE = '<?xml version="1.0"?>\n<svg data-ss-format="4"><g id="made \u00e4"/></svg>'


def of(factor):
    return Original(WAS, np.atleast_1d(np.float64(factor)))


def test_it_is_found_with_the_factors():
    for factor in ([1.5], [1.5, 1.0, 2.0]):
        text = keep_original(MADE, of(factor))
        kept = original_of(text.encode())
        assert kept is not None and kept.data == WAS and kept.factor.tolist() == factor
    kept = original_of(zlib.compress(keep_original(MADE, of([2.0, 2.0])).encode(), wbits=31))
    assert kept is not None and kept.factor.tolist() == [2.0]  # .svgz; alike is one for all
    assert original_of(MADE.encode()) is None


def test_what_is_nearly_one_is_meant_to_be():
    assert of(1.5).times(np.array([0.6667, 0.66])).tolist() == [1.0, pytest.approx(0.99)]
    assert of([2.0, 4.0]).times(np.array([0.5, 0.25])).tolist() == [1.0, 1.0]
    assert of([2.0, 4.0]).times(np.ones(3)) is None
    for factor in (0.0, 1e-4, 1e4, np.inf, np.nan):
        assert of([2.0, 1.0]).times(np.array([1.0, factor])) is None


def test_it_is_kept_once():
    within = keep_original(MADE, of(1.5)).replace("made", "changed")
    again = keep_original(MADE, Original(within.encode(), np.ones(1)))
    kept = original_of(again.encode())
    assert kept is not None and kept.data == MADE.replace("made", "changed").encode()


@pytest.mark.parametrize(
    "change",
    [("made", "mad"), ("1.5", "1.6e"), (' data-ss-was="1.5', ' data-ss-was="0'), ("</svg>", "")],
)
def test_a_file_that_was_changed_since_has_none(change):
    text = keep_original(MADE, of(1.5)).replace(*change, 1)
    assert original_of(text.encode()) is None


@pytest.mark.parametrize("factor", [0.0, 1e-4, 1e4, [1.0, 0.0], []])
def test_no_factor_out_of_range(factor):
    assert keep_original(MADE, of(factor)) == MADE


def test_what_is_too_large_is_not_kept_nor_unpacked(monkeypatch):
    text = keep_original(MADE, of(1.5)).encode()
    monkeypatch.setattr(files, "MAX_TEXT", len(WAS) - 1)
    assert original_of(text) is None
    assert keep_original(MADE, of(1.5)) == MADE
    monkeypatch.setattr(files, "MAX_TEXT", 1 << 20)
    monkeypatch.setattr(files, "MAX_BYTES", len(MADE.encode()) + 50)
    assert keep_original(MADE, of(1.5)) == MADE
    monkeypatch.setattr(files, "MAX_BYTES", 1 << 20)
    assert keep_original(MADE, of(1.5)) != MADE
    monkeypatch.setattr(original, "MAX_KEPT", 50)
    assert keep_original(MADE, of(1.5)) == MADE


@pytest.mark.parametrize("damage", [lambda packed: packed[:-9], lambda packed: b"no zlib at all"])
def test_damaged_data_are_none(damage):
    text = keep_original(MADE, of(1.5))
    packed = base64.b64encode(zlib.compress(WAS)).decode()
    assert packed in text
    other = base64.b64encode(damage(zlib.compress(WAS))).decode()
    assert original_of(text.replace(packed, other).encode()) is None
