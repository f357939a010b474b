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

__version__ = "0.1.0"

__all__ = [
    "FEATURES",
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
    "RefusedError",
    "Replay",
    "Taxonomy",
    "UnavailableError",
    "__version__",
    "connect",
    "local",
    "matrix",
]
