"""The client of a coordinator."""

from __future__ import annotations

import html
import os
import uuid
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
import numpy.typing as npt

from . import _answers as answers
from . import _programs as programs_
from ._access import Access, default_file
from ._access import read as read_access
from ._arguments import flag, path, positive, read, text, toml, whole, word
from ._campaign import Campaign
from ._cluster import Cluster
from ._errors import InvalidError, NotFoundError, ProgramError, UnavailableError
from ._evaluations import Evaluations, described, evaluate, replay
from ._rpc import Connection
from ._workers import Worker
from .v1 import campaign_pb2 as v1
from .v1 import node_pb2 as nodes

Kind = TypeVar("Kind")

# Time limit for the coordinator's first answer.
_SECONDS_TO_ANSWER = 30


class Client:
    """A connection to a coordinator. Get one from `local` or `connect`.

    At its end, a `with` statement closes the connection. In the examples, `client` is a `Client`.

    Attributes:
        url: The URL of the coordinator, for programs. Browsers need a `link`.
        rpc: The contract's methods, for requests that the library does not offer.
    """

    def __init__(
        self,
        url: str,
        *,
        ca: Path | None = None,
        token: str | None = None,
        access: Access | None = None,
        file: Path | None = None,
        programs: str | os.PathLike[str] | None = None,
        cluster: Cluster | None = None,
    ) -> None:
        """Use `local` or `connect` instead. `access` is that of the coordinator's owner."""
        self.url = url
        self._ca, self._token, self._programs, self._cluster = ca, token, programs, cluster
        self._access, self._file = access, file
        self._end_workers: Callable[[], None] | None = None
        pinned = access.certificate() if access and not ca else None
        trusted = ca.read_bytes() if ca else pinned
        name = access.name if access and pinned else None
        self.rpc = Connection(url, trusted, token, cluster.why if cluster else str, name)

    def __enter__(self) -> Client:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def __repr__(self) -> str:
        return f"Client({self.url!r})"

    def _repr_html_(self) -> str:
        return f'<a href="{html.escape(self.link())}" target="_blank">{html.escape(self.url)}</a>'

    def link(self, page: str = "/") -> str:
        """The address of a page, for a browser.

        If `local` started the coordinator, or an access file names it, the address logs the browser in. It works once,
        for 15 minutes.

        Example:
            >>> client.link().startswith("http://127.0.0.1:")
            True
        """
        page = text("page", page)
        if not page.startswith("/"):
            raise InvalidError.of("page", page, "a path that begins with /")
        return self._access.link(page) if self._access else self.url + page

    @property
    def access_file(self) -> Path:
        """The access file of the coordinator, for workers and commands elsewhere.

        Raises:
            InvalidError: If the client was connected by a URL.

        Example:
            >>> client.access_file.name
            'access.json'
        """
        file = self._cluster.access_file if self._cluster else self._file
        if file is None:
            raise InvalidError("a client that was connected by a URL has no access file: `connect(access=...)` has one")
        return file

    def workers(self) -> list[Worker]:
        """The connected workers, then the trainers, by name.

        Example:
            >>> [(worker.kind, worker.threads) for worker in client.workers()]
            [('worker', 1), ('worker', 1), ('trainer', 1)]
        """
        listed = self.rpc.whole("NodeService/ListNodes", nodes.ListNodesRequest(), nodes.ListNodesResponse)
        return [Worker.of(node) for node in listed.nodes]

    def workers_wanted(self, threads: int | None = None, *, seconds: float | None = None) -> int:
        """How many workers of `threads` threads would complete the open work within about `seconds`.

        By default, a worker has as many threads as the connected workers on average, and the time is five minutes.

        The open work is that of running campaigns and evaluations; its cost is measured on the connected workers. The
        number is 0 without open work. It is never more than the tasks that can be done at the same time.

        Example:
            >>> client.workers_wanted()
            0
        """
        request = nodes.GetDemandRequest()
        if threads is not None:
            request.threads = whole("threads", threads, 1, 65_536)
        if seconds is not None:
            request.seconds = positive("seconds", seconds)
        return self.rpc.call("NodeService/GetDemand", request, nodes.Demand).workers

    def close(self) -> None:
        """Closes the connection. A cluster that `local` started ends, which interrupts its running campaigns.

        Workers that `on_dask` or `on_ray` started end, too.
        """
        end_workers, self._end_workers = self._end_workers, None
        try:
            if end_workers is not None:
                end_workers()
        finally:
            self.rpc.close()
            if self._cluster is not None:
                self._cluster.close()

    def run(
        self,
        spec: str | os.PathLike[str] | Mapping[str, Any],
        *,
        seed: int | None = None,
        weight: int | None = None,
        progress: bool | None = None,
    ) -> Campaign:
        """Runs a campaign until it is completed, and shows its progress.

        If the wait is interrupted, the campaign goes on for as long as its coordinator runs: `client.campaign().wait()`
        waits for it again.

        Args:
            spec: The path of a campaign file, or its content as a dict, with a dict for each table.
            seed: Seed of the search and the training, instead of the file's.
            weight: Share of the workers relative to other running campaigns, 1 to 10,000; 100 by default.
            progress: Whether to show a bar; by default in notebooks and terminals.

        Raises:
            OSError: If the file cannot be read.
            InvalidError: If the specification is not valid.
            CampaignError: If the campaign fails, or a person pauses or cancels it.

        Example:
            >>> spec = {"model": "single-sensor", "method": "random", "world": {"horizon": 160}}
            >>> spec |= {"search": {"population": 10, "generations": 2}, "taxonomy": {"medoids": 2}}
            >>> client.run(spec).archive().num_rows
            20
        """
        return self.submit(spec, seed=seed, weight=weight).wait(progress=progress)

    def submit(
        self,
        spec: str | os.PathLike[str] | Mapping[str, Any],
        *,
        seed: int | None = None,
        weight: int | None = None,
    ) -> Campaign:
        """Starts a campaign, and returns without waiting for it. Arguments and errors are those of `run`."""
        request = v1.CreateCampaignRequest()
        if seed is not None:
            request.seed = whole("seed", seed, 0, (1 << 63) - 1)
        if weight is not None:
            request.weight = whole("weight", weight, 1, 10_000)
        is_dict = isinstance(spec, Mapping)
        request.toml = toml(spec).decode() if isinstance(spec, Mapping) else read("spec", spec)
        # A repeated call starts no second campaign.
        request.request_id = uuid.uuid4().hex
        try:
            with _without_place(spec):
                created = self.rpc.call("CampaignService/CreateCampaign", request, v1.Campaign)
        except InvalidError as error:
            raise error if is_dict else error.reworded(f"{path('spec', spec)}: {error}") from None
        return Campaign(self, answers.identifier(created.id))

    def evaluate(
        self,
        robot: str | os.PathLike[str] | Mapping[str, Any] | Campaign,
        controllers: npt.ArrayLike,
        seeds: Iterable[Any] | int | None = None,
        *,
        pictures: bool = False,
    ) -> Evaluations:
        """Evaluates controllers on all workers, for a search of your own. Nothing is stored.

        The same controller and seed have the same result on every machine, and as an individual of a campaign.

        Args:
            robot: The name of a capability model (`"single-sensor"`), or a campaign as a dict or the path of its file
                (ending in `.toml`), for other robots, worlds, numbers of starts, or an embedding by a `checkpoint`. A
                `Campaign` gives its robots, world, pictures and starts, and its embedder if it has one.
            controllers: Genes, (n, genes), within the ranges of their sensors and drives.
            seeds: The seed of each controller's first start, or one seed for all controllers, 0 to 2^64 - 1. By
                default, each controller has a seed of its own, which follows from its place, as in `murmuration
                evaluate`.
            pictures: Whether to return pictures, too.

        Raises:
            InvalidError: If the campaign or a controller is not valid.
            UnavailableError: If no worker is connected.
            BusyError: If the coordinator is already answering too many requests of the caller.

        Example:
            >>> result = client.evaluate("single-sensor", [[-0.7, 0.3, 1.0, 1.0], [1.0, 1.0, 1.0, 1.0]], seeds=7)
            >>> result.features.shape
            (2, 5)
        """
        with _without_place(robot):
            return evaluate(self.rpc, _described(robot), controllers, seeds, flag("pictures", pictures))

    def replay(
        self,
        robot: str | os.PathLike[str] | Mapping[str, Any] | Campaign,
        controller: npt.ArrayLike,
        seed: int = 1,
        *,
        steps: int | None = None,
    ) -> npt.NDArray[np.float64]:
        """The motion of one controller, in full precision. The coordinator simulates it: no worker is needed.

        The same controller and seed move in the same way on every machine, and as an individual of a campaign.

        Args:
            robot: As for `evaluate`: the name of a capability model, or a campaign that describes robots and world. A
                campaign whose method embeds needs no `checkpoint` here.
            controller: Genes, (genes,), within the ranges of their sensors and drives.
            seed: The seed of the start, 0 to 2^64 - 1, such as an individual's; by default 1.
            steps: Number of steps, 1 or more; by default the world's horizon.

        Returns:
            x and y (world units, y points down the screen) and heading (radians, not wrapped) of each robot, at the
            start and after each step; float64 (steps + 1, robots, 3).

        Raises:
            InvalidError: If the campaign or the controller is not valid, or the motion has more than 4,000,000 poses.

        Example:
            >>> motion = client.replay("single-sensor", [-0.7, 0.3, 1.0, 1.0], seed=7, steps=100)
            >>> motion.shape
            (101, 24, 3)
            >>> x, y, heading = motion[-1, 0]  # of robot 0, at the end
            >>> bool(0 <= x <= 500)
            True
        """
        with _without_place(robot):
            return replay(self.rpc, _described(robot), controller, seed, steps)

    def campaign(self, identifier: str = "latest") -> Campaign:
        """A campaign by its id; the newest by default.

        Raises:
            NotFoundError: If there is no such campaign.

        Example:
            >>> client.campaign("example-1")
            Campaign('example-1')
        """
        return self._found(text("identifier", identifier))

    def _found(self, identifier: str, seconds: float | None = None) -> Campaign:
        request = v1.GetCampaignRequest(campaign=identifier)
        found = self.rpc.call("CampaignService/GetCampaign", request, v1.Campaign, seconds)
        return Campaign(self, answers.identifier(found.id, identifier))

    def campaigns(self) -> list[Campaign]:
        """All campaigns of the coordinator's store, oldest first.

        Example:
            >>> client.campaigns()[0]
            Campaign('example-1')
        """
        request = v1.ListCampaignsRequest()
        listed = self.rpc.whole("CampaignService/ListCampaigns", request, v1.ListCampaignsResponse)
        return [Campaign(self, answers.identifier(one.id)) for one in listed.campaigns]

    def import_campaign(self, folder: str | os.PathLike[str]) -> Campaign:
        """Imports an exported campaign into the coordinator's store, with its id and the same digest.

        The import checks every file and every value first. A campaign that was running when it was exported is paused.

        Args:
            folder: A folder that `Campaign.export` or `murmuration export` wrote.

        Raises:
            InvalidError: If a file was changed, or the store already has a campaign with that id.

        Example:
            >>> folder = campaign.export("elsewhere")
            >>> with mm.local(workers=0) as other:
            ...     other.import_campaign(folder).digest() == campaign.digest()
            True
        """
        return Campaign(self, self.printed("id", str, "import", path("folder", folder)))

    def command(self, *words: str) -> dict[str, Any]:
        """Runs a command of the program `murmuration` on this coordinator, and returns what it prints with `--json`.

        `murmuration schema` describes the documents. If a command prints none, such as `checkpoints export`, the result
        is an empty document.

        Raises:
            InvalidError: If the command refuses its input, or prints several documents: `documents` returns them.
            NotFoundError: If the command names something that does not exist.
            ProgramError: If the program cannot be found, or fails.

        Example:
            >>> client.command("digest", "example-1")["evaluations"]
            100
        """
        documents = self.documents(*words)
        if len(documents) > 1:
            raise InvalidError(f"`murmuration {' '.join(words)}` prints {len(documents)} documents: use `documents`")
        return documents[0] if documents else {}

    def printed(self, field: str, kind: type[Kind], *words: str) -> Kind:
        """A field of a command's document, checked to be a `kind`. Errors are those of `command`."""
        value = self.command(*words).get(field)
        if not isinstance(value, kind):
            raise ProgramError(f"`murmuration {words[0]}` printed no field `{field}`, or one of another type")
        return value

    def documents(self, *words: str) -> list[dict[str, Any]]:
        """Runs a command that prints any number of documents, such as `list`, and returns them.

        Raises:
            InvalidError: If the command refuses its input.
            NotFoundError: If the command names something that does not exist.
            ProgramError: If the program cannot be found, or fails.

        Example:
            >>> client.documents("list")[0]["id"]
            'example-1'
        """
        self.rpc.check_open()
        words = tuple(word(one) for one in words)
        if words[:1] == ("serve",):
            raise InvalidError("`murmuration serve` is a coordinator of its own: `murmuration.local` starts one")
        place = ["--access", os.fspath(self._file)] if self._file else ["--coordinator", self.url]
        trust = ["--ca", os.fspath(self._ca)] if self._ca else []
        variables = {"MURMURATION_TOKEN": self._token} if self._token else {}
        program = programs_.find(self._programs)
        try:
            return programs_.run(program, [*words, *place, *trust], variables)
        except UnavailableError as error:
            raise self.rpc.explained(error) from None


def local(
    data: str | os.PathLike[str] | None = None,
    *,
    workers: int | None = None,
    trainers: int | None = None,
    listen: str | None = None,
    contact: str | None = None,
    programs: str | os.PathLike[str] | None = None,
) -> Client:
    """Starts a cluster on this machine, and connects to it.

    The cluster is one process (`murmuration serve`). The cluster ends when the client is closed, and when this process
    ends, even if this process is killed.

    Args:
        data: The data directory, created if it does not exist; by default a temporary one, which is removed at the
            end. The running campaigns of a data directory continue.
        workers: Number of workers, 0 to 4096; by default one for each core.
        trainers: Number of trainers, 0 to 4096; by default one.
        listen: The address and port to listen on, such as `"0.0.0.0:0"` for other machines too; by default a free port
            of 127.0.0.1, which only this machine reaches. Workers elsewhere need the `access_file`.
        contact: The name or address by which other machines reach this one; by default the name of this machine.
        programs: The folder of the programs; by default pip's folder for programs, or else the PATH.

    Raises:
        ProgramError: If the cluster cannot start, for example without its program, or if another process uses the data
            directory.

    Example:
        >>> with mm.local(workers=1) as client:
        ...     client.campaigns()
        []
    """
    for field, count in (("workers", workers), ("trainers", trainers)):
        if count is not None:
            whole(field, count, 0, 4096)
    folder = Path(path("data", data)).absolute() if data is not None else None
    listen = text("listen", listen) if listen is not None else None
    contact = text("contact", contact) if contact is not None else None
    program = programs_.find(programs)
    cluster = Cluster(program, folder, workers, trainers, listen, contact)
    access = Access(cluster.url, cluster.url, token=cluster.token)
    return Client(cluster.url, token=cluster.token, access=access, programs=program.parent, cluster=cluster)


def connect(
    url: str | None = None,
    *,
    access: str | os.PathLike[str] | None = None,
    ca: str | os.PathLike[str] | None = None,
    token: str | None = None,
    programs: str | os.PathLike[str] | None = None,
) -> Client:
    """Connects to a coordinator.

    Without arguments, this finds the coordinator of the folder `murmuration-data`, or of the file or data directory
    that `MURMURATION_ACCESS` or `MURMURATION_DATA` names.

    Args:
        url: `http://HOST:PORT` or `https://HOST:PORT`.
        access: The access file that `murmuration serve` wrote, instead of a URL.
        ca: File with the certificate (PEM) of the authority that signed the coordinator's certificate, for https.
        token: Your token, if the coordinator asks for one.
        programs: The folder of the program `murmuration`, which reads campaign files and writes reports; by default
            pip's folder for programs, or else the PATH.

    Raises:
        InvalidError: If the URL, the token or the access file is malformed, or `ca` is missing.
        OSError: If the certificate or the access file cannot be read.
        UnavailableError: If no coordinator answers within 30 seconds.
        RefusedError: If the coordinator does not accept the token.

    Example:
        >>> with mm.connect(client.url, token=token) as another:
        ...     another.campaign("example-1").state
        'completed'
    """
    found: Access | None = None
    file: Path | None = None
    if url is None:
        file = (Path(path("access", access)) if access is not None else default_file()).absolute()
        found = read_access(file)
        if token is not None:
            raise InvalidError.of("token", None, "left out where an access file names the coordinator")
        url, token = found.coordinator, found.token
    elif access is not None:
        raise InvalidError.of("access", str(access), "left out where a URL is given")
    url = text("url", url)
    if found is None and url.lower().startswith("https://") and ca is None:
        raise InvalidError.of("ca", None, "the file of a certificate, where the URL begins with https://")
    authority = Path(path("ca", ca)).absolute() if ca is not None else None
    client = Client(url, ca=authority, token=token, access=found, file=file, programs=programs)
    try:
        client._found("latest", _SECONDS_TO_ANSWER)
    except NotFoundError:
        # The coordinator has answered that it has no campaigns.
        pass
    except BaseException:
        client.close()
        raise
    return client


def hosting(
    start: Callable[[str], Callable[[], None]],
    *,
    access: str | os.PathLike[str] | None,
    data: str | os.PathLike[str] | None,
    trainers: int | None,
    contact: str | None,
    programs: str | os.PathLike[str] | None,
) -> Client:
    """A client whose workers an engine's processes start.

    `start` takes the text of the access file of the coordinator, and returns the function that ends the workers.
    """
    if access is None:
        client = local(data, workers=0, trainers=trainers, listen="0.0.0.0:0", contact=contact, programs=programs)
    elif data is not None:
        raise InvalidError.of("data", str(data), "left out where an access file names the coordinator")
    else:
        client = connect(access=access, programs=programs)
    try:
        client._end_workers = start(client.access_file.read_text(encoding="utf-8"))
    except BaseException:
        client.close()
        raise
    return client


def _described(robot: str | os.PathLike[str] | Mapping[str, Any] | Campaign) -> str:
    """The text of a campaign file that describes robots and world."""
    return described(_description_of(robot) if isinstance(robot, Campaign) else robot)


def _description_of(campaign: Campaign) -> dict[str, Any]:
    """A description that evaluates as a campaign does: its specification, with its current embedder."""
    spec = campaign.spec
    if checkpoint := campaign.status().checkpoint:
        spec = {name: value for name, value in spec.items() if name not in ("dataset", "training")}
        spec["checkpoint"] = answers.digest(f"the checkpoint of {campaign.id}", checkpoint)
    return spec


@contextmanager
def _without_place(spec: object) -> Iterator[None]:
    """Removes the place in a file from errors if the caller gave a dict."""
    try:
        yield
    except InvalidError as error:
        if not isinstance(spec, Mapping):
            raise
        # The error follows the place in the file, on a line of its own.
        raise error.reworded(str(error).rsplit("\n", 1)[-1]) from None
