"""Break the code in one place at a time, and see whether its tests notice.

    python benchmarks/mutants.py [GROUP ...] [--jobs 2] [--list]

A mutant is one change of text in a copy of `src`; the tests of its group run against the copy.
Killed is a mutant that makes a test fail. One that survives is a wrong program that the tests take
for right. Groups and their mutants stand in `benchmarks/mutants.txt`; a text that is not found
exactly once in its file is an error, so that the list keeps step with the code.
"""

import argparse
import os
import shutil
import subprocess
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
LIST = Path(__file__).with_suffix(".txt")
PATIENCE = 300  # s; tests that hang are tests that fail


@dataclass(frozen=True)
class Mutant:
    """One change: in `file` below src/strokestyle `old` becomes `new`; `tests` should notice."""

    group: str
    file: str
    old: str
    new: str
    tests: tuple[str, ...]


def mutants(text: str) -> list[Mutant]:
    """Read a list of mutants.

    `[group] test files` begins a group, `= file` names the file of the lines below it, and
    `old  ->  new` is a mutant. Blank lines and those that begin with # say nothing.
    """
    group = file = ""
    tests: tuple[str, ...] = ()
    found = []
    for number, line in enumerate(text.splitlines(), 1):
        if not line.strip() or line.startswith("#"):
            continue
        if "  ->  " in line:
            old, new = line.split("  ->  ")
            found.append(Mutant(group, file, old.strip(), new.strip(), tests))
        elif line.startswith("["):
            group, _, names = line[1:].partition("]")
            tests = tuple(names.split())
        elif line.startswith("= "):
            file = line[2:].strip()
        else:
            raise ValueError(
                f"line {number}: expected [group] tests, = file, or old  ->  new: {line}"
            )
    return found


def broken(mutant: Mutant, source: Path) -> None:
    """Apply a mutant to a copy of src.

    Raises ValueError where its text is not there exactly once.
    """
    path = source / "strokestyle" / mutant.file
    text = path.read_text()
    if text.count(mutant.old) != 1:
        raise ValueError(f"{mutant.file}: {text.count(mutant.old)} times, not once: {mutant.old}")
    path.write_text(text.replace(mutant.old, mutant.new))


def survives(mutant: Mutant) -> bool:
    """Whether the tests of a mutant pass in spite of it."""
    with tempfile.TemporaryDirectory() as folder:
        source = Path(folder) / "src"
        shutil.copytree(ROOT / "src", source, ignore=shutil.ignore_patterns("__pycache__"))
        broken(mutant, source)
        return passes(mutant.tests, source)


def passes(tests: tuple[str, ...], source: Path) -> bool:
    """Whether tests pass with the package of `source`."""
    environment = os.environ | {"PYTHONPATH": str(source), "OMP_NUM_THREADS": "1"}
    command = [sys.executable, "-m", "pytest", "-q", "-x", "-p", "no:cacheprovider", *tests]
    try:
        done = subprocess.run(
            command, cwd=ROOT, env=environment, capture_output=True, timeout=PATIENCE
        )
    except subprocess.TimeoutExpired:
        return False
    if done.returncode not in (0, 1):
        # not a test that failed but pytest itself, or a module that does not import: also noticed
        return done.returncode != 2 and sys.exit(done.stdout.decode() + done.stderr.decode())
    return done.returncode == 0


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("groups", nargs="*", help="all of them by default")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--list", action="store_true", help="only check that every text is there")
    args = parser.parse_args()
    every = [m for m in mutants(LIST.read_text()) if not args.groups or m.group in args.groups]
    if not every:
        parser.error(f"no such group in {LIST.name}: {', '.join(args.groups)}")
    for mutant in every:
        text = (ROOT / "src" / "strokestyle" / mutant.file).read_text()
        if text.count(mutant.old) != 1:
            sys.exit(f"{mutant.file}: {text.count(mutant.old)} times, not once: {mutant.old}")
    if args.list:
        print(f"{len(every)} mutants")
        return
    for tests in sorted({m.tests for m in every}):
        if not passes(tests, ROOT / "src"):
            sys.exit(f"these tests fail as it is: {' '.join(tests)}")
    killed: dict[str, list[bool]] = {}
    with ThreadPoolExecutor(args.jobs) as pool:
        for mutant, survived in zip(every, pool.map(survives, every), strict=True):
            killed.setdefault(mutant.group, []).append(not survived)
            if survived:
                print(f"SURVIVED {mutant.file}: {mutant.old}  ->  {mutant.new}", flush=True)
    for group, results in killed.items():
        print(f"{group}: killed {sum(results)} of {len(results)}")


if __name__ == "__main__":
    main()
