"""A study on a real Dask scheduler with workers on loopback, one of which is killed."""

import os
import signal
import socketserver
import threading

import pytest

import coramp
from coramp import CorampError
from coramp.studies import cluster
from tests.study import apart_from_time, written

STUDY = """
name = "on a cluster"
scenario = "paper"
seeds = 8
horizon_s = 600.0

[[runs]]
strategies = ["mainline-priority", "ramp-priority"]
engine = "exact"
mainline_veh_h = [1800.0, 3600.0]
ramp_veh_h = [500.0]

[[runs]]
strategies = ["mainline-priority"]
mainline_veh_h = [800.0]
ramp_veh_h = [200.0]
"""


@pytest.mark.filterwarnings("ignore")
def test_a_worker_that_is_killed_costs_only_its_own_runs(dask, tmp_path):
    address, workers = dask
    definition = written(tmp_path, STUDY)
    seen = []

    def kill_one(state):
        seen.append(state.done)
        if state.done == 8:
            os.kill(workers[0].pid, signal.SIGKILL)

    there = coramp.study(definition, cluster=address, out=tmp_path / "there", progress=kill_one)
    assert workers[0].wait(timeout=10) == -signal.SIGKILL
    assert there.failed.is_empty()
    assert max(seen) == 40
    here = coramp.study(definition, jobs=2, out=tmp_path / "here")
    assert apart_from_time(there.runs).equals(apart_from_time(here.runs))


@pytest.mark.filterwarnings("ignore")
def test_a_cluster_of_another_version_is_refused(dask, tmp_path, monkeypatch):
    address, _ = dask
    monkeypatch.setattr(cluster, "RESULT_VERSION", 99)
    with pytest.raises(coramp.CorampError, match=r"--cluster: tcp://.* instead of 99; install"):
        coramp.study(written(tmp_path, STUDY), cluster=address, out=tmp_path / "o")
    assert not (tmp_path / "o").exists()


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("address", ["tcp://127.0.0.1:9", "nonsense://x", "127.0.0.1:notaport"])
def test_an_address_that_nobody_answers_is_told(address, tmp_path, monkeypatch):
    monkeypatch.setattr(cluster, "ANSWER_S", 1)
    with pytest.raises(coramp.CorampError, match=f"--cluster: {address}: no Dask scheduler"):
        coramp.study(written(tmp_path, STUDY), cluster=address, out=tmp_path / "o")
    assert not (tmp_path / "o").exists()


@pytest.mark.parametrize(
    "greeting",
    [b"HTTP/1.1 400 Bad Request\r\n\r\n", b"SSH-2.0-OpenSSH_9.0\r\n", b"\xff" * 64, None],
)
def test_what_is_no_scheduler_is_told_in_a_line(tmp_path, greeting):
    """Dask takes the first eight bytes for a length; None sends back what comes."""

    class Other(socketserver.BaseRequestHandler):
        def handle(self):
            if greeting is not None:
                self.request.sendall(greeting)
            while content := self.request.recv(65536):
                if greeting is None:
                    self.request.sendall(content)

    class Server(socketserver.ThreadingTCPServer):
        daemon_threads = True

        def handle_error(self, request, client_address):
            """Dask hangs up."""

    with Server(("127.0.0.1", 0), Other) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        address = f"tcp://127.0.0.1:{server.server_address[1]}"
        with pytest.raises(CorampError, match=r"--cluster: tcp://.*no Dask scheduler") as told:
            coramp.study(written(tmp_path, STUDY), cluster=address, out=tmp_path / "o")
        server.shutdown()
    assert str(told.value).endswith("; allowed is an address like tcp://host:8786")
    assert not (tmp_path / "o").exists()
