"""Pieces of work that are done at once."""

import threading

import pytest

from strokestyle.fit.threads import at_once, each_at_once


def test_both_are_at_work_at_once_and_the_first_in_its_callers_thread():
    met, callers = threading.Barrier(2, timeout=20), threading.get_ident()

    def meet(what):
        met.wait()
        return what, threading.get_ident()

    (one, here), (other, there) = at_once(lambda: meet("one"), lambda: meet("other"))
    assert (one, other) == ("one", "other")
    assert here == callers != there


def test_errors_are_raised_once_both_are_over():
    over = []

    def failing(name):
        raise ValueError(name)

    with pytest.raises(ValueError, match="first"):
        at_once(lambda: failing("first"), lambda: over.append("second"))
    assert over == ["second"]
    with pytest.raises(ValueError, match="second"):
        at_once(lambda: over.append("first"), lambda: failing("second"))
    with pytest.raises(ValueError, match="first"):
        at_once(lambda: failing("first"), lambda: failing("second"))


@pytest.mark.parametrize("cores", [1, 2, None])
def test_each_keeps_the_order_of_items_on_any_number_of_cores(monkeypatch, cores):
    monkeypatch.setattr("os.cpu_count", lambda: cores)
    assert each_at_once(lambda x: x * x, range(20)) == [x * x for x in range(20)]
    assert each_at_once(len, []) == []
