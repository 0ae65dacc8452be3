"""Draws `dialogue.png` of `choosing.md`: a dialogue about the ascent from a flat airless body."""

from __future__ import annotations

from pathlib import Path

from macs import sweep
from macs.decisions import Dialogue, Larger, PhysicalProgramming, Smaller
from macs.fronts.pictures.front_plot import save_picture
from problems import load
from transcription import DFET

PICTURE = Path(__file__).with_suffix(".png")


def dialogue() -> Dialogue:
    """Physical programming, and what is asked for after it."""
    problem = load("goddard")
    talk = Dialogue(sweep(problem, DFET(4, 6), points=12), problem)
    classes = {"flight time": Smaller.even(120, 220), "horizontal speed": Larger.even(0.85, 0.25)}
    talk.prefer(PhysicalProgramming(classes), "ranges of preference")
    talk.choose()
    talk.improve("horizontal speed", giving={"flight time": 200.0})
    talk.improve("flight time", to=160.0, giving={"horizontal speed": 0.45})
    talk.alternatives(3)
    talk.take(2)
    return talk


if __name__ == "__main__":
    save_picture(dialogue(), PICTURE)
