"""What a perceptual study asks of whom, after Liu et al. 2021, appendix 4.

A comparison is one test drawing of ours beside one of another method. Each is to be judged by a
number of workers; a worker gets one questionnaire: a number of comparisons, then the same ones once
more in another order, left and right changed over. key.json keeps which drawing stood where."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from itertools import chain, zip_longest
from pathlib import Path

import numpy as np

QUESTIONS = 15  # of a questionnaire, each asked twice; as published
VOTES = 3  # of reliable workers for each comparison; as published
KEY = "key.json"
FORMAT = "strokestyle study 1"


@dataclass(frozen=True)
class Comparison:
    """One question: a shape in a style, drawn by our method and by another."""

    style: str
    shape: str
    other: str


@dataclass(frozen=True)
class Shown:
    """A comparison as it stands in a questionnaire.

    token : what the page calls it; says nothing
    comparison : its number
    flipped : whether our drawing is Y, on the right
    """

    token: str
    comparison: int
    flipped: bool


@dataclass(frozen=True)
class Questionnaire:
    """What one worker is asked.

    name : in file names and answers
    secret : what the page seals answers with
    shown : in the order of the page; each comparison twice
    """

    name: str
    secret: str
    shown: tuple[Shown, ...]

    @property
    def page(self) -> str:
        """The name of its file."""
        return f"questionnaire-{self.name}.html"


@dataclass(frozen=True)
class Study:
    """A study as planned.

    name : that its pages and answers bear; other drawings, another name
    ours : the method that all others are compared with
    others : those methods
    votes : that each comparison is to get
    """

    name: str
    seed: int
    ours: str
    others: tuple[str, ...]
    votes: int
    comparisons: tuple[Comparison, ...]
    questionnaires: tuple[Questionnaire, ...]

    @property
    def tolerance(self) -> int:
        """How many repeated answers of a reliable worker may differ from the first: a third, 5 of
        15 as published."""
        return len(self.questionnaires[0].shown) // 6

    def key_text(self) -> str:
        """Write key.json, which stays with the researcher."""
        return json.dumps({"format": FORMAT} | asdict(self), indent=1) + "\n"


def load_study(folder: Path) -> Study:
    """Read key.json of a study's folder.

    Raises ValueError, OSError, naming the file, where it is none.
    """
    path = Path(folder) / KEY
    try:
        key = json.loads(path.read_text(encoding="utf-8"))
        if key.pop("format") != FORMAT:
            raise ValueError
        key["others"] = tuple(key["others"])
        key["comparisons"] = tuple(Comparison(**each) for each in key["comparisons"])
        key["questionnaires"] = tuple(
            Questionnaire(each["name"], each["secret"], tuple(Shown(**s) for s in each["shown"]))
            for each in key["questionnaires"]
        )
        study = Study(**key)
        asked = {shown.comparison for sheet in study.questionnaires for shown in sheet.shown}
        if not asked <= set(range(len(study.comparisons))) or not asked:
            raise ValueError
        return study
    except FileNotFoundError:
        raise ValueError(
            f"{path}: there is no such file; STUDY is a folder that make wrote"
        ) from None
    except (ValueError, TypeError, KeyError, AttributeError, RecursionError):
        raise ValueError(f"{path}: is no key of a study, as make writes it") from None


def plan_study(
    name: str,
    ours: str,
    others: Sequence[str],
    comparisons: Sequence[Comparison],
    votes: int = VOTES,
    questions: int = QUESTIONS,
    seed: int = 0,
) -> Study:
    """Deal comparisons to as few questionnaires as give each its votes.

    name : hexadecimal digits; with `seed`, all that chance depends on

    Where the votes fill no whole number of questionnaires, some comparisons get one more. Raises
    ValueError where there are fewer comparisons than a questionnaire asks.
    """
    if len(comparisons) < questions:
        raise ValueError(
            f"{len(comparisons)} comparisons are too few for questionnaires of {questions}: "
            f"add styles, shapes or methods, or ask fewer (--questions {len(comparisons)})"
        )
    rng = np.random.default_rng([seed, int(name, 16)])
    hands = deal(comparisons, votes, questions, rng)
    sheets = tuple(
        Questionnaire(f"{n:03d}", token(rng), tuple(twice(hand, rng)))
        for n, hand in enumerate(hands, 1)
    )
    return Study(name, seed, ours, tuple(others), votes, tuple(comparisons), sheets)


def deal(
    comparisons: Sequence[Comparison], votes: int, questions: int, rng: np.random.Generator
) -> list[list[int]]:
    """Split `votes` times all comparisons into hands of `questions` different ones.

    A hand takes the next ones of a queue that it does not hold yet. As there are at least as many
    comparisons as a hand holds, none is left behind.
    """
    rounds = [spread(comparisons, rng) for _ in range(votes + 1)]  # the last one fills up
    queue, hands = list(chain(*rounds)), []
    for _ in range(-(-votes * len(comparisons) // questions)):
        hand: list[int] = []
        left: list[int] = []
        for n in queue:
            (left if n in hand or len(hand) == questions else hand).append(n)
        hands.append(hand)
        queue = left
    return hands


def spread(comparisons: Sequence[Comparison], rng: np.random.Generator) -> list[int]:
    """Order all comparisons at random so that those near one another differ in style and method."""
    styles = shuffled({c.style for c in comparisons}, rng)
    others = shuffled({c.other for c in comparisons}, rng)
    columns = []
    for s, style in enumerate(styles):
        of_style = shuffled((n for n, c in enumerate(comparisons) if c.style == style), rng)
        ranks: Counter[str] = Counter()
        places = {}
        for n in of_style:  # methods in turn, another first in the next style
            other = comparisons[n].other
            places[n] = (ranks[other], (others.index(other) - s) % len(others))
            ranks[other] += 1
        columns.append(sorted(of_style, key=places.__getitem__))
    return [n for row in zip_longest(*columns) for n in row if n is not None]


def twice(hand: Sequence[int], rng: np.random.Generator) -> list[Shown]:
    """Put comparisons in random order, left or right at random; then all again in another order,
    changed over. None comes twice in a row."""
    first, again = shuffled(hand, rng), shuffled(hand, rng)
    while len(hand) > 1 and (again[0] == first[-1] or again == first):
        again = shuffled(hand, rng)
    flipped = {n: bool(rng.integers(2)) for n in sorted(hand)}
    return [Shown(token(rng), n, flipped[n]) for n in first] + [
        Shown(token(rng), n, not flipped[n]) for n in again
    ]


def shuffled(items, rng: np.random.Generator) -> list:
    """The items, in an order that chance alone decides."""
    items = sorted(items)
    return [items[i] for i in rng.permutation(len(items))]


def token(rng: np.random.Generator) -> str:
    """A word that says nothing."""
    return rng.bytes(5).hex()
