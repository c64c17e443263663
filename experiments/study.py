"""A perceptual study of drawings, as the paper made one (Liu et al. 2021, sec. 5, appendix 4).

    python experiments/study.py make OUT DATA --ours M --others A,B,artist -o STUDY
    python experiments/study.py read STUDY ANSWERS.json [ANSWERS.json ...] [--json]
    python experiments/study.py simulate STUDY -o ANSWERS --preference 0.8 [--noise 0.1]

`make` writes questionnaires, each an HTML file of its own for one worker, and key.json, which tells
what stood where and stays with the researcher. Drawings are OUT/<method>/<style>/<shape>.png;
`artist` names the data set's own. A worker is shown a drawing in the style (A), the plain curves of
another shape (B) and two drawings of that (X, Y), ours and another's: which best mimics the style
of A? The answers are X, Y, neither or both; 15 questions, then the same again with X and Y changed
over. At the end the page saves a file, which the worker sends back.

`read` checks such files and counts votes. A worker of whose 15 repeated answers more than 5 differ
from the first is unreliable, and is not counted. A vote is the first answer; the repeated one only
tests the worker. `simulate` answers all questionnaires by a known law; such answers say that they
are simulated, and are not read together with people's."""

from __future__ import annotations

import argparse
import json
import shutil
import sys
import tempfile
from pathlib import Path

from dataset import DataSet, described_train
from study_page import comparisons, gather, questionnaire_page
from study_plan import KEY, QUESTIONS, VOTES, load_study, plan_study
from study_votes import results, sort_answers, tables
from study_workers import Law, simulate

from strokestyle.svg.write import write_text


def make(args: argparse.Namespace) -> None:
    """Write the questionnaires and the key of a study."""
    others = args.others.split(",")
    if args.ours in others or len(set(others)) < len(others) or "" in others:
        raise ValueError(f"--others {args.others}: names methods once each, ours not among them")
    if args.output.exists() and any(args.output.iterdir()):
        raise ValueError(f"{args.output}: is not empty; a new study needs a folder of its own")
    styles = args.styles.split(",") if args.styles else []
    data = DataSet(args.data, args.train or described_train(args.data))
    pictures = gather(args.out, data, [args.ours, *others], styles)
    asked = comparisons(pictures, args.ours, others)
    study = plan_study(
        pictures.digest(), args.ours, others, asked, args.votes, args.questions, args.seed
    )
    args.output.parent.mkdir(parents=True, exist_ok=True)
    folder = Path(tempfile.mkdtemp(prefix=f".{args.output.name}-", dir=args.output.parent))
    try:
        for sheet in study.questionnaires:
            page = questionnaire_page(study, sheet, pictures, args.send_to)
            write_text(folder / sheet.page, page)
        write_text(folder / KEY, study.key_text())
        folder.chmod(0o755)
        if args.output.exists():
            args.output.rmdir()  # empty; not every system replaces it
        folder.replace(args.output)
    except BaseException:
        shutil.rmtree(folder)
        raise
    print(
        f"{args.output}: study {study.name}, {len(asked)} comparisons, "
        f"{len(study.questionnaires)} questionnaires of 2 x {args.questions} questions; "
        f"{KEY} stays with you"
    )


def read(args: argparse.Namespace) -> None:
    """Print what was voted."""
    study = load_study(args.study)
    answers = sort_answers(study, files(args.answers))
    for line in answers.refused:
        print(line, file=sys.stderr)
    if not answers.usable:
        raise ValueError(f"{args.study}: no file of answers can be used")
    if len({each.simulated for each in answers.usable}) > 1 and not args.mix_simulated:
        raise ValueError(
            f"{args.study}: answers of people and simulated ones are mixed; read them apart, or "
            "with --mix-simulated"
        )
    found = results(study, answers)
    print(json.dumps(found, indent=1) if args.json else tables(study, found))


def files(names: list[Path]) -> list[Path]:
    """The files named, and all .json files of folders named."""
    return [path for name in names for path in (name.glob("*.json") if name.is_dir() else [name])]


def simulate_all(args: argparse.Namespace) -> None:
    """Write a simulated worker's answers to each questionnaire."""
    study = load_study(args.study)
    neither, both = args.undecided
    law = Law(args.preference, neither, both, args.noise, args.careless)
    if unknown := sorted(set(args.preference) - {"", *study.others}):
        raise ValueError(f"{args.study}: nothing is compared with {unknown[0]}")
    args.output.mkdir(parents=True, exist_ok=True)
    for sheet in study.questionnaires:
        told = simulate(study, sheet, law, args.seed)
        write_text(args.output / f"simulated-{sheet.name}.json", json.dumps(told) + "\n")
    print(f"{args.output}: simulated answers of {len(study.questionnaires)} workers")


def preference(text: str) -> dict[str, float]:
    """Read "0.8" or "nst=0.9,artist=0.5"."""
    pairs = [part.rpartition("=") for part in text.split(",")]
    return {name: float(chance) for name, _, chance in pairs}


def pair(text: str) -> tuple[float, float]:
    """Read two numbers with a comma between."""
    first, second = map(float, text.split(","))
    return first, second


def positive(text: str) -> int:
    """Read a whole number of 1 or more."""
    if int(text) < 1:
        raise ValueError
    return int(text)


def parser() -> argparse.ArgumentParser:
    """What the command line understands."""
    out = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    commands = out.add_subparsers(required=True, metavar="make | read | simulate")
    one = commands.add_parser("make", help="write questionnaires")
    one.add_argument("out", type=Path, help="drawings, <method>/<style>/<shape>.png")
    one.add_argument("data", type=Path, help="the data set that they were made from")
    one.add_argument("--ours", required=True, help="the method that all others are compared with")
    one.add_argument("--others", required=True, help="comma-separated; artist = the data set's own")
    one.add_argument("-o", "--output", type=Path, required=True, help="a new folder")
    one.add_argument("--train", help="the shape that styles were learned from")
    one.add_argument("--styles", help="comma-separated; all by default")
    one.add_argument("--votes", type=positive, default=VOTES, help="for each comparison")
    one.add_argument("--questions", type=positive, default=QUESTIONS, help="of a questionnaire")
    one.add_argument("--send-to", help="whom workers send their answers to, in words")
    one.add_argument("--seed", type=int, default=0)
    one.set_defaults(run=make)
    two = commands.add_parser("read", help="check answers and count votes")
    two.add_argument("study", type=Path)
    two.add_argument("answers", type=Path, nargs="+", help="files, or folders of .json files")
    two.add_argument("--json", action="store_true", help="all counts, instead of tables")
    two.add_argument("--mix-simulated", action="store_true", help="read people and programs alike")
    two.set_defaults(run=read)
    three = commands.add_parser("simulate", help="answer all questionnaires by a known law")
    three.add_argument("study", type=Path)
    three.add_argument("-o", "--output", type=Path, required=True)
    three.add_argument(
        "--preference",
        type=preference,
        default={"": 0.5},
        metavar="0.8 | nst=0.9,artist=0.5",
        help="chance of ours, of opinions that prefer one",
    )
    three.add_argument(
        "--undecided", type=pair, default=(0.0, 0.0), metavar="N,B", help="chance of neither, both"
    )
    three.add_argument("--noise", type=float, default=0.0, help="chance of an answer at random")
    three.add_argument("--careless", type=float, default=0.0, help="chance of such a worker")
    three.add_argument("--seed", type=int, default=0)
    three.set_defaults(run=simulate_all)
    return out


def main(words: list[str] | None = None) -> int:
    args = parser().parse_args(words)
    try:
        args.run(args)
    except (OSError, ValueError) as error:
        print(error, file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
