"""datasets/fetch against a server on loopback that does what servers on the net do."""

import functools
import hashlib
import http.server
import io
import os
import random
import signal
import subprocess
import sys
import tarfile
import tempfile
import threading
import time
import zipfile
from pathlib import Path

import pytest
import yaml

from sgf_paper import catalog, fetch, paths
from sgf_paper.download import Patience

PROGRAM = paths.PROJECT / "datasets" / "fetch"
HTML = b"<!DOCTYPE html><html><body>Please log in</body></html>"
IMPATIENT = ["--timeout", "1", "--attempts", "3", "--pause", "0.05"]


def zip_of(files):
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w") as archive:
        for name, content in files.items():
            archive.writestr(name, content)
    return out.getvalue()


def tar_of(files):
    out = io.BytesIO()
    with tarfile.open(fileobj=out, mode="w:gz") as archive:
        for name, content in files.items():
            info = tarfile.TarInfo(name)
            info.size = len(content)
            archive.addfile(info, io.BytesIO(content))
    return out.getvalue()


class Handler(http.server.BaseHTTPRequestHandler):
    """Answers /NAME with the server's content of that name, in the way its `manners` say."""

    protocol_version = "HTTP/1.1"

    def log_message(self, *_):
        pass

    def answer(self, status, body=b"", **headers):
        self.send_response(status)
        for name, value in {"Content_Length": len(body), **headers}.items():
            self.send_header(name.replace("_", "-"), str(value))
        self.end_headers()
        self.wfile.write(body)

    def do_GET(self):
        name, server = self.path[1:], self.server
        wanted = self.headers.get("Range")
        server.requests.append((name, wanted))
        manner = server.manners.get(name)
        if callable(manner):
            manner = manner()
        if name not in server.contents:
            self.answer(404)
        elif isinstance(manner, int):
            self.answer(manner)
        elif str(manner).startswith("to "):
            self.answer(302, Location=manner[3:])
        else:
            self.send(server.contents[name], wanted, manner)

    def send(self, content, wanted, manner):
        """Sends a range of a content. The manner is how: whole, truncated, stalling, slow, or blind to ranges."""
        first, last, status, more = 0, len(content) - 1, 200, {}
        if wanted and manner != "no ranges":
            start, _, end = wanted.removeprefix("bytes=").partition("-")
            first, last = int(start), int(end or last)
            if first >= len(content) or manner == "416 to ranges":
                self.answer(416)
                return
            status, more = 206, {"Content-Range": f"bytes {first}-{last}/{len(content)}"}
        body = content[first : last + 1]
        self.send_response(status)
        for name, value in {"Content-Length": len(body), **more}.items():
            self.send_header(name, str(value))
        self.end_headers()
        self.send_body(body, manner)

    def send_body(self, body, manner):
        if manner in ("truncates", "stalls"):
            self.wfile.write(body[:300_000] if manner == "truncates" else body[: min(300_000, len(body) - 1)])
            self.wfile.flush()
            if manner == "stalls":
                self.server.closing.wait(30)
            self.close_connection = True
        elif manner == "slow":
            for start in range(0, len(body), 1 << 13):
                self.wfile.write(body[start : start + (1 << 13)])
                time.sleep(0.05)
        else:
            self.wfile.write(body)


class Server(http.server.ThreadingHTTPServer):
    daemon_threads = True

    def handle_error(self, *_):
        """Clients that go away are no error here."""


@pytest.fixture
def server(monkeypatch):
    for name in ("http_proxy", "https_proxy", "all_proxy", "HTTP_PROXY", "HTTPS_PROXY", "ALL_PROXY"):
        monkeypatch.delenv(name, raising=False)
    with Server(("127.0.0.1", 0), Handler) as running:
        running.contents, running.manners, running.requests = {}, {}, []
        running.closing = threading.Event()
        running.address = f"http://127.0.0.1:{running.server_port}"
        threading.Thread(target=running.serve_forever, daemon=True).start()
        yield running
        running.closing.set()
        running.shutdown()


NOISE = random.Random(1).randbytes(3_000_000)  # so much that aria2 takes several connections
TOY = {"toys/train/a/im0.png": NOISE, "toys/train/a/im1.png": b"right", "toys/test/x.png": b"no"}


class World:
    """A catalogue with a data set `toy`, served as toy.zip, and the folder that it is fetched into."""

    def __init__(self, tmp_path, server):
        self.server, self.root = server, tmp_path
        self.into = tmp_path / "my data"
        self.toy = zip_of(TOY)
        server.contents["toy.zip"] = self.toy
        self.node = {
            "archives": {"toy.zip": {"urls": [f"{server.address}/toy.zip"]}},
            "publishers": {"we": {"home": "https://example.org", "licence": "CC0", "citation": "We, 2020"}},
            "datasets": {
                "toy": {
                    "title": "Toys",
                    "publisher": "we",
                    "folder": "toys/train",
                    "holds": ["a/im0.png", "a/im1.png"],
                    "ways": [[{"archive": "toy.zip", "take": "train"}]],
                }
            },
        }

    @property
    def archive(self):
        return self.node["archives"]["toy.zip"]

    def command(self, *arguments):
        file = self.root / "catalog.yaml"
        file.write_text(yaml.safe_dump(self.node))
        return [PROGRAM, *arguments, "--catalog", file, "--into", self.into, *IMPATIENT]

    def fetch(self, *names, accept=True):
        """Exit code and output of datasets/fetch."""
        accepted = ["--accept-licences"] if accept else []
        command = self.command(*(names or ["toy"]), *accepted)
        done = subprocess.run(command, capture_output=True, text=True, timeout=120)
        return done.returncode, done.stdout + done.stderr

    def is_right(self):
        train = self.into / "toys" / "train"
        files = sorted(str(path.relative_to(train)) for path in train.rglob("*") if path.is_file())
        return files == ["a/im0.png", "a/im1.png"] and (train / "a" / "im0.png").read_bytes() == NOISE

    def is_absent(self):
        return not (self.into / "toys").exists()

    def records(self):
        return yaml.safe_load((self.into / ".sgf-fetch" / "checksums.yaml").read_text())

    def left_over(self):
        return sorted(p.name for p in (self.into / ".sgf-fetch").iterdir() if p.name not in ("lock", "checksums.yaml"))


@pytest.fixture
def world(tmp_path, server):
    return World(tmp_path, server)


@pytest.fixture
def shared(world):
    """The data sets `toy` and `tests` of one archive."""
    toy = world.node["datasets"]["toy"]
    way = [{"archive": "toy.zip", "take": "test"}]
    world.node["datasets"]["tests"] = {**toy, "folder": "tests", "holds": ["x.png"], "ways": [way]}
    return world


def last_line(output):
    return output.splitlines()[-1].strip()


# ---- What goes well


def test_a_data_set_is_downloaded_checked_and_unpacked(world):
    world.archive.update({"bytes": len(world.toy), "sha256": hashlib.sha256(world.toy).hexdigest()})
    world.archive["md5"] = hashlib.md5(world.toy).hexdigest()
    code, output = world.fetch()
    assert code == 0 and world.is_right(), output
    assert f"done: {world.into}/toys/train" in last_line(output)
    assert world.left_over() == []
    assert len({wanted for _, wanted in world.server.requests}) > 1, "several connections"


def test_what_is_there_is_not_fetched_again(world):
    world.fetch()
    world.server.requests.clear()
    code, output = world.fetch()
    assert code == 0 and "at hand: " in last_line(output)
    assert world.server.requests == [] and "licences" not in output


def test_needed_and_free_space_are_said_before_anything_is_downloaded(world):
    world.archive["about_bytes"] = 3_000_000
    world.node["datasets"]["toy"]["unpacked_bytes"] = 20_000_000
    output = world.fetch()[1]
    assert "needs about 0.02 GB" in output[: output.index("from http")]


def test_a_tar_archive_in_pieces_and_an_archive_within_an_archive(world):
    world.server.contents["depth.tar.gz"] = tar_of({"train/a/disp.pfm": b"d"})
    world.server.contents["outer.zip"] = zip_of({"deep/inner.zip": zip_of({"mav0/x": b"x"})})
    for name in ("depth.tar.gz", "outer.zip"):
        world.node["archives"][name] = {"urls": [f"{world.server.address}/{name}"]}
    toy = world.node["datasets"]["toy"]
    toy["ways"][0].append({"archive": "depth.tar.gz", "take": "train"})
    piece = {"archive": "outer.zip", "inside": "inner.zip", "take": "mav0", "to": "mav0"}
    world.node["datasets"]["flight"] = {**toy, "folder": "flight", "holds": ["mav0/x"], "ways": [[piece]]}
    world.node["groups"] = {"all": ["toy", "flight"]}
    code, output = world.fetch("all")
    assert code == 0, output
    assert (world.into / "toys/train/a/disp.pfm").read_bytes() == b"d"
    assert (world.into / "flight/mav0/x").read_bytes() == b"x"


def test_data_sets_that_share_an_archive_download_it_once(shared):
    shared.server.manners["toy.zip"] = "no ranges"
    code, output = shared.fetch("toy", "tests")
    assert code == 0 and shared.is_right() and (shared.into / "tests" / "x.png").exists(), output
    assert output.count("from http") == 1 and shared.left_over() == []


def test_the_list_needs_no_folder_and_no_network(world, server):
    command = [*world.command()[:1], "--list", "--catalog", world.root / "catalog.yaml"]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0
    assert "CC0; https://example.org" in done.stdout and "Toys" in done.stdout
    assert server.requests == []


def test_what_is_downloaded_for_experiments(tmp_path):
    done = subprocess.run([PROGRAM, "--for", "fig1", "--into", tmp_path], capture_output=True, text=True)
    assert done.returncode == 1 and "icl_nuim_lr_kt2" in done.stdout and "euroc" not in done.stdout


def test_without_pyyaml_its_package_is_named():
    done = subprocess.run([sys.executable, "-S", PROGRAM, "--list"], capture_output=True, text=True)
    assert done.returncode == 1 and done.stdout == ""
    assert done.stderr == "Error: PyYAML is not installed (Debian package python3-yaml)\n"


def test_a_reader_that_goes_away_ends_it_silently():
    reader, writer = os.pipe()
    os.close(reader)
    done = subprocess.run([PROGRAM, "--list"], stdout=writer, stderr=subprocess.PIPE)
    os.close(writer)
    assert done.returncode == -signal.SIGPIPE and done.stderr == b""


def test_a_closed_output_does_not_keep_it_from_its_work(by_hand):
    command = ["sh", "-c", '"$@" >&-', "sh", *by_hand.command("toy")]
    done = subprocess.run(command, stderr=subprocess.PIPE, text=True)
    assert done.returncode == 1 and done.stderr == ""


def test_a_folder_may_have_any_name(world):
    world.into = world.root / os.fsdecode(b"d\xe4ta")
    code, output = world.fetch()
    assert code == 0 and world.is_right() and r"d\udce4ta/toys/train" in last_line(output), output


# ---- Licences, wrong usage


def test_without_accepted_licences_they_are_shown_and_nothing_is_downloaded(world):
    code, output = world.fetch(accept=False)
    assert code == 1 and not world.into.exists() and world.server.requests == []
    for text in ("licence: CC0", "home: https://example.org", "cite: We, 2020"):
        assert text in output
    assert "NOT FETCHED" in last_line(output) and "--accept-licences" in last_line(output)


@pytest.mark.parametrize(
    "arguments, message",
    [
        ([], "needs data sets and --into DIR, or --list"),
        (["toy"], "needs data sets and --into DIR"),
        (["--into", "x"], "needs data sets and --into DIR"),
        (["toys", "--into", "x"], "unknown data set 'toys'; known: "),
        (["--for", "table9", "--into", "x"], "table9.yaml: cannot be read"),
        (["kitti2015", "--into", ""], "needs data sets and --into DIR"),
        (["kitti2015", "--into", "/dev/null"], "--into needs a folder, which /dev/null is not"),
        (["kitti2015", "--into", "x", "--jobs", "0"], "--jobs needs a number from 1 to 16, not 0"),
        (["kitti2015", "--into", "x", "--jobs", "17"], "--jobs needs a number from 1 to 16, not 17"),
        (["kitti2015", "--into", "x", "--timeout", "601"], "--timeout needs a number from 1 to 600, not 601"),
        (["kitti2015", "--into", "x", "--attempts", "2000"], "--attempts needs a number from 1 to 100, not 2000"),
        (["kitti2015", "--into", "x", "--pause", "-1"], "--pause needs a number from 0 to 3600, not -1.0"),
        (["kitti2015", "--into", "x", "--pause", "nan"], "--pause needs a number from 0 to 3600, not nan"),
        (["kitti2015", "--into", "x", "--pause", "inf"], "--pause needs a number from 0 to 3600, not inf"),
        (["kitti2015", "--into", "x", "--fast"], "unrecognized arguments: --fast"),
    ],
)
def test_wrong_usage_ends_with_2_and_makes_nothing(tmp_path, arguments, message):
    done = subprocess.run([PROGRAM, *arguments], capture_output=True, text=True, cwd=tmp_path)
    assert done.returncode == 2 and message in done.stderr
    assert list(tmp_path.iterdir()) == []


# ---- What is fetched by hand


@pytest.fixture
def by_hand(world):
    del world.archive["urls"]
    world.node["datasets"]["toy"]["by_hand"] = "log in at https://example.org/login"
    return world


def test_what_has_to_be_fetched_by_hand_is_said_by_name(by_hand):
    code, output = by_hand.fetch()
    assert code == 1 and by_hand.is_absent()
    wanted = f"put toy.zip into {by_hand.into} and fetch again"
    assert last_line(output).startswith("toy") and "by hand: log in at https://example.org/login" in output
    assert wanted in output


def test_an_archive_that_the_user_put_there_is_unpacked_and_kept(by_hand):
    by_hand.into.mkdir()
    (by_hand.into / "toy.zip").write_bytes(by_hand.toy)
    code, output = by_hand.fetch()
    assert code == 0 and by_hand.is_right() and (by_hand.into / "toy.zip").exists(), output
    assert by_hand.server.requests == []


def test_a_wrong_archive_that_the_user_put_there_is_named_and_kept(by_hand):
    by_hand.into.mkdir()
    (by_hand.into / "toy.zip").write_bytes(HTML)
    code, output = by_hand.fetch()
    assert code == 1 and f"{by_hand.into}/toy.zip: toy.zip is neither" in output
    assert (by_hand.into / "toy.zip").exists()


def test_a_wrong_archive_is_read_once_for_all_that_comes_from_it(by_hand, monkeypatch):
    by_hand.into.mkdir()
    (by_hand.into / "toy.zip").write_bytes(HTML)
    by_hand.command()
    read = []
    checksums = fetch.checksums_of
    monkeypatch.setattr(fetch, "checksums_of", lambda file: read.append(file.name) or checksums(file))
    fetcher = fetch.Fetcher(catalog.load_catalog(by_hand.root / "catalog.yaml"), by_hand.into, Patience())
    for _ in range(2):
        with pytest.raises(fetch.FetchError, match=f"{by_hand.into}/toy.zip: toy.zip is neither"):
            fetcher.get_archive("toy.zip")
    assert read == ["toy.zip"]


def test_an_empty_folder_is_not_at_hand(by_hand):
    del by_hand.node["datasets"]["toy"]["ways"], by_hand.node["datasets"]["toy"]["holds"]
    (by_hand.into / "toys" / "train").mkdir(parents=True)
    code, output = by_hand.fetch()
    assert code == 1 and f"then unpack to {by_hand.into}/toys/train" in last_line(output)
    (by_hand.into / "toys" / "train" / "a").mkdir()
    code, output = by_hand.fetch()
    assert code == 0 and "at hand: " in last_line(output)


def test_what_comes_in_part_by_hand_is_not_begun_without_that_part(by_hand):
    by_hand.node["archives"]["net.zip"] = {"urls": [f"{by_hand.server.address}/net.zip"]}
    by_hand.node["datasets"]["toy"]["ways"][0].insert(0, {"archive": "net.zip"})
    code, output = by_hand.fetch()
    assert code == 1 and "by hand: log in at https://example.org/login" in last_line(output)
    assert f"then put toy.zip into {by_hand.into}" in last_line(output) and by_hand.server.requests == []


# ---- Servers that fail


def test_a_connection_that_breaks_is_gone_on_with(world):
    world.server.manners["toy.zip"] = "truncates"
    code, output = world.fetch()
    assert code == 0 and world.is_right(), output


def test_a_server_that_truncates_and_knows_no_ranges_is_given_up(world):
    world.server.manners["toy.zip"] = "truncates"
    wanted = Handler.send
    try:
        Handler.send = lambda self, content, _, manner: wanted(self, content, None, manner)
        code, output = world.fetch()
    finally:
        Handler.send = wanted
    assert code == 1 and world.is_absent()
    assert "FAILED" in last_line(output) and "toy.zip" in last_line(output)


def test_a_damaged_archive_is_not_kept_and_not_trusted(world):
    world.server.contents["toy.zip"] = world.toy.replace(NOISE[:1000], bytes(1000))
    code, output = world.fetch()
    assert code == 1 and world.is_absent() and "toy.zip: damaged" in last_line(output)
    world.server.contents["toy.zip"] = world.toy
    assert world.fetch()[0] == 0 and world.is_right()


def test_a_file_shorter_than_it_should_be_is_noticed(world):
    world.server.contents["toy.zip"] = world.toy[:-1000]
    world.archive["bytes"] = len(world.toy)
    code, output = world.fetch()
    assert code == 1 and world.is_absent()
    assert f"toy.zip has {len(world.toy) - 1000} bytes, not {len(world.toy)}" in last_line(output)
    assert "toy.zip" not in world.left_over()


def test_a_stall_ends_with_another_attempt(world):
    manners = iter(["stalls"] * 4)
    world.server.manners["toy.zip"] = lambda: next(manners, None)
    code, output = world.fetch()
    assert code == 0 and world.is_right(), output


def test_a_server_that_only_stalls_is_given_up(world):
    small = zip_of({"train/a/im0.png": b"1", "train/a/im1.png": b"2"})
    world.server.contents["toy.zip"] = small
    world.server.manners["toy.zip"] = "stalls"
    code, output = world.fetch()
    assert code == 1 and "FAILED" in last_line(output) and "imeout" in last_line(output)


@pytest.mark.parametrize("status", [503, 429])
def test_a_busy_server_is_asked_again(world, status):
    manners = iter([status, status])
    world.server.manners["toy.zip"] = lambda: next(manners, None)
    code, output = world.fetch()
    assert code == 0 and world.is_right(), output


@pytest.mark.parametrize("status", [503, 429])
def test_a_server_that_stays_busy_is_given_up_after_so_many_attempts(world, status):
    world.server.manners["toy.zip"] = status
    code, output = world.fetch()
    assert code == 1 and f"the server answers {status}" in last_line(output)
    assert len(world.server.requests) == 3


@pytest.mark.parametrize("status", [404, 403, 401])
def test_a_server_that_has_it_not_is_asked_once(world, status):
    world.server.manners["toy.zip"] = status
    code, output = world.fetch()
    assert code == 1 and len(world.server.requests) == 1
    assert last_line(output).startswith("toy") and "FAILED" in last_line(output)
    assert f"{world.server.address}/toy.zip: " in last_line(output)


def test_404_is_said(world):
    del world.server.contents["toy.zip"]
    assert "the server answers 404" in last_line(world.fetch()[1])


def test_a_server_that_ignores_ranges(world):
    world.server.manners["toy.zip"] = "no ranges"
    code, output = world.fetch()
    assert code == 0 and world.is_right(), output


def leave_partial_file(world, kill=os.kill):
    """Has a download killed when some of it has arrived."""
    world.server.manners["toy.zip"] = "slow"
    part = world.into / ".sgf-fetch" / "toy.zip.part"
    process = subprocess.Popen(
        world.command("toy", "--accept-licences"),
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
    )
    deadline = time.time() + 60
    while not part.with_name("toy.zip.part.aria2").exists() or part.stat().st_blocks < 1000:
        assert time.time() < deadline and process.poll() is None
        time.sleep(0.02)
    time.sleep(1.2)  # aria2 notes every second what it has
    assert process.poll() is None, "the server is too fast for this test"
    kill(process.pid, signal.SIGKILL)
    process.wait()
    assert world.is_absent()
    return part


@pytest.mark.parametrize("kill", [os.kill, os.killpg], ids=["of fetch", "of aria2 too"])
def test_a_download_goes_on_after_a_kill(world, kill):
    world.archive["sha256"] = hashlib.sha256(world.toy).hexdigest()
    leave_partial_file(world, kill)
    world.server.manners.clear()
    time.sleep(2)  # aria2 notices that nobody waits for it
    world.server.requests.clear()
    code, output = world.fetch()
    assert code == 0 and world.is_right(), output
    starts = [int(wanted[6:].split("-")[0]) for _, wanted in world.server.requests if wanted]
    assert any(start % 2**20 for start in starts), "from the middle of what a connection had taken"


@pytest.mark.parametrize("manner", ["416 to ranges", "no ranges"])
def test_a_server_that_will_not_resume_is_asked_from_the_beginning(world, manner):
    leave_partial_file(world)
    world.server.manners["toy.zip"] = manner
    code, output = world.fetch()
    assert code == 0 and world.is_right(), output


def test_a_partial_file_of_another_length_is_begun_anew(world):
    leave_partial_file(world)
    world.server.manners.clear()
    world.toy = world.server.contents["toy.zip"] = zip_of({**TOY, "toys/train/b": b"more"})
    code, output = world.fetch()
    assert code == 0 and (world.into / "toys/train/b").exists(), output


def test_a_partial_file_of_another_file_of_that_length_is_begun_anew(world):
    leave_partial_file(world)
    world.server.manners.clear()
    other = {**TOY, "toys/train/a/im0.png": random.Random(2).randbytes(len(NOISE))}
    world.server.contents["toy.zip"] = zip_of(other)
    world.archive["sha256"] = hashlib.sha256(world.server.contents["toy.zip"]).hexdigest()
    code, output = world.fetch()
    assert code == 0 and "again, from the beginning" in output, output
    assert (world.into / "toys/train/a/im0.png").read_bytes() == other["toys/train/a/im0.png"]


def test_a_partial_file_without_what_says_which_parts_it_has_is_not_trusted(world):
    world.archive["bytes"] = len(world.toy)
    work = world.into / ".sgf-fetch"
    work.mkdir(parents=True)
    (work / "toy.zip.part").write_bytes(b"\0" * 2_000_000)
    code, output = world.fetch()
    assert code == 0 and world.is_right() and "again" not in output, output


# ---- Wrong files


def test_a_wrong_checksum_is_named_and_the_file_removed(world):
    world.archive["sha256"] = "0" * 64
    code, output = world.fetch()
    assert code == 1 and world.is_absent()
    assert f"its sha256 is {hashlib.sha256(world.toy).hexdigest()}, not {'0' * 64}" in last_line(output)
    assert world.left_over() == [] and not (world.into / ".sgf-fetch" / "checksums.yaml").exists()


def test_a_wrong_md5_is_named(world):
    world.archive["md5"] = "0" * 32
    code, output = world.fetch()
    assert code == 1 and "toy.zip is another file: its md5 is" in last_line(output)


def test_a_page_instead_of_an_archive_is_said(world):
    world.server.contents["toy.zip"] = HTML
    code, output = world.fetch()
    assert code == 1 and world.is_absent()
    assert "neither a zip nor a tar archive, perhaps a page" in last_line(output)


def test_an_archive_without_what_the_data_set_holds_is_said(world):
    world.server.contents["toy.zip"] = zip_of({"train/a/im0.png": b"1"})
    code, output = world.fetch()
    assert code == 1 and world.is_absent() and "toy.zip: no a/im1.png in what was unpacked" in last_line(output)


def test_a_hostile_archive_leaves_nothing(world):
    world.server.contents["toy.zip"] = zip_of({**TOY, "../../../evil": b"evil"})
    code, output = world.fetch()
    assert code == 1 and world.is_absent() and "'../../../evil' leads out" in last_line(output)
    assert world.left_over() == []
    assert not list(world.root.rglob("evil"))
    assert not (world.into / ".sgf-fetch" / "checksums.yaml").exists(), "no trust in it"


def test_the_first_download_is_recorded_and_a_changed_one_refused(world):
    world.fetch()
    digest = hashlib.sha256(world.toy).hexdigest()
    assert world.records()["toy.zip"]["sha256"] == digest
    assert world.records()["toy.zip"]["bytes"] == len(world.toy)
    (world.into / "toys").rename(world.root / "away")
    code, output = world.fetch()
    assert code == 0 and world.is_right(), output

    (world.into / "toys").rename(world.root / "away_too")
    world.server.contents["toy.zip"] = zip_of({**TOY, "toys/train/new": b"1"})
    code, output = world.fetch()
    assert code == 1 and world.is_absent()
    record = world.into / ".sgf-fetch" / "checksums.yaml"
    assert digest in last_line(output) and f"remove toy.zip from {record}" in last_line(output)
    assert world.records()["toy.zip"]["sha256"] == digest

    record.unlink()
    assert world.fetch()[0] == 0


# ---- Alternates


@pytest.mark.parametrize("wrong", [404, 503, "stalls", "page", "changed", "to file:///etc/passwd"])
def test_the_next_address_is_tried(world, wrong):
    world.archive["sha256"] = hashlib.sha256(world.toy).hexdigest()
    world.server.contents["first.zip"] = {"page": HTML, "changed": zip_of({"train/a": b"1"})}.get(wrong, b"x" * 99)
    world.server.manners["first.zip"] = wrong
    world.archive["urls"].insert(0, f"{world.server.address}/first.zip")
    code, output = world.fetch()
    assert code == 0 and world.is_right(), output
    assert f"{world.server.address}/first.zip: " in output


def test_the_next_way_is_tried(world):
    world.node["archives"]["own.zip"] = {"urls": [f"{world.server.address}/own.zip"]}
    world.node["datasets"]["toy"]["ways"].insert(0, [{"archive": "own.zip", "take": "train"}])
    code, output = world.fetch()
    assert code == 0 and world.is_right(), output


def test_all_that_failed_is_said(world):
    world.server.contents.clear()
    world.archive["urls"].append(f"{world.server.address}/second.zip")
    line = last_line(world.fetch()[1])
    assert f"{world.server.address}/toy.zip: " in line and f"{world.server.address}/second.zip: " in line


def test_one_failure_does_not_keep_the_others(world):
    toy = world.node["datasets"]["toy"]
    world.node["archives"]["none.zip"] = {"urls": [f"{world.server.address}/none.zip"]}
    world.node["datasets"]["none"] = {**toy, "folder": "none", "ways": [[{"archive": "none.zip"}]]}
    code, output = world.fetch("none", "toy")
    assert code == 1 and world.is_right()
    assert "FAILED" in output.splitlines()[-2] and "done: " in output.splitlines()[-1]


def test_a_redirect_is_followed_but_not_to_a_file(world):
    secret = world.root / "secret.zip"
    secret.write_bytes(world.toy)
    world.server.contents["moved.zip"] = b""
    world.archive["urls"] = [f"{world.server.address}/moved.zip"]
    world.server.manners["moved.zip"] = f"to file://{secret}"
    code, output = world.fetch()
    assert code == 1 and world.is_absent() and "FAILED" in last_line(output)
    world.server.manners["moved.zip"] = f"to {world.server.address}/toy.zip"
    assert world.fetch()[0] == 0 and world.is_right()


# ---- The folder


def test_with_too_little_space_nothing_is_begun(world):
    world.archive["about_bytes"] = 10**15
    part = world.into / ".sgf-fetch" / "toy.zip.part"
    part.parent.mkdir(parents=True)
    part.write_bytes(bytes(10_000_000))
    code, output = world.fetch()
    assert code == 1 and world.server.requests == []
    assert f"too little space in {world.into}: 999999.99 GB needed" in output
    assert f"{part}: 0.01 GB, for toy" in output, "what could be deleted"


def raise_that_space_is_short(folder, needed, what):
    raise fetch.unpack.SpaceError(f"{what} needs more")


def test_when_space_runs_out_no_other_way_is_downloaded(world, monkeypatch, capsys):
    world.node["archives"]["own.zip"] = {"urls": [f"{world.server.address}/own.zip"]}
    world.node["datasets"]["toy"]["ways"].append([{"archive": "own.zip", "take": "train"}])
    world.command()
    monkeypatch.setattr(fetch.unpack, "require_space", raise_that_space_is_short)
    read = catalog.load_catalog(world.root / "catalog.yaml")
    assert fetch.run(read, ["toy"], world.into, True, Patience()) == 1
    assert "FAILED: unpacking toy.zip needs more" in last_line(capsys.readouterr().out)
    assert {name for name, _ in world.server.requests} == {"toy.zip"} and world.left_over() == ["toy.zip"]


def test_a_folder_that_is_there_but_not_complete_is_left_alone(world):
    (world.into / "toys" / "train" / "mine").mkdir(parents=True)
    code, output = world.fetch()
    assert code == 1 and world.server.requests == []
    assert f"{world.into}/toys/train is there without a/im0.png" in last_line(output)
    assert (world.into / "toys" / "train" / "mine").is_dir()


@pytest.mark.parametrize("other", ["file", "link that leads nowhere"])
@pytest.mark.parametrize("place", ["toys", "toys/train"])
def test_something_else_in_the_place_of_a_folder_is_found_before_the_download(world, place, other):
    path = world.into / place
    path.parent.mkdir(parents=True)
    path.write_text("mine") if other == "file" else path.symlink_to("nowhere")
    code, output = world.fetch()
    assert code == 1 and world.server.requests == []
    assert f"{path} is {'not a folder' if place == 'toys' else 'there without a/im0.png'}" in last_line(output)
    assert os.path.lexists(path) and [entry.name for entry in path.parent.iterdir()].count(path.name) == 1


def test_a_folder_that_cannot_be_written_is_found_before_the_download(world):
    world.into.mkdir()
    (world.into / "toys").symlink_to("/proc")
    code, output = world.fetch()
    assert code == 1 and world.server.requests == []
    assert "FAILED" in last_line(output) and f"{world.into}/toys/.sgf-unpacking" in last_line(output)


@pytest.fixture
def other_disk(tmp_path):
    """A folder on another file system."""
    shared_memory = Path("/dev/shm")
    if not shared_memory.is_dir() or shared_memory.stat().st_dev == tmp_path.stat().st_dev:
        pytest.skip("there is no second file system")
    with tempfile.TemporaryDirectory(dir=shared_memory) as folder:
        yield Path(folder)


def test_the_data_may_lie_on_another_disk(world, other_disk):
    world.node["datasets"]["toy"]["unpacked_bytes"] = 20_000_000
    world.into.mkdir()
    (world.into / "toys").symlink_to(other_disk)
    code, output = world.fetch()
    assert code == 0 and world.is_right() and world.left_over() == [], output
    assert [path.name for path in other_disk.iterdir()] == ["train"]
    needed = [line.split(";")[0].strip() for line in output.splitlines() if "are free in" in line]
    assert needed == ["needs about 0.00 GB", "needs about 0.02 GB"]


def test_the_downloads_may_lie_on_another_disk(world, other_disk):
    world.into.mkdir()
    (world.into / ".sgf-fetch").symlink_to(other_disk)
    code, output = world.fetch()
    assert code == 0 and world.is_right() and world.left_over() == [], output


def test_an_archive_is_kept_until_all_that_comes_from_it_is_there(shared):
    code, output = shared.fetch()
    assert code == 0 and shared.left_over() == ["toy.zip"]
    assert f"{shared.into}/.sgf-fetch/toy.zip: 0.00 GB, for tests" in output and "== archives kept" in output
    shared.server.requests.clear()
    code, output = shared.fetch("tests")
    assert code == 0 and shared.left_over() == [] and "== archives kept" not in output, output
    assert shared.server.requests == []


def test_what_a_kill_left_of_complete_data_sets_goes_with_the_next_fetch(shared):
    shared.fetch()
    shared.fetch("tests")
    (shared.into / ".sgf-fetch" / "toy.zip").write_bytes(shared.toy)
    other = {**shared.node["datasets"]["toy"], "folder": "other", "ways": [[{"archive": "none.zip"}]]}
    shared.node["datasets"]["other"] = other
    shared.node["archives"]["none.zip"] = {"urls": [f"{shared.server.address}/none.zip"]}
    assert shared.fetch("other")[0] == 1 and shared.left_over() == []


@pytest.mark.parametrize("name, accept, code", [("toy", True, 0), ("toy", False, 0), ("tests", False, 1)])
def test_what_another_fetch_works_on_is_left_alone(shared, name, accept, code):
    shared.fetch()
    work = shared.into / ".sgf-fetch"
    unpacked = shared.into / ".sgf-unpacking" / "tests" / "x.png"
    unpacked.parent.mkdir(parents=True)
    for file in (unpacked, work / "toy.zip", work / "toy.zip.part", work / "toy.zip.part.aria2"):
        file.touch()
    before = sorted(shared.into.rglob("*"))
    lock = fetch.take(shared.into)
    try:
        assert shared.fetch(name, accept=accept)[0] == code
    finally:
        os.close(lock)
    assert sorted(shared.into.rglob("*")) == before


def test_two_at_once_do_not_share_a_folder(world, monkeypatch):
    monkeypatch.setattr(fetch, "LOCK_WAIT_S", 0.2)
    descriptor = fetch.take(world.into)
    with pytest.raises(fetch.FetchError, match=f"another fetch is at work in {world.into}"):
        fetch.take(world.into)
    os.close(descriptor)
    os.close(fetch.take(world.into))


def test_a_kill_while_unpacking_leaves_no_half_of_a_data_set(world, monkeypatch):
    read = functools.partial(catalog.load_catalog, world.root / "catalog.yaml")
    world.command()
    monkeypatch.setattr(fetch.unpack, "extract", lambda *_: os._exit(9))
    if (child := os.fork()) == 0:
        fetch.run(read(), ["toy"], world.into, True, Patience())
        os._exit(0)
    assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 9
    assert world.is_absent() and (world.into / ".sgf-fetch" / "toy.zip").exists()
    world.server.requests.clear()
    code, output = world.fetch()
    assert code == 0 and world.is_right() and world.left_over() == [], output
    assert world.server.requests == [], "what was downloaded is not downloaded again"
    assert sorted(path.name for path in world.into.iterdir()) == [".sgf-fetch", "toys"]


def test_without_aria2_its_package_is_named(world, monkeypatch):
    world.command()
    monkeypatch.setenv("PATH", "/nonexistent")
    assert fetch.main([str(part) for part in world.command("toy", "--accept-licences")[1:]]) == 1
    assert world.is_absent()
