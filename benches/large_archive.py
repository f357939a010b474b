#!/usr/bin/env python3
"""Time and memory of the programs with a large archive: seconds, and the peak of resident memory of each process.

    cargo build --release --workspace --bins --example fill
    python3 benches/large_archive.py [--count 100000 1000000] [--evaluated] [--folder DIR] [--programs target/release]

The script fills a data directory with made-up individuals (`coordinator/store/examples/fill.rs`), all but the last generation.
With --evaluated, a campaign of null evaluations runs instead, over gRPC, from its first generation to its last, in generations of
1,000 (`murmuration lab bench cluster --keep`). The script prints a table. Each row measures a fresh process. `serve` finishes the
campaign; the script kills this process with SIGKILL as soon as it answers, and starts it again. While the map is made, the script
requests the page ten times a second; the longest wait shows whether making the map delays the page.
"""

import argparse
import contextlib
import json
import os
import pathlib
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time
import urllib.request

ROOT = pathlib.Path(__file__).resolve().parent.parent
MADE_UP, EVALUATED = "/campaigns/filled-1", "/campaigns/bench-1"


def row(item, seconds, cpu, mebibytes, note=""):
    print(f"| {item} | {seconds:.1f} | {cpu:.1f} | {mebibytes:.0f} | {note} |", flush=True)


def run(item, *command):
    """Runs a command to its end, and prints its row."""
    begun = time.perf_counter()
    process = subprocess.Popen([str(part) for part in command], stdout=subprocess.PIPE, text=True)
    message = process.stdout.read()
    _, status, used = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    seconds = time.perf_counter() - begun
    if process.returncode:
        sys.exit(f"{item}: exit code {process.returncode}")
    row(item, seconds, used.ru_utime + used.ru_stime, used.ru_maxrss / 1024, message.strip().splitlines()[-1][:70] if message.strip() else "")


def peak(process):
    """Peak of resident memory so far, in MiB."""
    status = pathlib.Path(f"/proc/{process.pid}/status").read_text()
    return int(status.split("VmHWM:")[1].split()[0]) / 1024


def cpu(process):
    """Seconds of CPU time so far."""
    fields = pathlib.Path(f"/proc/{process.pid}/stat").read_text().rsplit(")", 1)[1].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def get(url):
    """Seconds until the whole answer arrives, and the answer."""
    begun = time.perf_counter()
    with urllib.request.urlopen(url, timeout=3600) as answer:
        body = answer.read()
    return time.perf_counter() - begun, body


@contextlib.contextmanager
def serving(programs, data, workers, campaign):
    with socket.socket() as listener:
        listener.bind(("127.0.0.1", 0))
        address = "127.0.0.1:%d" % listener.getsockname()[1]
    command = [programs / "murmuration", "serve", "--data", data, "--listen", address, "--insecure-listen", "--workers", str(workers)]
    begun = time.perf_counter()
    process = subprocess.Popen([str(part) for part in command], stderr=subprocess.DEVNULL)
    try:
        while True:
            try:
                get(f"http://{address}{campaign}")
                break
            except OSError:
                if process.poll() is not None:
                    sys.exit("serve ended")
                time.sleep(0.02)
        yield process, f"http://{address}", time.perf_counter() - begun
    finally:
        if process.poll() is None:
            process.send_signal(signal.SIGTERM)
        process.wait()


def state(programs, url):
    command = [programs / "murmuration", "list", "--coordinator", url, "--json"]
    message = json.loads(subprocess.check_output([str(part) for part in command]))
    return message["state"]


def longest_wait(page, ended):
    """Requests the campaign's page until `ended`; returns the longest time of a request."""
    longest = 0.0
    while not ended.is_set():
        longest = max(longest, get(page)[0])
        time.sleep(0.1)
    return longest


def while_asking(page, path):
    """Seconds that the request of `path` took, the page's longest time meanwhile, and the bytes of the answer."""
    ended, waited = threading.Event(), []
    asking = threading.Thread(target=lambda: waited.append(longest_wait(page, ended)))
    asking.start()
    seconds, body = get(page + path)
    ended.set()
    asking.join()
    return seconds, waited[0], len(body)


def measure(programs, count, folder, evaluated):
    data = folder / "data"
    print(f"\n{count:,} individuals\n\n| item | s | CPU, s | MiB | |\n|---|--:|--:|--:|---|")
    campaign = EVALUATED if evaluated else MADE_UP
    if evaluated:
        command = ["lab", "bench", "cluster", "--generations", 1, "--rounds", 1, "--null-generations", count // 1000, "--keep", data]
        run("null evaluations", programs / "murmuration", *command)
    else:
        run("fill", programs / "examples/fill", data, count)
    database = data / "murmuration.sqlite"
    run("digest", programs / "murmuration", "digest", "latest", "--partial", "--data", data)
    run("doctor", programs / "murmuration", "doctor", "--data", data)
    run("backup", programs / "murmuration", "backup", folder / "backup", "--data", data)
    shutil.rmtree(folder / "backup")
    run("export", programs / "murmuration", "export", "latest", folder / "export", "--data", data)
    files = sum(path.stat().st_size for path in (folder / "export").rglob("*") if path.is_file())
    print(f"| the folder of the export | | | {files / 2**20:.0f} | of disk |", flush=True)
    run("import", programs / "murmuration", "import", folder / "export", "--data", folder / "imported")
    for name in ("export", "imported"):
        shutil.rmtree(folder / name)
    with serving(programs, data, 1, campaign) as (process, url, seconds):
        row("serve: the first page", seconds, cpu(process), peak(process))
        time.sleep(1)
        process.kill()
    with serving(programs, data, 1, campaign) as (process, url, seconds):
        begun = time.perf_counter()
        while state(programs, url) == "running":
            time.sleep(0.2)
        if state(programs, url) != "completed":
            sys.exit(f"the campaign is {state(programs, url)}")
        seconds = time.perf_counter() - begun
        row("after SIGKILL: last generation and taxonomy", seconds, cpu(process), peak(process))
    with serving(programs, data, 0, campaign) as (process, url, seconds):
        row("serve, completed: the first page", seconds, cpu(process), peak(process))
        for path in ["/taxonomy", "/points", "/points/axes", "/points/neighbours"]:
            before = cpu(process)
            seconds, waited, size = while_asking(url + campaign, path)
            row(path, seconds, cpu(process) - before, peak(process), f"{size:,} bytes; the page meanwhile: {waited:.2f} s at most")
    run("report", programs / "murmuration", "report", "latest", "--data", data, "--out", folder / "report")
    print(f"\n{database.stat().st_size / count:.0f} bytes on disk an individual")


def main():
    arguments = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    arguments.add_argument("--count", type=int, nargs="+", default=[100_000])
    arguments.add_argument("--evaluated", action="store_true", help="run a campaign of null evaluations instead of making one up")
    arguments.add_argument("--folder", type=pathlib.Path, help="where to put the data directories")
    arguments.add_argument("--programs", type=pathlib.Path, default=ROOT / "target/release")
    options = arguments.parse_args()
    for count in options.count:
        with tempfile.TemporaryDirectory(dir=options.folder) as folder:
            measure(options.programs, count, pathlib.Path(folder), options.evaluated)


if __name__ == "__main__":
    main()
