"""Runs commands on damaged files under a limit of memory: a process of its own.

    python fuzz_commands.py FOLDER SEED COUNT

FOLDER holds problem.yaml, part.stl, motion.csv and proof. Prints how often each status
came; whatever is not a status of the command line ends this process with a traceback.
"""

import contextlib
import gzip
import hashlib
import io
import json
import resource
import shutil
import sys
from collections import Counter
from pathlib import Path
from typing import Any, Final

import numpy as np

sys.path.insert(0, str(Path(__file__).parent / "io"))
from mutations import changed_bytes, changed_data

from vdsm_pin.cli import main

MEMORY: Final = 4 << 30
"""Address space of this process; [bytes]. Libraries map one of it and use a tenth."""

LONGEST: Final = 10_000
"""Characters that a command may say."""

ODD: Final = ("\x1b[2J", "\ud800", "\u202e", "\n", "x" * 9_999, "\0", 1e400, -1, None)
"""What no good certificate holds."""


def sealed(lines: list[Any]) -> bytes:
    """A certificate with a last line that fits."""
    body = b"".join(json.dumps(line).encode() + b"\n" for line in lines)
    last = {"end": True, "sha256": hashlib.sha256(body).hexdigest()}
    return gzip.compress(body + json.dumps(last).encode() + b"\n")


def forged(content: bytes, rng: np.random.Generator) -> bytes:
    """A certificate with one value changed, sealed again."""
    lines = [json.loads(line) for line in gzip.decompress(content).splitlines()[:-1]]
    value = ODD[rng.integers(len(ODD))]
    if rng.uniform() < 0.5:
        lines[0][str(rng.choice(sorted(lines[0])))] = value
        return sealed(lines)
    holder: Any = lines[-1]["proofs"]
    while isinstance(holder[0], list) and rng.uniform() < 0.8:
        holder = holder[0]
    holder[int(rng.integers(len(holder)))] = value
    return sealed(lines)


def damage(folder: Path, rng: np.random.Generator) -> list[str]:
    """Damage one of the files; the command that reads it."""
    name = str(rng.choice(["problem.yaml", "part.stl", "motion.csv", "proof"]))
    content = (folder / name).read_bytes()
    if name == "proof" and rng.uniform() < 0.7:
        content = forged(content, rng)
    elif name == "problem.yaml" and rng.uniform() < 0.5:
        content = changed_data(content.decode(), rng).encode("utf-8", "replace")
    else:
        content = changed_bytes(content, rng)
    (folder / name).write_bytes(content)
    files = [str(folder / one) for one in ("problem.yaml", "motion.csv", "proof")]
    if name == "proof" or rng.uniform() < 0.5:
        return ["check-certificate", files[2], files[0], files[1]]
    if rng.uniform() < 0.5:
        page = str(folder / "page.html")
        return ["view", files[0], "--trajectory", files[1], "--html", page]
    words = ["verify", files[0], "--trajectory", files[1], "--time-limit", "5"]
    return [*words, "--out", str(folder / "out")]


def status(words: list[str]) -> int:
    """The exit status, once what was said is seen to be fit for a terminal."""
    out, err = io.StringIO(), io.StringIO()
    code: object = None
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        try:
            main(words)
        except SystemExit as ended:
            code = ended.code
    said = out.getvalue() + err.getvalue()
    assert code in (0, 1, 2), (words, code)
    assert all(line.isprintable() for line in said.splitlines()), said[:LONGEST]
    assert len(said) < LONGEST, said[:LONGEST]
    assert code != 2 or err.getvalue().startswith("vdsm: "), said
    return int(str(code))


def run(source: Path, seed: int, count: int) -> Counter[int]:
    """How often each status came."""
    found: Counter[int] = Counter()
    for k in range(count):
        folder = source / f"case{seed}"
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir()
        for name in ("problem.yaml", "part.stl", "motion.csv", "proof"):
            shutil.copy(source / name, folder / name)
        words = damage(folder, np.random.default_rng([seed, k]))
        try:
            found[status(words)] += 1
        except BaseException:
            sys.stderr.write(f"seed {seed}, case {k}: {words}\n")
            raise
    return found


if __name__ == "__main__":
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    tally = run(Path(sys.argv[1]), int(sys.argv[2]), int(sys.argv[3]))
    sys.stdout.write(json.dumps({str(key): tally[key] for key in sorted(tally)}))
