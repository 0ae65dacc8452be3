"""Builds the wheel and the source distribution and tries them where nothing of the checkout is in reach: `make package`.

The wheel is installed into a fresh environment, with its dependencies as in constraints.txt, which needs the network. There `macs solve
goddard` is run in an empty folder, then the first tests of a newcomer, which come from the source distribution.
"""

import os
import subprocess
import sys
import tarfile
import tempfile
import venv
import zipfile
from collections.abc import Iterable
from pathlib import Path

ROOT = Path(__file__).parents[1]
FLOORS = ("problems", "transcription", "macs", "runs")
TARGET = ROOT / "dist"
NEEDED = ("hypothesis", "markdown-it-py", "plotly", "pytest", "pytest-xdist")
"""Packages that the tests need; plotly is for the page in the browser that the first steps write."""
TESTS = {"tests/test_stranger.py": "script_of_the_face", "tests/test_manual.py": "first-steps"}
"""Files of tests, and which of their tests are run."""
LEFT_OUT = (".png",)
"""Suffixes of files of the packages that only the README shows."""


def missing(distributed: Iterable[str], installed: Iterable[str]) -> list[str]:
    """Files of the packages that the source distribution has and the wheel has not.

    Parameters
    ----------
    distributed, installed : names, from the folders of the packages on
    """
    here = set(installed)
    return sorted(
        name
        for name in distributed
        if name.split("/")[0] in FLOORS and "." in Path(name).name and not name.endswith(LEFT_OUT) and name not in here
    )


def built() -> tuple[Path, Path]:
    """The wheel and the source distribution, built from the checkout."""
    for old in TARGET.glob("macs_trajectories-*"):
        old.unlink()
    run([sys.executable, "-m", "build", "--outdir", str(TARGET), str(ROOT)], ROOT)
    (wheel,), (source,) = TARGET.glob("*.whl"), TARGET.glob("*.tar.gz")
    return wheel, source


def unpacked(source: Path, folder: Path) -> Path:
    """The content of a source distribution, unpacked into a folder."""
    with tarfile.open(source) as archive:
        archive.extractall(folder, filter="data")
    (inside,) = folder.iterdir()
    return inside


def run(command: list[str], folder: Path, **environment: str) -> None:
    """Run a command in a folder; ends all where it fails. No folder of the checkout is on Python's path."""
    print(f"$ {' '.join(command)}", flush=True)
    clean = {name: value for name, value in os.environ.items() if not name.startswith("PYTHON")}
    done = subprocess.run(command, cwd=folder, env={**clean, **environment}, check=False)
    if done.returncode:
        raise SystemExit(f"this failed with exit code {done.returncode}: {' '.join(command)}")


def main() -> None:
    """Build, compare, install, solve and test."""
    wheel, source = built()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for part in ("source", "away", "tests"):
            (folder / part).mkdir()
        inside = unpacked(source, folder / "source")
        distributed = [path.relative_to(inside).as_posix() for path in inside.rglob("*") if path.is_file()]
        if not any(one.startswith("tests/") for one in distributed):
            raise SystemExit("the source distribution has no tests")
        with zipfile.ZipFile(wheel) as archive:
            left_out = missing(distributed, archive.namelist())
        if left_out:
            raise SystemExit(f"the wheel lacks {', '.join(left_out)}")
        venv.create(folder / "venv", with_pip=True)
        scripts = folder / "venv" / ("Scripts" if os.name == "nt" else "bin")
        pip = [
            str(scripts / "python"),
            "-m",
            "pip",
            "install",
            "--quiet",
            "--disable-pip-version-check",
            "-c",
            str(inside / "constraints.txt"),
        ]
        run([*pip, str(wheel), *NEEDED], folder)
        run([str(scripts / "macs"), "solve", "goddard", "--seed", "1", "--out", "goddard.nc", "--plot", "goddard.png"], folder / "away")
        run([str(scripts / "macs"), "verify", "goddard.nc"], folder / "away")
        # The packages of the source distribution stay out of reach: tests import what is installed.
        for one in FLOORS:
            (inside / one).rename(folder / f"{one}.not-imported")
        chosen = {path: words for path, words in TESTS.items() if (inside / path).is_file()}
        run([str(scripts / "python"), "-m", "pytest", "-p", "no:cacheprovider", *chosen, "-k", " or ".join(chosen.values())], inside)
        print(f"{wheel.name} and {source.name} are whole: solved, verified and tested outside of the checkout")


if __name__ == "__main__":
    main()
