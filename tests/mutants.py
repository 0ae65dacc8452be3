"""Changes the lines that judge, one at a time, and counts how many of the changes a test notices: `make mutants`.

mutmut makes the changes, runs the tests and keeps the results; here is only which modules, with which tests (`mutants.toml`). Each module
is worked on in a folder of its own, `build/mutants/NAME`, in which `mutmut browse` shows the results again.
"""

import os
import re
import shutil
import subprocess
import sys
import tomllib
from collections import Counter
from configparser import ConfigParser
from pathlib import Path

ROOT = Path(__file__).parents[1]
FLOORS = ("problems", "transcription", "macs", "runs")
MUTMUT = [sys.executable, "-m", "mutmut"]
NOTICED = {"killed", "timeout", "segfault"}
"""What mutmut says of a mutant that a test fails on, or that does not let the tests end."""


def prepared(module: str, tests: list[str], spared: list[str]) -> Path:
    """The folder in which mutmut works on a module: links to the code and the tests, and mutmut's settings."""
    folder = ROOT / "build" / "mutants" / re.sub(r"\W", "-", module.removesuffix(".py"))
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    for name in (*FLOORS, "tests", "pyproject.toml"):
        (folder / name).symlink_to(ROOT / name)
    settings = ConfigParser(interpolation=None)
    settings["mutmut"] = {
        "source_paths": "\n".join(FLOORS),
        "only_mutate": module,
        "do_not_mutate_patterns": "\n".join(spared),
        "pytest_add_cli_args_test_selection": "\n".join(tests),
        "pytest_add_cli_args": "\n".join(["-p", "no:cacheprovider", "--hypothesis-seed=0"]),
        "timeout_multiplier": "5",
        "use_git_change_detection": "false",
    }
    with (folder / "setup.cfg").open("w", encoding="utf-8") as file:
        settings.write(file)
    return folder


def mutmut(folder: Path, *arguments: str) -> str:
    """What mutmut prints; RuntimeError if it fails."""
    environment = {**os.environ, "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "PYTHONPATH": ""}
    done = subprocess.run([*MUTMUT, *arguments], cwd=folder, env=environment, capture_output=True, text=True, check=False)
    if done.returncode:
        raise RuntimeError(f"mutmut {' '.join(arguments)} failed in {folder}:\n{done.stdout[-4000:]}{done.stderr[-4000:]}")
    return done.stdout


def judged(module: str, tests: list[str], spared: list[str]) -> float:
    """The percentage of a module's mutants that its tests notice; prints the others."""
    folder = prepared(module, tests, spared)
    mutmut(folder, "run", "--max-children", os.environ.get("JOBS", "2"))
    found = dict(line.strip().rsplit(": ", 1) for line in mutmut(folder, "results", "--all", "true").splitlines() if ": " in line)
    left = [name for name, status in found.items() if status not in NOTICED]
    share = 100.0 * (1.0 - len(left) / len(found)) if found else 0.0
    counts = ", ".join(f"{count} {status}" for status, count in Counter(found.values()).most_common())
    print(f"{share:5.1f} % {module}: {len(found)} mutants, {counts}", flush=True)
    for name in left:
        lines = mutmut(folder, "show", name).splitlines()
        print(f"    {name.rpartition('.')[2]}: {found[name]}")
        print("\n".join(f"        {line}" for line in lines if re.match(r"[-+](?![-+]{2})", line)), flush=True)
    return share


def main(wanted: list[str]) -> int:
    """Work on the modules whose path has one of the words, or on all; 1 if the tests of one notice too little."""
    settings = tomllib.loads((Path(__file__).with_name("mutants.toml")).read_text(encoding="utf-8"))
    modules = {name: one for name, one in settings["modules"].items() if not wanted or any(word in name for word in wanted)}
    if not modules:
        print(f"no module of mutants.toml has {' or '.join(wanted)} in its path: {', '.join(settings['modules'])}", file=sys.stderr)
        return 2
    shares = {}
    for name, one in modules.items():
        spared = [*settings["spared"], *(item["line"] for item in one.get("equivalent", []))]
        try:
            shares[name] = judged(name, [*one["tests"], *(f"--deselect={test}" for test in settings["slow"])], spared)
        except RuntimeError as error:  # the other modules can still be judged
            print(error, flush=True)
            shares[name] = 0.0
    few = [name for name, share in shares.items() if share < settings["least"]]
    print(f"below {settings['least']} %: {', '.join(few)}" if few else f"{settings['least']} % or more of the mutants of each are noticed")
    return int(bool(few))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
