"""View + a drawing of it -> Style."""

from .. import render  # noqa: F401  says how torch's threads wait, before anything imports torch
