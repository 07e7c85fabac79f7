"""Running a study on a Dask cluster, through joblib as on one machine."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from coramp.coordination.time_limit import TooLong, time_limit
from coramp.errors import CorampError
from coramp.records.schemas import RESULT_VERSION
from coramp.runs.running import versions

ANSWER_S = 10
"""How long a scheduler, and its first worker, may take to answer."""


@contextmanager
def connected(address: str) -> Iterator[int]:
    """Lets joblib run on the cluster at ``address`` (tcp://host:port); gives its threads.

    Raises CorampError where Dask is missing, nobody answers, or a worker is of another version.
    """
    try:
        import distributed as untyped_distributed
    except ImportError:
        raise CorampError("--cluster: Dask is not installed; pip install coramp[dask]") from None
    distributed: Any = untyped_distributed
    try:
        with time_limit(3.0 * ANSWER_S):  # what is no scheduler may keep Dask for ever
            client = distributed.Client(address, timeout=ANSWER_S)
    except TooLong:
        raise CorampError(
            f"--cluster: {address}: no Dask scheduler answers within {3 * ANSWER_S} s; "
            "allowed is an address like tcp://host:8786"
        ) from None
    except (OSError, ValueError, ImportError) as error:
        reason = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise CorampError(
            f"--cluster: {address}: no Dask scheduler answers ({reason}); "
            "allowed is an address like tcp://host:8786"
        ) from error
    except Exception as error:  # bytes of another protocol become lengths, or break Dask's asserts
        raise CorampError(
            f"--cluster: {address}: what answers there is no Dask scheduler "
            f"({type(error).__name__}); allowed is an address like tcp://host:8786"
        ) from error
    import joblib as untyped_joblib

    joblib: Any = untyped_joblib
    with client:
        _check_workers(client, address)
        with joblib.parallel_config(backend="dask"):
            yield sum(client.nthreads().values())


def _check_workers(client: Any, address: str) -> None:
    from distributed import TimeoutError as NoWorker

    try:
        client.wait_for_workers(1, timeout=ANSWER_S)
    except (NoWorker, TimeoutError):
        raise CorampError(f"--cluster: {address}: has no workers; start dask worker") from None
    try:
        found = client.run(what_counts)
    except Exception as error:
        raise CorampError(
            f"--cluster: {address}: a worker has no coramp of this version ({error})"
        ) from error
    here = what_counts()
    for worker, theirs in found.items():
        if theirs != here:
            differing = ", ".join(
                f"{name} {theirs.get(name)} instead of {here[name]}"
                for name in here
                if theirs.get(name) != here[name]
            )
            raise CorampError(
                f"--cluster: {address}: worker {worker} has {differing}; install the same there"
            )


def what_counts() -> dict[str, str]:
    """Returns the versions that decide whether results are alike."""
    names = ("coramp", "libsumo", "numpy", "numba")
    return {**{name: versions()[name] for name in names}, "results": str(RESULT_VERSION)}
