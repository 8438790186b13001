"""An interface file is read anew as often as it is asked for, though its content is parsed once."""

from __future__ import annotations

import sys
from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest

from contact.half import interface as kept
from contact.half.interface import read_interface, write_interface

sys.path.insert(0, str(Path(__file__).parent))
from toy_halves import interface


def test_each_file_gives_what_it_holds(tmp_path):
    sizes = range(2, 4 + kept.KEPT)
    for n in sizes:
        write_interface(interface(n), tmp_path / f"{n}.h5")
    for n in (*sizes, *sizes):
        assert len(read_interface(tmp_path / f"{n}.h5").nodes) == n
    assert len(kept._READ) <= kept.KEPT


def test_a_file_that_was_written_over_is_read_again(tmp_path):
    for n in (3, 4, 3):
        write_interface(interface(n), tmp_path / "interface.h5")
        assert len(read_interface(tmp_path / "interface.h5").nodes) == n


def test_what_one_half_does_to_its_interface_no_other_sees(tmp_path):
    write_interface(interface(3), tmp_path / "interface.h5")
    one, two = (read_interface(tmp_path / "interface.h5") for _ in range(2))
    one.nodes[:] = 7.0
    one.surfaces.clear()
    after = read_interface(tmp_path / "interface.h5")
    for other in (two, after):
        for field in fields(interface(3)):
            np.testing.assert_equal(getattr(other, field.name), getattr(interface(3), field.name))


def test_what_is_no_interface_is_named(tmp_path):
    (tmp_path / "interface.h5").write_bytes(b"nothing")
    for _ in range(2):
        with pytest.raises(ValueError, match=r"interface\.h5: not a readable slideline\.interface file"):
            read_interface(tmp_path / "interface.h5")
    with pytest.raises(ValueError, match=r"none\.h5: not a readable"):
        read_interface(tmp_path / "none.h5")
