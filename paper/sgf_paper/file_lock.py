"""A file that one process at a time holds."""

from __future__ import annotations

import fcntl
import os
import time
from pathlib import Path


def take(file: Path, wait_s: float) -> int | None:
    """Takes a file, made if it is not there, for this process and those it starts.

    @returns the open file that holds the lock, which the kernel drops when the last holder ends; None if another process
    holds it for as long as one waits
    @throws OSError that names the file where it cannot be locked, as in folders of a network without locks
    """
    descriptor = os.open(file, os.O_RDWR | os.O_CREAT, 0o644)
    deadline = time.monotonic() + wait_s
    while True:
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
            return descriptor
        except BlockingIOError:
            if time.monotonic() > deadline:
                os.close(descriptor)
                return None
        except OSError as error:
            os.close(descriptor)
            raise OSError(error.errno, error.strerror, str(file)) from error
        time.sleep(0.1)
