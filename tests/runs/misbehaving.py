"""A tiny problem, and solvers that do to a run what may happen to one. Processes of their own import this module."""

import os
import signal
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from macs import MACS
from problems import Problem


def glide(speed: float = 3.0, most: float = 20.0) -> Problem:
    problem = Problem("glide")
    phase = problem.phase("leg", t0=0.0, tf=(1.0, 5.0))
    x = phase.state("x", bounds=(0, most), initial=0, unit="km")
    u = phase.control("u", bounds=(0, speed), unit="km/s")
    phase.dynamics(x=u)
    problem.minimize("time", phase.tf, unit="s")
    problem.maximize("distance", phase.final(x), unit="km")
    problem.default_transcription = "dfet:2x2"
    problem.default_evaluations = 60
    return problem


@dataclass(frozen=True)
class Plain(MACS):
    """Quick, and well-behaved."""

    refine: bool = False


@dataclass(frozen=True)
class Crashing(Plain):
    def advance(self, state: Any, evaluator: Any, budget: int) -> None:
        raise ArithmeticError("the root of all evil")


@dataclass(frozen=True)
class Hanging(Plain):
    def advance(self, state: Any, evaluator: Any, budget: int) -> None:
        time.sleep(1000)


@dataclass(frozen=True)
class Hungry(Plain):
    def advance(self, state: Any, evaluator: Any, budget: int) -> None:
        raise MemoryError("nothing left")


@dataclass(frozen=True)
class Dying(Plain):
    """Killed from outside, as for want of memory: at every attempt, or once, if it can make a file of this name."""

    once: str = ""

    def advance(self, state: Any, evaluator: Any, budget: int) -> None:
        if self.once and Path(self.once).exists():
            super().advance(state, evaluator, budget)
            return
        if self.once:
            Path(self.once).touch()
        os.kill(os.getpid(), signal.SIGKILL)


@dataclass(frozen=True)
class Slow(Plain):
    """So that there is time to interfere."""

    def advance(self, state: Any, evaluator: Any, budget: int) -> None:
        time.sleep(0.05)
        super().advance(state, evaluator, budget)


@dataclass(frozen=True)
class Gated(Plain):
    """Waits half way until there is a file."""

    gate: str = ""

    def advance(self, state: Any, evaluator: Any, budget: int) -> None:
        while evaluator.counts.evaluations >= budget // 2 and not Path(self.gate).exists():
            time.sleep(0.02)
        super().advance(state, evaluator, budget)


@dataclass(frozen=True)
class Faltering(Plain):
    """Crashes half way as long as there is a file, and deletes that; notes in another how much was evaluated before each iteration."""

    folder: str = ""

    def advance(self, state: Any, evaluator: Any, budget: int) -> None:
        spent, obstacle = evaluator.counts.evaluations, Path(self.folder, "obstacle")
        with Path(self.folder, "spent").open("a") as file:
            file.write(f"{spent}\n")
        if spent >= budget // 2 and obstacle.exists():
            obstacle.unlink()
            raise ArithmeticError("half way")
        super().advance(state, evaluator, budget)
