"""A library that a compiler makes beside the work, which does not wait for it."""

from __future__ import annotations

import atexit
import ctypes
import os
import threading
from collections.abc import Callable
from weakref import WeakSet

from ...warn import warn_once
from .build import Compilation, CompilerError, build

#: Compilations that are under way in this process.
_UNDER_WAY: WeakSet[Background] = WeakSet()


class Background:
    """A library of a C source: asked for, under way, there, or failed."""

    def __init__(
        self, source: Callable[[], str], ready: Callable[[ctypes.CDLL], ctypes.CDLL]
    ) -> None:
        self._source, self._ready = source, ready
        self._lock = threading.Lock()
        self._library: ctypes.CDLL | None = None
        self._error: CompilerError | None = None
        self._thread: threading.Thread | None = None
        self._process = -1  # the one that the thread belongs to
        self._run = Compilation(quiet=True)

    def start(self) -> None:
        """Begin to compile, unless that has happened."""
        with self._lock:
            if self._library or self._error or (self._thread and self._process == os.getpid()):
                return
            self._run = Compilation(quiet=True)
            self._thread = threading.Thread(target=self._compile, daemon=True)
            self._process = os.getpid()
            _UNDER_WAY.add(self)
            self._thread.start()

    def _compile(self) -> None:
        try:
            self._library = self._ready(build(self._source(), run=self._run))
        except CompilerError as error:
            if not self._run.stopped:
                self._error = error
        finally:
            _UNDER_WAY.discard(self)

    def library(self) -> ctypes.CDLL | None:
        """Return the library if it is there; never waits."""
        if self._error is not None:
            brief = self._error.brief or str(self._error)
            warn_once(f"{brief} Long runs stay with the slower interpreter.")
        return self._library

    def wait(self) -> ctypes.CDLL:
        """Return the library, compiled now if it is not there."""
        thread = self._thread if self._process == os.getpid() else None
        if thread is not None:
            thread.join()
        if self._library is None:
            self._library = self._ready(build(self._source()))
        return self._library

    def stop(self) -> None:
        """End a compilation that is under way, and what it has written."""
        self._run.stop()
        if self._thread is not None and self._process == os.getpid():
            self._thread.join(timeout=5.0)


@atexit.register
def _stop_all() -> None:
    for job in list(_UNDER_WAY):
        job.stop()
