"""HDF5 files from elsewhere: opened only where all that they hold lies in themselves."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO

import h5py

from tribodyn.refusal import Refusal


@contextmanager
def opened_hdf5(source: Path | BinaryIO) -> Iterator[h5py.File]:
    """Open an HDF5 file that somebody else may have written.

    Raises  Refusal: it names other files or places (soft and external links, external storage, virtual data sets), so
        that reading it would read those; OSError: it is no HDF5 file"""
    with h5py.File(source, "r") as file:
        _require_contained(file, set())
        yield file


def _require_contained(group: h5py.Group, visited: set[int]) -> None:
    """Visit every object below a group once; a group can hold itself."""
    for name in group:
        if not isinstance(group.get(name, getlink=True), h5py.HardLink):
            raise Refusal(f"'{name}' in this HDF5 file is a link to another place or file: write a file without links")
        item = group[name]
        if isinstance(item, h5py.Dataset) and (item.external or item.is_virtual):
            raise Refusal(f"'{name}' in this HDF5 file is stored in another file: write its numbers into this one")
        address = h5py.h5o.get_info(item.id).addr
        if isinstance(item, h5py.Group) and address not in visited:
            visited.add(address)
            _require_contained(item, visited)
