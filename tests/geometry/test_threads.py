"""Work shared by threads: in order, as many as are allowed, errors passed on."""

import threading
import time

import pytest

from strokestyle.geometry import threads
from strokestyle.geometry.threads import at_once, each


def test_what_is_made_lies_in_the_order_of_the_items(monkeypatch):
    monkeypatch.setenv("OMP_NUM_THREADS", "3")
    names = set()

    def slow(k):
        names.add(threading.current_thread().name)
        time.sleep(0.02 / (1 + k))
        return 2 * k

    assert each(slow, iter(range(6))) == [0, 2, 4, 6, 8, 10]
    assert 1 < len(names) <= 3
    assert each(slow, []) == []


def test_one_thread_is_the_caller_s(monkeypatch):
    monkeypatch.setenv("OMP_NUM_THREADS", "1")
    here = threading.current_thread()
    assert each(lambda _: threading.current_thread(), range(3)) == [here] * 3


def test_errors_are_passed_on(monkeypatch):
    monkeypatch.setenv("OMP_NUM_THREADS", "2")
    with pytest.raises(ZeroDivisionError):
        each(lambda k: 1 // k, [1, 0, 2])


@pytest.mark.parametrize(
    "said, count", [("1", 1), (" 4,2", 4), ("0", 1), ("", 7), ("many", 7), ("-2", 7), (None, 7)]
)
def test_as_many_threads_as_are_said_or_as_there_are_cores(monkeypatch, said, count):
    monkeypatch.setattr(threads, "cores", lambda: 7)
    monkeypatch.delenv("OMP_NUM_THREADS", raising=False)
    if said is not None:
        monkeypatch.setenv("OMP_NUM_THREADS", said)
    assert threads.threads() == count


def test_both_are_at_work_at_once_and_the_first_in_its_callers_thread(monkeypatch):
    monkeypatch.setenv("OMP_NUM_THREADS", "2")
    met, callers = threading.Barrier(2, timeout=20), threading.get_ident()

    def meet(what):
        met.wait()
        return what, threading.get_ident()

    (one, here), (other, there) = at_once(lambda: meet("one"), lambda: meet("other"))
    assert (one, other) == ("one", "other")
    assert here == callers != there


def test_errors_are_raised_once_both_are_over(monkeypatch):
    monkeypatch.setenv("OMP_NUM_THREADS", "2")
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


def test_one_thread_does_one_after_the_other(monkeypatch):
    monkeypatch.setenv("OMP_NUM_THREADS", "1")
    here, order = threading.get_ident(), []

    def work():
        order.append(threading.get_ident())
        return len(order)

    assert at_once(work, work) == (1, 2) and order == [here, here]
