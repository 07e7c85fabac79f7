"""A limit on the wall time of what somebody else wrote."""

import ctypes
import signal
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager
from types import FrameType, TracebackType

from coramp._kernel import compiling

AGAIN_S = 2e-5
"""Once the time is over TooLong is raised this often, for code that catches everything."""
LOOK_S = 0.005
"""How often it is looked whether the code inside has raised Python's recursion limit."""
MOST_FRAMES = 10_000
"""Python's recursion limit inside the block, where it was higher."""


class TooLong(BaseException):
    """The time is over; no ``except Exception`` catches it."""


def time_limit(longest_s: float) -> AbstractContextManager[None]:
    """Raises TooLong inside the block after that time, and goes on until the block is left.

    Compiling a kernel does not count. What runs in native code is interrupted when it comes back to
    Python; outside the main thread that holds for waiting, too. In the main thread, recursion is
    limited inside the block, and ends there when the time is over, whatever it catches.
    """
    if threading.current_thread() is threading.main_thread():
        return _Alarm(longest_s)
    return _watched(longest_s)


class _Alarm:
    """Raises TooLong by a timer signal.

    A class, and no generator: once recursion is limited, leaving the block must take few frames.
    """

    def __init__(self, longest_s: float) -> None:
        self._longest_s = longest_s

    def __enter__(self) -> None:
        self._limit = sys.getrecursionlimit()
        _lower_recursion_limit(1)
        self._lowest = sys.getrecursionlimit() + LEAVING_FRAMES
        self._inside = max(self._lowest, min(self._limit, MOST_FRAMES))
        sys.setrecursionlimit(self._inside)
        self._is_over, self._over_s = False, time.monotonic() + self._longest_s
        self._before = signal.signal(signal.SIGALRM, self._give_up)
        signal.setitimer(signal.ITIMER_REAL, min(LOOK_S, self._longest_s), LOOK_S)

    def _give_up(self, _: int, frame: FrameType | None) -> None:
        if frame is None or frame.f_code.co_filename in _LEAVING:
            return
        if not self._is_over and compiling():
            self._over_s = time.monotonic() + self._longest_s
        elif (
            self._is_over
            or time.monotonic() >= self._over_s
            or sys.getrecursionlimit() > self._inside
        ):
            self._is_over = True
            signal.setitimer(signal.ITIMER_REAL, AGAIN_S, AGAIN_S)
            handled = sys.exc_info()[1]
            if handled is not None:  # Python walks its whole chain for every error raised
                handled.__context__ = None
            _lower_recursion_limit(self._lowest)
            raise TooLong

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        sys.setrecursionlimit(self._limit)
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        before = _nothing if self._before is signal.SIG_DFL else self._before
        signal.signal(signal.SIGALRM, before)
        if self._is_over and isinstance(error, RecursionError):
            raise TooLong from None


LEAVING_FRAMES = 6
"""So many frames leaving the block may take, on top of those that entering it took: its own, and
those of an alarm that comes meanwhile."""


def _lower_recursion_limit(lowest: int) -> None:
    """Sets Python's recursion limit as low as the present depth allows.

    Code that catches everything and recurses again would else take the square of its steps for
    every frame that it leaves.
    """
    high = sys.getrecursionlimit()
    while lowest < high:
        middle = (lowest + high) // 2
        try:
            sys.setrecursionlimit(middle)
        except RecursionError:
            lowest = middle + 1
        else:
            high = middle


def _nothing(*_: object) -> None:
    """Takes a last alarm that was under way when the timer stopped; by default it would kill."""


_LEAVING = frozenset({__file__, signal.__file__})
"""Files whose code leaves the block: there it is too late to interrupt."""


@contextmanager
def _watched(longest_s: float) -> Iterator[None]:
    thread = ctypes.c_ulong(threading.get_ident())
    left, lock = threading.Event(), threading.Lock()

    def watch() -> None:
        wait_s = longest_s
        while not left.wait(wait_s):
            with lock:
                if not left.is_set() and not compiling():
                    ctypes.pythonapi.PyThreadState_SetAsyncExc(thread, ctypes.py_object(TooLong))
                    wait_s = 1.0

    threading.Thread(target=watch, name="coramp time limit", daemon=True).start()
    try:
        yield
    finally:
        with lock:
            left.set()
            ctypes.pythonapi.PyThreadState_SetAsyncExc(thread, None)
