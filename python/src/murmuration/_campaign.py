"""One campaign of a coordinator."""

from __future__ import annotations

import os
import sys
import tempfile
import uuid
import warnings
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt
import pyarrow as pa

from . import _answers as answers
from . import _archive as archive
from . import _label_files as label_files
from . import _label_tasks as label_tasks
from . import _tables as tables
from ._agreement import Agreement
from ._agreement import agreement as agreement_
from ._arguments import flag, path, positive, shown, text, whole
from ._arguments import index as index_
from ._errors import AnswerError, CampaignError, InvalidError, NotFoundError, RefusedError, UnavailableError, clean
from ._found import Replay, Taxonomy, replay_of, taxonomy_of
from ._progress import Bar
from ._tracks import Recognition, recognition
from ._tracks import in_python as tracks_in_python
from ._tracks import write as write_tracks
from .v1 import campaign_pb2 as v1
from .v1 import label_pb2 as label_v1

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

if TYPE_CHECKING:
    from ._client import Client

# Number of pictures of a whole archive that arrive in the time of one call for a single picture.
_PICTURES_FOR_ONE_CALL = 20


class Campaign:
    """A campaign: one search with its archive, labels and taxonomy.

    Get a campaign from `Client.run`, `Client.submit` or `Client.campaign`. In the examples, `campaign` is a completed
    campaign of 5 generations of 20 individuals.

    Attributes:
        id: The campaign's id, `NAME-N`, unique in a coordinator's store.
    """

    def __init__(self, client: Client, identifier: str) -> None:
        """Use a `Client` instead, which checks that the campaign exists."""
        self._client = client
        self.id = identifier

    def __repr__(self) -> str:
        return f"Campaign({self.id!r})"

    def status(self) -> v1.Campaign:
        """The state of the campaign now, as the contract's message `Campaign`.

        Example:
            >>> campaign.status().generations_done
            5
        """
        return archive.status(self._client.rpc, self.id)

    @property
    def state(self) -> str:
        """`running`, `paused`, `completed`, `failed` or `cancelled`; `unknown` if a newer coordinator has another.

        Example:
            >>> campaign.state
            'completed'
        """
        return state_of(self.status())

    @property
    def spec(self) -> dict[str, Any]:
        """The campaign's specification: the campaign file with every default filled in. `Client.run` accepts it.

        Example:
            >>> campaign.spec["search"]["population"]
            20
        """
        try:
            return tomllib.loads(self._description())
        except tomllib.TOMLDecodeError as error:
            raise AnswerError(f"the coordinator sent a specification that is no TOML: {error}") from None

    @property
    def gene_names(self) -> list[str]:
        """The names of a controller's genes, in the order of the column `genes` of the archive.

        Example:
            >>> campaign.gene_names
            ['left_0', 'right_0', 'left_1', 'right_1']
        """
        with tempfile.TemporaryDirectory() as folder:
            file = Path(folder, "spec.toml")
            file.write_text(self._description(), encoding="utf-8")
            return [str(name) for name in self._client.printed("genes", list, "robot", os.fspath(file))]

    def wait(self, *, progress: bool | None = None) -> Campaign:
        """Waits until the campaign is completed, and shows its progress.

        Args:
            progress: Whether to show a bar; by default in notebooks and terminals.

        Returns:
            The campaign itself.

        Raises:
            CampaignError: If the campaign fails, or a person pauses or cancels it.
            UnavailableError: If the coordinator ends before that.

        Warns:
            RuntimeWarning: If the campaign waits for something, such as a worker, and no bar shows it.

        Example:
            >>> campaign.wait()
            Campaign('example-1')
        """
        bar = Bar(None if progress is None else flag("progress", progress))
        last = v1.Campaign()
        printed: set[str] = set()
        try:
            request = v1.WatchCampaignRequest(campaign=self.id)
            for last in self._client.rpc.stream("CampaignService/WatchCampaign", request, v1.Campaign):
                answers.identifier(last.id, self.id)
                bar.show(last)
                waiting = clean(last.waiting)
                if waiting and bar.is_hidden and waiting not in printed:
                    printed.add(waiting)
                    warnings.warn(f"campaign {self.id} waits: {waiting}", RuntimeWarning, stacklevel=2)
        finally:
            bar.close()
        if not last.id:
            raise answers.wrong(f"the watch of campaign {self.id} ended without a message")
        if last.state == v1.CAMPAIGN_STATE_RUNNING:
            raise self._client.rpc.explained(UnavailableError(f"the coordinator ended while {self.id} was running"))
        if last.state != v1.CAMPAIGN_STATE_COMPLETED:
            state = state_of(last)
            if state == "unknown":
                newer = f"campaign {self.id} is in state {last.state}, which this version of the library does not know"
                raise CampaignError(newer, state)
            why = f": {clean(last.error)}" if last.error else ""
            raise CampaignError(f"campaign {self.id} is {state}{why}", state)
        return self

    def archive(self, *, flat: bool = False) -> pa.Table:
        """All individuals evaluated so far, in order.

        Args:
            flat: Whether each gene, feature and dimension of the embedding has its own column, as suits a data frame,
                instead of columns of lists.

        Returns:
            A table with these columns, and with units in the metadata of its schema: `index`; `generation`; `genes`,
            lists of float64; `features`, lists of 5 float64 (`murmuration.FEATURES` names them); `embedding`, lists of
            float32, null in a campaign without embedder; `novelty` when evaluated, in units of the behaviour space;
            `class`, the last class given if annotators differ, null without a class; `seed` of the start. There is a
            column `trials` (seed, features and embedding of each trial) if individuals have several trials.

            If `flat`, columns named after `gene_names` and `FEATURES`, and `embedding_0` and so on, replace `genes`,
            `features` and `embedding`. There is no column `trials`, and a completed campaign has a column `cluster`:
            the number of the behaviour, from 1, as in reports; null for individuals outside the sample.

        Example:
            >>> archive = campaign.archive()
            >>> archive.num_rows, archive.schema.field("novelty").metadata[b"unit"]
            (100, b'behaviour space')
            >>> campaign.archive(flat=True).column_names[2:8]
            ['left_0', 'right_0', 'left_1', 'right_1', 'average_speed', 'angular_momentum']
        """
        table = tables.archive(list(archive.individuals(self._client.rpc, self.id)), self._classes())
        if not flag("flat", flat):
            return table
        status = self.status()
        clusters = self.taxonomy().clusters if status.state == v1.CAMPAIGN_STATE_COMPLETED else None
        return tables.flat(table, self.gene_names, clusters, status.spec.taxonomy.sample or None)

    def pictures(self, indices: Iterable[int] | None = None) -> npt.NDArray[np.uint8]:
        """Pictures of individuals: the paths of their robots during the last steps.

        Args:
            indices: The individuals' places in the archive; all by default.

        Returns:
            Grey values, uint8 (n, side, side), rows from the top down; with a channel for each species
            (n, channels, side, side). An embedder reads pictures column by column: `pictures.swapaxes(-1, -2)`.

        Raises:
            NotFoundError: If an index is not in the archive.

        Example:
            >>> campaign.pictures([3, 5]).shape
            (2, 50, 50)
        """
        status = self.status()
        if indices is None:
            images = [one.image for one in archive.individuals(self._client.rpc, self.id, images=True)]
        else:
            try:
                asked = [index_(one) for one in indices]
            except TypeError:
                raise InvalidError.of("indices", shown(indices), "a list of them, such as [3, 5]") from None
            found: dict[int, bytes] = {}
            if len(asked) * _PICTURES_FOR_ONE_CALL > status.generations_done * status.spec.search.population:
                wanted = set(asked)
                found = {
                    one.index: one.image
                    for one in archive.individuals(self._client.rpc, self.id, images=True)
                    if one.index in wanted
                }
            images = [found.get(index) or archive.individual(self._client.rpc, self.id, index).image for index in asked]
        return tables.pictures(images, status.spec.image.resolution)

    def taxonomy(self) -> Taxonomy:
        """The behaviours that the campaign found.

        Raises:
            RefusedError: If the campaign is not completed.

        Example:
            >>> taxonomy = campaign.taxonomy()
            >>> taxonomy
            Taxonomy(4 medoids of 100 individuals)
            >>> taxonomy.medoids.num_rows, taxonomy.clusters.shape, taxonomy.pictures.shape
            (4, (100,), (4, 50, 50))
        """
        request = v1.GetTaxonomyRequest(campaign=self.id)
        found = self._client.rpc.whole("CampaignService/GetTaxonomy", request, v1.Taxonomy)
        return taxonomy_of(found, self.status(), self._classes())

    def generations(self) -> pa.Table:
        """The complete generations of the campaign.

        Returns:
            A table: `generation`; `best_novelty` and `mean_novelty` of its individuals when it was evaluated, in units
            of the behaviour space; `filtered`, the number of proposals that the heuristic filter rejected.

        Example:
            >>> campaign.generations().num_rows
            5
        """
        return tables.generations(archive.generations(self._client.rpc, self.id))

    def digest(self, *, partial: bool = False) -> str:
        """The BLAKE3 digest of the archive, 64 hexadecimal digits. One specification has one digest, on any machine.

        Args:
            partial: Whether to accept a campaign that is not completed, and return the digest of its archive so far.

        Raises:
            RefusedError: If the campaign is not completed, unless `partial` is true.

        Example:
            >>> len(campaign.digest())
            64
        """
        status = self.status()
        if not flag("partial", partial) and status.state != v1.CAMPAIGN_STATE_COMPLETED:
            why = "its archive is not complete; digest(partial=True) is of what it has so far"
            raise RefusedError(f"campaign {self.id} is {state_of(status)}: {why}")
        request = v1.GetDigestRequest(campaign=self.id)
        found = self._client.rpc.call("CampaignService/GetDigest", request, v1.GetDigestResponse)
        return answers.digest(f"the digest of {self.id}", found.digest)

    def replay(self, index: int, *, stride: int = 1) -> Replay:
        """The motion of an individual, simulated again by a worker.

        Args:
            index: The individual's place in the archive.
            stride: Steps from one frame to the next, 1 or more; the last step always has a frame.

        Raises:
            InvalidError: If the frames have more than 4,000,000 poses.
            NotFoundError: If the index is not in the archive.

        Example:
            >>> campaign.replay(3, stride=10)
            Replay(21 frames of 24 robots)
        """
        request = v1.GetReplayRequest(
            campaign=self.id, index=index_(index), stride=whole("stride", stride, 1, (1 << 32) - 1)
        )
        replay = self._client.rpc.whole("CampaignService/GetReplay", request, v1.Replay)
        return replay_of(replay, self.status().spec.world.horizon)

    def labels(self) -> pa.Table:
        """The standing answers of all annotators, by individual, then annotator.

        Returns:
            A table: `index` of the individual; `answer`, a class, `not sure` or `skip`; `annotator`; `time`; `entry`,
            the answer's place in the label log.

        Example:
            >>> campaign.labels().column_names
            ['index', 'answer', 'annotator', 'time', 'entry']
        """
        return tables.answers(self._standing())

    def label(self, answers: object, *, annotator: str | None = None, columns: Mapping[str, str] | None = None) -> None:
        """Adds answers about individuals: all of them, or none if one is refused.

        Of two answers of one annotator about one individual, the newer one counts. Rows without a class are ignored.

        Args:
            answers: A class, `not sure` or `skip` for each index; 1 to 50,000. Or a table (of pandas, polars or
                pyarrow, or a dict of columns) with the columns of label files (docs/labels.md). Or the path of such a
                table, of an export of Label Studio (JSON, JSON-MIN or CSV), or of a dataset of FiftyOne
                (FiftyOneDataset or CSV); or a document that was read from these JSON files.
            annotator: The name of the annotator; of a table, of the rows that name no annotator.
            columns: The names of columns or fields of a table, by our names: `index`, `class`, `annotator`, `time` and
                `seed`. If `index` is the name of a column of pictures, the numbers at the ends of their names count.

        Raises:
            InvalidError: If a class or the annotator's name is not allowed, or a row does not say which individual it
                is about. A row has an index, a seed or a controller, or a picture of `label_tasks`; a column `id` of
                another tool is no index.
            NotFoundError: If an index is not in the archive.
            OSError: If the file cannot be read.

        Example:
            >>> campaign.label({3: "milling", 5: "random"}, annotator="eve")
            >>> [label["answer"] for label in campaign.labels().to_pylist() if label["annotator"] == "eve"]
            ['milling', 'random']
        """
        if isinstance(answers, Mapping) and not label_files.is_table(answers):
            self._answer(answers, annotator)
            return
        names = {text("columns", ours): text("columns", name) for ours, name in (columns or {}).items()}
        words = [] if annotator is None else ["--annotator", text("annotator", annotator)]
        if label_files.is_file(answers):
            file = Path(path("answers", answers))
            if label_files.plain_csv(file, names):
                try:
                    self._client.command("label", self.id, "--csv", os.fspath(file), *words)
                except InvalidError as error:
                    raise label_files.in_python(error) from None
                return
        found = label_files.source(answers)
        known = label_files.Archive(
            self.id, lambda: self.gene_names, lambda: archive.individuals(self._client.rpc, self.id)
        )
        with tempfile.TemporaryDirectory() as folder:
            written = Path(folder, "labels.csv")
            label_files.write(found, names, known, written)
            try:
                self._client.command("label", self.id, "--csv", os.fspath(written), *words)
            except InvalidError as error:
                raise label_files.explained(found, error, written) from None

    def label_tasks(
        self,
        folder: str | os.PathLike[str],
        *,
        format: str = "label-studio",  # noqa: A002
        indices: Iterable[int] | None = None,
        classes: Sequence[str] | None = None,
        url: str | None = None,
        force: bool = False,
    ) -> Path:
        """Writes pictures of individuals as tasks of another tool, whose export `label` reads.

        Args:
            folder: A new or empty folder.
            format: `label-studio`: the files `tasks.json` to import, `config.xml` with the interface, and `pictures`.
                `fiftyone`: a folder that FiftyOne imports as a `FiftyOneDataset`.
            indices: The individuals' places in the archive; all by default.
            classes: The classes to choose from, besides `not sure`; by default, the campaign's classes.
            url: What comes before the names of pictures in the tasks of Label Studio; by default, the address of local
                files, for a folder within Label Studio's LOCAL_FILES_DOCUMENT_ROOT.
            force: Whether to replace files of former tasks in the folder. Other files stay.

        Returns:
            The path of `tasks.json`, or for FiftyOne the folder.

        Raises:
            InvalidError: If the folder is not empty, the format is unknown, or there are no classes.
            NotFoundError: If an index is not in the archive.
            OSError: If the folder cannot be written.

        Example:
            >>> campaign.label_tasks("tasks", indices=[3, 5], classes=["milling", "random"]).name
            'tasks.json'
        """
        target = Path(path("folder", folder))
        if classes is None:
            listed = self._client.rpc.call(
                "LabelService/ListClasses", label_v1.ListClassesRequest(campaign=self.id), label_v1.ListClassesResponse
            )
            classes = [clean(one.name) for one in listed.classes]
        if isinstance(classes, str) or not classes:
            raise InvalidError.of("classes", shown(classes), "a list of names, such as ['milling', 'random']")
        named = [text("classes", one) for one in classes]
        address = None if url is None else text("url", url)
        seeds = {one.index: one.seed for one in archive.individuals(self._client.rpc, self.id)}
        chosen = list(seeds) if indices is None else [index_(one) for one in indices]
        pictures = self.pictures(chosen)
        found = list(label_tasks.tasks(self.id, chosen, (seeds[index] for index in chosen), pictures))
        return label_tasks.write(text("format", format), target, found, named, address, flag("force", force))

    def _answer(self, answers: Mapping[Any, Any], annotator: str | None) -> None:
        """Adds an answer for each index."""
        if annotator is None:
            raise InvalidError.of("annotator", None, "a name")
        annotator = text("annotator", annotator)
        request = label_v1.AppendLabelsRequest(
            campaign=self.id,
            request_id=str(uuid.uuid4()),
            answers=[
                label_v1.Answer(index=index_(index), answer=text("answer", answer), annotator=annotator)
                for index, answer in answers.items()
            ],
        )
        self._client.rpc.whole("LabelService/AppendLabels", request, label_v1.AppendLabelsResponse)

    def agreement(self, annotators: Sequence[str] | None = None) -> Agreement:
        """How well annotators agree, over the individuals to which two or more of them gave a class.

        `pip install 'murmuration[labels]'` installs the library that measures it.

        Args:
            annotators: The names of two or more annotators; by default, all persons, without the judge `synthetic`.

        Raises:
            InvalidError: If there are fewer than two annotators, or one of them gave no class.

        Example:
            >>> campaign.label({0: "milling", 1: "random", 2: "milling"}, annotator="ana")
            >>> campaign.label({0: "milling", 1: "random", 2: "random"}, annotator="ben")
            >>> campaign.agreement(["ana", "ben"])
            Agreement(alpha 0.444 over 3 individuals)
        """
        return agreement_(self._standing(), annotators)

    def recognise(
        self,
        tracks: object,
        *,
        count: int = 5,
        keypoint: str | None = None,
        arena: tuple[float, float] | None = None,
        origin: str = "corner",
        y: str = "down",
        degrees: bool = False,
        fps: float | None = None,
        frame_time: float | None = None,
        min_frames: int | None = None,
        robot: str | os.PathLike[str] | None = None,
    ) -> Recognition:
        """Finds the individuals that a filmed swarm is like.

        Args:
            tracks: A row for each robot in each frame, as a table of pandas, polars or pyarrow or a dict of columns:
                `frame`, `robot` (a number or a name), `x`, `y`, and perhaps `heading` and `species`. Or a dataset of
                the library `movement`, which reads the files of SLEAP, DeepLabCut, idtracker.ai and others
                (`pip install 'murmuration[tracks]'`).
            count: Number of nearest individuals, 1 to 100.
            keypoint: The keypoint of a dataset that is a robot's place; by default, the mean of all keypoints.
            arena: Width and height of the filmed arena, in units of the tracks; by default, tracks are in world units.
            origin: The place of 0, 0 in the arena: `corner` or `centre`.
            y: The direction in which y grows: `down` or `up`.
            degrees: Whether headings are in degrees.
            fps: Frames per unit of the world's time.
            frame_time: Time from one frame to the next, in units of the world's time; by default, one step.
            min_frames: Leaves out robots that are seen in fewer frames.
            robot: A file that describes the robots; by default, the campaign's robots.

        Raises:
            InvalidError: If the tracks cannot be meant: outside the walls, far too small, or with robots that are
                seldom seen. The message names the option that can mend them.

        Example:
            >>> film = campaign.replay(0)
            >>> frames, robots, _ = film.poses.shape
            >>> tracks = {
            ...     "frame": np.repeat(film.steps, robots),
            ...     "robot": np.tile(np.arange(robots), frames),
            ...     "x": film.poses[:, :, 0].ravel(),
            ...     "y": film.poses[:, :, 1].ravel(),
            ...     "heading": film.poses[:, :, 2].ravel(),
            ... }
            >>> campaign.recognise(tracks).neighbours["index"][0].as_py()
            0
        """
        words = ["--campaign", self.id, "--count", str(whole("count", count, 1, 100))]
        words += ["--origin", text("origin", origin), "--y", text("y", y)]
        if arena is not None:
            words += ["--arena", "x".join(str(positive("arena", side)) for side in arena)]
        if flag("degrees", degrees):
            words.append("--degrees")
        for option, time in (("fps", fps), ("frame-time", frame_time)):
            if time is not None:
                words += [f"--{option}", str(positive(option, time))]
        if min_frames is not None:
            words += ["--min-frames", str(whole("min_frames", min_frames, 0, (1 << 32) - 1))]
        if robot is not None:
            words += ["--robot", path("robot", robot)]
        with tempfile.TemporaryDirectory() as folder:
            file = Path(folder, "tracks.csv")
            write_tracks(tracks, keypoint, file)
            try:
                return recognition(self._client.command("recognise", os.fspath(file), *words))
            except InvalidError as error:
                raise tracks_in_python(error, file) from None

    def report(self, folder: str | os.PathLike[str]) -> Path:
        """Writes the report of a completed campaign, and returns the path of its page.

        Args:
            folder: The folder of the report. It is created if it does not exist.

        Raises:
            ProgramError: If the campaign is not completed, or the folder cannot be written.

        Example:
            >>> campaign.report("out").name
            'report.html'
        """
        target = path("folder", folder)
        page = self._client.printed("report", str, "report", self.id, "--out", target)
        return Path(target, Path(page).name)

    def embedder(self, file: str | os.PathLike[str]) -> Path:
        """Writes the network that embeds the campaign's pictures, and returns the path of its file.

        Args:
            file: The ONNX file to write. Its input `images` is float32 (n, channels, side, side), grey values from 0 to
                255, column by column; its output `embeddings` is float32 (n, dimensions).

        Raises:
            NotFoundError: If the campaign has no embedder (yet).
            ProgramError: If the file cannot be written.
        """
        checkpoint = self.status().checkpoint
        if not checkpoint:
            raise NotFoundError(f"campaign {self.id} has no embedder")
        answers.digest(f"the checkpoint of {self.id}", checkpoint)
        written = path("file", file)
        self._client.command("checkpoints", "export", checkpoint, written)
        return Path(written)

    def export(self, folder: str | os.PathLike[str], *, csv: bool = False, force: bool = False) -> Path:
        """Writes everything of the campaign to a folder, also while it runs, and returns the folder.

        The folder has the campaign as one SQLite database, for `Client.import_campaign`. The other files are for other
        programs: individuals, labels and generations as Parquet, pictures as NPZ, embedders as ONNX, the
        specification, a README about every column, and a datasheet.

        Args:
            folder: A new folder.
            csv: Whether to add every table as CSV.
            force: Whether to replace an export that the folder holds.

        Raises:
            InvalidError: If the folder is not empty; with `force`, if it holds something besides an export.
            ProgramError: If the folder cannot be written.

        Example:
            >>> import pyarrow.parquet as pq
            >>> pq.read_table(campaign.export("exported") / "individuals.parquet").num_rows
            100
        """
        given = (("--csv", flag("csv", csv)), ("--force", flag("force", force)))
        target = path("folder", folder)
        self._client.command("export", self.id, target, *(option for option, is_given in given if is_given))
        return Path(target)

    def pause(self) -> None:
        """Stops the campaign at its last complete generation.

        Raises:
            RefusedError: If the campaign is not running.
        """
        self._client.rpc.call("CampaignService/PauseCampaign", v1.PauseCampaignRequest(campaign=self.id), v1.Campaign)

    def resume(self) -> None:
        """Continues the campaign where it was paused or interrupted, or where it failed.

        Raises:
            RefusedError: If the campaign is completed or cancelled.
        """
        self._client.rpc.call("CampaignService/ResumeCampaign", v1.ResumeCampaignRequest(campaign=self.id), v1.Campaign)

    def cancel(self) -> None:
        """Ends the campaign for good. Its archive stays.

        Raises:
            RefusedError: If the campaign has already ended.
        """
        self._client.rpc.call("CampaignService/CancelCampaign", v1.CancelCampaignRequest(campaign=self.id), v1.Campaign)

    def refine(self) -> None:
        """Begins a round: the embedder is fine-tuned on the current labels, and the search continues in its space.

        Call `wait` to follow the round.

        Raises:
            RefusedError: If the campaign has no embedder, or its labels name fewer than two classes.
        """
        self._client.rpc.call("CampaignService/RefineCampaign", v1.RefineCampaignRequest(campaign=self.id), v1.Campaign)

    def extend(self, generations: int) -> None:
        """Continues the search of this completed campaign to `generations` generations, and makes a new taxonomy.

        The archive becomes that of a campaign that asked for so many generations from the start, unless the campaign
        has adopted another checkpoint. Call `wait` to follow the search.

        Args:
            generations: The new number of generations, more than the campaign has.

        Raises:
            RefusedError: If the campaign is not completed, belongs to a study, has learned from feedback, or cannot
                have so many generations.
        """
        wanted = whole("generations", generations, 1, 2**32 - 1)
        request = v1.ExtendCampaignRequest(campaign=self.id, generations=wanted)
        self._client.rpc.call("CampaignService/ExtendCampaign", request, v1.Campaign)

    def note(self, note: str | None = None, *, add: Iterable[str] = (), remove: Iterable[str] = ()) -> None:
        """Changes the tags and the note of the campaign, which are for people; results and digests stay as they are.

        `status()` has both as `tags` and `note`.

        Args:
            note: The new note, at most 4,000 characters; empty for none. By default, the note stays.
            add: Tags to add, each 1 to 32 letters, digits, `-`, `_`, `.` and `:`; a campaign has at most 16 tags.
            remove: Tags to remove.

        Raises:
            InvalidError: If a tag or the note is not allowed, or there would be too many tags.

        Example:
            >>> campaign.note("Repeat with more noise", add=["baseline"])
            >>> list(campaign.status().tags)
            ['baseline']
        """
        request = v1.NoteCampaignRequest(
            campaign=self.id,
            add_tags=_tags("add", add),
            remove_tags=_tags("remove", remove),
            note=None if note is None else text("note", note),
        )
        self._client.rpc.call("CampaignService/NoteCampaign", request, v1.Campaign)

    def _description(self) -> str:
        """The text of the campaign's file, with every default filled in."""
        return self.status().toml

    def _standing(self) -> list[label_v1.Label]:
        request = label_v1.ListLabelsRequest(campaign=self.id)
        return list(self._client.rpc.whole("LabelService/ListLabels", request, label_v1.ListLabelsResponse).labels)

    def _classes(self) -> dict[int, str]:
        return tables.classes_of(self._standing())


def _tags(field: str, given: Iterable[str]) -> list[str]:
    """The tags to add or to remove; a string would be a tag for each letter."""
    if isinstance(given, str):
        raise InvalidError.of(field, shown(given), "a list of tags, such as ['baseline']")
    return [text(field, tag) for tag in given]


def state_of(campaign: v1.Campaign) -> str:
    """The state of a campaign in a word."""
    return answers.word(v1.CampaignState.Name, campaign.state, "CAMPAIGN_STATE_")
