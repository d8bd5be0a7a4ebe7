"""Counts how many small changes of the code the fast tests notice.

    python -m analysis.mutation --save out/mutants.md

A change that no test can notice, since it changes nothing that is promised, stands in
`equivalent.txt` with its reason. With `--kept FILE` a run takes up where another one
ended: what was tried stands in the file, a line each, and is not tried again.
"""

import argparse
import json
import multiprocessing
import random
import sys
import tempfile
import time
from collections.abc import Iterator
from functools import cache
from multiprocessing.queues import Queue
from pathlib import Path
from typing import Final

from analysis.mutation.changes import Change, changes, uses
from analysis.mutation.coverage_map import (
    PLAIN,
    Asked,
    CoverageMap,
    computed,
    coverage_map,
)
from analysis.mutation.groups import GROUPS, ROOT, Group, modules_of
from analysis.mutation.trial import Task, Trial, copy_checkout, try_changes

EQUIVALENT: Final = Path(__file__).with_name("equivalent.txt")
MAPS: Final = Path(tempfile.gettempdir()) / "mutation-maps"
"""Which tests run which lines, kept for the next run."""

BUDGET: Final = 4.0
"""Tests are asked for a change until their usual times come to this; [s]."""

WIDER: Final = 5
"""Of a change at import nobody knows who may see it: so many times the budget."""


def equivalent_changes() -> dict[str, str]:
    """Reason by key of each change that is known to change nothing.

    What names another line by now than it was judged of is left out, and told.
    """
    found = {}
    for row in EQUIVALENT.read_text(encoding="utf-8").splitlines()[1:]:
        key, reason, *judged = row.split(" || ")
        lines = _lines_of(key.partition(":")[0])
        line = lines.get(key.removesuffix(" (all)"))
        if line is None or (judged and judged[0] != line):
            print(f"no such change: {key}", flush=True)
        else:
            found[key] = reason
    return found


@cache
def _lines_of(module: str) -> dict[str, str]:
    """The line of each change of a module, by key."""
    if not (ROOT / module).exists():
        return {}
    source = (ROOT / module).read_text(encoding="utf-8").splitlines()
    return {c.key: source[c.line - 1].strip() for c in changes(ROOT, module)}


def reason_of(key: str, known: dict[str, str]) -> str | None:
    """Why a change is known to change nothing, by itself or as one of several."""
    return known.get(key) or known.get(key.partition(" (no. ")[0] + " (all)")


def is_equivalent(key: str, known: dict[str, str]) -> bool:
    """Whether a change is known to change nothing."""
    return reason_of(key, known) is not None


def sampled(groups: list[Group], size: int, seed: int) -> dict[str, list[Change]]:
    """A sample of all changes, by group."""
    every = [
        (g.name, c) for g in groups for m in modules_of(g) for c in changes(ROOT, m)
    ]
    chosen = random.Random(seed).sample(every, min(size, len(every)))
    return {g.name: [c for name, c in chosen if name == g.name] for g in groups}


def maps_of(
    group: Group, tests: list[str], chosen: list[Change], asked: argparse.Namespace
) -> dict[bool, CoverageMap]:
    """What tests cover, of machine code as Python and of the rest."""
    maps = {}
    for plain in {group.runs_plain(change.module) for change in chosen}:
        modules = [m for m in modules_of(group) if group.runs_plain(m) is plain]
        what = Asked(ROOT, modules, plain)
        maps[plain] = coverage_map(what, tests, asked.jobs, asked.maps)
    return maps


def _work(
    folder: Path, files: list[str], plain: str | None, tasks: "Queue", done: "Queue"
) -> None:
    try:
        try_changes(folder, files, tasks, done.put, plain)
    finally:
        done.put(None)


def effects(change: Change, modules: list[str]) -> dict[str, tuple[int, ...]]:
    """Where a change has an effect, lines by module: what it names is imported."""
    if not change.names:
        return {change.module: change.lines}
    origin = change.module.removesuffix(".py").replace("/", ".")
    found = {m: uses(ROOT / m, origin, change.names) for m in modules}
    return {m: lines for m, lines in found.items() if lines} | {
        change.module: change.lines
    }


def _as_it_is(module: str) -> Change:
    """No change at all: its tests must pass in the copy, as they did for the map."""
    content = (ROOT / module).read_text(encoding="utf-8")
    return Change(module, 0, "", "", "", content)


def _task(change: Change, seen: CoverageMap, budget: float) -> Task:
    """Whom to ask about a change: nobody, where it is within a function never run."""
    places = effects(change, list(seen.tests))
    within = change.function and not change.names
    if within and not seen.meets(places):
        return Task(change, {}, budget)
    known = seen.runs(places) or not change.line
    return Task(change, seen.asked(places), budget * (1 if known else WIDER))


def tried(
    group: Group, chosen: list[Change], asked: argparse.Namespace
) -> Iterator[Trial]:
    """Try changes on so many processes; as they end."""
    maps = maps_of(group, asked.tests or list(group.tests), chosen, asked)
    for plain, seen in maps.items():
        mine = [one for one in chosen if group.runs_plain(one.module) is plain]
        every = [*[_as_it_is(mine[0].module)] * asked.jobs, *mine]
        tasks = [_task(one, seen, asked.budget) for one in every]
        for trial in tried_at_once(tasks, PLAIN if plain else None, asked.jobs):
            if trial.change.line:
                yield trial
            elif trial.noticed:
                message = f"tests of {trial.change.module} fail without a change"
                raise RuntimeError(message)


def tried_at_once(tasks: list[Task], plain: str | None, jobs: int) -> Iterator[Trial]:
    """Try changes on so many processes; as they end."""
    waiting: Queue = multiprocessing.Queue()
    done: Queue = multiprocessing.Queue()
    files = sorted({name.partition("::")[0] for task in tasks for name in task.tests})
    for task in [*tasks, *[None] * jobs]:
        waiting.put(task)
    with tempfile.TemporaryDirectory(prefix="mutants-") as place:
        workers = []
        for k in range(jobs):
            copy_checkout(ROOT, folder := Path(place) / str(k))
            words = (folder, files, plain, waiting, done)
            workers.append(multiprocessing.Process(target=_work, args=words))
            workers[-1].start()
        try:
            ended = 0
            while ended < jobs:
                if (trial := done.get()) is None:
                    ended += 1
                else:
                    yield trial
        finally:
            for worker in workers:
                worker.terminate()
                worker.join()
            waiting.cancel_join_thread()  # what is left in it is read by nobody


def kept_trials(path: Path | None) -> dict[str, tuple[bool, int, float]]:
    """What came of changes in earlier runs: noticed, tests, seconds, by key."""
    if path is None or not path.exists():
        return {}
    rows = map(json.loads, path.read_text(encoding="utf-8").splitlines())
    return {key: tuple(rest) for key, *rest in rows}


def results(
    group: Group,
    chosen: list[Change],
    known: dict[str, str],
    asked: argparse.Namespace,
    ends: float,
) -> Iterator[Trial]:
    """What came of a group's changes until time is up; it is kept for the next run.

    What is known to change nothing is not tried.
    """
    before = kept_trials(asked.kept)
    left = []
    for change in chosen:
        if change.key in before:
            yield Trial(change, *before[change.key])
        elif is_equivalent(change.key, known):
            yield Trial(change, False, 0, 0.0)
        else:
            left.append(change)
    for trial in tried(group, left, asked) if left else ():
        yield trial
        if asked.kept:
            row = trial.change.key, trial.noticed, trial.tests, round(trial.seconds, 2)
            with asked.kept.open("a", encoding="utf-8") as file:
                file.write(json.dumps(row) + "\n")
        if time.monotonic() > ends:
            return


def page(trials: dict[str, list[Trial]], known: dict[str, str], made: str) -> str:
    """The counts as Markdown, what nobody noticed, and why the rest changes nothing.

    Args:
        trials: What came of changes, by group.
        known: Reason by key of each change that is known to change nothing.
        made: The command that tried them.
    """
    lines = [
        "# Small changes of the code, and how many the fast tests notice",
        "",
        "One change at a time: a comparison, a sign, an operator, a constant, a",
        "condition, two arguments in each other's place, a statement left out. Made by",
        f"`{made}`. What is equivalent changes nothing that is",
        "promised; *after* are those of them that were tried first and judged then.",
        "",
        "| code | changes | equivalent | after | noticed | share of the others | s |",
        "|---|---|---|---|---|---|---|",
    ]
    lines += [_row(name, found, known) for name, found in trials.items()]
    every = [trial for found in trials.values() for trial in found]
    lines += [_row("all", every, known), "", "Seconds are of processor time a change,",
              "without what finding out takes which test runs which line."]  # fmt: skip
    unnoticed = sorted((t for t in every if not t.noticed), key=lambda t: t.change.key)
    lines += ["", "## Not noticed", ""]
    lines += [f"    {t.change.key}  (line {t.change.line}, {t.tests} tests)"
              for t in unnoticed if not is_equivalent(t.change.key, known)]  # fmt: skip
    lines += ["", "## Equivalent", "", "Of this sample; all that are known stand in "
              "`analysis/mutation/equivalent.txt`.", ""]  # fmt: skip
    lines += [f"* `{t.change.key}`: {reason_of(t.change.key, known)}"
              for t in unnoticed if is_equivalent(t.change.key, known)]  # fmt: skip
    return "\n".join(lines) + "\n"


def _row(name: str, found: list[Trial], known: dict[str, str]) -> str:
    """A row of the table: counts of some changes."""
    alike = [t for t in found if not t.noticed and is_equivalent(t.change.key, known)]
    tried, seen = [t for t in found if t.tests], sum(t.noticed for t in found)
    share = 100.0 * seen / max(1, len(found) - len(alike))
    seconds = sum(t.seconds for t in found) / max(1, len(tried))
    after = sum(t.tests > 0 for t in alike)
    counts = f"{len(found)} | {len(alike)} | {after} | {seen}"
    return f"| {name} | {counts} | {share:.1f} % | {seconds:.1f} |"


def main() -> None:
    """Parse arguments, try changes, write the page."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--sample", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument(
        "--group",
        action="append",
        help="only these; " + ", ".join(g.name for g in GROUPS),
    )
    parser.add_argument("--module", default="", help="part of the modules' paths")
    parser.add_argument("--tests", nargs="*", help="files and folders, not all")
    parser.add_argument("--maps", type=Path, default=MAPS, help="what tests cover")
    parser.add_argument("--minutes", type=float, default=float("inf"), help="no more")
    parser.add_argument("--budget", type=float, default=BUDGET, help="[s] a change")
    parser.add_argument("--kept", type=Path, help="what came of changes so far")
    parser.add_argument("--save", type=Path)
    asked = parser.parse_args()
    groups = [g for g in GROUPS if not asked.group or g.name in asked.group]
    asked.maps.mkdir(parents=True, exist_ok=True)
    known, trials = equivalent_changes(), {}
    ends = time.monotonic() + 60.0 * asked.minutes
    for name, chosen in sampled(groups, asked.sample, asked.seed).items():
        group = next(g for g in groups if g.name == name)
        wanted = [c for c in chosen if asked.module in c.module]
        trials[name] = []
        for trial in results(group, wanted, known, asked, ends):
            trials[name].append(trial)
            if not trial.noticed and not is_equivalent(trial.change.key, known):
                line = f"{trial.change.line}, {trial.tests} tests"
                print(f"not noticed: {trial.change.key} (line {line})", flush=True)
    print(f"{computed():.0f} s of processor time, with the maps", flush=True)
    words = f"--sample {asked.sample} --seed {asked.seed} --budget {asked.budget:g}"
    groups_asked = "".join(f" --group {name}" for name in asked.group or ())
    text = page(trials, known, f"python -m analysis.mutation {words}{groups_asked}")
    if asked.save:
        asked.save.parent.mkdir(parents=True, exist_ok=True)
        asked.save.write_text(text, encoding="utf-8")
    print(text)


if __name__ == "__main__":
    sys.exit(main())
