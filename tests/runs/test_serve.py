"""The server of `macs serve`, asked by http.client: what it answers, whom it answers, and files that change or are wrong under its eyes."""

import gzip
import http.client
import json
import os
import shutil
import signal
import subprocess
import sys
import threading
import time
from contextlib import contextmanager
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from misbehaving import Crashing, Plain, glide
from synthetic_fronts import black_box, flights
from test_study import Inline

from runs import Study
from runs.batch.running import PROGRESS_FILE, STALE, StudyDisplay, read_progress
from runs.batch.store import Store
from runs.browser.live import followed
from runs.browser.server import Server
from runs.execution.task import ArchiveSamples

pytest.importorskip("plotly")


def study(**changes) -> Study:
    solvers = {"plain": Plain(), "broken": Crashing()}
    return Study("gliders <b>", **({"problems": {"glide": glide()}, "solvers": solvers, "evaluations": 60, "runs": 1, "seed": 1} | changes))


@pytest.fixture(scope="module")
def made(tmp_path_factory) -> Path:
    """A study of which one run is finished and one failed; two more of each can be made."""
    out = tmp_path_factory.mktemp("serve") / "out"
    study().run(out, executor=Inline())
    return out


@pytest.fixture
def out(made, tmp_path) -> Path:
    return Path(shutil.copytree(made, tmp_path / "out"))


class Client:
    """Asks a server."""

    def __init__(self, server: Server) -> None:
        self.server = server

    def ask(self, path: str, method: str = "GET", **headers: str) -> SimpleNamespace:
        connection = http.client.HTTPConnection("127.0.0.1", self.server.server_address[1], timeout=30)
        try:
            connection.putrequest(method, path, skip_host="Host" in headers, skip_accept_encoding=True)
            for name, value in headers.items():
                connection.putheader(name.replace("_", "-"), value)
            connection.endheaders()
            answer = connection.getresponse()
            content = answer.read()
        finally:
            connection.close()
        if answer.headers["Content-Encoding"] == "gzip":
            content = gzip.decompress(content)
        return SimpleNamespace(status=answer.status, headers=answer.headers, content=content)

    def json(self, path: str):
        answer = self.ask(path)
        assert (answer.status, answer.headers["Content-Type"]) == (200, "application/json"), path
        return json.loads(answer.content)

    def seen(self, condition, path: str = "/status.json"):
        """What a path has after one look at the files."""
        self.json("/status.json")
        found = self.json(path)
        assert condition(found), found
        return found


@contextmanager
def served(path: Path, trust: bool = False, host: str = "127.0.0.1"):
    server = Server(followed(path, trust), host)
    threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.02}, daemon=True).start()
    try:
        client = Client(server)
        client.seen(lambda status: "data" in status["versions"])
        yield client
    finally:
        server.shutdown()
        server.server_close()


def contents(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def test_the_routes_have_what_the_report_has_and_nothing_is_written(out):
    before = contents(out)
    with served(out, trust=True) as client:
        status = client.json("/status.json")
        assert {key: status[key] for key in ("total", "finished", "failed", "waiting", "running", "alive")} == {
            "total": 2, "finished": 1, "failed": 1, "waiting": 0, "running": 0, "alive": False
        }  # fmt: skip
        data = client.json("/data.json")
        (comparison,) = data["comparisons"]
        (run,) = comparison["runs"]
        front = next(run for run in Store.open(out, trust=True).runs() if run.finished).front
        assert run["points"]["objectives"] == front.objectives.T.tolist()
        assert "the root of all evil" in data["failures"][0]["reason"] and "Traceback" in data["failures"][0]["traceback"]
        details = client.json(f"/details/{run['block']}.json")
        assert len(details) == len(front) and details[0]["phases"][0]["name"] == "leg"
        measures = client.seen(lambda found: found["finished"] == 1, "/measures.json")
        assert measures["comparisons"][comparison["id"]]["tables"]
        page = client.ask("/").content.decode()
        assert "gliders &lt;b&gt;" in page and "gliders <b>" not in page
        assert b"function follow" in client.ask("/scripts.js").content and len(client.ask("/plotly.js").content) > 1_000_000
    assert contents(out) == before


@pytest.fixture(scope="module")
def client(made):
    with served(made) as one:
        yield one


def test_only_get_and_head_are_answered_and_no_file_by_its_path(client):
    for method in ("POST", "PUT", "DELETE", "OPTIONS", "TRACE", "CONNECT", "MACS"):
        answer = client.ask("/", method)
        assert (answer.status, answer.headers["Allow"]) == (405, "GET, HEAD")
    for path in ("/", "/data.json"):
        got, head = client.ask(path), client.ask(path, "HEAD")
        assert head.content == b"" and head.headers["Content-Length"] == got.headers["Content-Length"] == str(len(got.content))
    for path in (
        *("/study.json", "/../study.json", "/details/../study.json", "/details/%2e%2e%2fstudy.json", "/..%2f..%2fetc/passwd"),
        *("//etc/passwd", "/static/main.js", "/scripts.js/", "/details/9-1.json", "/details/0-99.json", "/data", "/.progress"),
        *("/?/../study.json", "/details/.json", "//[", "HTTP://[::1"),
    ):
        answer = client.ask(path)
        assert answer.status == (200 if path.startswith("/?") else 404), path
        assert b"crc32" not in answer.content and b"root:" not in answer.content


def test_names_of_other_places_are_refused_where_only_this_machine_is_meant(client, made):
    port = client.server.server_address[1]
    for host in ("localhost", "127.0.0.1", f"localhost:{port}", f"LOCALHOST:{port}", "[::1]:80"):
        assert client.ask("/status.json", Host=host).status == 200, host
    for host in ("evil.example", f"evil.example:{port}", "localhost.evil.example", "127.0.0.1.evil.example", "", "evil@localhost"):
        assert client.ask("/status.json", Host=host).status == 403, host
    with served(made, host="0.0.0.0") as everywhere:
        assert not everywhere.server.local and everywhere.ask("/status.json", Host="lab.example:80").status == 200


def test_every_answer_has_headers_that_keep_other_places_out_and_is_compressed_if_asked(client):
    for path, method in (("/", "GET"), ("/data.json", "GET"), ("/nothing", "GET"), ("/", "POST")):
        headers = client.ask(path, method).headers
        policy = headers["Content-Security-Policy"]
        assert "default-src 'none'" in policy and "connect-src 'self'" in policy and "frame-ancestors 'none'" in policy
        assert "unsafe-inline" not in policy.split("script-src")[1].split(";")[0]
        assert headers["X-Content-Type-Options"] == "nosniff" and headers["Cross-Origin-Resource-Policy"] == "same-origin"
        assert "Access-Control-Allow-Origin" not in headers
    plain, compressed = client.ask("/data.json"), client.ask("/data.json", Accept_Encoding="gzip")
    assert int(compressed.headers["Content-Length"]) < len(plain.content) and compressed.content == plain.content


def test_a_study_that_grows_is_followed_and_finished_runs_are_not_read_again(out):
    with served(out, trust=True) as client:
        (before,) = client.json("/data.json")["comparisons"]
        known = client.server.followed.fronts
        study(runs=2).run(out, executor=Inline())
        status = client.json("/status.json")
        assert (status["total"], status["finished"], status["failed"]) == (4, 2, 2)
        (after,) = client.json("/data.json")["comparisons"]
        assert after["runs"][0] == before["runs"][0] and len(after["runs"]) == 2
        assert client.json(f"/details/{after['runs'][1]['block']}.json") and client.json("/measures.json")["finished"] == 2
        read = client.server.followed.fronts
        client.json("/status.json")
        again = client.server.followed.fronts
        assert len(known) == 1 and len(read) == 2 and all(again[name] is read[name] for name in read), "the same objects: nothing was read"


def test_files_that_are_damaged_or_gone_are_named_and_the_server_goes_on(out):
    with served(out) as client:
        whole = (out / "study.json").read_bytes()
        (out / "study.json").write_bytes(whole[:100])
        assert "study.json" in client.seen(lambda status: status["trouble"])["trouble"]
        assert client.json("/data.json")["comparisons"][0]["runs"]  # what was seen before stays
        (out / "study.json").unlink()
        assert "no study" in client.seen(lambda status: "no study" in status["trouble"])["trouble"]
        (out / "study.json").write_bytes(whole)
        client.seen(lambda status: not status["trouble"])
        front = next(out.rglob("*.nc"))
        half = front.read_bytes()[:1000]
        front.write_bytes(half)
        client.seen(lambda status: (status["finished"], status["failed"]) == (0, 2))
        assert any("damaged" in one["reason"] for one in client.seen(lambda found: len(found["failures"]) == 2, "/data.json")["failures"])
        shutil.rmtree(out)
        assert "there is no folder" in client.seen(lambda status: "no folder" in status["trouble"])["trouble"]
        assert client.ask("/").status == 200


def test_code_that_only_a_file_names_is_not_run(tmp_path, monkeypatch):
    monkeypatch.syspath_prepend(tmp_path)
    (tmp_path / "rocket.py").write_text("from misbehaving import glide\ndef build():\n    return glide()\n", encoding="utf-8")
    solvers = {"plain": Plain()}
    stated = Study("rocket", problems=f"{tmp_path}/rocket.py:build", solvers=solvers, evaluations=60, runs=1, seed=1, verify=0.5)
    stated.run(tmp_path / "out", executor=Inline())
    mark = tmp_path / "it_ran"
    (tmp_path / "rocket.py").write_text(f"from pathlib import Path\nPath({str(mark)!r}).touch()\n", encoding="utf-8")
    with served(tmp_path / "out") as client:
        measures = client.seen(lambda found: found["trouble"], "/measures.json")
        assert "--trust" in measures["trouble"]
        (run,) = client.json("/data.json")["comparisons"][0]["runs"]
        assert run["points"]["count"] and client.json(f"/details/{run['block']}.json")
    assert not mark.exists()


def test_the_points_so_far_of_runs_that_have_not_ended_are_shown(out):
    stated = study(runs=2)
    cell = stated.cells[0]
    (run,) = (run for run in Store.open(out).runs(2) if run.cell.labels == cell.labels and run.number == 2)
    samples = ArchiveSamples(60, path=run.path.with_suffix(".samples"))
    counts = {"evaluations": 20, "inner_iterations": 0, "gradient_solves": 0, "work": 0, "charge": 0}
    samples.note(SimpleNamespace(**counts, elapsed=1.0, F=np.array([[1.0, -3.0], [2.0, -6.0]])))
    with Store.claim(out, stated.definition()):
        pass
    with served(out) as client, StudyDisplay("a", [run], [run], False, folder=out) as display:
        display.reporter(run)(31, 1.5)
        display.refresh()
        status = client.seen(lambda status: status["running"] == 1)
        assert (status["alive"], status["waiting"]) == (True, 1) and status["left"] > 0.0
        assert status["going"] == [{"name": f"{cell.name}, run 2", "evaluations": 31, "budget": 60, "elapsed": 1.5}]
        (points,) = client.json("/going.json")["glide, dfet:2x2"]
        assert points == {"solver": "plain", "number": 2, "objectives": [[1.0, 2.0], [3.0, 6.0]]}  # in the user's senses
        run.path.with_suffix(".samples").write_bytes(b'{"crc32": 1, "con')  # half written
        client.seen(lambda found: not found["glide, dfet:2x2"], "/going.json")
        assert not client.json("/status.json")["trouble"]
    with served(out) as client:
        assert client.json("/status.json")["alive"] is False and client.json("/going.json") == {"glide, dfet:2x2": []}


def test_before_the_first_run_has_ended_the_objectives_are_known_but_of_a_study_by_an_older_version(tmp_path):
    definition = study().definition()
    with Store.claim(tmp_path / "new", definition), served(tmp_path / "new") as client:
        (comparison,) = client.json("/data.json")["comparisons"]
        assert [goal["name"] for goal in comparison["goals"]] == ["time", "distance"] and comparison["runs"] == []
        assert client.json("/status.json")["waiting"] == 2
    del definition["objectives"]
    with Store.claim(tmp_path / "old", definition) as store, served(tmp_path / "old") as client:
        assert client.json("/data.json")["comparisons"] == []
        store.check(study().definition())  # the same study


def test_progress_that_is_old_or_damaged_is_none(tmp_path):
    assert read_progress(tmp_path) is None
    display = StudyDisplay("a", [], [], False, folder=tmp_path)
    display.refresh()
    assert read_progress(tmp_path) is not None
    path = tmp_path / PROGRESS_FILE
    old = time.time() - 2 * STALE
    os.utime(path, (old, old))
    assert read_progress(tmp_path) is None
    path.write_text("{}", encoding="utf-8")
    assert read_progress(tmp_path) is None
    display.__exit__(None, None, None)
    assert not path.exists()


@pytest.mark.slow
def test_fronts_are_followed_one_alone_and_those_of_a_folder(tmp_path):
    flights(3).save(tmp_path / "first.nc")
    with served(tmp_path / "first.nc") as client:
        assert client.json("/data.json")["kind"] == "front"
        flights(4).save(tmp_path / "first.nc")
        client.seen(lambda found: found["comparisons"][0]["runs"][0]["points"]["count"] == 4, "/data.json")
        (tmp_path / "first.nc").write_bytes(b"half")
        assert "first.nc" in client.seen(lambda status: status["trouble"])["trouble"]
        flights(4).save(tmp_path / "first.nc")
        client.seen(lambda status: not status["trouble"])
    with served(tmp_path) as client:
        assert client.json("/data.json")["kind"] == "fronts"
        flights(5, seed=1).save(tmp_path / "second.nc")
        black_box(4).save(tmp_path / "other.nc")
        (tmp_path / "text.nc").write_text("no front", encoding="utf-8")
        data = client.seen(lambda found: len(found["comparisons"]) == 2 and found["unreadable"], "/data.json")
        assert {tuple(one["solvers"]) for one in data["comparisons"]} == {("first", "second"), ("other",)}
        assert "text.nc" in data["unreadable"][0]
        assert len(client.server.followed._readings._known) == 3
        (tmp_path / "second.nc").unlink()
        client.seen(lambda found: all("second" not in one["solvers"] for one in found["comparisons"]), "/data.json")
        assert len(client.server.followed._readings._known) == 2, "what is gone is forgotten"


def test_an_address_that_cannot_be_had_is_one_line(out, refused):
    with served(out) as client:
        for words in (("--port", str(client.server.server_address[1])), ("--host", "999.1.1.1"), ("--host", "192.0.2.1")):
            assert words[1] in refused("serve", str(out), *words)


@contextmanager
def process(*call: str):
    """`macs` in a process of its own, and the address that it prints."""
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(str(Path(part).resolve()) for part in sys.path)}
    made = subprocess.Popen(
        [sys.executable, "-m", "runs.cli", "serve", *call], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=environment
    )
    try:
        assert made.stdout is not None
        yield made, made.stdout.readline()
    finally:
        made.kill()
        made.wait()


@pytest.mark.slow
def test_ctrl_c_ends_the_server_quietly_and_an_open_address_is_warned_of(out):
    with process(str(out), "--port", "0", "--host", "0.0.0.0") as (server, said):
        assert "http://0.0.0.0:" in said and str(out) in said
        server.send_signal(signal.SIGINT)
        rest, complaints = server.communicate(timeout=20)
        assert (server.returncode, rest) == (0, "") and complaints.count("\n") == 1 and "everybody on the network" in complaints
