"""Addresses of code that files name. Loading one runs it, so without the user's trust only the catalogue's own are loaded."""

from __future__ import annotations

from os import PathLike

from macs.front import Front
from problems.catalogue import is_catalogued


def check_trusted(address: str, trust: bool, where: str) -> None:
    """Raise ValueError if a file names an address that must not be loaded."""
    if ":" in address and not trust and not is_catalogued(address):
        raise ValueError(
            f"{where} names '{address}', which is not in the catalogue and runs code of its own when loaded: "
            "if you trust it, give --trust, or trust=True in Python"
        )


def load_front(path: str | PathLike[str], trust: bool) -> Front:
    """A saved front whose problem may be loaded from its address. Raises ValueError or FileNotFoundError as `Front.load`, and ValueError
    for an address that is not trusted."""
    front = Front.load(path, trust=trust)
    if front.source is not None and front.source.address:
        check_trusted(front.source.address, trust, f"'{path}'")
    return front
