"""Checksums of a results file: what was damaged on a disk or on the way is refused, not read.

Numbers carry HDF5's own (Fletcher32, checked as they are read), the file's structure those of its format since HDF5
1.10.  Neither covers texts, which HDF5 keeps on a heap, and single values: a digest over all of them is an attribute
of the file.
"""

from __future__ import annotations

import hashlib
from typing import Any

import h5py
import numpy as np

FORMAT_BOUNDS = ("v110", "v110")  # the oldest format with checksums in its structure, and none newer
DIGEST = "texts"  # attribute of the file
WHOLE = 1 << 20  # bytes of an array that is one chunk


def put(group: h5py.Group, name: str, data: Any, **how: Any) -> h5py.Dataset:
    """Write an array with a checksum, which an array without values has no room for."""
    data = np.asarray(data)
    if data.ndim == 0 or data.size == 0:
        return group.create_dataset(name, data=data)
    # fault: arrays have no checksum -> how = {**how} | coupler/test_damaged_results
    how = {"fletcher32": True, **how}
    return group.create_dataset(name, data=data, chunks=data.shape if data.nbytes <= WHOLE else True, **how)


def digest_of(f: h5py.File) -> str:
    """Return the digest of all texts and single values of a file: of its attributes and of its data sets."""
    digest = hashlib.blake2b(digest_size=16)

    def add(*words: str) -> None:
        for word in words:
            digest.update(len(word.encode()).to_bytes(8, "little") + word.encode())

    def attributes(name: str, item: Any) -> None:
        for key in sorted(item.attrs):
            if (name, key) != ("/", DIGEST):
                value = item.attrs[key]
                add(name, key, value if isinstance(value, str) else repr(np.asarray(value).tolist()))

    def visit(name: str, item: Any) -> None:
        attributes(name, item)
        if isinstance(item, h5py.Dataset):
            add(name, str(item.dtype), repr(item.shape))
            if h5py.check_string_dtype(item.dtype) is not None:
                add(item.asstr()[()])
            elif item.shape == ():
                add(repr(item[()]))

    attributes("/", f)
    f.visititems(visit)
    return digest.hexdigest()


def close_texts(f: h5py.File) -> None:
    """Write the digest of the texts: the last act on a file that was made or changed."""
    f.attrs[DIGEST] = digest_of(f)


def check_texts(f: h5py.File) -> None:
    """Check the texts of a file against their digest.  Raises ValueError; a file of before has none."""
    # fault: texts of a results file are not checked -> if False: | coupler/test_damaged_results
    if DIGEST in f.attrs and f.attrs[DIGEST] != digest_of(f):
        raise ValueError("its texts are not those that were written: it is damaged")
