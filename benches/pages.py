#!/usr/bin/env python3
"""How long a coordinator takes to answer what people do on its pages, with a large archive: milliseconds.

    cargo build --release --workspace --bins --example fill
    python3 benches/pages.py [--count 100000] [--folder DIR] [--programs target/release] [--times 30] [--limit 100]

The script fills a data directory with made-up individuals, and lets a coordinator finish their campaign and a small campaign for
comparison. After that, the script makes each request as a page does, over a connection that stays open: once while the
coordinator fills its caches, and then --times times. The script ends with exit code 1 if the median of an interaction is over the
limit.
"""

import argparse
import concurrent.futures
import http.client
import json
import pathlib
import random
import secrets
import statistics
import sys
import tempfile
import time
import urllib.parse

from large_archive import MADE_UP as CAMPAIGN
from large_archive import ROOT, run, serving

# Pictures in the gallery of a selection, and a browser's connections to one coordinator.
GALLERY = 60
CONNECTIONS = 6
LABELS = 2000
# The form fields of the small campaign for comparison.
SMALL = {
    "step": "start",
    "name": "small",
    "model": "single-sensor",
    "method": "hand-crafted",
    "search.population": 20,
    "search.generations": 3,
    "world.horizon": 100,
}


class Page:
    """A page in a browser, with a connection that stays open."""

    def __init__(self, url):
        self.address = url.removeprefix("http://")
        self.connection = http.client.HTTPConnection(self.address, timeout=600)

    def submit(self, path, fields):
        """Sends a form."""
        self.send(path, urllib.parse.urlencode(fields), "application/x-www-form-urlencoded")

    def ask(self, path, body=None, whole=True):
        """Milliseconds until the answer (or its first bytes) arrives, and the answer."""
        return self.send(path, json.dumps(body) if body is not None else None, "application/json", whole)

    def send(self, path, body, kind, whole=True):
        headers = {"content-type": kind, "origin": f"http://{self.address}"} if body is not None else {}
        method = "GET" if body is None else "POST"
        begun = time.perf_counter()
        self.connection.request(method, path, body, headers)
        answer = self.connection.getresponse()
        read = answer.read() if whole else answer.read1(1)
        took = 1000 * (time.perf_counter() - begun)
        if answer.status >= 400:
            sys.exit(f"{path}: {answer.status} {read.decode()}")
        if not whole:
            # Closing the connection drops the rest of the answer.
            self.connection.close()
        return took, read


class Interactions:
    """People's interactions, each a function from the number of the try to milliseconds."""

    def __init__(self, url, count):
        self.page = Page(url)
        self.others = [Page(url) for _ in range(CONNECTIONS)]
        self.count = count
        self.random = random.Random(1)
        self.fresh = iter(self.random.sample(range(count), 50_000))

    def get(self, path, whole=True):
        return lambda _: self.page.ask(path, whole=whole)[0]

    def post(self, path, body):
        return lambda number: self.page.ask(CAMPAIGN + path, body(number))[0]

    def picture(self, page):
        return page.ask(f"{CAMPAIGN}/individuals/{next(self.fresh)}")

    def gallery(self, _):
        begun = time.perf_counter()
        share = GALLERY // CONNECTIONS
        with concurrent.futures.ThreadPoolExecutor(CONNECTIONS) as pool:
            list(pool.map(lambda page: [self.picture(page) for _ in range(share)], self.others))
        return 1000 * (time.perf_counter() - begun)

    def question(self, _):
        return {"annotator": "Ana", "session": "bench", "strategy": "medoids", "count": 4, "agreement": False, "again": []}

    def answer(self, number):
        message = [{"index": next(self.fresh), "answer": ["milling", "dispersal", "random"][number % 3]}]
        return {"request_id": f"bench-{secrets.token_hex(8)}", "annotator": "Ana", "answers": message}

    def change(self, **change):
        return {"request_id": f"bench-{secrets.token_hex(8)}", "annotator": "Ana", "change": change}

    def rename(self, number):
        """Renames a class there and back, so that the class has two names in turn."""
        names = ["milling", "mill"]
        return self.change(rename={"class": names[number % 2], "to": names[(number + 1) % 2]})

    def colour(self, number):
        return self.change(colour={"class": "dispersal", "colour": f"#{number % 256:02x}4080"})

    def all(self):
        """All interactions by name."""
        names = ["", "/map", "/label", "/sheet", "/answers", "/classes", "/taxonomy", "/taxonomy/changes"]
        pages = {f"the page {name or '/'}": self.get(CAMPAIGN + name) for name in names}
        return {
            "the list of campaigns": self.get("/"),
            "the list, filtered": self.get("/?words=filled&state=completed"),
            **pages,
            "the map: its points": self.get(CAMPAIGN + "/points"),
            "the map: places on principal axes": self.get(CAMPAIGN + "/points/axes"),
            "the map: places by t-SNE": self.get(CAMPAIGN + "/points/neighbours"),
            "a hover: a picture": lambda _: self.picture(self.page)[0],
            f"a lasso: {GALLERY} pictures, {CONNECTIONS} at a time": self.gallery,
            "the next questions": self.post("/questions", self.question),
            "an answer": self.post("/labels", self.answer),
            "the labels that stand": self.get(CAMPAIGN + "/labels"),
            "the answers that stand, with who and when": self.get(CAMPAIGN + "/answers/standing"),
            "the classes and their pictures": self.get(CAMPAIGN + "/classes/details"),
            "a class in another colour": self.post("/classes", self.colour),
            "a class under another name": self.post("/classes", self.rename),
            "how the campaign stands: the first event": self.get(CAMPAIGN + "/changes", whole=False),
            "labels as CSV: the first bytes": self.get(CAMPAIGN + "/labels.csv", whole=False),
            "the archive as CSV: the first bytes": self.get(CAMPAIGN + "/archive.csv", whole=False),
            "novelty over generations": self.get(CAMPAIGN + "/generations"),
            "epochs of trainings, and events": self.get(CAMPAIGN + "/epochs"),
            "what moves on Progress: the newest and most novel": self.get(CAMPAIGN + "/shown"),
            "two campaigns side by side, the other small": self.get("/compare?campaign=filled-1&campaign=small-2"),
        }


def label(page, count):
    """Adds answers of one person."""
    answers = [{"index": index, "answer": ["milling", "dispersal", "random"][index % 3]} for index in range(LABELS)]
    for first in range(0, LABELS, 500):
        body = {"request_id": f"before-{first}", "annotator": "Ben", "answers": answers[first : first + 500]}
        page.ask(f"{CAMPAIGN}/labels", body)


def finished(page, name):
    """Waits until the campaign of that name is completed."""
    while f"campaign-{name}-".encode() not in page.ask(f"/?words={name}&state=completed")[1]:
        time.sleep(0.2)


def measure(options, folder):
    data = folder / "data"
    if not data.exists():
        run("fill", options.programs / "examples/fill", data, options.count)
    with serving(options.programs, data, 1, CAMPAIGN) as (_, url, _):
        page = Page(url)
        finished(page, "filled")
        if b"small-2" not in page.ask("/")[1]:
            page.submit("/new", SMALL)
        finished(page, "small")
    slow = []
    with serving(options.programs, data, 1, CAMPAIGN) as (_, url, _):
        interactions = Interactions(url, options.count)
        label(interactions.page, options.count)
        print(f"\n{options.count:,} individuals, {LABELS:,} answers\n\n| interaction | first, ms | median, ms | longest, ms |\n|---|--:|--:|--:|")
        for name, ask in interactions.all().items():
            first = ask(0)
            if name.endswith("t-SNE"):
                while len(interactions.page.ask(CAMPAIGN + "/points/neighbours")[1]) == 0:
                    time.sleep(0.5)
            took = [ask(number) for number in range(1, options.times + 1)]
            median = statistics.median(took)
            print(f"| {name} | {first:.0f} | {median:.1f} | {max(took):.0f} |", flush=True)
            if median > options.limit:
                slow.append(name)
    if slow:
        sys.exit(f"over {options.limit:g} ms: {', '.join(slow)}")


def main():
    arguments = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    arguments.add_argument("--count", type=int, default=100_000)
    arguments.add_argument("--folder", type=pathlib.Path, help="the data directory is made, or used again, in this folder")
    arguments.add_argument("--programs", type=pathlib.Path, default=ROOT / "target/release")
    arguments.add_argument("--times", type=int, default=30)
    arguments.add_argument("--limit", type=float, default=100, help="most milliseconds for a median")
    options = arguments.parse_args()
    if options.folder:
        options.folder.mkdir(parents=True, exist_ok=True)
        measure(options, options.folder)
        return
    with tempfile.TemporaryDirectory() as folder:
        measure(options, pathlib.Path(folder))


if __name__ == "__main__":
    main()
