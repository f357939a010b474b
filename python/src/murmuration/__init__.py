"""Murmuration: search for the collective behaviours that a swarm of robots can show.

A local cluster runs for as long as the program needs it, and the library returns tables and arrays:

    >>> with mm.local(workers=2) as client:
    ...     campaign = client.run(spec)
    ...     archive = campaign.archive()
    >>> archive.num_rows
    100

All results come from a coordinator, over the same contract that the programs use. The contract's messages are in
`murmuration.v1`.
"""

from typing import TYPE_CHECKING, Any

from . import swarmsim
from ._agreement import Agreement
from ._campaign import Campaign
from ._client import Client, connect, local
from ._errors import (
    AnswerError,
    BusyError,
    CampaignError,
    InvalidError,
    MurmurationError,
    NotFoundError,
    ProgramError,
    RefusedError,
    UnavailableError,
)
from ._evaluations import Evaluations
from ._found import Replay, Taxonomy
from ._tables import FEATURES, matrix
from ._tracks import Recognition
from ._workers import Worker

if TYPE_CHECKING:
    from ._dask import DaskAdaptive as DaskAdaptive
    from ._dask import on_dask as on_dask
    from ._ray import on_ray as on_ray

__version__ = "0.1.0"

__all__ = [
    "FEATURES",
    "Agreement",
    "AnswerError",
    "BusyError",
    "Campaign",
    "CampaignError",
    "Client",
    "Evaluations",
    "InvalidError",
    "MurmurationError",
    "NotFoundError",
    "ProgramError",
    "Recognition",
    "RefusedError",
    "Replay",
    "Taxonomy",
    "UnavailableError",
    "Worker",
    "__version__",
    "connect",
    "local",
    "matrix",
    "swarmsim",
]


def __getattr__(name: str) -> Any:  # noqa: ANN401
    # Dask and Ray are extras, and importing them takes a second. So `import *` must not ask for these names.
    if name in ("on_dask", "DaskAdaptive"):
        from . import _dask

        return getattr(_dask, name)
    if name == "on_ray":
        from ._ray import on_ray

        return on_ray
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
