"""The errors of this library, with the messages of the coordinator and the programs."""

from __future__ import annotations

import grpc
from google.rpc import error_details_pb2
from grpc_status import rpc_status


class MurmurationError(Exception):
    """An error of this library. Its text is a sentence for people."""


class InvalidError(MurmurationError, ValueError):
    """A value that is not allowed.

    Attributes:
        field: The field, as in a campaign file (`search.population`); None if the coordinator does not name one.
        value: The value, as text; None if it is missing or the coordinator does not repeat it.
        limit: The allowed values, such as `a whole number from 1 to 100000`; None if the coordinator does not name
            them.

    Example:
        >>> try:
        ...     client.submit({"model": "single-sensor", "method": "random", "search": {"population": 0}})
        ... except mm.InvalidError as error:
        ...     print(error.field, "must be", error.limit)
        search.population must be a whole number from 1 to 100000
    """

    def __init__(
        self, message: str, field: str | None = None, value: str | None = None, limit: str | None = None
    ) -> None:
        super().__init__(message)
        self.field = field
        self.value = value
        self.limit = limit

    @classmethod
    def of(cls, field: str, value: str | None, limit: str) -> InvalidError:
        """The error about an argument of this library; without `value`, the argument is missing."""
        found = f"{field} is missing" if value is None else f"{field} = {value}"
        return cls(f"{found}: must be {limit}", field, value, limit)

    def reworded(self, message: str) -> InvalidError:
        """The same error in other words."""
        return InvalidError(message, self.field, self.value, self.limit)

    def __reduce__(self) -> tuple[type[InvalidError], tuple[str, str | None, str | None, str | None]]:
        # Processes of a pool send it to each other.
        return type(self), (str(self), self.field, self.value, self.limit)


class NotFoundError(MurmurationError, LookupError):
    """A campaign, an individual or a checkpoint that does not exist."""


class RefusedError(MurmurationError):
    """A request that the coordinator refuses in the present state, or for this token."""


class UnavailableError(MurmurationError, ConnectionError):
    """A coordinator that does not answer."""


class BusyError(MurmurationError):
    """The coordinator has too many open requests of yours, or no room on its disk. Try again later."""


class AnswerError(MurmurationError):
    """An impossible answer of the coordinator, such as a picture of a wrong size. The whole answer is discarded.

    The coordinator is broken or of another version, or something between it and this library alters the answers.
    """


class CampaignError(MurmurationError):
    """A campaign that stopped before it was completed.

    Attributes:
        state: The campaign's state: `failed`, `paused` or `cancelled`; `unknown` for a state of a newer coordinator.
    """

    def __init__(self, message: str, state: str) -> None:
        super().__init__(message)
        self.state = state

    def __reduce__(self) -> tuple[type[CampaignError], tuple[str, str]]:
        # Processes of a pool send it to each other.
        return type(self), (str(self), self.state)


class ProgramError(MurmurationError):
    """A program of Murmuration that cannot be found, or that failed."""


# Maximum number of characters of a coordinator's error text.
_LONGEST = 4_000

_BY_CODE: dict[grpc.StatusCode, type[MurmurationError]] = {
    grpc.StatusCode.INVALID_ARGUMENT: InvalidError,
    # The message is larger than the coordinator accepts.
    grpc.StatusCode.OUT_OF_RANGE: InvalidError,
    grpc.StatusCode.NOT_FOUND: NotFoundError,
    grpc.StatusCode.FAILED_PRECONDITION: RefusedError,
    grpc.StatusCode.ALREADY_EXISTS: RefusedError,
    grpc.StatusCode.PERMISSION_DENIED: RefusedError,
    grpc.StatusCode.UNAUTHENTICATED: RefusedError,
    grpc.StatusCode.RESOURCE_EXHAUSTED: BusyError,
    grpc.StatusCode.UNAVAILABLE: UnavailableError,
    grpc.StatusCode.DEADLINE_EXCEEDED: UnavailableError,
}


def of_status(error: grpc.RpcError) -> MurmurationError:
    """The error of a gRPC status."""
    # The error that grpc raises for a call is also the call, which has the status.
    if not isinstance(error, grpc.Call):
        return MurmurationError(str(error))
    message = clean(error.details() or error.code().name)
    kind = _BY_CODE.get(error.code(), MurmurationError)
    return _invalid(message, error) if kind is InvalidError else kind(message)


def clean(text: str) -> str:
    """A coordinator's text, cut to a length to read, without characters that control a terminal."""
    return "".join(letter if letter.isprintable() or letter == "\n" else "\ufffd" for letter in text[:_LONGEST])


def _invalid(message: str, call: grpc.Call) -> InvalidError:
    """The error with the field from the status's details; a proxy may have dropped them."""
    error = InvalidError(message)
    try:
        status = rpc_status.from_call(call)
    except ValueError:
        # The details belong to another status than the call's.
        return error
    for detail in status.details if status else ():
        request, info = error_details_pb2.BadRequest(), error_details_pb2.ErrorInfo()
        if detail.Unpack(request) and request.field_violations:
            violation = request.field_violations[0]
            error.field, error.limit = clean(violation.field), clean(violation.description) or None
        elif detail.Unpack(info):
            value = info.metadata.get("value")
            error.value = None if value is None else clean(value)
    return error
