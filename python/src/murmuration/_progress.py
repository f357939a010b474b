"""The progress of a campaign, as a bar in a terminal or a notebook."""

from __future__ import annotations

import sys
from typing import Any, NamedTuple, NoReturn

from tqdm import tqdm

from ._answers import word
from ._errors import clean
from .v1 import campaign_pb2 as v1

# Stages of training, which may end before their last epoch.
_TRAININGS = ("pretrain", "fine-tune")


class Step(NamedTuple):
    """The progress of a stage."""

    stage: str
    done: int
    total: int
    unit: str


class Bar:
    """One bar for each stage.

    Without `shown`, bars are shown in notebooks and in terminals, but not where stderr is a file.

    Attributes:
        is_hidden: Whether the bar is not shown.
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
        """Shows the campaign's progress."""
        step = step_of(campaign)
        if step is None:
            return
        bar = self._bar_of(step)
        bar.total = step.total
        bar.update(step.done - bar.n)
        if campaign.waiting:
            bar.set_postfix_str(f"waiting: {clean(campaign.waiting)}")
        elif step.stage == "evolve" and campaign.HasField("mean_novelty"):
            bar.set_postfix_str(f"novelty {campaign.mean_novelty:.3g}")
        else:
            # The campaign no longer waits.
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
        """Shows a stage as done when another one follows: its last progress may not have arrived."""
        bar = self._bar
        # A search also pauses when a person moves its archive to another embedder.
        if bar is None or (self._stage == "evolve" and following != "label"):
            return
        if bar.total and self._stage not in _TRAININGS:
            bar.n = bar.total
        elif bar.n:
            bar.total = bar.n
        else:
            # The stage was too short to report progress.
            bar.bar_format = "{desc}: done"

    def close(self) -> None:
        """Closes the bar in its present state."""
        if self._bar is not None:
            self._bar.close()
            self._bar = None


class _Output:
    """An output of a notebook's cell that shows a bar's last line.

    The output is text: in a notebook that is saved or shown without its kernel, a widget would become its initial,
    empty bar.
    """

    # Lets tqdm draw with more than ASCII.
    encoding = "utf-8"

    def __init__(self) -> None:
        self._shown: Any = None

    def write(self, written: str) -> int:
        """Shows a bar, without the characters that move a terminal's cursor."""
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
    """The progress of a campaign's stage; None if the stage counts nothing."""
    if not campaign.HasField("progress"):
        return None
    stage = campaign.stage
    # All evaluations are done once the archive is clustered.
    if stage == v1.CAMPAIGN_STAGE_TAXONOMY:
        stage = v1.CAMPAIGN_STAGE_EVOLVE
    name = word(v1.CampaignStage.Name, stage, "CAMPAIGN_STAGE_").replace("_", "-")
    progress = campaign.progress
    return Step(name, progress.done, progress.total, f"{clean(progress.unit)}s")
