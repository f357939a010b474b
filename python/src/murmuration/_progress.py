"""The progress of a campaign, as a bar in a terminal or a notebook."""

from __future__ import annotations

import sys
from typing import Any, NamedTuple, NoReturn

from tqdm import tqdm

from ._answers import word
from .v1 import campaign_pb2 as v1

# Stages of training, which may end before their last epoch.
_TRAININGS = ("pretrain", "fine-tune")


class Step(NamedTuple):
    """How far a stage has come."""

    stage: str
    done: int
    total: int
    unit: str


class Bar:
    """One bar for each stage.

    Without `shown`, bars are shown in notebooks and in terminals, but not where stderr is a file.

    Attributes:
        is_hidden: Whether nobody sees it.
    """

    def __init__(self, shown: bool | None) -> None:
        in_notebook = _is_in_notebook()
        # With None, tqdm finds out by itself whether stderr is a terminal. A process may have no stderr at all.
        self._disable = not shown if shown is not None else (False if in_notebook else None)
        if sys.stderr is None and not in_notebook:
            self._disable = True
        self.is_hidden = self._disable is True or (self._disable is None and not sys.stderr.isatty())
        self._in_notebook = in_notebook
        self._stage = ""
        self._bar: tqdm[NoReturn] | None = None

    def show(self, campaign: v1.Campaign) -> None:
        """Shows where the campaign is."""
        step = step_of(campaign)
        if step is None:
            return
        bar = self._bar_of(step)
        bar.total = step.total
        bar.update(step.done - bar.n)
        if campaign.waiting:
            bar.set_postfix_str(f"waiting: {campaign.waiting}")
        elif step.stage == "evolve" and campaign.HasField("mean_novelty"):
            bar.set_postfix_str(f"novelty {campaign.mean_novelty:.3g}")
        else:
            # It waits no more.
            bar.set_postfix_str("", refresh=False)

    def _bar_of(self, step: Step) -> tqdm[NoReturn]:
        if self._bar is None or step.stage != self._stage:
            self._finish(step.stage)
            self.close()
            self._stage = step.stage
            output = _Output() if self._in_notebook and not self._disable else None
            self._bar = tqdm(
                total=step.total, desc=step.stage, unit=f" {step.unit}", disable=self._disable, file=output
            )
        return self._bar

    def _finish(self, following: str) -> None:
        """Shows a stage as done that another one follows: its last progress may not have been told."""
        bar = self._bar
        # A search also stops for a while when a person has its archive move to another embedder.
        if bar is None or (self._stage == "evolve" and following != "label"):
            return
        if bar.total and self._stage not in _TRAININGS:
            bar.n = bar.total
        elif bar.n:
            bar.total = bar.n
        else:
            # It was too short for a word about how far it was.
            bar.bar_format = "{desc}: done"

    def close(self) -> None:
        """Leaves the bar as it is."""
        if self._bar is not None:
            self._bar.close()
            self._bar = None


class _Output:
    """An output of a notebook's cell, which has the last line that a bar wrote.

    It is text, and no widget: where a notebook is saved or shown without its kernel, of a widget there is nothing left
    but the empty bar that it began with.
    """

    # By which tqdm knows that it may draw with more than ASCII.
    encoding = "utf-8"

    def __init__(self) -> None:
        self._shown: Any = None

    def write(self, written: str) -> int:
        """Shows a bar; what moves a terminal's cursor is left out."""
        from IPython.display import display

        if written.startswith("\r"):
            line = {"text/plain": written.strip()}
            if self._shown is None:
                self._shown = display(line, raw=True, display_id=True)  # type: ignore[no-untyped-call]
            else:
                self._shown.update(line, raw=True)
        return len(written)


def _is_in_notebook() -> bool:
    """Whether this process is the kernel of a notebook."""
    ipython = sys.modules.get("IPython")
    return ipython is not None and hasattr(ipython.get_ipython(), "kernel")


def step_of(campaign: v1.Campaign) -> Step | None:
    """How far the stage of a campaign has come; None where nothing is counted."""
    if not campaign.HasField("progress"):
        return None
    stage = campaign.stage
    # While the archive is clustered, all evaluations are done.
    if stage == v1.CAMPAIGN_STAGE_TAXONOMY:
        stage = v1.CAMPAIGN_STAGE_EVOLVE
    name = word(v1.CampaignStage.Name, stage, "CAMPAIGN_STAGE_").replace("_", "-")
    progress = campaign.progress
    return Step(name, progress.done, progress.total, f"{progress.unit}s")
