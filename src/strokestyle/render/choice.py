"""Which of a view's lines a style draws: learned from those that an artist drew and left out.

An exemplar has a few dozen lines, which is little to learn from: a law that could be anything would
be what chance made of them. So laws come from a short list, such as "no valleys shorter than 60
px" or "nothing that faces away from a light at the upper left", and each is believed as far as it
explains what was drawn, and as it is simple: Bayesian model averaging (Hoeting et al. 1999), with
the marginal likelihood of a beta-binomial on either side of a law. Where nothing was left out, the
law that draws all lines explains that best.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict, dataclass, replace
from typing import NamedTuple

import numpy as np

from ..extract.view import View
from ..geometry.curves import arc_length, owner, runs
from ..geometry.kinds import KIND_TABLE, KINDS
from ..geometry.near import near_pairs
from .features import along_strokes, surface_at

AZIMUTHS = 24  # of the lights that a law may have
TILTS = (0.0, 0.7)  # how far these stand towards the eye, of a unit beside 1 across the picture
# What a law may ask of a point, and how likely beforehand it is to draw where that is more, or less
FAMILIES = {
    "length": (3.0, 0.3),
    "strength": (3.0, 0.3),
    "line_strength": (3.0, 0.3),
    "height": (1.0, 1.0),
    "across": (1.0, 1.0),
    "depth": (1.0, 1.5),
    "n_dot_v": (0.7, 0.7),
    "crowd": (0.3, 1.0),
    "step": (1.0, 0.2),
    "light": (3.0, 0.0),
}
COLUMNS = (
    *(name for name in FAMILIES if name != "light"),
    *(f"light_{tilt:g}_{k}" for tilt in TILTS for k in range(AZIMUTHS)),
)
NORMAL_SIGMA = 6.0  # px along a line, Gaussian of what is read off the surface
SIDE = 4.0  # px across a line, where the depth to both sides is read
CROWD_RADIUS = 24.0  # px within which other lines are a crowd
DEPTH_RANGE = (3, 97)  # percentiles of the lines' depth that count as 0 and 1
UNIT = 30.0  # px of line that say as much as one independent observation
ALIKE = 0.5  # a line n units long says as much as n to the power of 1 - ALIKE independent ones
THRESHOLDS = 32  # of a column that are tried, at most
DRAWN, LEFT_OUT = (12.0, 0.4), (0.4, 6.0)  # beta priors of a point's being drawn, by a law's side
# Logarithms of how likely laws are beforehand, beside the one that all is drawn
SOME_KINDS, ONE_THRESHOLD, SECOND = -2.5, -3.0, -1.5
NEAR_BELOW = 0.25  # see _Ranked.limits
SINGLES, KEPT = 48, 96  # the best laws that are paired, and that are kept
LEAST_LEFT = 0.02  # of the length of a view: of less nobody makes a drawing
EVEN = 0.5  # a point that is likelier drawn than this is drawn
MIN_RUN = 12.0  # px; a line is not interrupted, nor taken up, for less
ALL_DRAWN = 0.985  # share of the lines' length above which nothing is said to be left out


@dataclass(frozen=True)
class Laws:
    """Laws of which lines to draw, and how far each is believed.

    A law holds at a point of a line where both of its conditions do. A condition holds outside of
    its kinds of line, and inside where `sign` times a column is `limit` at least.

    Parameters
    ----------
    kinds : (L, 2, K) bool, of which of KINDS each condition speaks
    column : (L, 2) int, index into COLUMNS
    sign, limit : (L, 2) float64; limit inf: never, -inf: always
    weight : (L,) float64, how far each law is believed; their sum is 1
    drawn : (L, 2) float64, how likely a point is drawn where the law does not hold, and where
    """

    kinds: np.ndarray
    column: np.ndarray
    sign: np.ndarray
    limit: np.ndarray
    weight: np.ndarray
    drawn: np.ndarray

    def likely(self, kind: np.ndarray, columns: np.ndarray) -> np.ndarray:
        """Tell how likely points of lines of `kind` (N,) are drawn, (N,); columns are (N, P)."""
        out = np.zeros(len(kind))
        for law, (weight, drawn) in enumerate(zip(self.weight, self.drawn, strict=True)):
            one, two = (
                _holds(kinds, columns[:, column], sign, limit, kind)
                for kinds, column, sign, limit in zip(
                    self.kinds[law], self.column[law], self.sign[law], self.limit[law], strict=True
                )
            )
            out += weight * drawn[(one & two).astype(int)]
        return out


@dataclass(frozen=True)
class LineChoice:
    """Which lines an artist chooses.

    Parameters
    ----------
    required : laws of the lines of a view that are drawn unless an artist leaves them out; None
        where none is left out
    optional : laws of those that are not drawn unless an artist does; None where none is drawn
    seen : (K,) bool, which of KINDS the exemplar had
    """

    required: Laws | None
    optional: Laws | None
    seen: np.ndarray

    def state(self) -> dict:
        """Give all of it as nested dicts of arrays, for the model file."""
        return asdict(self)

    @classmethod
    def from_state(cls, state: dict) -> LineChoice:
        """Make a choice of what `state` gave. Raises KeyError or TypeError on anything else."""
        laws = (state["required"], state["optional"])
        required, optional = (None if one is None else Laws(**one) for one in laws)
        return cls(required, optional, state["seen"])


def _holds(
    kinds: np.ndarray, column: np.ndarray, sign: float, limit: float, kind: np.ndarray
) -> np.ndarray:
    return ~kinds[kind] | (sign * column >= limit)


class _Conditions(NamedTuple):
    """Conditions (L,) that laws may have; the first always holds.

    Parameters
    ----------
    kinds, column, sign, limit : as in `Laws`, of one condition
    prior : (L,) logarithm of how likely each is beforehand
    family : (L,) str, two of one family make no law
    mass : (L, 2), `_Seen.mass` of the points where each holds
    """

    kinds: np.ndarray
    column: np.ndarray
    sign: np.ndarray
    limit: np.ndarray
    prior: np.ndarray
    family: np.ndarray
    mass: np.ndarray

    def of(self, rows: np.ndarray) -> Iterator[tuple[np.ndarray, int, float, float]]:
        """Give kinds, column, sign and limit of some."""
        fields = (self.kinds, self.column, self.sign, self.limit)
        return zip(*(field[rows] for field in fields), strict=True)


class _Seen(NamedTuple):
    """Points (N,) of lines of an exemplar, and which of them were drawn.

    Parameters
    ----------
    kind : (N,) int, of their lines
    columns : (N, P)
    drawn : (N,) bool
    weight : (N,) of the points, in independent observations
    """

    kind: np.ndarray
    columns: np.ndarray
    drawn: np.ndarray
    weight: np.ndarray

    @property
    def mass(self) -> np.ndarray:
        """The weight of each point as one that was drawn, and as one that was not, (N, 2)."""
        return self.weight[:, None] * np.stack([self.drawn, ~self.drawn], axis=1)

    def of(self, rows: np.ndarray) -> _Seen:
        return _Seen(self.kind[rows], self.columns[rows], self.drawn[rows], self.weight[rows])


# ---------------------------------------------------------------------------------------- columns


def line_columns(view: View, scale: float = 1.0) -> np.ndarray:
    """COLUMNS at every point of a view's curves, (N, P) float64.

    `scale` is how many px of the view one of the style's canvas is.
    """
    curves, count = view.curves, len(view.curves.xy)
    if not count:
        return np.zeros((0, len(COLUMNS)))
    line, spacing = owner(curves.offsets), _spacing(view) / scale
    surface = along_strokes(surface_at(view, spacing), curves.offsets, NORMAL_SIGMA, spacing)
    depth, n_dot_v, normal = surface[:, 0], surface[:, 1], surface[:, 3:]
    n_dot_v = n_dot_v * view.maps.scale_of("n_dot_v")
    strength = np.ones(count) if view.strength is None else view.strength
    strength = along_strokes(strength, curves.offsets, NORMAL_SIGMA, spacing)
    low, high = np.percentile(depth, DEPTH_RANGE)
    extent = np.ptp(curves.xy, axis=0)
    place = (curves.xy - curves.xy.min(axis=0)) / np.maximum(extent, 1e-6)
    named = {
        "length": np.log(np.maximum(curves.lengths() / scale, 1.0))[line],
        "strength": strength,
        "line_strength": np.maximum.reduceat(strength, curves.offsets[:-1])[line],
        "height": 1.0 - place[:, 1],
        "across": place[:, 0],
        "depth": np.clip((depth - low) / max(high - low, 1e-6), 0.0, 1.0),
        "n_dot_v": n_dot_v,
        "crowd": _crowd(view, scale),
        "step": _step(view, max(high - low, 1e-6), scale),
    }
    lights = [_lit(normal, n_dot_v, tilt) for tilt in TILTS]
    return np.concatenate([np.stack(list(named.values()), axis=1), *lights], axis=1)


def _spacing(view: View) -> float:
    """The distance between the points of a view's curves, px."""
    lengths, steps = view.curves.lengths().sum(), len(view.curves.xy) - len(view.curves)
    return max(float(lengths) / max(steps, 1), 1e-3)


def _lit(normal: np.ndarray, n_dot_v: np.ndarray, tilt: float) -> np.ndarray:
    """How far normals (N, 2), (N,) face lights at AZIMUTHS, (N, AZIMUTHS) in -1..1."""
    angle = 2.0 * np.pi * np.arange(AZIMUTHS) / AZIMUTHS
    toward = normal @ np.stack([np.cos(angle), np.sin(angle)]) + tilt * n_dot_v[:, None]
    size = np.sqrt((normal**2).sum(axis=1) + n_dot_v**2)
    return toward / np.maximum(size, 1e-3)[:, None] / np.hypot(1.0, tilt)


def _crowd(view: View, scale: float) -> np.ndarray:
    """How many radii of other lines lie within CROWD_RADIUS of each point, (N,)."""
    xy, line = view.curves.xy / scale, owner(view.curves.offsets)
    pairs = near_pairs(xy, CROWD_RADIUS)
    pairs = pairs[line[pairs[:, 0]] != line[pairs[:, 1]]]
    near = np.bincount(pairs.ravel(), minlength=len(xy))
    return near * (_spacing(view) / scale / CROWD_RADIUS)


def _step(view: View, extent: float, scale: float) -> np.ndarray:
    """How far the depth jumps across each line, of `extent` in 0..1; 1 at the shape's own rim."""
    curves, covered = view.curves, view.maps.covered
    step = np.gradient(curves.xy, axis=0)
    step /= np.maximum(np.hypot(*step.T), 1e-9)[:, None]
    across = np.stack([-step[:, 1], step[:, 0]], axis=1) * SIDE * scale
    sides = []
    for way in (-1.0, 1.0):
        x, y = (curves.xy + way * across).T
        column = np.clip(np.floor(x), 0, covered.shape[1] - 1).astype(int)
        row = np.clip(np.floor(y), 0, covered.shape[0] - 1).astype(int)
        sides.append((view.maps["depth"][row, column], covered[row, column]))
    (one, here), (two, there) = sides
    jump = np.clip(np.abs(one.astype(np.float64) - two) / extent, 0.0, 1.0)
    jump = np.where(here != there, 1.0, np.where(here, jump, 0.0))
    return along_strokes(jump, curves.offsets, NORMAL_SIGMA, _spacing(view) / scale)


# ------------------------------------------------------------------------------------- learn them


def learn_choice(view: View, drawn: np.ndarray, scale: float = 1.0) -> LineChoice | None:
    """Learn which lines to draw from which points of a view's curves were drawn, (N,) bool.

    None where those are just the lines that anyone would draw, or where nothing was.

    `scale` is how many px of the view one of the style's canvas is.
    """
    if not drawn.any():
        return None
    line = owner(view.curves.offsets)
    kind = view.curves.kind[line]
    optional = ~view.required
    units = np.maximum(view.curves.lengths() / scale / UNIT, 1.0)
    weight = _spacing(view) / scale / UNIT / units[line] ** ALIKE
    seen = _Seen(kind, line_columns(view, scale), drawn, weight)
    left_out, taken_up = ~drawn & ~optional, drawn & optional
    required, more = None, None
    if left_out.sum() > (1.0 - ALL_DRAWN) * (~optional).sum():
        required = _unless_idle(_learn_laws(seen.of(~optional), True), seen.of(~optional), True)
    if taken_up.sum() > (1.0 - ALL_DRAWN) * (~optional).sum():
        more = _unless_idle(_learn_laws(seen.of(optional), False), seen.of(optional), False)
    if required is None and more is None:
        return None
    return LineChoice(required, more, np.isin(np.arange(len(KINDS)), kind))


def _learn_laws(seen: _Seen, draws_all: bool) -> Laws:
    """Find the laws that explain best what was drawn.

    Where nothing speaks for another, it is the law that `draws_all`, or else that draws none.
    """
    among = _conditions(seen, draws_all)
    value = among.prior + _evidence(among.mass, seen)
    best = _descending(value)[:SINGLES]
    holds = np.stack([_holds_at(seen, *condition) for condition in among.of(best)])
    one, two = np.triu_indices(len(best), 1)
    unlike = among.family[best[one]] != among.family[best[two]]
    one, two = one[unlike], two[unlike]
    both = np.stack([((holds * mass) @ holds.T)[one, two] for mass in seen.mass.T], axis=1)
    together = among.prior[best[one]] + among.prior[best[two]] + SECOND + _evidence(both, seen)
    laws = np.concatenate(
        [np.stack([best, np.zeros_like(best)], axis=1), np.stack([best[one], best[two]], axis=1)]
    )
    value = np.r_[value[best], together]
    order = _descending(value)[:KEPT]
    laws, belief = laws[order], np.exp(value[order] - value[order[0]])
    names = ("kinds", "column", "sign", "limit")
    conditions = {name: getattr(among, name)[laws] for name in names}
    drawn = _share_drawn(np.concatenate([among.mass[best], both])[order], seen)
    return Laws(**conditions, weight=belief / belief.sum(), drawn=drawn)


def _descending(value: np.ndarray) -> np.ndarray:
    """Order (L,) from the largest on; what differs by how it was summed counts as equal."""
    return np.argsort(-np.round(value, 9), kind="stable")


def _unless_idle(laws: Laws, seen: _Seen, draws_all: bool) -> Laws | None:
    """Drop laws that all in all draw the exemplar's lines as if there were none."""
    likely = laws.likely(seen.kind, seen.columns)
    return None if ((likely > EVEN) == draws_all).all() else laws


def _evidence(mass: np.ndarray, seen: _Seen) -> np.ndarray:
    """Logarithm of the marginal likelihood of laws, (L,), of the `_Seen.mass` where each holds."""
    from scipy.special import betaln  # takes .05 s to import, and only those who learn ask for it

    total = np.zeros(len(mass))
    for side, (a, b) in ((mass, DRAWN), (_rest(mass, seen), LEFT_OUT)):
        yes, no = side.T
        total += betaln(a + yes, b + no) - betaln(a, b)
    return total


def _share_drawn(mass: np.ndarray, seen: _Seen) -> np.ndarray:
    """Tell how likely a point is drawn where laws do not hold, and where they do, (L, 2).

    `mass` (L, 2) is the `_Seen.mass` where each holds.
    """
    likely = []
    for side, (a, b) in ((_rest(mass, seen), LEFT_OUT), (mass, DRAWN)):
        yes, no = side.T
        likely.append((yes + a) / (yes + no + a + b))
    return np.stack(likely, axis=1)


def _rest(mass: np.ndarray, seen: _Seen) -> np.ndarray:
    """The mass of the other points."""
    return np.maximum(seen.mass.sum(axis=0) - mass, 0.0)


def _holds_at(seen: _Seen, kinds: np.ndarray, column: int, sign: float, limit: float) -> np.ndarray:
    return _holds(kinds, seen.columns[:, column], sign, limit, seen.kind)


def _conditions(seen: _Seen, draws_all: bool) -> _Conditions:
    """List the conditions that laws may have, of an exemplar's lines."""
    none, everything = np.zeros(len(KINDS), bool), np.ones(len(KINDS), bool)
    always, never = (0.0, SOME_KINDS) if draws_all else (SOME_KINDS, 0.0)
    rows = [(none, 0, 1.0, -np.inf, always, ""), (everything, 0, 1.0, np.inf, never, "")]
    kinds_seen = np.unique(seen.kind)
    for kinds, share in _kinds_left_out(kinds_seen, draws_all):
        rows.append((kinds, 0, 1.0, np.inf, SOME_KINDS + np.log(share), "kind"))
    masses = [_holds_at(seen, *row[:4]) @ seen.mass for row in rows]
    chances = sum(sum(pair) for pair in FAMILIES.values())
    for kinds, share in [(everything, 0.5), *_groups(kinds_seen)]:
        ranked = _Ranked.of(seen, kinds)
        for i, name in enumerate(COLUMNS):
            family = name.split("_")[0] if name.startswith("light") else name
            alike = AZIMUTHS * len(TILTS) if family == "light" else 1
            for sign, chance in zip((1.0, -1.0), FAMILIES[family], strict=True):
                limits = ranked.limits(i, sign)
                if not chance or not len(limits):
                    continue
                prior = ONE_THRESHOLD + np.log(chance / chances * share / alike)
                each = [prior - np.log(len(limits))] * len(limits)
                if family == "light":  # what faces it is lit, what faces away lies in shadow
                    limits, each = np.r_[0.0, limits], [prior, *each]
                rows += [(kinds, i, sign, t, p, family) for t, p in zip(limits, each, strict=True)]
                masses.append(ranked.mass_from(i, sign, limits))
    return _Conditions(*[*map(np.array, zip(*rows, strict=True)), np.vstack(masses)])


class _Ranked(NamedTuple):
    """Points (M,) of some kinds of line in the order of each column.

    Parameters
    ----------
    values : (P, M), of the columns, ascending
    below : (P, M + 1, 2), `_Seen.mass` of the points before each
    outside : (2,), that of the lines of other kinds
    """

    values: np.ndarray
    below: np.ndarray
    outside: np.ndarray

    @classmethod
    def of(cls, seen: _Seen, kinds: np.ndarray) -> _Ranked:
        inside = kinds[seen.kind]
        columns = np.ascontiguousarray(seen.columns[inside].T)
        order = np.argsort(columns, axis=1)
        mass = seen.mass[inside]
        below = np.zeros((len(columns), len(mass) + 1, 2))
        np.cumsum(mass[order], axis=1, out=below[:, 1:])
        values = np.take_along_axis(columns, order, 1)
        return cls(values, below, seen.mass[~inside].sum(axis=0))

    def mass_from(self, column: int, sign: float, limits: np.ndarray) -> np.ndarray:
        """The mass (L, 2) of the points where `sign` times a column is one of `limits` at least."""
        values, below = self.values[column], self.below[column]
        if sign > 0:
            mass = below[-1] - below[np.searchsorted(values, limits, "left")]
        else:
            mass = below[np.searchsorted(values, -limits, "right")]
        return self.outside + mass

    def limits(self, column: int, sign: float) -> np.ndarray:
        """Choose THRESHOLDS numbers at most between those found, with as many points between each.

        A law leaves out what is like that which it leaves out of the exemplar, and draws what lies
        between: limits are NEAR_BELOW of the way to the next number.
        """
        values = self.values[column]
        values = values if sign > 0 else -values[::-1]
        found = _distinct(np.round(values, 6))
        if len(found) <= THRESHOLDS + 1:
            return found[:-1] + NEAR_BELOW * np.diff(found)
        place = (np.arange(THRESHOLDS) + 0.5) / THRESHOLDS * (len(values) - 1)
        return _distinct(np.interp(place, np.arange(len(values)), values))


def _distinct(ascending: np.ndarray) -> np.ndarray:
    return ascending[np.r_[True, np.diff(ascending) > 0]] if len(ascending) else ascending


def _named(*names: str) -> np.ndarray:
    return np.isin(KINDS, names)


def _kinds_left_out(seen: np.ndarray, draws_all: bool) -> list[tuple[np.ndarray, float]]:
    """Sets of kinds that may be left out as such, and how likely each is beforehand.

    Who draws contours only is taken to mean it, so that kinds he had none of go too; and so do
    optional lines of kinds that he had none of.
    """
    if not draws_all:
        return [(~_named(KINDS[k]), 1.0 / len(seen)) for k in seen]
    prominence = np.array([kind.prominence for kind in KIND_TABLE])
    soft = np.array([kind.soft for kind in KIND_TABLE])
    sets = [(prominence < 1.0, 0.5), (soft, 0.2)]
    singles = [_named(KINDS[k]) for k in seen]
    return [*sets, *((one, 0.3 / len(singles)) for one in singles)]


def _groups(seen: np.ndarray) -> list[tuple[np.ndarray, float]]:
    """Sets of kinds that a law may speak of apart from others, and how likely each is."""
    prominence = np.array([kind.prominence for kind in KIND_TABLE])
    soft = np.array([kind.soft for kind in KIND_TABLE])
    sets = [soft, prominence < 1.0, *(_named(KINDS[k]) for k in seen)]
    unlike: list[np.ndarray] = []
    for one in sets:  # sets that speak of the same lines of the exemplar are one
        if one[seen].any() and not one[seen].all():
            unlike.append(one)
    return [(one, 0.5 / len(unlike)) for one in unlike]


# -------------------------------------------------------------------------------------- apply them


def choose_lines(view: View, choice: LineChoice | None, scale: float = 1.0) -> View:
    """Leave out of a view the lines, and parts of lines, that a style does not draw.

    Without a choice only optional lines go. Where no surface is seen behind the lines, as where a
    drawing is drawn anew, and where hardly anything would be left, all are drawn.

    `scale` is how many px of the view one of the style's canvas is.
    """
    return replace(view.only(drawn_points(view, choice, scale)), optional=None)


def drawn_points(view: View, choice: LineChoice | None, scale: float = 1.0) -> np.ndarray:
    """Tell which points of a view's curves `choose_lines` keeps, (N,) bool."""
    if choice is not None and len(view.curves) and view.maps.covered.any():
        drawn = chosen_points(view, choice, scale)
        if not _hardly_any(drawn):
            return drawn
    return view.required


def leaves_nothing(view: View, choice: LineChoice | None, scale: float = 1.0) -> bool:
    """Tell whether a style's laws leave hardly a line of a view, so that all are drawn.

    `scale` is as in `choose_lines`.
    """
    if choice is None or not len(view.curves) or not view.maps.covered.any():
        return False
    return _hardly_any(chosen_points(view, choice, scale))


def _hardly_any(drawn: np.ndarray) -> bool:
    """Whether so few points are drawn (N,) bool that the laws cannot be meant for such a view."""
    return bool(drawn.mean() < LEAST_LEFT)


def unknown_kinds(view: View, left: View, choice: LineChoice | None) -> list[str]:
    """Name the kinds of line left out of a view as such, and of which the exemplar had none."""
    gone = np.setdiff1d(view.curves.kind, left.curves.kind)
    return [KINDS[k] for k in gone if k in never_drawn(choice)]


def never_drawn(choice: LineChoice | None) -> list[int]:
    """List the kinds of line left out as such because the exemplar had none, as KINDS' places."""
    if choice is None or choice.required is None:
        return []
    laws = choice.required
    as_such = laws.weight @ (laws.kinds & np.isposinf(laws.limit)[..., None]).any(axis=1)
    return np.flatnonzero((as_such > EVEN) & ~choice.seen).tolist()


def chosen_points(view: View, choice: LineChoice, scale: float = 1.0) -> np.ndarray:
    """Tell which points of a view's curves a style draws, (N,) bool."""
    line = owner(view.curves.offsets)
    kind, columns = view.curves.kind[line], line_columns(view, scale)
    optional, drawn = ~view.required, view.required
    for laws, rows in ((choice.required, ~optional), (choice.optional, optional)):
        if laws is not None:
            drawn[rows] = laws.likely(kind[rows], columns[rows]) > EVEN
    along = arc_length(view.curves.xy, view.curves.offsets)
    for state in (False, True):
        drawn = without_short_runs(drawn, line, along, state, MIN_RUN * scale)
    return drawn


def without_short_runs(
    drawn: np.ndarray, line: np.ndarray, along: np.ndarray, state: bool, least: float
) -> np.ndarray:
    """Turn over runs of `state` in `drawn` (N,) under `least` px, but for whole lines."""
    start = runs(drawn, line)
    first, last = start[:-1], start[1:] - 1
    whole = (line[np.maximum(first - 1, 0)] != line[first]) | (first == 0)
    whole &= (line[np.minimum(last + 1, len(line) - 1)] != line[last]) | (last == len(line) - 1)
    turn = (drawn[first] == state) & (along[last] - along[first] < least) & ~whole
    return drawn ^ np.repeat(turn, np.diff(start))
