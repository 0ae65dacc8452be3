"""What may come out of any problem or black box, however strange: a front that is true, or one clear error. All else is a finding.

By hand: `python tests/fuzz/fuzzing.py --flights 2000 --boxes 1000`; a finding is printed with its seed, and repeated by it.
"""

import argparse
import linecache
import signal
import sys
import time
import traceback
import warnings
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
from other_code import flown
from random_boxes import random_box
from random_flights import random_flight

from macs import MACS, MOPSO, NSGA2, Front, optimize, sweep

LIMIT, GRACE, HANGS = 6.0, 6.0, 60
"""Seconds that an attempt gets; more of its own that it may take; seconds of the clock after which it hangs."""
FLIES = 3e-3
"""Largest miss of other code at a point that is called verified to 1e-3."""


class Hang(BaseException):
    """The clock ended an attempt."""


class FindingError(AssertionError):
    """The contract is broken."""


def attempt_flight(seed: int) -> str:
    """The outcome of one random problem; raises FindingError."""
    rng = np.random.default_rng([seed, 1])
    way = str(rng.choice(["macs", "macs", "macs", "propagate", "sweep", "optimize", "nsga2"]))
    found = _outcome(lambda: _solved(seed, way))
    if isinstance(found, str):
        return found
    front, plain = found
    if not len(front):
        return "nothing feasible" if front.message or way in ("nsga2",) else "no points"
    for point in front:
        if point.status == "converged" and not np.isfinite(list(point.objectives.values())).all():
            raise FindingError(f"objectives that are no numbers: {point.objectives}")
        if point.verified:
            try:
                check_flown(plain, point, front)
            except ZeroDivisionError:
                return "divided by zero"
    return "verified points" if front.verified.any() else "points, none verified"


def _solved(seed: int, way: str) -> tuple[Front, Any]:
    problem, plain, transcription = random_flight(seed)
    if way == "optimize":
        return Front.of(optimize(problem, transcription, time_limit=LIMIT, progress=False).alone()), plain
    if way == "sweep":
        return sweep(problem, transcription, points=4, time_limit=LIMIT, progress=False), plain
    common: dict[str, Any] = {"seed": seed, "time_limit": LIMIT, "progress": False}
    if way == "nsga2":
        return NSGA2(population=8).solve(problem, transcription, evaluations=24, **common), plain
    inner = {"inner": "propagate"} if way == "propagate" else {}
    return MACS(agents=4, archive=5).solve(problem, transcription, evaluations=40, **inner, **common), plain


def check_flown(plain: Any, point: Any, front: Front) -> None:
    """Raise Finding where other code does not get what a verified point says."""
    misses, objectives = flown(plain, point)
    worst = max(misses, key=lambda label: misses[label]) if misses else ""
    if worst and not misses[worst] <= FLIES:
        raise FindingError(f"verified, but other code misses {worst} by {misses[worst]:.2e}; its own defect {point.defect:.1e}")
    ranges = np.ptp(front.objectives, axis=0)
    for k, (name, value) in enumerate(objectives.items()):
        # As simulated: how far that may be from the mesh's own is a matter of what the objective varies by.
        simulated = point.simulated[name]
        scale = max(float(ranges[k]), abs(simulated), 1e-5)
        if not abs(value - simulated) <= FLIES * scale:
            raise FindingError(f"verified, but other code has '{name}' = {value!r} instead of {simulated!r}")


def attempt_box(seed: int) -> str:
    """The outcome of one random black box; raises FindingError."""
    box, rng = random_box(seed), np.random.default_rng([seed, 1])
    solver = [MACS(agents=4, archive=6), NSGA2(population=8), MOPSO(particles=8, archive=8)][int(rng.integers(3))]
    calls = {"evaluations": 60, "seed": seed, "time_limit": LIMIT, "progress": False}
    found = _outcome(lambda: solver.minimize(box.function, box.bounds, **calls), box.kind)
    if isinstance(found, str):
        if box.honest and not box.narrow:
            raise FindingError(f"{box.kind}: refused: {found}")
        return "refused"
    if box.narrow or (not box.honest and box.kind not in ("objects", "raises later", "other columns later", "masked")):
        raise FindingError(f"{box.kind}: accepted")
    if len(found) and box.honest:
        again = box.function(found.decision.copy())
        F = np.asarray(again[0] if isinstance(again, tuple) else again, dtype=float).reshape(len(found), -1)
        if not np.array_equal(F, found.objectives):
            raise FindingError(f"{box.kind}: objectives are not those of the variables: {np.abs(F - found.objectives).max():.1e} off")
    return "points" if len(found) else "no points"


def _outcome(work: Callable[[], Any], kind: str = "") -> Any:
    """What the work returns, or the words of its error; raises FindingError for another exception, warnings, or a hang."""
    began = time.process_time()
    with warnings.catch_warnings(record=True) as said, _clock(HANGS):
        warnings.simplefilter("always")
        try:
            found = work()
        except Hang:
            raise FindingError(f"{kind}: it hangs") from None
        except (ValueError, TypeError) as error:
            if not _deliberate(error):
                raise FindingError(f"an error from the depths:\n{traceback.format_exc()}") from None
            return f"refused: {error}"
        except Exception as error:
            if kind.startswith("raises") and _its_own(error):
                return "its own error"
            raise FindingError(f"an error from the depths:\n{traceback.format_exc()}") from None
    if time.process_time() - began > LIMIT + GRACE:
        raise FindingError(f"it took {time.process_time() - began:.1f} s, with a time limit of {LIMIT:g} s")
    ours = [one for one in said if issubclass(one.category, RuntimeWarning) and "random_" not in one.filename]
    if ours:
        raise FindingError(f"a warning from the depths: {ours[0].filename}:{ours[0].lineno}: {ours[0].message}")
    return found


def _deliberate(error: BaseException) -> bool:
    """Whether an error was raised on purpose, with words, by code of the project."""
    frame = traceback.extract_tb(error.__traceback__)[-1]
    raised = linecache.getline(frame.filename, frame.lineno).strip().startswith("raise")
    return raised and "site-packages" not in frame.filename and bool(str(error))


def _its_own(error: BaseException) -> bool:
    """Whether the function that was searched raised it."""
    return traceback.extract_tb(error.__traceback__)[-1].filename.endswith("random_boxes.py")


@contextmanager
def _clock(seconds: int) -> Iterator[None]:
    def ring(*_: object) -> None:
        raise Hang

    before = signal.signal(signal.SIGALRM, ring)
    signal.alarm(seconds)
    try:
        yield
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)


def main() -> int:
    """Make the attempts; the exit code is 1 if there was a finding."""
    parser = argparse.ArgumentParser(description="Random problems and black boxes; a finding is printed with its seed.")
    parser.add_argument("--flights", type=int, default=200, help="number of random problems")
    parser.add_argument("--boxes", type=int, default=100, help="number of random black boxes")
    parser.add_argument("--seed", type=int, default=0, help="the first seed; a finding is repeated by its own, with a number of 1")
    arguments = parser.parse_args()
    findings = 0
    for attempt, count in ((attempt_flight, arguments.flights), (attempt_box, arguments.boxes)):
        outcomes, began = Counter[str](), time.perf_counter()
        for seed in range(arguments.seed, arguments.seed + count):
            try:
                outcome = attempt(seed)
                outcomes["refused" if outcome.startswith("refused") else outcome] += 1
            except FindingError as finding:
                findings += 1
                outcomes["FINDING"] += 1
                print(f"{attempt.__name__} {seed}: {finding}\n", flush=True)
        print(f"{attempt.__name__}: {dict(outcomes)} in {time.perf_counter() - began:.0f} s", flush=True)
    return int(findings > 0)


if __name__ == "__main__":
    sys.exit(main())
