"""Models of other tools on a phase: FMUs for model exchange (Functional Mock-up Interface 2.0 and 3.0, fmi-standard.org).

CasADi loads and evaluates the binary. Of its derivatives only directional ones are asked for, since Jacobians by the lists of dependencies
in the file are wrong where these are; and none by time, which some FMUs do not survive.
"""

from __future__ import annotations

import atexit
import math
import os
import shutil
import tempfile
import warnings
import xml.etree.ElementTree as ElementTree
import zipfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache, lru_cache
from pathlib import Path
from typing import Any

import casadi as ca

from .externals import Native, external
from .phase import Phase


@dataclass(frozen=True)
class ModelVariable:
    """A variable of an FMU. Without a start value it has None, without bounds infinite ones; a fixed parameter has one value all along."""

    name: str
    kind: str  # state, input, parameter or output
    unit: str = ""
    start: float | None = None
    lower: float = -math.inf
    upper: float = math.inf
    fixed: bool = False

    @property
    def bounds(self) -> tuple[float, float] | None:
        """None unless both are finite."""
        return (self.lower, self.upper) if math.isfinite(self.lower) and math.isfinite(self.upper) else None

    def __str__(self) -> str:
        start = "" if self.start is None else f"{self.start:g}"
        ends = "" if self.bounds is None else f"{self.lower:g} to {self.upper:g}"
        return f"{self.kind:9}  {self.name:24}  {self.unit:8}  {start:>10}  {ends}{'fixed' if self.fixed else ''}".rstrip()


class Fmu:
    """A model of another tool, exported as an FMU for model exchange (FMI 2.0 or 3.0); `declare` brings it to a phase.

    Its binary is run, with the rights of the user. It is unzipped into a temporary folder, which goes with the process; other processes
    unzip it themselves. Derivatives are its own directional ones, where it has them and they agree with differences; else differences.

    Parameters
    ----------
    path : str or path
        The file, or the folder that it was unzipped into.

    Attributes
    ----------
    path : Path
    name : str
        Of the file.
    variables : dict of ModelVariable
        By name. `print` shows them as a table.

    Raises
    ------
    ValueError
        For what is no FMU, one for co-simulation only, or one without a binary for this machine.

    Examples
    --------
    >>> from problems import Fmu
    >>> Fmu("glider.fmu")
    Traceback (most recent call last):
    ...
    ValueError: glider.fmu is no FMU that can be read: there is no file glider.fmu
    """

    def __init__(self, path: str | os.PathLike[str]) -> None:
        self.path, self.name = Path(path).resolve(), Path(path).name
        self.variables: dict[str, ModelVariable] = {}
        try:
            _, self._root = _unpacked(self.path, _stamp(self.path))
        except (OSError, zipfile.BadZipFile, ElementTree.ParseError) as error:
            raise ValueError(f"{self.name} is no FMU that can be read: {error}") from None
        self._check()
        dae, described = _loaded(self.path, _stamp(self.path)), _attributes(self._root)
        kinds = dict.fromkeys(dae.y(), "output") | dict.fromkeys([*dae.p(), *dae.c()], "parameter")
        kinds |= {name: "input" if dae.type(name).startswith("Float") else "parameter" for name in dae.u()}
        for name, kind in (kinds | dict.fromkeys(dae.x(), "state")).items():
            if dae.numel(name) > 1 and kind in ("state", "input"):
                raise ValueError(f"{self.name}: the {kind} '{name}' is an array; only numbers can be taken")
            of = described.get(name, {})
            start, lower, upper = (_number(of.get(word)) for word in ("start", "min", "max"))
            ends = -math.inf if lower is None else lower, math.inf if upper is None else upper
            fixed = kind == "parameter" and name not in dae.p()
            self.variables[name] = ModelVariable(name, kind, of.get("unit", ""), start, *ends, fixed)

    def __str__(self) -> str:
        head = f"{self.name}\n{'kind':9}  {'name':24}  {'unit':8}  {'start':>10}  bounds"
        order = ("state", "input", "parameter", "output")
        return "\n".join([head, *(str(one) for kind in order for one in self._all(kind))])

    def declare(
        self,
        phase: Phase,
        *,
        bounds: Mapping[str, Any] | None = None,
        initial: Mapping[str, Any] | None = None,
        final: Mapping[str, Any] | None = None,
        values: Mapping[str, Any] | None = None,
        outputs: Sequence[str] = (),
    ) -> dict[str, ca.MX]:
        """Declare the model's states, its inputs as controls and its rates on a phase, with its names, units and bounds.

        Parameters
        ----------
        phase : Phase
            Without dynamics; its time is in seconds.
        bounds : mapping
            Pairs by state or input, in the place of `min` and `max` of the FMU; needed where it has none.
        initial, final : mapping
            A number, a pair or None (free) by state, at t0 and tf. Without, a state begins at the FMU's start value, if it has one, and
            ends anywhere.
        values : mapping
            Of inputs that are no controls, and of parameters: numbers; or expressions of the phase's symbols and the problem's parameters,
            which parameters that the FMU calls fixed do not take.
        outputs : sequence of str
            Names of further variables that are wanted.

        Returns
        -------
        dict of MX
            The outputs, for any expression of the phase.

        Raises
        ------
        ValueError
            For a name that the model does not have, missing bounds, and what it does not take.
        """
        bounds, initial, final, values = (dict(one or {}) for one in (bounds, initial, final, values))
        states, inputs, parameters = ([one.name for one in self._all(kind)] for kind in ("state", "input", "parameter"))
        every = {"bounds": (bounds, [*states, *inputs]), "initial": (initial, states), "final": (final, states)}
        every |= {"values": (values, [*inputs, *parameters]), "outputs": (dict.fromkeys(outputs), list(_attributes(self._root)))}
        for word, (given, known) in every.items():
            if wrong := [name for name in given if name not in known]:
                raise ValueError(f"{self.name}: {word} of '{wrong[0]}'; there are {', '.join(known[:20]) or 'none'}")
        if phase._time_unit != "s":
            raise ValueError(f"{self.name}: rates are per second, the time unit of phase '{phase.name}' is {phase._time_unit}")
        controls = [name for name in inputs if name not in values]
        chosen = {name: bounds.get(name, self.variables[name].bounds) for name in [*states, *controls]}
        if missing := [name for name, pair in chosen.items() if pair is None]:
            wanted = ", ".join(f"'{name}': (lower, upper)" for name in missing)
            raise ValueError(f"{self.name} has no bounds of {', '.join(missing)}: give bounds={{{wanted}}}")
        constants = {name: float(value) for name, value in values.items() if not isinstance(value, ca.MX)}
        moving = {name: value for name, value in values.items() if isinstance(value, ca.MX)}
        if fixed := [name for name in moving if self.variables[name].fixed]:
            raise ValueError(f"{self.name}: '{fixed[0]}' is a fixed parameter, which takes a number")
        rows = _rows(self.path, _stamp(self.path), (*states, *controls, *moving), tuple(constants.items()), tuple(outputs))
        for name in states:
            start = {"initial": initial.get(name, self.variables[name].start), "final": final.get(name)}
            phase.state(name, bounds=chosen[name], unit=self.variables[name].unit, **start)
        for name in controls:
            phase.control(name, bounds=chosen[name], unit=self.variables[name].unit)
        found = external(rows, states=states, controls=controls, parameters=list(moving.values()), outputs=[*states, *outputs])
        parts = ca.vertsplit(found)
        phase.dynamics(**dict(zip(states, parts, strict=False)))
        return dict(zip(outputs, parts[len(states) :], strict=True))

    def _all(self, kind: str) -> list[ModelVariable]:
        return [one for one in self.variables.values() if one.kind == kind]

    def _check(self) -> None:
        """Raise ValueError, or warn, for a model that cannot be used as it is."""
        root = self._root
        version, model = root.get("fmiVersion", ""), root.find("ModelExchange")
        if version[:2] not in ("2.", "3."):
            raise ValueError(f"{self.name} is of FMI {version}; 2.0 and 3.0 can be taken")
        if model is None:
            raise ValueError(f"{self.name} is for co-simulation only: it has no rates. Export it for model exchange")
        if int(root.get("numberOfEventIndicators") or 0) or root.find("ModelStructure/EventIndicator") is not None:
            warnings.warn(f"{self.name} has events: its rates are those between them, and what an event changes is left out", stacklevel=3)


def _stamp(path: Path) -> int:
    """What changes where the file does."""
    return path.stat().st_mtime_ns if path.exists() else 0


@cache
def _unpacked(path: Path, stamp: int) -> tuple[Path, ElementTree.Element]:
    """The files of an FMU, in a folder that goes with the process, and its description."""
    if not path.exists():
        raise OSError(f"there is no file {path.name}")
    folder = Path(tempfile.mkdtemp(prefix="fmu-"))
    atexit.register(_remove, folder, os.getpid())
    if path.is_dir():
        shutil.copytree(path, folder, dirs_exist_ok=True)
    else:
        with zipfile.ZipFile(path) as archive:
            archive.extractall(folder)
    tree = ElementTree.parse(folder / "modelDescription.xml")
    for one in tree.iterfind("ModelStructure//*"):
        one.attrib.setdefault("dependencies", "")  # CasADi does not read a file of FMI 3 without; they are not used
    tree.write(folder / "modelDescription.xml")
    return folder, tree.getroot()


def _remove(folder: Path, process: int) -> None:
    """Remove a folder, unless this is a fork of the process that made it."""
    if process == os.getpid():
        shutil.rmtree(folder, ignore_errors=True)


def _loaded(path: Path, stamp: int) -> ca.DaeBuilder:
    """CasADi's builder of an FMU, to change as one likes."""
    try:
        # Without serialization: CasADi would evaluate what the exporter has written beside the binary, in the place of this.
        return ca.DaeBuilder("model", str(_unpacked(path, stamp)[0]), {"enable_ls_serialization": False})
    except RuntimeError as error:
        raise ValueError(f"{path.name} is not understood by CasADi: {_reason(error)}") from None


def _reason(error: Exception) -> str:
    return str(error).strip().splitlines()[-1]


@lru_cache(maxsize=8)
def _rows(path: Path, stamp: int, columns: tuple[str, ...], constants: tuple[tuple[str, float], ...], outputs: tuple[str, ...]) -> Native:
    """Rates and outputs of an FMU, as a function of columns, and of time."""
    name, dae = path.name, _loaded(path, stamp)
    for one in [*dae.p(), *dae.u()]:
        if one not in columns:
            dae.set_category(one, "c")
    for one, constant in constants:
        dae.set(one, constant)
    try:
        dae.set_y(list(outputs))
        rates = dae.create("rates", ["t", "x", "u", "p"], ["ode", "y"])
    except RuntimeError as error:
        binaries = ", ".join(sorted(one.name for one in (_unpacked(path, stamp)[0] / "binaries").glob("*"))) or "nothing"
        raise ValueError(f"{name} cannot be loaded on this machine, it has binaries for {binaries}: {_reason(error)}") from None
    n = len(columns)
    X, time = ca.MX.sym("X", n + 1), ca.MX.sym("time")

    def parts(entries: Any) -> list[Any]:
        """Rows of an array by columns, for states, inputs and parameters."""
        groups = [[entries[columns.index(one), :] for one in group] for group in (dae.x(), dae.u(), dae.p())]
        return [ca.vertcat(*group) if group else ca.MX(0, entries.shape[1]) for group in groups]

    point = [time, *parts(X)]
    value = ca.Function("value", [X, time], [ca.densify(ca.vertcat(*rates.call(point)))])
    slopes = None
    if dae.provides_directional_derivatives():
        found = rates.forward(n).call([*point, *(ca.MX(*rates.size_out(i)) for i in (0, 1)), ca.MX(1, n), *parts(ca.MX.eye(n))])
        step = 1e-6 * (1.0 + ca.fabs(time))
        by_time = (value(X, time + step) - value(X, time - step)) / (2.0 * step)
        slope = ca.Function("slope", [X, time], [ca.densify(ca.horzcat(ca.vertcat(*found), by_time))])
        slopes = ca.Function("slopes", [X], [slope(X, X[n])])
    return Native(name, ca.Function("values", [X], [value(X, X[n])]), slopes, (_rows, (path, stamp, columns, constants, outputs)))


def _attributes(root: ElementTree.Element) -> dict[str, dict[str, str]]:
    """Attributes of all variables by name, with those of their types."""

    def whole(one: ElementTree.Element) -> dict[str, str]:
        return {**(one[0].attrib if one.tag in ("SimpleType", "ScalarVariable") and len(one) else {}), **one.attrib}  # FMI 2: inside

    types = {one.get("name"): whole(one) for one in root.iterfind("TypeDefinitions/*")}
    variables = map(whole, root.iterfind("ModelVariables/*"))
    return {one["name"]: {**types.get(one.get("declaredType"), {}), **one} for one in variables}


def _number(text: str | None) -> float | None:
    """A finite number, as tools write none where they mean one without end."""
    try:
        value = float(text) if text else math.nan
    except ValueError:
        return None
    return value if abs(value) < 1e30 else None
