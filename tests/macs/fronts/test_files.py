import csv
import errno
import gzip
import io
import json
import os
import pickle
from dataclasses import replace
from functools import cache, partial
from pathlib import Path

import h5py
import numpy as np
import pytest
import xarray
from carts import cart, constant, points
from damage import damaged
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from synthetic_fronts import black_box, compiled, contents, costated, empty, flights, marked, state_problem

import problems
from macs import MACS
from macs.front import Front
from macs.fronts import files
from macs.fronts.columns import legal_names
from macs.fronts.dataset import FORMAT_VERSION, group_names
from macs.fronts.provenance import ProblemSource
from macs.io.atomic import sealed, unsealed
from problems.compiled import Variable
from transcription import DFET
from transcription.trajectories.trajectory import Trajectory


def same(a, b) -> bool:
    """Bit for bit."""
    a, b = np.ascontiguousarray(a), np.ascontiguousarray(b)
    return a.shape == b.shape and a.dtype.kind == b.dtype.kind and (a.dtype.kind == "U" or a.tobytes() == b.tobytes())


def assert_same(one: Front, two: Front) -> None:
    assert contents(one) == contents(two)


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
    "costates": costated,
    "simulated": lambda: marked(flights(3), [True, False, False], [True, True, False]),
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
    assert_same(front, files.from_bytes(files.to_bytes(front)))


@pytest.mark.slow
def test_the_file_is_self_describing(tmp_path):
    flights(3).save(tmp_path / "front.nc")
    root = xarray.open_dataset(tmp_path / "front.nc", engine="h5netcdf")
    assert root["objectives"].dims == ("point", "objective") and root["objective"].values.tolist() == ["time", "height"]
    assert root["objective_unit"].values.tolist() == ["s", "km"]
    assert root["decision"].dims == ("point", "variable") and root["parameters"].dims == ("point", "parameter")
    assert root.attrs["problem"] == "two legs" and root.attrs["fingerprint"] == compiled().fingerprint
    assert json.loads(str(root["transcription"].values[0]))["method"] == "DFET"
    assert (root.attrs["seed"], root.attrs["evaluations"], root.attrs["wall_time"], root.attrs["reproducible"]) == (7, 1000, 1.25, 1)
    assert json.loads(root.attrs["versions"])["numpy"] == np.__version__
    climb = xarray.open_dataset(tmp_path / "front.nc", engine="h5netcdf", group="climb")
    assert climb["h"].dims == climb["u"].dims == climb["load"].dims == ("point", "node") and climb["h"].shape == climb["time"].shape
    units = {"time": "s", "h": "km", "v": "km/s", "u": "km/s²", "load": "km²/s³"}
    assert {name: climb[name].attrs["units"] for name in units} == units and climb["path_unit"].values.tolist() == ["km²/s³"]
    assert climb["state_coefficients"].sel(state="v").dims == ("point", "element", "state_function")


@pytest.mark.slow
@pytest.mark.parametrize("name", ["flights", "empty"])
def test_every_array_has_a_name_and_a_unit_and_is_that_of_to_xarray(tmp_path, name):
    front = FRONTS[name]()
    front.save(tmp_path / "front.nc")
    for phase in (None, *(("climb", "coast") if any(point.trajectory for point in front) else ())):
        data = xarray.open_dataset(tmp_path / "front.nc", engine="h5netcdf", group=phase)
        told = front.to_xarray(phase)
        assert data.equals(told) and set(data.variables) == set(told.variables)
        assert all(array.attrs["long_name"] and array.attrs["units"] for array in data.variables.values())


@pytest.mark.parametrize("seed", [None, 0, 2**63 - 1, 2**80, [7, None], [1, 2**70], [3, 4]])
def test_any_seed_comes_back(seed):
    back = files.from_bytes(files.to_bytes(black_box(stats={"seed": seed}))).stats["seed"]
    assert back == seed and type(back) is type(seed)


def test_counts_that_another_program_has_written_as_10_0_are_whole():
    written = {"evaluations": 10.0, "failures": {"infeasible": 3.0}, "seed": 7.0, "work": np.float64(5)}
    back = files.from_bytes(files.to_bytes(black_box(stats=written))).stats
    assert all(isinstance(back[name], int) for name in ("evaluations", "seed", "work")) and back["failures"] == {"infeasible": 3}
    with pytest.raises(ValueError, match="stats"):
        files.from_bytes(files.to_bytes(black_box(stats={"evaluations": 10.5})))


def test_names_that_netcdf_does_not_allow_are_changed():
    names = legal_names(["h", "a/b", "time", "_x", "3", "", "a b", "é", "e\u0301", "x\0", "."], "state", {"time"})
    assert list(names.values()) == ["h", "a_b", "state_time", "state__x", "state_3", "state_", "state_a_b", "é", "state_é", "x_", "state_."]
    assert group_names(["ascent", "status", "_closest"]) == {"ascent": "ascent", "status": "phase_status", "_closest": "phase__closest"}


@pytest.mark.slow
def test_states_may_have_any_name(tmp_path):
    names = ["element", "node", "a/b", "height [km]", "state_element", "_FillValue"]
    problem = problems.Problem("names")
    phase = problem.phase("a/b", t0=0, tf=(1, 2))
    for i, name in enumerate(names):
        phase.state(name, bounds=(-9, 9), initial=i, unit="km")
    phase.control("state", bounds=(0, 1))
    phase.dynamics(**dict.fromkeys(names, 1))
    problem.minimize("time", phase.tf)
    problem.maximize("end", phase.final(phase["node"]))
    front = MACS(mesh="fixed").solve(problem, DFET(2, 1), evaluations=30, seed=1)
    front.save(tmp_path / "front.nc")
    assert_same(front, Front.load(tmp_path / "front.nc"))
    data = xarray.open_dataset(tmp_path / "front.nc", engine="h5netcdf", group="a_b")
    found = {data[array].attrs["long_name"]: data[array].values for array in data.data_vars if data[array].attrs["units"] == "km"}
    assert list(found) == names and all(same(found[name][0], front[0].trajectory["a/b"][name]) for name in names)


def test_data_that_cannot_be_written_down_has_to_be_passed_again(tmp_path):
    front = flights(1, problem=ProblemSource("two legs", compiled().fingerprint, "two_legs", {"table": np.arange(50_000.0)}))
    front.save(tmp_path / "a.nc")
    assert Front.load(tmp_path / "a.nc").source.data == {"table": list(range(50_000))}
    flights(1, problem=ProblemSource("two legs", compiled().fingerprint, "two_legs", {"f": print})).save(tmp_path / "a.nc")
    assert Front.load(tmp_path / "a.nc").source.address == ""


def test_saving_replaces_a_front_while_another_is_read_from_it(tmp_path):
    path = tmp_path / "front.nc"
    flights(2).save(path)
    front = Front.load(path)
    flights(3).save(path)
    assert len(front) == 2 and len(Front.load(path)) == 3
    (tmp_path / "real").mkdir()
    link = tmp_path / "link.nc"
    link.symlink_to(tmp_path / "real" / "front.nc")
    for n in (1, 2):
        flights(n).save(link)
        assert link.is_symlink() and len(Front.load(tmp_path / "real" / "front.nc")) == n
    assert [path.name for path in (tmp_path / "real").iterdir()] == ["front.nc"]


def test_a_missing_folder_or_file_is_named(tmp_path, monkeypatch):
    with pytest.raises(FileNotFoundError, match=r"there is no file '.*nothing\.nc'"):
        Front.load(tmp_path / "nothing.nc")
    with pytest.raises(FileNotFoundError, match=r"cannot write '.*front\.nc': there is no folder '.*nowhere'"):
        flights(1).save(tmp_path / "nowhere" / "front.nc")
    with pytest.raises(IsADirectoryError, match="it is a folder"):
        flights(1).save(tmp_path)
    with pytest.raises(FileNotFoundError, match="there is no folder"):
        flights(1).to_csv(tmp_path / "nowhere" / "front.csv")
    (tmp_path / "gone").mkdir()
    monkeypatch.chdir(tmp_path / "gone")
    (tmp_path / "gone").rmdir()
    with pytest.raises(FileNotFoundError, match=r"cannot write 'front\.nc': the working folder is no longer there"):
        flights(1).save("front.nc")


def test_a_file_that_is_replaced_keeps_its_permissions_owner_and_group(tmp_path, monkeypatch):
    path, root = tmp_path / "front.nc", hasattr(os, "geteuid") and os.geteuid() == 0  # only root gives files away
    flights(1).save(path)
    if root:
        os.chown(path, 4321, 1234)
    path.chmod(0o640)
    flights(2).save(path)
    found = path.stat()
    assert found.st_mode & 0o777 == 0o640 and len(Front.load(path)) == 2
    assert not root or (found.st_uid, found.st_gid) == (4321, 1234)
    path, modes = tmp_path / "front.nc", []
    flights(1).save(path)
    path.chmod(0o600)
    sync = os.fsync
    monkeypatch.setattr("os.fsync", lambda number: (modes.append(os.fstat(number).st_mode & 0o777), sync(number)))
    flights(2).save(path)
    assert modes == [0o600]


def test_a_name_that_cannot_be_written_is_found_before_any_work(tmp_path, monkeypatch):
    monkeypatch.setattr(files, "to_bytes", lambda _: pytest.fail("the front was converted"))
    (tmp_path / "file").write_text("")
    for name, why in {"x" * 300: "File name too long", "a\0b": "embedded null byte", "file/front.nc": "there is no folder"}.items():
        with pytest.raises(OSError, match=f"(?s)cannot write '.*{why}"):
            flights(1).save(f"{tmp_path}/{name}")
    real = os.access
    monkeypatch.setattr("os.access", lambda path, mode: Path(path).name != "file" and real(path, mode))
    with pytest.raises(PermissionError, match="the file is write-protected"):
        flights(1).save(tmp_path / "file")


@pytest.mark.parametrize("step", ["os.fsync", "pathlib.Path.replace"])
def test_a_full_disk_leaves_the_old_file_and_no_litter(tmp_path, monkeypatch, step):
    path = tmp_path / "front.nc"
    flights(2).save(path)
    before = path.read_bytes()

    def full(*_):
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(step, full)
    with pytest.raises(OSError, match=r"cannot write '.*front\.nc': No space left on device") as caught:
        flights(3).save(path)
    assert caught.value.errno == errno.ENOSPC
    monkeypatch.undo()
    assert path.read_bytes() == before and [p.name for p in tmp_path.iterdir()] == ["front.nc"]


def test_what_cannot_be_read_says_why(tmp_path):
    """What is no ordinary file: `tests/runs/test_odd_files.py`."""
    with (tmp_path / "large").open("wb") as file:
        file.truncate(2**40)
    paths = {tmp_path / "large": "it has 1099511627776 bytes, more than", tmp_path / ("x" * 300): "File name too long"}
    for path, why in (paths | {"a\0b": "embedded null byte"}).items():
        with pytest.raises(ValueError, match=rf"cannot be read: .*{why}"):
            Front.load(path)


def test_a_file_cut_anywhere_is_refused(tmp_path):
    whole = files.to_bytes(flights(3))
    path = tmp_path / "front.nc"
    for length in sorted(
        {0, 1, 4, 8, 9, 47, 48, 95, 96, 200, 511, 512, *range(1000, len(whole), len(whole) // 25), len(whole) - 8, len(whole) - 1}
    ):
        path.write_bytes(whole[:length])
        with pytest.raises(
            ValueError, match=r"front\.nc does not hold a front that can be read: it is (empty|not a netCDF-4 file|cut short)"
        ):
            Front.load(path)


def test_damage_is_refused_in_one_line(tmp_path):
    rng = np.random.default_rng(1)
    wholes = [files.to_bytes(front) for front in (flights(2), black_box(4), empty())]
    path = tmp_path / "front.nc"
    for i in range(200):
        content = damaged(wholes[i % 3], rng)
        path.write_bytes(content)
        if content == wholes[i % 3]:
            Front.load(path)
            continue
        with pytest.raises(ValueError, match="does not hold a front that can be read") as caught:
            Front.load(path)
        assert "\n" not in str(caught.value)


@pytest.mark.parametrize("version", [1, 2])
def test_older_formats_are_read_with_a_warning(tmp_path, version):
    path = tmp_path / "front.nc"
    path.write_bytes(gzip.decompress((Path(__file__).parent / "files" / f"format{version}.nc.gz").read_bytes()))
    with pytest.warns(UserWarning, match=rf"front\.nc was written by an earlier MACS \(format {version}\) and has no checksum") as caught:
        old = Front.load(path)
    assert [Path(one.filename).name for one in caught] == ["test_files.py"]
    assert_same(old, before_limits_had_units(old))
    assert [point.verified for point in old] == [None] * len(old) and "verify" not in old.stats and "verified" not in old.table()
    old.save(path)
    assert_same(Front.load(path), old)


def test_points_of_files_without_tolerances_stay_as_they_were_marked(tmp_path, monkeypatch):
    """The tolerance is a thousandth of the range of both points, also where only one of them is marked again."""
    front = points(cart(), *constant(0.5, 1.5)).verify()
    front = front.replace(F=front.F + 5e-4, verified=[False, True])
    monkeypatch.setattr(files, "root_dataset", partial(without_tolerances, files.root_dataset))
    front.save(tmp_path / "front.nc")
    monkeypatch.undo()
    old = Front.load(tmp_path / "front.nc", problem=cart())
    assert old.verified.tolist() == [False, True] and old[0].tolerances == pytest.approx({"distance": 2e-3, "effort": 4e-3})
    assert old.verify().verified.all() and old[:1].verify().verified.all()
    front[:1].save(tmp_path / "front.nc")
    assert Front.load(tmp_path / "front.nc").tolerances == pytest.approx(front[:1].tolerances)


def without_tolerances(of, front):
    """What an earlier MACS would have written."""
    root = of(front)
    return replace(root, arrays={name: values for name, values in root.arrays.items() if name not in ("tolerances", "within")})


@pytest.mark.parametrize("wrong", [0.0, -1.0, np.inf])
def test_files_with_impossible_tolerances_are_refused(tmp_path, wrong):
    for name, columns in (("tolerances", [[wrong, 1.0]] * 2), ("within", [wrong] * 2)):
        marked(flights(2), [True, False]).replace(**{name: columns}).save(tmp_path / "front.nc")
        with pytest.raises(ValueError, match=f"'{name}' has numbers that are not above 0"):
            Front.load(tmp_path / "front.nc")


def before_limits_had_units(saved: Front) -> Front:
    """What the files in the folder `files` have."""
    new = flights(2, elements=[1, 2])
    phases = [
        [replace(one, path_limits=tuple(replace(limit, unit="") for limit in one.path_limits)) for one in flight.phases]
        for flight in new.trajectories
    ]
    bare = [Trajectory(tuple(several), flight.parameters) for several, flight in zip(phases, new.trajectories, strict=True)]
    return new.replace(trajectories=bare, stats=new.stats | {"versions": saved.stats["versions"]})


def test_files_from_before_limits_had_units_are_read(tmp_path):
    """They are of today's format but for that, and their fronts are still those of the same problem, whose limits have units now."""
    path = tmp_path / "front.nc"
    path.write_bytes(gzip.decompress((Path(__file__).parent / "files" / "format3.nc.gz").read_bytes()))
    old = Front.load(path, problem=compiled())
    assert_same(old, before_limits_had_units(old))
    assert len(Front.merge([old, flights(3, 1)])) == 5
    content = files.to_bytes(old)
    assert_same(files.from_bytes(content), old)


def test_an_older_format_is_not_believed_with_a_checksum_nor_this_one_without(tmp_path):
    old = gzip.decompress((Path(__file__).parent / "files" / "format2.nc.gz").read_bytes())
    for content, why in ((sealed(old), "a netCDF file of something else"), (unsealed(files.to_bytes(flights(1))), "it has no checksum")):
        (tmp_path / "front.nc").write_bytes(content)
        with pytest.raises(ValueError, match=why):
            Front.load(tmp_path / "front.nc")


def test_files_of_other_kinds_are_refused(tmp_path):
    for content in (b"hello\n", b"\x80\x04K\x01.", pickle.dumps({"F": 1}), b"CDF\x01\0\0\0\0", b"PK\3\4"):
        (tmp_path / "front.nc").write_bytes(content)
        with pytest.raises(ValueError, match="it is not a netCDF-4 file"):
            Front.load(tmp_path / "front.nc")
    xarray.Dataset({"objectives": (("point",), [1.0])}).to_netcdf(tmp_path / "front.nc", engine="h5netcdf")
    with pytest.raises(ValueError, match="a netCDF file of something else"):
        Front.load(tmp_path / "front.nc")


# Forged files: the checksum is right, the content is not


@cache
def content() -> bytes:
    """That of the file of a front of two flights on different meshes, the second with costates, without its checksum."""
    return unsealed(files.to_bytes(costated()))


def forged(change) -> bytes:
    """That file with a valid checksum, after `change` has had its h5py.File."""
    buffer = io.BytesIO(content())
    with h5py.File(buffer, "r+") as file:
        change(file)
    return sealed(buffer.getvalue())


def put(name: str, value, **options):
    """A change: another array, or another text or number as an attribute, in the place of one."""

    def change(file: h5py.File) -> None:
        place, _, last = name.rpartition("/")
        group = file[place or "/"]
        if last.startswith("@"):
            fixed = h5py.string_dtype("utf-8", len(value)) if isinstance(value, str) else None
            group.attrs.create(last[1:], value, dtype=fixed)
            return
        if last in group:
            del group[last]
        group.create_dataset(last, data=value, **options)

    return change


def edit(name: str, key, value):
    """A change of some entries of an array."""

    def change(file: h5py.File) -> None:
        file[name][key] = value

    return change


def remove(name: str):
    return lambda file: file.__delitem__(name)


def link(name: str, target):
    def change(file: h5py.File) -> None:
        if name in file:
            del file[name]
        file[name] = target(file) if callable(target) else target

    return change


def claim(name: str, shape, **options):
    """A change: an array that claims a shape, of which nothing is written."""

    def change(file: h5py.File) -> None:
        if name in file:
            del file[name]
        file.create_dataset(name, shape=shape, dtype=options.pop("dtype", "f8"), **options)

    return change


def virtual(file: h5py.File) -> None:
    layout = h5py.VirtualLayout(shape=(2,), dtype="f8")
    layout[:] = h5py.VirtualSource("other.nc", "violation", shape=(2,))
    del file["violation"]
    file.create_virtual_dataset("violation", layout)


def other_climb(file: h5py.File) -> h5py.Group:
    with h5py.File(io.BytesIO(unsealed(files.to_bytes(flights(1))))) as other:
        other.copy("climb", file, "/elsewhere")
    group = file["elsewhere"]
    del file["elsewhere"]
    return group


def long_texts(file: h5py.File) -> None:
    """Many references to one long text."""
    del file["note"]
    texts = file.create_dataset("note", data=np.array(["x" * 100_000] + [""] * 4000, dtype=object), dtype=h5py.string_dtype())
    file.flush()
    content = bytearray(file.id.get_file_image())
    offset = texts.id.get_offset()
    content[offset : offset + 16 * 4001] = bytes(content[offset : offset + 16]) * 4001
    raise Replaced(bytes(content))


def claim_length(file: h5py.File) -> None:
    """A reference to a text of 4 GB."""
    file.flush()
    content = bytearray(file.id.get_file_image())
    offset = file["note"].id.get_offset()
    content[offset : offset + 4] = b"\xff" * 4
    raise Replaced(bytes(content))


class Replaced(Exception):  # noqa: N818 - carries the content of the file
    pass


FORGERIES = {
    "a later format": (
        put("@format_version", FORMAT_VERSION + 1),
        f"version {FORMAT_VERSION + 1}, this MACS reads up to version {FORMAT_VERSION}: update MACS",
    ),
    "no format": (put("@format_version", 0), "version 0"),
    "an array that is not known": (put("climb/extra", [1.0]), "array 'extra', which is not known"),
    "a group that is not known": (lambda file: file.create_group("extra"), "its groups are"),
    "no violations": (remove("violation"), "'violation' is missing"),
    "no phase": (remove("climb"), "its groups are"),
    "no attribute": (lambda file: file.attrs.__delitem__("message"), "'message' is missing"),
    "no seed": (lambda file: file.attrs.__delitem__("seed"), "missing required field `seed`"),
    "a negative count": (put("@evaluations", -1), r"Expected `int` >= 0 - at `\$.evaluations`"),
    "JSON that never ends": (put("@solver", "[" * 100_000), "'solver' is no JSON"),
    "a solver without a name": (put("@solver", '{"name": 5}'), "'solver' is not what it should be"),
    "a transcription that is none": (edit("transcription", 0, "3"), "'transcription' is not what it should be"),
    "another type": (put("violation", np.ones(2, dtype="f4")), "of type float32"),
    "another kind": (put("violation", np.ones(2, dtype="i8")), "'violation' has whole numbers, not numbers"),
    "texts of rank 2": (put("status", np.array([["a"], ["b"]], dtype=object), dtype=h5py.string_dtype()), "texts have 1"),
    "another length": (put("violation", np.ones(3)), "along 'point'"),
    "a compound": (put("violation", np.zeros(2, dtype=[("a", "f8"), ("b", "f8")])), "'violation' is of type"),
    "a status that is none": (edit("status", 0, "perfect"), "'status' is 'perfect'"),
    "a sense that is none": (edit("objective_sense", 0, "best"), "'objective_sense' is 'best'"),
    "bounds that are NaN": (edit("variable_lower", 0, np.nan), r"'climb\.u\[0\]' has bounds that are no interval"),
    "a scale that is NaN": (edit("climb/state_scale", 1, np.nan), "'v' has a scale that is not above 0"),
    "a negative period": (edit("climb/control_period", 0, -1.0), "a period that is not above 0"),
    "two objectives of a name": (edit("objective", 1, "time"), "two objectives have the same name"),
    "places twice": (edit("place", (0, 1), 0), "'place' does not number"),
    "more nodes than there are": (edit("climb/node_count", 0, 10**9), "'node_count' is not between"),
    "elements without ends": (edit("climb/element_count", 0, 1), "'edge_count' is not that of its elements"),
    "a phase that a point lacks": (edit("climb/node_count", 0, 0), "in some phases only"),
    "a basis that is none": (edit("climb/state_basis", 0, "fourier"), "there is no basis 'fourier'"),
    "costates without an end": (edit("climb/costate_edge_count", 1, 3), "'costate_edge_count' is not that of its elements"),
    "costates less than none": (edit("climb/costate_element_count", 1, -1), "'costate_element_count' is not between"),
    "costates of too many functions": (edit("climb/costate_function_count", 1, 99), "'costate_function_count' is not between"),
    "costates of no basis": (edit("climb/costate_basis", 1, "fourier"), "there is no basis 'fourier'"),
    "costates without a Hamiltonian": (remove("climb/hamiltonian"), "'hamiltonian' is missing"),
    "costates of some states": (remove("climb/costate_of_v"), "'costate_of_v' is missing"),
    "costates with a weight that is NaN": (edit("weights", 1, np.nan), "without weights"),
    "costates without weights": (remove("weights"), "without weights"),
    "no state": (remove("climb/h"), "'h' is missing"),
    "other points in a phase": (link("climb", other_climb), "phase 'climb' has 1 points, the front has 2"),
    "compressed": (put("violation", np.zeros(2), compression="gzip"), "compressed, in pieces or elsewhere"),
    "filled": (claim("violation", (10**9,)), "but 0 bytes are stored"),
    "long without an entry": (claim("objectives", (10**12, 0), chunks=(1, 1), maxshape=(None, None)), "but 0 bytes are stored"),
    "in another file": (claim("violation", (2,), external=[("/etc/hostname", 0, 16)]), "compressed, in pieces or elsewhere"),
    "virtual": (virtual, "compressed, in pieces or elsewhere"),
    "a soft link": (link("violation", h5py.SoftLink("/optimality")), "'violation' is a link to another place"),
    "a link to another file": (link("violation", h5py.ExternalLink("other.nc", "/violation")), "'violation' is a link to another place"),
    "a circle of groups": (link("_closest", lambda file: file["/"]), "groups at more than"),
    "a text that is longer than the file": (lambda file: claim_length(file), "'note' refers to a text that is not there"),
    "many references to one text": (long_texts, "has more content than the file has bytes"),
    "two points closest": (lambda file: copy_root(file), "the closest point is one, not 2"),
}


def copy_root(file: h5py.File) -> None:
    closest = file.create_group("_closest")
    for name in list(file):
        if name != "_closest":
            file.copy(name, closest)
    for key, value in file.attrs.items():
        if not key.startswith("_"):
            closest.attrs[key] = value


@pytest.mark.parametrize("name", FORGERIES)
def test_forged_files_are_refused_in_one_line(tmp_path, name):
    change, why = FORGERIES[name]
    try:
        file = forged(change)
    except Replaced as replaced:
        file = sealed(replaced.args[0])
    (tmp_path / "front.nc").write_bytes(file)
    with pytest.raises(ValueError, match=why) as caught:
        Front.load(tmp_path / "front.nc")
    assert "\n" not in str(caught.value) and "does not hold a front that can be read" in str(caught.value)


def save_with(path: Path, address: str, **data) -> None:
    flights(1, problem=ProblemSource("two legs", compiled().fingerprint, address, data)).save(path)


def test_an_address_in_a_file_is_not_run_unasked(tmp_path, monkeypatch):
    (tmp_path / "own.py").write_text(f"open({str(tmp_path / 'ran')!r}, 'w')\nfrom synthetic_fronts import state_problem\n")
    path, address = tmp_path / "front.nc", f"{tmp_path / 'own.py'}:state_problem"
    save_with(path, address)
    for act in (lambda front: front[0].simulate(), lambda front: front.simulate(), lambda front: front.compiled()):
        with pytest.raises(
            ValueError, match=r"made by the code at '.*own\.py:state_problem', .*--trust, or Front.load\(path, trust=True\)"
        ):
            act(Front.load(path))
    assert not (tmp_path / "ran").exists()
    Front.load(path, state_problem())[0].simulate()
    assert not (tmp_path / "ran").exists()
    monkeypatch.setattr("problems.load", lambda name: state_problem() if name == address else pytest.fail(name))
    Front.load(path, trust=True)[0].simulate()


@pytest.mark.parametrize("trust", [False, True])
@pytest.mark.parametrize("address", ["os:system", "subprocess:getoutput", "posix:system", "os.path:os.system"])
def test_a_forged_address_runs_nothing(tmp_path, address, trust):
    marker = tmp_path / "marker"
    argument = "cmd" if address == "subprocess:getoutput" else "command"
    save_with(tmp_path / "front.nc", address, **{argument: f"touch {marker}"})
    front = Front.load(tmp_path / "front.nc", trust=trust)
    with pytest.raises(ValueError, match=r"does not load from|is not run unasked"):
        front[0].simulate()
    assert not marker.exists()


def test_a_front_takes_its_own_problem_or_one_of_the_catalogue(tmp_path):
    path = tmp_path / "front.nc"
    flights(2).save(path)
    assert Front.load(path, problem=state_problem()).problem.name == "two legs"
    assert Front.load(path, problem=compiled()).problem is compiled()
    with pytest.raises(ValueError, match=r"front\.nc belongs to problem 'two legs'.*not to 'two legs'"):
        Front.load(path, problem=state_problem(speed=4.0))
    black_box().save(path)
    with pytest.raises(ValueError, match="black box"):
        Front.load(path, problem=compiled())
    empty().save(tmp_path / "front.nc")
    assert Front.load(tmp_path / "front.nc", compiled()).closest.simulate().trajectory is not None
    for address in ("goddard", "problems.cases.goddard:problem"):
        save_with(tmp_path / "front.nc", address)
        with pytest.raises(ValueError, match=r"the front belongs to problem 'two legs' \(.*\), not to 'goddard'"):
            Front.load(tmp_path / "front.nc").compiled()


TIMES = ["climb: t0 [s]", "climb: tf [s]", "coast: t0 [s]", "coast: tf [s]"]


def table(path: Path) -> tuple[list[str], list[list[str]]]:
    head, *rows = csv.reader(path.open(encoding="utf-8"))
    return head, rows


def floats(rows: list[list[str]], first: int, end: int) -> np.ndarray:
    return np.array([[float(cell) for cell in row[first:end]] for row in rows])


def test_csv_of_fronts_has_units_every_bit_and_what_a_simulation_found(tmp_path):
    front = flights(3)
    front.to_csv(tmp_path / "front.csv")
    head, rows = table(tmp_path / "front.csv")
    assert head == ["point", "time [s]", "height [km]", "verified", "status", "mass", *TIMES, "violation"]
    assert [row[0] for row in rows] == ["0", "1", "2"] and [row[3:5] for row in rows] == [["", "converged"]] * 3
    assert same(floats(rows, 1, 3), front.objectives)
    ends = [[t for phase in point.trajectory.phases for t in (phase.t0, phase.tf)] for point in front]
    assert same(floats(rows, 5, 10), np.column_stack([[point.parameters["mass"] for point in front], ends]))
    front = marked(flights(3), [True, False, False], [True, True, False])
    front.to_csv(tmp_path / "front.csv")
    head, rows = table(tmp_path / "front.csv")
    assert head[10:] == ["violation", "defect", "time, simulated [s]", "height, simulated [km]", "violation, simulated"]
    assert [row[3] for row in rows] == ["yes", "no", ""] and [row[11] for row in rows] == ["1e-05", "1e-05", ""]
    assert same(floats(rows[:2], 12, 14), 1.01 * front.objectives[:2])
    assert rows[2][11:] == [""] * 4 and [row[14] for row in rows[:2]] == ["1e-06"] * 2
    front = black_box(3)
    front.to_csv(tmp_path / "front.csv")
    head, rows = table(tmp_path / "front.csv")
    assert head == ["point", "f0 [kg]", "f1", "verified", "status", "span [m]", "chord [m]", "twist", "violation"]
    assert same(floats(rows, 5, 8), front.decision)
    front[1].to_csv(tmp_path / "one.csv")
    assert table(tmp_path / "one.csv") == (head, [["0", *rows[1][1:]]])
    failed = flights(2).replace(trajectories=[None, flights(2).trajectories[1]])
    failed.to_csv(tmp_path / "failed.csv")
    assert table(tmp_path / "failed.csv")[1][0][5:10] == [""] * 5


def test_csv_of_a_trajectory_is_its_history(tmp_path):
    point = flights(3)[1]
    point.to_csv(tmp_path / "flight.csv")
    head, rows = table(tmp_path / "flight.csv")
    assert head == ["phase", "time [s]", "h [km]", "v [km/s]", "u [km/s²]", "load [km²/s³]"]
    climb, coast = point.trajectory.phases
    count = len(climb.time)
    assert [row[0] for row in rows] == ["climb"] * count + ["coast"] * len(coast.time)
    assert same(floats(rows[:count], 1, 6), np.column_stack([climb.time, climb.states, climb.controls, climb.paths]))
    assert same(floats(rows[count:], 1, 3), np.column_stack([coast.time, coast.states]))
    assert all(row[3:] == [""] * 3 for row in rows[count:]), "the coast has no speed and no control"


@pytest.mark.parametrize(("length", "known"), [(2.0, True), (-3.7e-6, False)])
def test_csv_has_costates_of_phases_with_a_length(tmp_path, length, known):
    point = costated(length)[1]
    point.to_csv(tmp_path / "flight.csv")
    head, rows = table(tmp_path / "flight.csv")
    assert head[6:] == ["costate of h [per km]", "costate of v [per km/s]", "Hamiltonian [per s]"]
    climb, costates = len(point.trajectory["climb"].time), point.costates["climb"]
    assert same(floats(rows[:climb], 6, 9), np.column_stack([costates.at_nodes, costates.hamiltonian]))
    assert [bool(row[6]) for row in rows[climb:]] == [known] * (len(rows) - climb)


@pytest.mark.parametrize("wrong", [None, 0.0, -1.0, "much", True])
def test_files_whose_points_were_judged_by_nothing_are_refused(wrong, tmp_path):
    front = marked(flights(2), [True, False])
    front.stats = {key: value for key, value in front.stats.items() if key != "verify"} | ({} if wrong is None else {"verify": wrong})
    front.save(tmp_path / "front.nc")
    with pytest.raises(ValueError, match="may miss" if wrong is None else r"at `\$.verify`"):
        Front.load(tmp_path / "front.nc")
