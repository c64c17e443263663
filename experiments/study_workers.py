"""Workers that are programs: they answer a study as a known law says, to try its reading and to see
how many votes tell a preference. Their files say "simulated": true."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from study_plan import Questionnaire, Study
from study_votes import ANSWERS, FORMAT, VOTES, seal


@dataclass(frozen=True)
class Law:
    """How simulated workers answer.

    preference : {other method: the chance that an opinion that prefers one of two drawings prefers
        ours}; "" stands for all that are not named
    neither, both : the chances of these opinions
    noise : the chance that an answer is any of the four at random, not the worker's opinion
    careless : the chance of a worker all of whose answers are at random
    """

    preference: dict[str, float] = field(default_factory=lambda: {"": 0.5})
    neither: float = 0.0
    both: float = 0.0
    noise: float = 0.0
    careless: float = 0.0

    def __post_init__(self) -> None:
        chances = [*self.preference.values(), self.neither, self.both, self.noise, self.careless]
        if not all(0 <= chance <= 1 for chance in chances) or self.neither + self.both > 1:
            raise ValueError(
                "chances of simulated workers are from 0 to 1, neither and both together"
            )

    def opinions(self, other: str) -> list[float]:
        """The chances of VOTES."""
        decided = 1 - self.neither - self.both
        ours = self.preference.get(other, self.preference.get("", 0.5))
        return [decided * ours, decided * (1 - ours), self.neither, self.both]

    def shares(self, other: str) -> np.ndarray:
        """The shares of VOTES (4,) that careful workers' answers have in the long run."""
        return (1 - self.noise) * np.array(self.opinions(other)) + self.noise / len(VOTES)


def simulate(study: Study, sheet: Questionnaire, law: Law, seed: int) -> dict[str, Any]:
    """Answer a questionnaire, as its page would save it."""
    rng = np.random.default_rng([seed, int(study.name, 16), int(sheet.name)])
    noise = 1.0 if rng.random() < law.careless else law.noise
    opinion: dict[int, str] = {}
    answers = []
    for shown in sheet.shown:
        n = shown.comparison
        if n not in opinion:
            opinion[n] = VOTES[rng.choice(4, p=law.opinions(study.comparisons[n].other))]
        vote = VOTES[rng.integers(4)] if rng.random() < noise else opinion[n]
        seconds = round(float(rng.lognormal(1.6, 0.5)), 1)
        answers.append(
            {"question": shown.token, "answer": answer_of(vote, shown.flipped), "seconds": seconds}
        )
    told = {
        "format": FORMAT,
        "study": study.name,
        "questionnaire": sheet.name,
        "worker": rng.bytes(8).hex(),
        "simulated": True,
        "answers": answers,
    }
    return told | {"seal": seal(told, sheet.secret)}


def answer_of(vote: str, flipped: bool) -> str:
    """What a page saves for a vote; ours is X, or Y where `flipped`."""
    return ANSWERS[VOTES.index(vote) ^ flipped] if vote in VOTES[:2] else vote
