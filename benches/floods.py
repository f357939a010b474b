#!/usr/bin/env python3
"""Cost of a flood for the others: a viewer floods a coordinator, while an operator and a campaign go on.

    cargo build --release --workspace --bins --example fill
    pip install grpcio
    python3 benches/floods.py [--count 20000] [--seconds 60] [--programs target/release] [--only archives digests ...]

A coordinator with tokens serves an archive of made-up individuals, and a campaign of small generations runs. Each flood comes
from one token, by a process of low priority. A viewer requests archives and label logs without reading them, digests, lists of
campaigns, pages of reports, watchers, swarms on the page Play, or the agreement of two annotators; one flood is all of these at
once. An annotator sends requests of 20,000 labels and undoes them, or requests of one label, alone and beside lists of all
labels. Meanwhile an operator lists campaigns, and resumes and pauses another campaign; a second viewer opens a page and watches a
campaign. The flood comes four times, for SECONDS in all.

The script prints a table. Its columns are the campaign's pace relative to its pace without a flood; the share of all cores that
the flooding process took (another machine's, in practice); the 95th percentile of `list` and `pause`; the peak of resident memory
above idle; the number of the second viewer's refused requests; and the time that SIGTERM took. The script ends with exit code 1
if a figure is over its limit.
"""

import argparse
import contextlib
import http.client
import itertools
import json
import multiprocessing
import os
import pathlib
import signal
import socket
import statistics
import subprocess
import sys
import tempfile
import threading
import time

import grpc

ROOT = pathlib.Path(__file__).resolve().parent.parent
SERVICES = "/murmuration.v1."
PACED = """
name = "{name}"
model = "single-sensor"
method = "hand-crafted"
[world]
horizon = 1200
[search]
population = 100
generations = {generations}
[taxonomy]
medoids = 2
"""
FLOODS = ("archives", "labels", "digests", "lists", "reports", "watchers", "play", "starts", "agreement", "polling", "all", "answers", "single")
# Number of annotators, which is the number of label log entries for each individual.
ANNOTATORS = 5
LIMITS = {"list": 500, "pause": 500, "memory": 256, "refused": 0, "end": 5}
PACE = 0.8
# Number of floods, with idle stretches between them. The campaign's pace in a flood is compared with that of the idle stretches
# before and after, because a search slows down while its archive grows.
STRETCHES = 4


def field(number, value):
    """A text, or a truth value, of a message."""
    if isinstance(value, bool):
        return bytes([number << 3, int(value)])
    text = value.encode()
    return bytes([number << 3 | 2, len(text)]) + text


class Client:
    """A connection with a token of its own."""

    def __init__(self, address, token):
        # Without this option, the channels of a process would share a connection.
        options = [("grpc.use_local_subchannel_pool", 1), ("grpc.max_receive_message_length", -1)]
        self.channel = grpc.insecure_channel(address, options)
        self.metadata = [("authorization", f"Bearer {token}")]

    def stream(self, method, *fields):
        call = self.channel.unary_stream(SERVICES + method, lambda message: message, lambda answer: answer)
        return call(b"".join(fields), metadata=self.metadata)

    def call(self, method, *fields):
        call = self.channel.unary_unary(SERVICES + method, lambda message: message, lambda answer: answer)
        return call(b"".join(fields), metadata=self.metadata)


def page(address, token, path, form=None):
    connection = http.client.HTTPConnection(address, timeout=120)
    headers = {"authorization": f"Bearer {token}", "origin": f"http://{address}"}
    if form:
        headers["content-type"] = "application/x-www-form-urlencoded"
    connection.request("POST" if form else "GET", path, form, headers)
    answer = connection.getresponse()
    answer.read()
    connection.close()
    return answer.status


def again(ended, count, act):
    """Runs `act` over and over on `count` threads."""

    def loop(number):
        while not ended.is_set():
            with contextlib.suppress(grpc.RpcError, OSError, http.client.HTTPException):
                act(number)

    threads = [threading.Thread(target=loop, args=(number,), daemon=True) for number in range(count)]
    for thread in threads:
        thread.start()


def flood(kind, address, token, ended):
    os.nice(19)
    held = []
    if kind in ("archives", "all"):
        for client in [Client(address, token) for _ in range(2)]:
            held += [(client, client.stream("CampaignService/GetArchive", field(1, "filled-1"), field(2, True))) for _ in range(250)]
    if kind in ("labels", "all"):
        for client in [Client(address, token) for _ in range(2)]:
            held += [(client, client.stream("LabelService/ListLabelEntries", field(1, "filled-1"))) for _ in range(250)]
    if kind in ("digests", "all"):
        clients = [Client(address, token) for _ in range(2)]
        again(ended, 250, lambda number: clients[number % 2].call("CampaignService/GetDigest", field(1, "filled-1")))
    if kind in ("lists", "all"):
        listing = [Client(address, token) for _ in range(8)]
        again(ended, 64, lambda number: list(listing[number % 8].stream("CampaignService/ListCampaigns")))
    if kind in ("reports", "all"):
        again(ended, 200, lambda _: page(address, token, "/campaigns/filled-1/report"))
    if kind in ("watchers", "all"):
        for client in [Client(address, token) for _ in range(4)]:
            held += [(client, client.stream("CampaignService/WatchCampaign", field(1, "paced-2"))) for _ in range(256)]
    if kind == "answers":
        answers = b"".join(answer(index) for index in range(20_000))
        clients = [Client(address, token) for _ in range(3)]

        def label_and_undo(number):
            label = field(1, "filled-1") + field(2, f"label-{number}-{time.time_ns()}")
            list(clients[number].stream("LabelService/AppendLabels", label, answers))
            undo = field(2, f"undo-{number}-{time.time_ns()}") + field(3, "guest")
            list(clients[number].stream("LabelService/UndoLabels", field(1, "filled-1"), undo))

        again(ended, 3, label_and_undo)
    if kind in ("agreement", "all"):
        agreeing = [Client(address, token) for _ in range(4)]
        pair = field(2, "annotator 0") + field(3, "annotator 1")
        again(ended, 64, lambda number: list(agreeing[number % 4].stream("LabelService/GetAgreement", field(1, "filled-1"), pair)))
    if kind == "polling":
        looking = [Client(address, token) for _ in range(4)]
        again(ended, 48, lambda number: list(looking[number % 4].stream("LabelService/ListLabels", field(1, "filled-1"))))
    if kind in ("single", "polling"):
        clients = [Client(address, token) for _ in range(8)]

        def label(number):
            request = field(1, "filled-1") + field(2, f"one-{number}-{time.time_ns()}")
            list(clients[number % 8].stream("LabelService/AppendLabels", request, answer(number)))

        again(ended, 64 if kind == "single" else 16, label)
    if kind in ("play", "all"):
        form = "robots=1000&seed={}&from=1000000"
        again(ended, 8, lambda number: page(address, token, "/play/motion", form.format(number)))
    if kind in ("starts", "all"):
        index = itertools.count()
        again(ended, 8, lambda _: page(address, token, f"/campaigns/filled-1/individuals/{next(index)}/starts"))
    ended.wait()
    os._exit(0)


def processor_time(process):
    """CPU seconds of all threads of a process."""
    fields = pathlib.Path(f"/proc/{process.pid}/stat").read_text().rsplit(")", 1)[1].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def varint(number):
    return bytes([number & 127 | 128]) + varint(number >> 7) if number > 127 else bytes([number])


def answer(index):
    """An answer about an individual, as a field of a request."""
    message = b"\x08" + varint(index) + field(2, f"kind {index % 7}") + field(4, "guest")
    return b"\x1a" + varint(len(message)) + message


def memory(process, what):
    status = pathlib.Path(f"/proc/{process.pid}/status").read_text()
    return int(status.split(what)[1].split()[0]) / 1024


class Cluster:
    """A coordinator with one worker thread per core, and its filled data directory."""

    def __init__(self, programs, folder, count):
        self.programs, self.folder = programs, folder
        subprocess.check_call([programs / "examples/fill", folder / "data", str(count)], stdout=subprocess.DEVNULL)
        self.tokens = {}
        with (folder / "tokens.toml").open("w") as file:
            for name, role in (("guest", "viewer"), ("annotator", "annotator"), ("other", "viewer"), ("boss", "operator")):
                made = subprocess.run([programs / "murmuration", "token", name, "--role", role], capture_output=True, text=True, check=True)
                file.write(made.stdout)
                self.tokens[name] = next(word for word in made.stderr.split() if word.startswith("mur_"))
        with socket.socket() as listener:
            listener.bind(("127.0.0.1", 0))
            self.address = "127.0.0.1:%d" % listener.getsockname()[1]
        command = [programs / "murmuration", "serve", "--data", folder / "data", "--listen", self.address, "--tokens", folder / "tokens.toml"]
        self.process = subprocess.Popen([str(part) for part in command], stderr=subprocess.DEVNULL)
        while True:
            try:
                if page(self.address, self.tokens["boss"], "/readyz") == 200:
                    break
            except OSError:
                time.sleep(0.05)
        while json.loads(self.command("list", "--json").splitlines()[0])["state"] == "running":
            time.sleep(0.2)
        labels = folder / "labels.csv"
        labels.write_text("index,class\n" + "".join(f"{index},kind {index % 7}\n" for index in range(count)))
        for number in range(ANNOTATORS):
            self.command("label", "filled-1", "--csv", labels, "--annotator", f"annotator {number}")
        for name, generations in (("paced", 100_000), ("paused", 100_000)):
            path = folder / f"{name}.toml"
            path.write_text(PACED.format(name=name, generations=generations))
            self.command("submit", path)
        self.command("pause", "paused-3")

    def command(self, *arguments):
        environment = {**os.environ, "MURMURATION_TOKEN": self.tokens["boss"]}
        command = [self.programs / "murmuration", *arguments, "--coordinator", f"http://{self.address}"]
        return subprocess.check_output([str(part) for part in command], env=environment, text=True, stderr=subprocess.DEVNULL)

    def generations(self):
        listed = [json.loads(line) for line in self.command("list", "--json").splitlines()]
        return next(one["generations_done"] for one in listed if one["id"] == "paced-2")


def measure(cluster, seconds):
    """Measures the operator's and the second viewer's requests for `seconds`, and the campaign's generations per second."""
    operator, other = Client(cluster.address, cluster.tokens["boss"]), cluster.tokens["other"]
    times, refused = {"list": [], "pause": []}, 0
    before, begun = cluster.generations(), time.perf_counter()
    watching = Client(cluster.address, other)
    while time.perf_counter() - begun < seconds:
        for what, act in (
            ("list", lambda: list(operator.stream("CampaignService/ListCampaigns"))),
            ("pause", lambda: operator.call("CampaignService/ResumeCampaign", field(1, "paused-3"))),
            ("pause", lambda: operator.call("CampaignService/PauseCampaign", field(1, "paused-3"))),
        ):
            asked = time.perf_counter()
            act()
            times[what].append(1000 * (time.perf_counter() - asked))
        refused += page(cluster.address, other, "/campaigns/paced-2") != 200
        try:
            watched = watching.stream("CampaignService/WatchCampaign", field(1, "paced-2"))
            next(watched)
            watched.cancel()
        except grpc.RpcError:
            refused += 1
        time.sleep(0.1)
    pace = (cluster.generations() - before) / (time.perf_counter() - begun)
    return {
        "pace": pace,
        "refused": refused,
        **times,
    }


def late(stretches, what):
    """The 95th percentile of the times of all stretches, ms."""
    return statistics.quantiles([time for stretch in stretches for time in stretch[what]], n=20)[-1]


@contextlib.contextmanager
def flooding(context, kind, cluster):
    """Runs a guest's flood during the block."""
    ended = context.Event()
    token = cluster.tokens["annotator" if kind in ("answers", "single", "polling") else "guest"]
    guest = context.Process(target=flood, args=(kind, cluster.address, token, ended))
    guest.start()
    try:
        time.sleep(2)
        yield guest
    finally:
        ended.set()
        guest.join(10)
        guest.kill()


def stretches(context, kind, cluster, seconds):
    """The measures of alternating idle and flooded stretches, and the growth of memory beyond the first idle stretch, MiB."""
    measure(cluster, 5)
    idle, flooded = [measure(cluster, seconds)], []
    resident = memory(cluster.process, "VmRSS:")
    pathlib.Path(f"/proc/{cluster.process.pid}/clear_refs").write_text("5")
    for _ in range(STRETCHES):
        with flooding(context, kind, cluster) as guest:
            used, begun = processor_time(guest), time.perf_counter()
            measured = measure(cluster, seconds)
            measured["guest"] = (processor_time(guest) - used) / (time.perf_counter() - begun) / os.cpu_count()
            flooded.append(measured)
        time.sleep(2)
        idle.append(measure(cluster, seconds))
    return idle, flooded, memory(cluster.process, "VmHWM:") - resident


def main():
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--count", type=int, default=20_000)
    options.add_argument("--seconds", type=float, default=60)
    options.add_argument("--programs", type=pathlib.Path, default=ROOT / "target/release")
    options.add_argument("--only", nargs="*", default=list(FLOODS), choices=FLOODS)
    options = options.parse_args()
    # gRPC does not survive a fork.
    context = multiprocessing.get_context("spawn")
    failed = False
    print("| flood | pace | cores of the guest | list, ms | pause, ms | memory, MiB | refused to others | SIGTERM, s |\n|---|--:|--:|--:|--:|--:|--:|--:|")
    for kind in options.only:
        with tempfile.TemporaryDirectory() as folder:
            cluster = Cluster(options.programs.resolve(), pathlib.Path(folder), options.count)
            try:
                idle, flooded, grown = stretches(context, kind, cluster, options.seconds / STRETCHES)
                pace = statistics.mean(
                    of["pace"] / statistics.mean([before["pace"], after["pace"]]) for of, before, after in zip(flooded, idle, idle[1:])
                )
                with flooding(context, kind, cluster):
                    begun = time.perf_counter()
                    cluster.process.send_signal(signal.SIGTERM)
                    code = cluster.process.wait(120)
                    end = time.perf_counter() - begun
            finally:
                cluster.process.kill()
        guest = statistics.mean(stretch["guest"] for stretch in flooded)
        slow = {what: (late(flooded, what), late(idle, what)) for what in ("list", "pause")}
        refused = sum(stretch["refused"] for stretch in flooded)
        times = [f"{while_flooded:.0f} ({while_idle:.0f} idle)" for while_flooded, while_idle in slow.values()]
        print(f"| {kind} | {pace:.2f} | {guest:.2f} | {' | '.join(times)} | {grown:.0f} | {refused} | {end:.1f} |", flush=True)
        found = {what: while_flooded for what, (while_flooded, _) in slow.items()} | {"memory": grown, "refused": refused, "end": end}
        failed |= code != 0 or pace / (1 - guest) < PACE or any(found[what] > limit for what, limit in LIMITS.items())
    sys.exit(failed)


if __name__ == "__main__":
    main()
