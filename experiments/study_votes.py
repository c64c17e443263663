"""Answers of a perceptual study: what a page saves, whether it can be used, and what was voted.

A worker's vote is the first answer to a question; the repeated one only tells whether the worker is
reliable. (The paper does not say which of two that differ it counts.)"""

from __future__ import annotations

import json
import math
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from statistics import median
from typing import Any

from scipy.stats import beta
from study_plan import Comparison, Questionnaire, Study

FORMAT = "strokestyle study answers 1"
ANSWERS = ("x", "y", "neither", "both")  # as a page saves them
VOTES = ("ours", "other", "neither", "both")  # as they are counted
MAX_BYTES = 1 << 20  # of a file of answers; a real one has 3 kB
CONFIDENCE = 0.95


@dataclass(frozen=True)
class Answers:
    """What one worker answered.

    worker : a random word of the worker's browser
    first, again : {comparison: one of VOTES}, as asked first and when repeated
    seconds : that each question took, in their order
    """

    path: Path
    questionnaire: str
    worker: str
    simulated: bool
    first: dict[int, str]
    again: dict[int, str]
    seconds: tuple[float, ...]

    @property
    def uniform(self) -> bool:
        """Whether all votes are alike and for none of two: "both", say, pressed thirty times, is
        consistent."""
        votes = {*self.first.values(), *self.again.values()}
        return votes in ({"neither"}, {"both"})

    @property
    def inconsistent(self) -> int:
        """How many repeated answers differ from the first."""
        return sum(self.again[n] != vote for n, vote in self.first.items())


def seal(told: dict[str, Any], secret: str) -> str:
    """Sum up answers, so that a file that was changed by hand or by accident is noticed: FNV-1a,
    32 bits, as page.js does it. Who reads the page can make one: no proof against a forger."""
    words = [secret, told["study"], told["questionnaire"], told["worker"]]
    words += ["simulated" if told["simulated"] else "real"]
    for each in told["answers"]:
        tenths = math.floor(10 * each["seconds"] + 0.5)
        words.append(f"{each['question']}:{each['answer']}:{tenths}")
    total = 0x811C9DC5
    for byte in "|".join(words).encode("utf-8", "replace"):
        total = ((total ^ byte) * 0x01000193) & 0xFFFFFFFF
    return f"{total:08x}"


def read_answers(path: Path, study: Study) -> Answers:
    """Read a file that a page saved.

    Raises ValueError, with one line that names the file and what is wrong with it.
    """
    told = parsed(path)
    if told["study"] != study.name:
        raise ValueError(
            f"{path}: answers study {told['study'][:20]!a}, and this is {study.name!a}"
        )
    sheets = {sheet.name: sheet for sheet in study.questionnaires}
    if told["questionnaire"] not in sheets:
        name = told["questionnaire"][:20]
        raise ValueError(f"{path}: this study has no questionnaire {name!a}")
    sheet = sheets[told["questionnaire"]]
    check_order(path, told["answers"], sheet)
    if told["seal"] != seal(told, sheet.secret):
        raise ValueError(f"{path}: was changed after the page saved it: its seal does not fit")
    half = len(sheet.shown) // 2
    votes = [
        vote_of(each["answer"], shown.flipped)
        for each, shown in zip(told["answers"], sheet.shown, strict=True)
    ]
    asked = [shown.comparison for shown in sheet.shown]
    return Answers(
        path,
        sheet.name,
        told["worker"],
        told["simulated"],
        dict(zip(asked[:half], votes[:half], strict=True)),
        dict(zip(asked[half:], votes[half:], strict=True)),
        tuple(float(each["seconds"]) for each in told["answers"]),
    )


def vote_of(answer: str, flipped: bool) -> str:
    """Whom an answer is for; ours is X, or Y where `flipped`."""
    return VOTES[ANSWERS.index(answer) ^ flipped] if answer in ANSWERS[:2] else answer


def parsed(path: Path) -> dict[str, Any]:
    """Read a file of answers, of any study: the right names with values of the right kind."""
    try:
        data = path.read_bytes()
    except OSError as error:
        raise ValueError(f"{path}: cannot be read ({error.strerror})") from None
    if len(data) > MAX_BYTES:
        raise ValueError(f"{path}: has {len(data)} bytes, too many for a file of answers")
    try:
        told = json.loads(data.decode("utf-8-sig"))
    except (ValueError, RecursionError):
        raise ValueError(f"{path}: is not JSON; the page saves answers as .json") from None
    if not isinstance(told, dict) or told.get("format") != FORMAT:
        raise ValueError(f"{path}: is no file of answers, which says {FORMAT!r}")
    kinds = dict.fromkeys(("study", "questionnaire", "worker", "seal"), str)
    for name, kind in (kinds | {"simulated": bool, "answers": list}).items():
        if not isinstance(told.get(name), kind):
            raise ValueError(f"{path}: {name!r} is missing or is no {KIND_NAMES[kind]}")
    for n, each in enumerate(told["answers"], 1):
        if not isinstance(each, dict) or not isinstance(each.get("question"), str):
            raise ValueError(f"{path}: answer {n} names no question")
        if each.get("answer") not in ANSWERS:
            raise ValueError(f"{path}: is incomplete: answer {n} is none of {', '.join(ANSWERS)}")
        seconds = each.get("seconds")
        if type(seconds) not in (int, float) or not 0 <= seconds < 1e9:
            raise ValueError(f"{path}: answer {n} took no number of seconds")
    return told


KIND_NAMES = {str: "text", bool: "truth value", list: "list"}


def check_order(path: Path, answers: list[dict[str, Any]], sheet: Questionnaire) -> None:
    """Raise ValueError unless all questions are answered, in the order of the page."""
    asked, found = [s.token for s in sheet.shown], [each["question"] for each in answers]
    if missing := set(asked) - set(found):
        raise ValueError(
            f"{path}: is incomplete: {len(missing)} of {len(asked)} questions have no answer"
        )
    if found != asked:
        raise ValueError(
            f"{path}: was changed: its questions are not those of questionnaire {sheet.name}, "
            "in their order"
        )


@dataclass
class Sorted:
    """Files of answers, sorted.

    reliable : whose votes count, one for a questionnaire
    unreliable : with more inconsistent answers than the study's tolerance
    refused : a line for each file that cannot be used
    """

    reliable: list[Answers] = field(default_factory=list)
    unreliable: list[Answers] = field(default_factory=list)
    refused: list[str] = field(default_factory=list)

    @property
    def usable(self) -> list[Answers]:
        """All answers that could be read."""
        return self.reliable + self.unreliable


def sort_answers(study: Study, paths: Iterable[Path]) -> Sorted:
    """Read files of answers by their names' order.

    A worker counts once, a questionnaire as well: a further reliable worker's answers to it are
    refused, while those of an unreliable one leave it open to the next.
    """
    out = Sorted()
    workers: dict[str, Path] = {}
    sheets: dict[str, Path] = {}
    for path in sorted(set(paths)):
        try:
            read = read_answers(path, study)
            if read.worker in workers:
                raise ValueError(
                    f"{path}: is by the worker of {workers[read.worker]}, and each answers once"
                )
            reliable = read.inconsistent <= study.tolerance
            if reliable and read.questionnaire in sheets:
                raise ValueError(
                    f"{path}: questionnaire {read.questionnaire} was answered before, in "
                    f"{sheets[read.questionnaire]}"
                )
        except ValueError as error:
            out.refused.append(str(error))
            continue
        workers[read.worker] = path
        if reliable:
            sheets[read.questionnaire] = path
        (out.reliable if reliable else out.unreliable).append(read)
    return out


def cast(study: Study, reliable: Sequence[Answers]) -> list[tuple[Comparison, str]]:
    """All votes that count: the first answers of reliable workers."""
    return [(study.comparisons[n], vote) for each in reliable for n, vote in each.first.items()]


def interval(count: int, total: int, confidence: float = CONFIDENCE) -> tuple[float, float]:
    """The exact binomial interval of a share, by quantiles of the beta distribution (Clopper &
    Pearson, The use of confidence or fiducial limits, Biometrika 26, 1934): it holds the true share
    with at least that confidence, if votes are independent. Votes of one worker, and on one
    drawing, are a little alike, so that it is rather too narrow."""
    tail = (1 - confidence) / 2
    low = float(beta.ppf(tail, count, total - count + 1)) if count else 0.0
    high = float(beta.isf(tail, count + 1, total - count)) if count < total else 1.0
    return low, high


def share(count: int, total: int) -> dict[str, float | int | None]:
    """A count of a total, with its share and interval; None for those of nothing."""
    low, high = interval(count, total) if total else (None, None)
    return {"count": count, "share": count / total if total else None, "low": low, "high": high}


def tally(votes: Iterable[str]) -> dict[str, Any]:
    """Count votes: each kind of all, and ours of those that preferred one of the two."""
    counts = Counter(votes)
    total, decided = counts.total(), counts["ours"] + counts["other"]
    shares = {kind: share(counts[kind], total) for kind in VOTES}
    return {"votes": total} | shares | {"ours of decided": share(counts["ours"], decided)}


def results(study: Study, answers: Sorted) -> dict[str, Any]:
    """All that a study says so far, as --json prints it.

    Tallies are by the method that is compared with ours, and by style and method. `missing` lists
    comparisons that lack votes; `open` the pages that no reliable worker answered.
    """
    votes = cast(study, answers.reliable)
    styles = sorted({c.style for c in study.comparisons})
    counts = Counter(c for c, _ in votes)
    lack = {c: study.votes - counts[c] for c in study.comparisons if counts[c] < study.votes}
    answered = {each.questionnaire for each in answers.reliable}

    def of(other: str, style: str | None = None) -> dict[str, Any]:
        return tally(v for c, v in votes if c.other == other and style in (None, c.style))

    return {
        "study": study.name,
        "ours": study.ours,
        "workers": {
            "reliable": len(answers.reliable),
            "unreliable": len(answers.unreliable),
            "simulated": sum(each.simulated for each in answers.usable),
            "uniform": [str(each.path) for each in answers.reliable if each.uniform],
            "median seconds": median(s for each in answers.usable for s in each.seconds),
        },
        "against": {other: of(other) for other in study.others},
        "styles": {style: {other: of(other, style) for other in study.others} for style in styles},
        "missing": [
            {"style": c.style, "shape": c.shape, "other": c.other, "votes": n}
            for c, n in lack.items()
        ],
        "open": [sheet.page for sheet in study.questionnaires if sheet.name not in answered],
        "refused": answers.refused,
    }


def tables(study: Study, found: dict[str, Any]) -> str:
    """Write results as markdown."""
    workers = found["workers"]
    usable = workers["reliable"] + workers["unreliable"]
    lines = []
    if simulated := workers["simulated"]:
        who = "all workers are" if simulated == usable else f"{simulated} of {usable} workers are"
        lines += [f"**Simulated: {who} a program; no such person was asked.**", ""]
    lines += [
        f"{usable} workers, {workers['unreliable']} of them unreliable (more than "
        f"{study.tolerance} repeated answers that differ); {workers['median seconds']:.1f} s for a "
        "question, in the median.",
        "",
        f"| {study.ours} against | votes | ours | other | neither | both | ours of decided |",
        "| --- | --- | --- | --- | --- | --- | --- |",
    ]
    for other, row in found["against"].items():
        cells = [share_text(row[kind]) for kind in (*VOTES, "ours of decided")]
        lines.append(f"| {other} | {row['votes']} | " + " | ".join(cells) + " |")
    lines += [
        "",
        f"In brackets {CONFIDENCE:.0%} intervals (Clopper-Pearson). By style, votes for ours / "
        "other / neither / both:",
        "",
        "| style | " + " | ".join(study.others) + " |",
        "| --- |" + " --- |" * len(study.others),
    ]
    for style, row in found["styles"].items():
        cells = [" / ".join(str(row[o][kind]["count"]) for kind in VOTES) for o in study.others]
        lines.append(f"| {style} | " + " | ".join(cells) + " |")
    if uniform := workers["uniform"]:
        lines += ["", f"Neither or both throughout, yet counted: {', '.join(uniform)}."]
    return "\n".join([*lines, "", missing_text(study, found)])


def missing_text(study: Study, found: dict[str, Any]) -> str:
    """What still has to be asked, in words."""
    total = len(study.comparisons) * study.votes
    if not (missing := found["missing"]):
        return f"All {len(study.comparisons)} comparisons have {study.votes} votes or more."
    by_other = Counter[str]()
    for each in missing:
        by_other[each["other"]] += each["votes"]
    named = ", ".join(f"{other} {count}" for other, count in by_other.items())
    pages = ", ".join(found["open"][:6]) + (" ..." if len(found["open"]) > 6 else "")
    return (
        f"{by_other.total()} of {total} votes are missing, at {len(missing)} of "
        f"{len(study.comparisons)} comparisons ({named}). Pages for further workers: "
        f"{len(found['open'])} ({pages})."
    )


def share_text(found: dict[str, Any]) -> str:
    """A count, its share and interval, as a cell of a table."""
    if found["share"] is None:
        return "-"
    low, high = (f"{100 * found[end]:.0f}" for end in ("low", "high"))
    return f"{found['count']}: {found['share']:.0%} ({low}-{high})"
