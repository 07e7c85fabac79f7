"""``coramp`` without the two seconds of imports: a process that has them answers by forks.

Each call is a process of its own, with the caller's folder, environment, words and open files, and
it runs the same ``coramp.cli.main`` as the installed command does. ``test_how_tos`` puts the
program that ``WarmCoramp`` writes first on the path of a page's terminal.
"""

import atexit
import contextlib
import gc
import importlib
import json
import os
import socket
import stat
import subprocess
import sys
import threading
import traceback
from pathlib import Path

CALLER = """\
#!{python} -SE
import json, os, socket, sys
with socket.socket(socket.AF_UNIX) as line:
    line.connect({address!r})
    told = json.dumps([sys.argv[1:], os.getcwd(), dict(os.environ)]).encode()
    socket.send_fds(line, [len(told).to_bytes(8, "big")], [0, 1, 2])
    line.sendall(told)
    code = line.recv(1)
os._exit(code[0] if code else 70)
"""
NEEDED = "coramp.api coramp.cli.console coramp.report.plots matplotlib.figure scipy.special"


class WarmCoramp:
    """A server and, in ``folder``, the program ``coramp`` that calls it; close it in the end."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        address = str(folder / "line")
        program = folder / "coramp"
        program.write_text(CALLER.format(python=sys.executable, address=address), encoding="utf-8")
        program.chmod(program.stat().st_mode | stat.S_IXUSR)
        self._server = subprocess.Popen(
            [sys.executable, "-c", f"from {__name__} import serve; serve({address!r})"],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            cwd=Path(__file__).parents[2],
        )
        self._server.stdout.readline()  # it listens now

    def close(self) -> None:
        self._server.terminate()
        self._server.wait()
        self._server.stdout.close()


def serve(address: str) -> None:
    """Answers calls until it is ended."""
    for name in NEEDED.split():
        importlib.import_module(name)
    _load_kernels()
    gc.freeze()  # or each fork soon copies all of it, to look for what is no longer needed
    with socket.socket(socket.AF_UNIX) as listening:
        listening.bind(address)
        listening.listen()
        print("ready", flush=True)
        while True:
            line, _ = listening.accept()
            if os.fork() == 0:
                listening.close()
                _answer(line)
                return
            line.close()
            with contextlib.suppress(ChildProcessError):
                while os.waitpid(-1, os.WNOHANG)[0]:
                    pass


def _load_kernels() -> None:
    """Loads kernels that most runs need, by a run that uses no library with threads of its own."""
    from coramp.scenarios.loading import load_scenario
    from coramp.strategies.registry import strategy_named
    from coramp.worlds.exact.engine import run_exact

    scenario = load_scenario("paper", {"simulation.horizon_s": 30.0})
    run_exact(scenario, strategy_named("mainline-priority")(), 0)


def _answer(line: socket.socket) -> None:
    """Runs one call in a process of its own, and tells the caller the exit code."""
    size, files, *_ = socket.recv_fds(line, 8, 3)
    told = b""
    while len(told) < int.from_bytes(size, "big"):
        told += line.recv(1 << 16)
    words, folder, environment = json.loads(told)
    command = os.fork()
    if command:
        code = os.waitstatus_to_exitcode(os.waitpid(command, 0)[1])
        line.sendall(bytes([code if code >= 0 else 128 - code]))
        os._exit(0)
    line.close()
    for number, file in enumerate(files):
        os.dup2(file, number)
        os.close(file)
    os.chdir(folder)
    os.environ.clear()
    os.environ.update(environment)
    sys.argv[:] = ["coramp", *words]
    os._exit(_code_of_main())


def _code_of_main() -> int:
    """Runs the command line to its end, without tidying up what was imported."""
    from coramp.cli import main

    code = 1
    try:
        main()
    except SystemExit as ended:
        code = ended.code
    except BaseException:  # noqa: BLE001 - as Python does where a program ends by one
        traceback.print_exc()
    threading._shutdown()
    atexit._run_exitfuncs()
    sys.stdout.flush()
    sys.stderr.flush()
    return code
