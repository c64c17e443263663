"""The paper's model and ours, and what is left of them without one of their parts."""

from . import ours, paper

METHODS = paper.METHODS | ours.METHODS
