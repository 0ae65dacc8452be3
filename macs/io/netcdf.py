"""Labelled arrays as a netCDF-4 file in memory, and back from a file that need not be trusted.

What is written is plain: arrays are stored in full, one after the other, without filters, and each has a name and a unit. Only such files
are read: no links but hard ones, nothing stored elsewhere, nothing that is smaller in the file than in memory. So reading takes no more
memory and time than the size of the file allows, whatever shapes the file claims.
"""

from __future__ import annotations

import io
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

if TYPE_CHECKING:
    import xarray

NUMBERS = ("float64", "int8", "int32", "int64")
"""Types of the numbers that are read."""
DEPTH = 3
"""Most levels of groups, the root included."""
OVERHEAD = 64
"""Bytes that an array or a group takes in a file at the least, beside its values."""
REFERENCE = 16
"""Bytes of a reference to a text, which is stored elsewhere in the file."""
AT_ONCE = 2**26
"""Bytes that the texts that are read in one call may take, should a file refer to its longest text again and again."""
HEAP = b"GCOL\1\0\0\0"
"""How HDF5 begins the collections in which it keeps texts."""
DIMENSION_ONLY = b"This is a netCDF dimension but not a netCDF variable"
"""What netCDF-4 calls a dimension without labels."""


class Labels(NamedTuple):
    """What an array is: the names of its dimensions, and a name and a unit for its reader."""

    dimensions: tuple[str, ...]
    long_name: str
    units: str = "1"


@dataclass(frozen=True, eq=False)
class Labelled:
    """Arrays with named dimensions, as a group of a netCDF file has them: what files need of an xarray.Dataset, which takes a second or two
    to import.

    Attributes
    ----------
    arrays : name -> array
        Of numbers, or of str as objects. Labels of a dimension are the array of its name.
    labels : name -> Labels
        Of each array.
    attrs : mapping
        Texts, numbers and arrays of numbers.

    Raises
    ------
    ValueError
        If two arrays do not agree on the length of a dimension.
    """

    arrays: Mapping[str, np.ndarray]
    labels: Mapping[str, Labels]
    attrs: dict[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        lengths: dict[str, int] = {}
        for name, values in self.arrays.items():
            dimensions = self.labels[name].dimensions
            if values.ndim != len(dimensions):
                raise ValueError(f"'{name}' has {values.ndim} dimensions, not {len(dimensions)} ({', '.join(dimensions)})")
            for dimension, length in zip(dimensions, values.shape, strict=True):
                if lengths.setdefault(dimension, length) != length:
                    raise ValueError(f"'{name}' has {length} entries along '{dimension}', others have {lengths[dimension]}")

    @property
    def sizes(self) -> dict[str, int]:
        """Lengths of the dimensions."""
        return {
            dimension: length
            for name, values in self.arrays.items()
            for dimension, length in zip(self.labels[name].dimensions, values.shape, strict=True)
        }

    def __getitem__(self, name: str) -> np.ndarray:
        return self.arrays[name]

    def to_xarray(self) -> xarray.Dataset:
        """The same as a Dataset of xarray."""
        import xarray

        variables = {
            name: (list(labels.dimensions), self.arrays[name], {"long_name": labels.long_name, "units": labels.units})
            for name, labels in self.labels.items()
        }
        return xarray.Dataset(variables, attrs=self.attrs)


@dataclass(frozen=True)
class Group:
    """Content of a group of a file: its arrays, attributes and groups by name."""

    arrays: dict[str, np.ndarray]
    attrs: dict[str, Any]
    groups: dict[str, Group]


def to_bytes(groups: Mapping[str, Labelled]) -> bytes:
    """The content of a file with these groups, by their paths; "" is the root."""
    import h5netcdf
    import h5py

    buffer = io.BytesIO()
    with h5netcdf.File(buffer, "w") as file:
        for path, data in groups.items():
            group = file.create_group(path) if path else file
            group.dimensions = data.sizes
            for name, labels in data.labels.items():
                values = data[name]
                dtype = h5py.string_dtype() if values.dtype.kind == "O" else values.dtype
                variable = group.create_variable(name, labels.dimensions, dtype=dtype, data=values)
                variable.attrs["long_name"], variable.attrs["units"] = labels.long_name, labels.units
            for key, value in data.attrs.items():
                group.attrs[key] = value
    return buffer.getvalue()


def from_bytes(content: bytes) -> Group:
    """The root of a file with all that is in it.

    Raises
    ------
    ValueError
        If it has what `to_bytes` does not write: links to other places, compressed or incomplete arrays, types other than `NUMBERS` and
        texts, more values than bytes.
    Exception
        Of any class, from HDF5, if it is none of its files.
    """
    import h5py

    _check_heaps(content)
    with h5py.File(io.BytesIO(content), "r") as file:
        return _Reader(len(content)).group(file)


def _check_heaps(content: bytes) -> None:
    """Raise ValueError for a collection of texts in which HDF5 would go in a circle, since one of its objects has no length."""
    start, left = content.find(HEAP), len(content) // 16
    while start >= 0:
        end = start + int.from_bytes(content[start + 8 : start + 16], "little")
        place = start + 16
        while place + 16 <= end:
            index, length = int.from_bytes(content[place : place + 2], "little"), int.from_bytes(content[place + 8 : place + 16], "little")
            # Object 0 is the space that is free, its own head included.
            step = length if index == 0 else 16 + (length + 7) // 8 * 8
            left -= 1
            if step < 16 or place + step > end or left < 0:
                raise ValueError("its texts are damaged")
            place += step
        start = content.find(HEAP, start + 1)


class _Reader:
    """Reads a file of `size` bytes, and no more values than would fit into it."""

    def __init__(self, size: int):
        self._size = self._left = size

    def group(self, group: Any, level: int = 1) -> Group:
        """A group with all that is in it."""
        import h5py

        if level > DEPTH:
            raise ValueError(f"it has groups at more than {DEPTH} levels")
        found = Group({}, self._attributes(group), {})
        for name in group:
            self._take(OVERHEAD, name)
            if group.id.links.get_info(name.encode()).type != h5py.h5l.TYPE_HARD:
                raise ValueError(f"'{name}' is a link to another place")
            item = group[name]
            if isinstance(item, h5py.Group):
                found.groups[name] = self.group(item, level + 1)
            elif not isinstance(item, h5py.Dataset):
                raise ValueError(f"'{name}' is no array")
            elif not (h5py.h5ds.is_scale(item.id) and h5py.h5ds.get_scale_name(item.id).startswith(DIMENSION_ONLY)):
                found.arrays[name] = self._array(name, item)
        return found

    def _take(self, count: int, name: str) -> None:
        self._left -= count
        if self._left < 0:
            raise ValueError(f"'{name}' has more content than the file has bytes")

    def _array(self, name: str, data: Any) -> np.ndarray:
        import h5py

        text = _is_text(data.dtype)
        if not text and data.dtype.name not in NUMBERS:
            raise ValueError(f"'{name}' is of type {data.dtype}, neither a number of 64 bits nor a text")
        plan = data.id.get_create_plist()
        stored = data.id.get_storage_size()
        count = math.prod(data.shape)
        # netCDF gives dimensions without entries an unlimited length, for which HDF5 needs chunks.
        plain = plan.get_layout() in (h5py.h5d.COMPACT, h5py.h5d.CONTIGUOUS) or (not count and plan.get_layout() == h5py.h5d.CHUNKED)
        if not plain or plan.get_nfilters() or plan.get_external_count():
            raise ValueError(f"'{name}' is not stored in this file as it is, but compressed, in pieces or elsewhere")
        if max(data.shape, default=0) > self._size or stored != count * (REFERENCE if text else data.dtype.itemsize):
            raise ValueError(f"'{name}' has a shape of {data.shape}, but {stored} bytes are stored")
        self._take(stored, name)
        return self._texts(name, data) if text else np.asarray(data[...])

    def _texts(self, name: str, data: Any) -> np.ndarray:
        """An array of str, read in blocks: how long texts are is only known when they are read, and many may refer to the same."""
        if data.ndim != 1:
            raise ValueError(f"'{name}' has {data.ndim} dimensions, texts have 1")
        block = max(1, AT_ONCE // self._size)
        texts: list[str] = []
        for start in range(0, len(data), block):
            raw = data[start : start + block].tolist()
            self._take(sum(map(len, raw)), name)
            texts += [word.decode() for word in raw]
        return words(texts)

    def _attributes(self, group: Any) -> dict[str, Any]:
        """Texts, numbers and lists of numbers; what netCDF and HDF5 note for themselves is not read."""
        found: dict[str, Any] = {}
        for name in group.attrs:
            attribute = group.attrs.get_id(name)
            text = _is_text(attribute.dtype) and attribute.shape in ((), (1,))
            if not text and (attribute.dtype.name not in NUMBERS or len(attribute.shape) > 1):
                continue
            self._take(math.prod(attribute.shape) * attribute.dtype.itemsize, name)
            value = group.attrs[name]
            if text:
                value = value if isinstance(value, str) else str(value[0])
                self._take(len(value), name)
            found[name] = value if text else value.item() if value.size == 1 else value.tolist()
        return found


def words(texts: Any) -> np.ndarray:
    """An array of str as objects, each as long as it is."""
    array = np.empty(len(texts), dtype=object)
    array[:] = [str(text) for text in texts]
    return array


def _is_text(dtype: np.dtype) -> bool:
    import h5py

    info = h5py.check_string_dtype(dtype)
    return info is not None and info.length is None
