"""A file that one process at a time holds."""

import errno
import fcntl
import os

import pytest
from sgf_paper import file_lock


def test_one_at_a_time_holds_it(tmp_path):
    file = tmp_path / "lock"
    held = file_lock.take(file, 0)
    assert held is not None
    assert file_lock.take(file, 0.2) is None
    os.close(held)
    again = file_lock.take(file, 0)
    assert again is not None
    os.close(again)


def test_a_folder_without_locks_is_not_one_that_another_holds(tmp_path, monkeypatch):
    def flock(descriptor, operation):
        raise OSError(errno.ENOLCK, os.strerror(errno.ENOLCK))

    monkeypatch.setattr(fcntl, "flock", flock)
    with pytest.raises(OSError, match="No locks available: '.*lock'"):
        file_lock.take(tmp_path / "lock", 5)
