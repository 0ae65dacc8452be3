from __future__ import annotations

import errno
import json
import pickle
from pathlib import Path

import h5netcdf
import numpy as np
import pytest
import xarray
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from synthetic_fronts import black_box, compiled, empty, flights, state_problem

import problems
from macs import MACS
from macs.front import Front
from macs.fronts import files as storage
from macs.fronts.dataset import ARRAYS, VERSION, _arrays
from macs.fronts.provenance import Source
from problems.compiled import Variable
from transcription import DFET


def same(a, b) -> bool:
    """Bit for bit."""
    a, b = np.ascontiguousarray(a), np.ascontiguousarray(b)
    return a.shape == b.shape and a.dtype.kind == b.dtype.kind and (a.dtype.kind == "U" or a.tobytes() == b.tobytes())


def assert_same(one: Front, two: Front) -> None:
    for name in ("F", "objectives", "violation", "decision"):
        assert same(getattr(one, name), getattr(two, name)), name
    assert one.status.tolist() == two.status.tolist()
    for name in ("goals", "variables", "transcriptions", "solver", "message", "stats", "source"):
        assert getattr(one, name) == getattr(two, name), name
    for a, b in zip(one, two, strict=True):
        assert same(a.decision, b.decision) and a.variables == b.variables and a.note == b.note
        assert repr((a.violations, a.excursions, a.optimality, a.parameters)) == repr(
            (b.violations, b.excursions, b.optimality, b.parameters)
        )
        assert_same_flight(a.trajectory, b.trajectory)
    assert (one._closest is None) == (two._closest is None)
    if one._closest is not None:
        assert_same(one.closest.alone(), two.closest.alone())


def assert_same_flight(a, b) -> None:
    assert (a is None) == (b is None)
    if a is None:
        return
    assert list(a) == list(b) and dict(a.parameters) == dict(b.parameters)
    for name in a:
        p, q = a[name], b[name]
        assert all(same(_arrays(p)[array], _arrays(q)[array]) for array in ARRAYS)
        assert (p.time_unit, p.state.basis, p.control.basis) == (q.time_unit, q.state.basis, q.control.basis)
        assert (p.state_variables, p.control_variables, p.path_limits) == (q.state_variables, q.control_variables, q.path_limits)


def mixed() -> Front:
    """Points of different meshes, whose variables share some names and follow each other in different orders."""
    names = (["a"], ["b", "a", "c", "d"], [], ["c", "b", "a"])
    return flights(
        4,
        elements=[2, 5, 1, 3],
        decision=[np.arange(len(own), dtype=float) + 10 * i for i, own in enumerate(names)],
        variables=[[Variable(name, -1.0, 1.0, "km", 2.0) for name in own] for own in names],
        transcriptions=[{"method": "DFET", "settings": {"elements": k}} for k in (2, 5, 2, 3)],
        notes=["", "not as exact as it should be: 3e-5", None, ""],
    )


FRONTS = {
    "flights": flights,
    "one point": lambda: flights(1),
    "meshes of different sizes": lambda: mixed(),
    "empty": empty,
    "empty, nothing evaluated": lambda: empty(closest=None),
    "a failed point": lambda: flights(
        2,
        F=[[1.0, 2.0], [np.nan, np.nan]],
        trajectories=[flights(1)[0].trajectory, None],
        violation=[0, np.inf],
        status=["converged", "failed"],
        violations=[{"a": np.nan, "b": 1.0}, None],
        excursions=[{}, None],
        optimality=[1e-12, None],
        sort=False,
    ),
    "payoff": lambda: flights(3, F=[[3.0, 1.0], [1.0, 3.0], [2.0, 2.0]], sort=False),
    "black box": black_box,
    "empty black box": lambda: black_box(0),
    "three objectives": lambda: black_box(5, 3),
    "merged": lambda: Front.merge([flights(3, 1), flights(4, 2)]),
}


@pytest.mark.parametrize("name", FRONTS)
def test_everything_comes_back_bit_for_bit(tmp_path, name):
    front = FRONTS[name]()
    front.save(tmp_path / "front.nc")
    assert_same(front, Front.load(tmp_path / "front.nc"))
    assert [p.name for p in tmp_path.iterdir()] == ["front.nc"]


@settings(max_examples=8, deadline=None)
@given(
    decision=arrays(float, (3, 3), elements=st.floats(width=64)),
    message=st.text(st.characters(blacklist_categories=("Cs",), blacklist_characters="\0"), max_size=30),
    violation=st.floats(),
)
def test_any_numbers_come_back(decision, message, violation):
    front = black_box(3, decision=decision, message=message, violations=[{"row": violation}] * 3)
    assert_same(front, storage.from_bytes(storage.to_bytes(front)))


def test_trajectories_interpolate_as_before(tmp_path):
    front = flights(3, elements=[2, 3, 4])
    front.save(tmp_path / "front.nc")
    for before, after in zip(front, Front.load(tmp_path / "front.nc"), strict=True):
        times = np.linspace(before.trajectory["coast"].t0, before.trajectory["coast"].tf, 50)
        assert same(before.trajectory["coast"].at(times)["h"], after.trajectory["coast"].at(times)["h"])


def test_the_file_is_self_describing(tmp_path):
    flights(3).save(tmp_path / "front.nc")
    root = xarray.open_dataset(tmp_path / "front.nc", engine="h5netcdf")
    assert root["objectives"].dims == ("point", "objective") and root["objective"].values.tolist() == ["time", "height"]
    assert root["objective_unit"].values.tolist() == ["s", "km"]
    assert root["decision"].dims == ("point", "variable") and root["parameters"].dims == ("point", "parameter")
    assert root.attrs["problem"] == "two legs" and root.attrs["fingerprint"] == compiled().fingerprint
    assert json.loads(str(root["transcription"].values[0]))["method"] == "DFET" and json.loads(root.attrs["seed"]) == 7
    assert json.loads(root.attrs["versions"])["numpy"] == np.__version__
    climb = xarray.open_dataset(tmp_path / "front.nc", engine="h5netcdf", group="climb")
    assert climb["states"].dims == ("point", "node", "state") and climb["state_unit"].values.tolist() == ["km", "km/s"]
    assert climb["controls"].sel(control="u").shape == climb["time"].shape


def test_phases_may_have_any_name(tmp_path):
    names = storage._group_names(["ascent", "a/b", "status", "_closest", "."], {"status", "_closest"})
    assert names == {"ascent": "ascent", "a/b": "a_b", "status": "phase_status", "_closest": "phase__closest", ".": "phase_."}


def test_data_that_cannot_be_written_down_has_to_be_passed_again(tmp_path):
    front = flights(1, problem=Source("two legs", compiled().fingerprint, "two_legs", {"table": np.arange(3.0)}))
    front.save(tmp_path / "a.nc")
    assert Front.load(tmp_path / "a.nc").source.data == {"table": [0, 1, 2]}
    flights(1, problem=Source("two legs", compiled().fingerprint, "two_legs", {"f": print})).save(tmp_path / "a.nc")
    assert Front.load(tmp_path / "a.nc").source.address == ""


def test_large_data_fits(tmp_path):
    flights(1, problem=Source("two legs", compiled().fingerprint, "two_legs", {"table": list(range(50_000))})).save(tmp_path / "a.nc")
    assert len(Front.load(tmp_path / "a.nc").source.data["table"]) == 50_000


# Writing


def test_saving_replaces_a_front_while_another_is_read_from_it(tmp_path):
    path = tmp_path / "front.nc"
    flights(2).save(path)
    front = Front.load(path)
    flights(3).save(path)
    assert len(front) == 2 and len(Front.load(path)) == 3


def test_a_missing_folder_is_named(tmp_path):
    with pytest.raises(FileNotFoundError, match=r"cannot write '.*front\.nc': there is no folder '.*nowhere'"):
        flights(1).save(tmp_path / "nowhere" / "front.nc")
    with pytest.raises(IsADirectoryError, match="it is a folder"):
        flights(1).save(tmp_path)
    with pytest.raises(FileNotFoundError, match="there is no folder"):
        flights(1).to_csv(tmp_path / "nowhere" / "front.csv")


def test_a_folder_that_may_not_be_written_to_is_named(tmp_path, monkeypatch):
    monkeypatch.setattr("os.access", lambda path, mode: False)
    with pytest.raises(PermissionError, match="not writable"):
        flights(1).save(tmp_path / "front.nc")


@pytest.mark.parametrize("step", ["write", "fsync", "replace"])
def test_a_full_disk_leaves_the_old_file_and_no_litter(tmp_path, monkeypatch, step):
    path = tmp_path / "front.nc"
    flights(2).save(path)
    before = path.read_bytes()

    def full(*_):
        raise OSError(errno.ENOSPC, "No space left on device")

    if step == "write":
        monkeypatch.setattr("os.fsync", full)
        monkeypatch.setattr("pathlib.Path.open", _full_file)
    else:
        monkeypatch.setattr("os.fsync" if step == "fsync" else "pathlib.Path.replace", full)
    with pytest.raises(OSError, match=r"cannot write '.*front\.nc': No space left on device") as caught:
        flights(3).save(path)
    assert caught.value.errno == errno.ENOSPC
    monkeypatch.undo()
    assert path.read_bytes() == before and [p.name for p in tmp_path.iterdir()] == ["front.nc"]


OPEN = Path.open


class _FullFile:
    def __init__(self, file):
        self.file = file

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.file.close()

    def write(self, content):
        self.file.write(content[: len(content) // 2])
        raise OSError(errno.ENOSPC, "No space left on device")


def _full_file(path, mode):
    return _FullFile(OPEN(path, mode))


# Reading


def test_a_missing_file_is_named(tmp_path):
    with pytest.raises(FileNotFoundError, match=r"there is no file '.*nothing\.nc'"):
        Front.load(tmp_path / "nothing.nc")


def test_a_folder_is_not_a_front(tmp_path):
    with pytest.raises(ValueError, match="cannot be read"):
        Front.load(tmp_path)


def test_a_file_cut_anywhere_is_refused(tmp_path):
    whole = storage.to_bytes(flights(3))
    path = tmp_path / "front.nc"
    for length in sorted(
        {0, 1, 4, 8, 9, 47, 48, 95, 96, 200, 511, 512, *range(1000, len(whole), len(whole) // 25), len(whole) - 8, len(whole) - 1}
    ):
        path.write_bytes(whole[:length])
        with pytest.raises(
            ValueError, match=r"front\.nc does not hold a front that can be read: it is (empty|not a netCDF-4 file|cut short)"
        ):
            Front.load(path)


@settings(max_examples=6, deadline=None)
@given(st.data())
def test_damage_is_an_error_or_harmless_but_never_a_crash(data):
    whole = bytearray(storage.to_bytes(flights(2)))
    start = data.draw(st.integers(0, len(whole) - 1))
    junk = data.draw(st.binary(min_size=1, max_size=64))
    whole[start : start + len(junk)] = junk
    try:
        assert len(storage.from_bytes(bytes(whole[: len(whole)]))) >= 0
    except Exception as error:
        assert not isinstance(error, (SystemError, MemoryError))


@pytest.mark.parametrize("content", [b"hello\n", b"\x80\x04K\x01.", pickle.dumps({"F": 1}), b"CDF\x01\0\0\0\0", b"PK\3\4"])
def test_files_of_other_kinds_are_refused(tmp_path, content):
    (tmp_path / "front.nc").write_bytes(content)
    with pytest.raises(ValueError, match="it is not a netCDF-4 file"):
        Front.load(tmp_path / "front.nc")


def test_foreign_netcdf_is_refused(tmp_path):
    xarray.Dataset({"objectives": (("point",), [1.0])}).to_netcdf(tmp_path / "front.nc", engine="h5netcdf")
    with pytest.raises(ValueError, match="a netCDF file of something else"):
        Front.load(tmp_path / "front.nc")


@pytest.mark.parametrize(("change", "why"), [(1, "update MACS"), (-1, "an earlier MACS wrote it")])
def test_another_format_is_refused(tmp_path, change, why):
    flights(1).save(tmp_path / "front.nc")
    with h5netcdf.File(tmp_path / "front.nc", "a") as file:
        file.attrs["format_version"] = VERSION + change
    with pytest.raises(ValueError, match=f"version {VERSION + change}, this MACS reads version {VERSION}: {why}"):
        Front.load(tmp_path / "front.nc")


def test_a_missing_part_is_named(tmp_path):
    flights(1).save(tmp_path / "front.nc")
    with h5netcdf.File(tmp_path / "front.nc", "a") as file:
        del file._h5file["violation"]
    with pytest.raises(ValueError, match="violation"):
        Front.load(tmp_path / "front.nc")


# The problem


def test_opening_a_file_runs_no_code(tmp_path, monkeypatch):
    monkeypatch.setattr("problems.load", lambda *_, **__: pytest.fail("the problem was loaded"))
    flights(2, problem=Source("two legs", compiled().fingerprint, "two_legs")).save(tmp_path / "front.nc")
    front = Front.load(tmp_path / "front.nc")
    front.table()
    assert front.problem is None


def test_a_front_takes_its_own_problem_and_no_other(tmp_path):
    path = tmp_path / "front.nc"
    flights(2).save(path)
    assert Front.load(path, problem=state_problem()).problem.name == "two legs"
    assert Front.load(path, problem=compiled()).problem is compiled()
    with pytest.raises(ValueError, match=r"front\.nc belongs to problem 'two legs'.*not to 'two legs'"):
        Front.load(path, problem=state_problem(speed=4.0))
    black_box().save(path)
    with pytest.raises(ValueError, match="black box"):
        Front.load(path, problem=compiled())


# Tables of values


def test_csv_names_units_and_keeps_every_bit(tmp_path):
    front = flights(3)
    front.to_csv(tmp_path / "front.csv")
    lines = (tmp_path / "front.csv").read_text(encoding="utf-8").splitlines()
    assert lines[0] == "time [s],height [km],violation,status," + ",".join(f"climb.u[{i}] [km/s²]" for i in range(4))
    cells = [line.split(",") for line in lines[1:]]
    assert same(np.array([[float(c) for c in row[:2]] for row in cells]), front.objectives)
    assert same(np.array([[float(c) for c in row[4:]] for row in cells]), front.decision)


def test_a_phase_may_have_the_name_of_anything_in_the_file(tmp_path):
    problem = problems.Problem("names")
    phase = problem.phase("point", t0=0, tf=(1, 2))
    x = phase.state("x", bounds=(0, 3), initial=0)
    phase.dynamics(x=phase.control("u", bounds=(0, 1)))
    problem.minimize("time", phase.tf)
    problem.maximize("end", phase.final(x))
    front = MACS().solve(problem, DFET(2, 1), evaluations=30, seed=1)
    front.save(tmp_path / "front.nc")
    np.testing.assert_array_equal(Front.load(tmp_path / "front.nc")[0].trajectory["point"]["x"], front[0].trajectory["point"]["x"])
