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

NUMBER, COUNT, TEXT = "f", "i", "O"
"""Kinds of an array: float64, whole numbers, str."""
NUMBERS = ("float64", "int8", "int32", "int64")
"""Types of the numbers that are read."""
DEPTH = 3
"""Most levels of groups, the root included."""
REFERENCE = np.dtype([("length", "<u4"), ("address", "<u8"), ("index", "<u4")])
"""How an array refers to a text: its length in bytes, the address of a collection of texts, and its index there."""
COLLECTION = b"GCOL\1\0\0\0"
"""How HDF5 begins a collection of texts."""
HEAD = 16
"""Bytes before the objects of a collection, and before the content of each of them."""
DIMENSION_ONLY = b"This is a netCDF dimension but not a netCDF variable"
"""What netCDF-4 calls a dimension without labels."""


class FileArray(NamedTuple):
    """What an array of a file is."""

    dimensions: tuple[str, ...]
    kind: str  # NUMBER, COUNT or TEXT
    long_name: str
    units: str = "1"
    optional: bool = False  # whether files need not have it

    def of(self, values: Any) -> np.ndarray:
        """Values as an array of this kind, with NaN for None."""
        if self.kind == TEXT:
            return words(values)
        if self.kind == COUNT:
            return np.asarray(values, dtype=np.int32)
        return np.array([np.nan if value is None else value for value in values], dtype=float)


@dataclass(frozen=True, eq=False)
class Labelled:
    """Arrays with named dimensions, as a group of a netCDF file has them: what files need of an xarray.Dataset, which takes a second or two
    to import."""

    arrays: Mapping[str, np.ndarray]  # of numbers, or of str as objects. Labels of a dimension are the array of its name.
    table: Mapping[str, FileArray]  # of these arrays, and maybe of others
    attrs: dict[str, Any] = field(default_factory=dict)  # texts, numbers and arrays of numbers

    def __post_init__(self) -> None:
        lengths: dict[str, int] = {}
        for name, values in self.arrays.items():
            dimensions = self.table[name].dimensions
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
            for dimension, length in zip(self.table[name].dimensions, values.shape, strict=True)
        }

    def __getitem__(self, name: str) -> np.ndarray:
        return self.arrays[name]

    def to_xarray(self) -> xarray.Dataset:
        """The same as a Dataset of xarray."""
        import xarray

        about = {name: self.table[name] for name in self.arrays}
        labels = {name: {"long_name": one.long_name, "units": one.units} for name, one in about.items()}
        variables = {name: (list(one.dimensions), self.arrays[name], labels[name]) for name, one in about.items()}
        return xarray.Dataset(variables, attrs=self.attrs)


@dataclass(frozen=True)
class Group:
    """Content of a group of a file: its arrays, attributes and groups by name."""

    arrays: dict[str, np.ndarray]
    attrs: dict[str, Any]
    groups: dict[str, Group]


def to_bytes(groups: Mapping[str, Labelled]) -> bytes:
    """The content of a file with these groups, by their paths; "" is the root. h5netcdf takes five times as long to write it."""
    import h5py

    buffer = io.BytesIO()
    with h5py.File(buffer, "w", track_order=True) as file:
        for path, data in groups.items():
            _write_group(file.create_group(path, track_order=True) if path else file, data)
    return buffer.getvalue()


def _write_group(group: Any, data: Labelled) -> None:
    """Write the arrays of a group, its dimensions and its attributes, as "NetCDF-4 Format" (docs.unidata.ucar.edu) has them: a dimension is
    a scale of HDF5, which is the array of its labels if it has any."""
    from h5py import string_dtype

    sizes, items = data.sizes, {}
    for name, size in sizes.items():
        if name not in data.arrays:
            items[name] = group.create_dataset(name, (size,), ">f4", maxshape=None if size else (None,))
            items[name].make_scale(DIMENSION_ONLY + b".%10d" % size)
    for name, values in data.arrays.items():
        labels = data.table[name]
        # netCDF gives dimensions without entries an unlimited length.
        most = tuple(size or None for size in values.shape) if 0 in values.shape else None
        dtype = string_dtype() if values.dtype.kind == "O" else values.dtype
        items[name] = group.create_dataset(name, dtype=dtype, data=values, maxshape=most, track_order=True)
        items[name].attrs["long_name"], items[name].attrs["units"] = labels.long_name, labels.units
        if labels.dimensions == (name,):
            items[name].make_scale(name)
    for name in data.arrays:
        for place, dimension in enumerate(data.table[name].dimensions):
            if dimension != name:
                items[name].dims[place].attach_scale(items[dimension])
    for key, value in data.attrs.items():
        group.attrs[key] = _fixed(value) if isinstance(value, str) else value


def _fixed(text: str) -> np.ndarray:
    """A text as an attribute that has its length in its type."""
    import h5py

    content = text.encode() or b"\0"
    return np.array(content, dtype=h5py.string_dtype("utf-8", len(content)))


def from_bytes(content: bytes, older: bool = False) -> Group:
    """The root of a file with all that is in it."""
    import h5py

    reader = _Reader(content, older)
    with h5py.File(io.BytesIO(content), "r") as file:
        return reader.group(file.id)


class _Reader:
    """Reads the content of a file, and no more values than would fit into it.

    Groups and arrays are those of h5py's lower level: the upper one takes twice as long, most of it to look up what is not asked for.
    """

    def __init__(self, content: bytes, older: bool):
        self._content, self._left = content, len(content)
        self._older = older
        self._texts = _find_texts(content)

    def group(self, group: Any, level: int = 1) -> Group:
        """A group with all that is in it."""
        import h5py

        if level > DEPTH:
            raise ValueError(f"it has groups at more than {DEPTH} levels")
        attributes = h5py.AttributeManager(h5py.Group(group))
        found = Group({}, {name: self._attribute(name, attributes) for name in attributes}, {})
        for name in h5py.Group(group):
            self._take(64, name)  # bytes that an array or a group takes in a file at the least, beside its values
            if group.links.get_info(name.encode()).type != h5py.h5l.TYPE_HARD:
                raise ValueError(f"'{name}' is a link to another place")
            item = h5py.h5o.open(group, name.encode())
            if isinstance(item, h5py.h5g.GroupID):
                found.groups[name] = self.group(item, level + 1)
            elif not isinstance(item, h5py.h5d.DatasetID):
                raise ValueError(f"'{name}' is no array")
            elif not (h5py.h5ds.is_scale(item) and h5py.h5ds.get_scale_name(item).startswith(DIMENSION_ONLY)):
                found.arrays[name] = self._array(name, item)
        return found

    def _take(self, count: int, name: str) -> None:
        self._left -= count
        if self._left < 0:
            raise ValueError(f"'{name}' has more content than the file has bytes")

    def _array(self, name: str, data: Any) -> np.ndarray:
        import h5py

        dtype, shape = data.dtype, data.shape
        text = _is_text(dtype)
        if not text and dtype.name not in NUMBERS:
            raise ValueError(f"'{name}' is of type {dtype}, neither a number of 64 bits nor a text")
        plan, count, stored = data.get_create_plist(), math.prod(shape), data.get_storage_size()
        # netCDF gives dimensions without entries an unlimited length, for which HDF5 needs chunks.
        plain = plan.get_layout() == (h5py.h5d.CONTIGUOUS if count else h5py.h5d.CHUNKED)
        if not plain or plan.get_nfilters() or plan.get_external_count():
            raise ValueError(f"'{name}' is not stored in this file as it is, but compressed, in pieces or elsewhere")
        if max(shape, default=0) > len(self._content) or stored != count * (REFERENCE.itemsize if text else dtype.itemsize):
            raise ValueError(f"'{name}' has a shape of {shape}, but {stored} bytes are stored")
        self._take(stored, name)
        if not text:
            values = np.empty(shape, dtype)
            if count:
                data.read(h5py.h5s.ALL, h5py.h5s.ALL, values)
            return values
        if len(shape) != 1:
            raise ValueError(f"'{name}' has {len(shape)} dimensions, texts have 1")
        references = np.frombuffer(self._content, REFERENCE, count, data.get_offset()) if count else np.empty(0, REFERENCE)
        return words([self._text(name, *reference) for reference in references.tolist()])

    def _text(self, name: str, length: int, address: int, index: int) -> str:
        """The text that a reference is to, as HDF5 would read it; but HDF5 allocates any length that a reference claims."""
        start, size = self._texts.get((address, index), (0, 0))
        if length > size:
            raise ValueError(f"'{name}' refers to a text that is not there")
        self._take(length, name)
        return self._content[start : start + length].decode()

    def _attribute(self, name: str, attributes: Any) -> Any:
        """A text, a number or a list of numbers; None for anything else, such as what netCDF and HDF5 note for themselves."""
        found = attributes.get_id(name)
        fixed = found.dtype.kind == "S" and not found.shape
        number = found.dtype.name in NUMBERS and len(found.shape) < 2
        self._take(math.prod(found.shape) * found.dtype.itemsize, name)
        if fixed:
            return attributes[name].decode()
        if number:
            return attributes[name].item() if math.prod(found.shape) == 1 else attributes[name].tolist()
        if self._older and _is_text(found.dtype) and not found.shape:
            return str(attributes[name])
        return None


def _find_texts(content: bytes) -> dict[tuple[int, int], tuple[int, int]]:
    """Where the texts of a file begin, and their lengths in bytes, by the address of their collection and their index in it.

    Raises ValueError if an object of a collection has no length or ends beyond it; in such, HDF5 could go in a circle.
    """
    found: dict[tuple[int, int], tuple[int, int]] = {}
    address, left = content.find(COLLECTION), len(content) // HEAD
    while address >= 0:
        end = address + int.from_bytes(content[address + 8 : address + 16], "little")
        place = address + HEAD
        while place + HEAD <= end:
            index, length = int.from_bytes(content[place : place + 2], "little"), int.from_bytes(content[place + 8 : place + 16], "little")
            # Object 0 is the space that is free, its own head included; objects take whole multiples of 8 bytes.
            step = length if index == 0 else HEAD + (length + 7) // 8 * 8
            left -= 1
            if step < HEAD or place + step > min(end, len(content)) or left < 0:
                raise ValueError("its texts are damaged")
            found[address, index] = place + HEAD, length
            place += step
        address = content.find(COLLECTION, address + 1)
    return found


def words(texts: Any) -> np.ndarray:
    """An array of str as objects, each as long as it is."""
    array = np.empty(len(texts), dtype=object)
    array[:] = [str(text) for text in texts]
    return array


def _is_text(dtype: np.dtype) -> bool:
    """Whether this is a type of texts of variable length."""
    import h5py

    info = h5py.check_string_dtype(dtype)
    return info is not None and info.length is None
