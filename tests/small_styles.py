"""Styles made by hand, for tests of what draws with them."""

import numpy as np

from strokestyle.render.config import StyleConfig
from strokestyle.render.displacement import DEFORMATIONS
from strokestyle.render.features import FEATURES, FeatureScaling
from strokestyle.render.style import Style, SumOfCurves


def plain_style(size=768, thin_above=False):
    """A style that has learned next to nothing: a line a few pixels thick, or one that fades
    towards the top."""
    count, each = len(FEATURES), np.zeros(len(FEATURES))
    line = np.where(np.array(FEATURES) == "height", 6.0 * thin_above, 0.0)
    none = np.zeros((count, 1))
    network = SumOfCurves(none, none, none, line, np.array(-3.0 if thin_above else 1.5, np.float32))
    scaling = FeatureScaling(each - 9, each + 9, each, each + 1)
    return Style(StyleConfig(size), network, np.zeros(len(DEFORMATIONS)), scaling)
