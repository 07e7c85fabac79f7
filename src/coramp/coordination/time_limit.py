"""A limit on the wall time of what somebody else wrote."""

import ctypes
import signal
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

from coramp._kernel import compiling

AGAIN_S = 2e-5
"""Once the time is over TooLong is raised this often, for code that catches everything."""
LOOK_S = 0.005
"""How often it is looked whether the code inside has raised Python's recursion limit."""
MOST_FRAMES = 10_000
"""Python's recursion limit inside the block, where it was higher."""


class TooLong(BaseException):
    """The time is over; no ``except Exception`` catches it."""


@contextmanager
def time_limit(longest_s: float) -> Iterator[None]:
    """Raises TooLong inside the block after that time, and goes on until the block is left.

    Compiling a kernel does not count. What runs in native code is interrupted when it comes back to
    Python; outside the main thread that holds for waiting, too. In the main thread, recursion is
    limited inside the block, and ends there when the time is over, whatever it catches.
    """
    in_main_thread = threading.current_thread() is threading.main_thread()
    with (_by_alarm if in_main_thread else _by_watch)(longest_s):
        yield


@contextmanager
def _by_alarm(longest_s: float) -> Iterator[None]:
    limit = sys.getrecursionlimit()
    _lower_recursion_limit(1)
    lowest = sys.getrecursionlimit() + LEAVING_FRAMES
    inside = max(lowest, min(limit, MOST_FRAMES))
    sys.setrecursionlimit(inside)
    over_s = time.monotonic() + longest_s

    def give_up(_: int, frame: FrameType | None) -> None:
        nonlocal over_s
        if frame is None or frame.f_code.co_filename in _LEAVING:
            return
        if compiling():
            over_s = time.monotonic() + longest_s
        elif time.monotonic() >= over_s or sys.getrecursionlimit() > inside:
            over_s = 0.0
            signal.setitimer(signal.ITIMER_REAL, AGAIN_S, AGAIN_S)
            handled = sys.exc_info()[1]
            if handled is not None:  # Python walks its whole chain for every error raised
                handled.__context__ = None
            _lower_recursion_limit(lowest)
            raise TooLong

    before = signal.signal(signal.SIGALRM, give_up)
    signal.setitimer(signal.ITIMER_REAL, min(LOOK_S, longest_s), LOOK_S)
    try:
        yield
    except RecursionError:
        if over_s == 0.0:
            raise TooLong from None
        raise
    finally:
        sys.setrecursionlimit(limit)
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, _nothing if before is signal.SIG_DFL else before)


LEAVING_FRAMES = 6
"""So many frames leaving the block may take, on top of those that entering it took: those of the
context managers, and those of another alarm that comes meanwhile."""


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


_LEAVING = frozenset({__file__, contextmanager.__code__.co_filename, signal.__file__})
"""Files whose code leaves the block: there it is too late to interrupt."""


@contextmanager
def _by_watch(longest_s: float) -> Iterator[None]:
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
