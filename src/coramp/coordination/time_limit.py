"""A limit on the wall time of what somebody else wrote."""

import ctypes
import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

from coramp._kernel import compiling

AGAIN_S = 2e-5
"""Once the time is over it is said this often: code that swallows one word does not get far."""


class TooLong(BaseException):
    """The time is over; no ``except Exception`` catches it."""


@contextmanager
def time_limit(longest_s: float) -> Iterator[None]:
    """Raises TooLong inside the block after that time, and goes on until the block is left.

    Compiling a kernel does not count. What runs in native code is interrupted when it comes back to
    Python; outside the main thread that holds for waiting, too.
    """
    in_main_thread = threading.current_thread() is threading.main_thread()
    with (_by_alarm if in_main_thread else _by_watch)(longest_s):
        yield


@contextmanager
def _by_alarm(longest_s: float) -> Iterator[None]:
    def give_up(_: int, frame: FrameType | None) -> None:
        if frame is None or frame.f_code.co_filename in _LEAVING:
            return
        if not compiling():
            raise TooLong
        signal.setitimer(signal.ITIMER_REAL, longest_s, AGAIN_S)

    before = signal.signal(signal.SIGALRM, give_up)
    signal.setitimer(signal.ITIMER_REAL, longest_s, AGAIN_S)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, _nothing if before is signal.SIG_DFL else before)


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
