"""Warnings about a mesh name its file, once each."""

import warnings

import pytest

from strokestyle.mesh.messages import MeshWarning, naming, warn


def test_a_warning_names_the_file_and_is_given_once():
    with warnings.catch_warnings(record=True) as found:
        warnings.simplefilter("always")
        with naming("a.obj"), naming("a.obj"):
            warn("3 lines are left out")
            warn("3 lines are left out")
            warnings.warn("another's", DeprecationWarning, stacklevel=1)
    assert [(str(one.message), one.category) for one in found] == [
        ("a.obj: 3 lines are left out", MeshWarning),
        ("another's", DeprecationWarning),
    ]


def test_after_an_error_nothing_is_warned_of():
    with warnings.catch_warnings(record=True) as found:
        warnings.simplefilter("always")
        with pytest.raises(KeyError), naming("a.obj"):
            warn("lost")
            raise KeyError
    assert not found
