"""The one way a function becomes a compiled kernel.

A kernel is plain Python on floats, tuples and arrays that numba compiles at its first call.
Machine code is cached in a directory named after a hash of all kernels' sources, because numba by
itself recompiles a function when its own file changes, but not when a kernel that it calls does.
"""

import hashlib
import os
import shutil
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any, TypeVar

import numba
import numpy as np
import numpy.typing as npt
from numba import extending

Function = TypeVar("Function", bound=Callable[..., Any])

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]
BoolArray = npt.NDArray[np.bool_]


def kernel(function: Function) -> Function:
    """Returns ``function`` compiled by numba on its first call, its machine code cached on disk."""
    settings: Any = numba.config
    previous = settings.CACHE_DIR
    settings.CACHE_DIR = str(_cache_directory())
    try:
        compiled: Any = numba.njit(cache=True)(function)
    except RuntimeError:  # nowhere to write the cache: compile in each process
        compiled = numba.njit(function)
    finally:
        settings.CACHE_DIR = previous
    return compiled  # type: ignore[no-any-return]


def kernel_part(function: Function) -> Function:
    """Returns ``function`` as plain Python, which kernels that call it compile with themselves.

    For what Python asks often: a call from there into compiled code costs more than a comparison.
    """
    registered: Function = extending.register_jitable(function)
    return registered


@cache
def _cache_directory() -> Path:
    package = Path(__file__).parent
    digest = hashlib.sha256()
    for source in sorted(package.rglob("*.py")):
        text = source.read_bytes()
        if b"@kernel" in text:
            digest.update(text)
    root = package / "__pycache__"
    if not os.access(root if root.exists() else package, os.W_OK):
        root = Path(os.environ.get("XDG_CACHE_HOME", Path.home() / ".cache")) / "coramp"
    directory = root / f"kernels-{digest.hexdigest()[:16]}"
    if not directory.exists():
        for outdated in root.glob("kernels-*"):
            shutil.rmtree(outdated, ignore_errors=True)
    return directory


def never_compiled() -> bool:
    """Returns whether no run of this version has ever been compiled here.

    Checking a scenario compiles a few kernels; every run needs those of the separations. Where
    numba is told to compile nothing (``NUMBA_DISABLE_JIT``), there is nothing to wait for.
    """
    if os.environ.get("NUMBA_DISABLE_JIT", "0") != "0":
        return False
    return next(_cache_directory().glob("*/separations.lane_extremes-*"), None) is None


def compiling() -> bool:
    """Returns whether a kernel is being compiled now."""
    from numba.core.compiler_lock import global_compiler_lock as untyped_lock

    lock: Any = untyped_lock
    return bool(lock.is_locked())
