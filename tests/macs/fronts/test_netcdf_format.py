"""Files have what h5netcdf writes for the same arrays, object by object, so that programs for netCDF-4 open them."""

from __future__ import annotations

import io
from typing import Any

import h5netcdf
import h5py
import numpy as np
import pytest
from synthetic_fronts import black_box, empty, flights

from macs.fronts import files
from macs.io import netcdf

FRONTS = {"flights": flights, "empty": empty, "black box": black_box}


def by_h5netcdf(groups: dict[str, netcdf.Labelled]) -> bytes:
    buffer = io.BytesIO()
    with h5netcdf.File(buffer, "w") as file:
        for path, data in groups.items():
            group = file.create_group(path) if path else file
            group.dimensions = data.sizes
            for name in data.arrays:
                values, labels = data[name], data.table[name]
                dtype = h5py.string_dtype() if values.dtype.kind == "O" else values.dtype
                variable = group.create_variable(name, labels.dimensions, dtype=dtype, data=values)
                variable.attrs["long_name"], variable.attrs["units"] = labels.long_name, labels.units
            for key, value in data.attrs.items():
                group.attrs[key] = netcdf._fixed(value) if isinstance(value, str) else value
    return buffer.getvalue()


def attributes(item: Any) -> dict[str, Any]:
    """Types, shapes and values; of references, the names of what they are to. But not which program wrote the file."""
    found: dict[str, Any] = {}
    for name, value in item.attrs.items():
        about = item.attrs.get_id(name)
        if name == "DIMENSION_LIST":
            found[name] = [[item.file[one].name for one in row] for row in value]
        elif name == "REFERENCE_LIST":
            found[name] = sorted((item.file[one].name, int(place)) for one, place in value)
        elif name != "_NCProperties":
            found[name] = (about.dtype.str, about.shape, repr(value))
    return dict(sorted(found.items()))


def objects(content: bytes) -> dict[str, Any]:
    """All groups and arrays in their order, with all that there is to know of them but how empty ones would be cut into chunks."""
    found: dict[str, Any] = {}

    def note(name: str, item: Any) -> None:
        plan = item.id.get_create_plist()
        if isinstance(item, h5py.Group):
            found[name] = (list(item), attributes(item), plan.get_link_creation_order())
        else:
            scale = h5py.h5ds.get_scale_name(item.id) if h5py.h5ds.is_scale(item.id) else None
            layout = (item.dtype.str, item.shape, item.maxshape, plan.get_layout(), plan.get_attr_creation_order())
            found[name] = (layout, scale, attributes(item), item[...].tolist(), repr(item.fillvalue))

    with h5py.File(io.BytesIO(content)) as file:
        note("/", file)
        file.visititems(note)
    return found


@pytest.mark.slow
@pytest.mark.parametrize("name", FRONTS)
def test_a_file_has_what_h5netcdf_writes(name: str) -> None:
    groups = dict(files._datasets(FRONTS[name]()))
    ours, theirs = objects(netcdf.to_bytes(groups)), objects(by_h5netcdf(groups))
    assert list(ours) == list(theirs)
    for path, item in ours.items():
        assert repr(item) == repr(theirs[path]), path


def test_a_dimension_has_no_other_array_of_its_name() -> None:
    labels = {"a": netcdf.FileArray(("b",), "f", "an array"), "b": netcdf.FileArray(("a",), "f", "another")}
    with pytest.raises(ValueError, match="'a' is a dimension, and an array of others"):
        netcdf.to_bytes({"": netcdf.Labelled({"a": np.zeros(2), "b": np.zeros(3)}, labels)})
