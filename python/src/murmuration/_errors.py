"""Errors, as the coordinator and the programs say them."""

from __future__ import annotations

import grpc
from google.rpc import error_details_pb2
from grpc_status import rpc_status


class MurmurationError(Exception):
    """An error of this library. Its text is a sentence for people."""


class InvalidError(MurmurationError, ValueError):
    """A value that is not allowed.

    Attributes:
        field: The field, as in a campaign file (`search.population`); None where the coordinator does not name one.
        value: The value, as text; None where it is missing or the coordinator does not repeat it.
        limit: What is allowed, such as `a whole number from 1 to 100000`; None where the coordinator does not say it.

    Example:
        >>> try:
        ...     client.submit({"model": "single-sensor", "method": "random", "search": {"population": 0}})
        ... except mm.InvalidError as error:
        ...     print(error.field, "must be", error.limit)
        search.population must be a whole number from 1 to 100000
    """

    def __init__(self, said: str, field: str | None = None, value: str | None = None, limit: str | None = None) -> None:
        super().__init__(said)
        self.field = field
        self.value = value
        self.limit = limit

    @classmethod
    def of(cls, field: str, value: str | None, limit: str) -> InvalidError:
        """The error about a field of this library; without `value` the field is missing."""
        found = f"{field} is missing" if value is None else f"{field} = {value}"
        return cls(f"{found}: must be {limit}", field, value, limit)

    def reworded(self, said: str) -> InvalidError:
        """The same error in other words."""
        return InvalidError(said, self.field, self.value, self.limit)

    def __reduce__(self) -> tuple[type[InvalidError], tuple[str, str | None, str | None, str | None]]:
        # Processes of a pool send it to each other.
        return type(self), (str(self), self.field, self.value, self.limit)


class NotFoundError(MurmurationError, LookupError):
    """A campaign, an individual or a checkpoint that does not exist."""


class RefusedError(MurmurationError):
    """A request that the coordinator does not carry out now, or not for this person."""


class UnavailableError(MurmurationError, ConnectionError):
    """A coordinator that does not answer."""


class BusyError(MurmurationError):
    """A coordinator that answers too many requests of yours, or has no room on its disk: ask again later."""


class AnswerError(MurmurationError):
    """An answer of the coordinator that cannot be, such as a picture of a wrong size. Nothing of it is used.

    The coordinator is broken or of another version, or something on the way to it changes what it says.
    """


class CampaignError(MurmurationError):
    """A campaign that stopped before it was completed.

    Attributes:
        state: Its state: `failed`, `paused` or `cancelled`; `unknown` if a newer coordinator has another.
    """

    def __init__(self, said: str, state: str) -> None:
        super().__init__(said)
        self.state = state

    def __reduce__(self) -> tuple[type[CampaignError], tuple[str, str]]:
        # Processes of a pool send it to each other.
        return type(self), (str(self), self.state)


class ProgramError(MurmurationError):
    """A program of Murmuration that cannot be found, or that failed."""


_BY_CODE: dict[grpc.StatusCode, type[MurmurationError]] = {
    grpc.StatusCode.INVALID_ARGUMENT: InvalidError,
    # A message that is larger than the coordinator reads.
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
    # What grpc raises for a call is also the call, which has the status.
    if not isinstance(error, grpc.Call):
        return MurmurationError(str(error))
    said = error.details() or error.code().name
    kind = _BY_CODE.get(error.code(), MurmurationError)
    return _invalid(said, error) if kind is InvalidError else kind(said)


def _invalid(said: str, call: grpc.Call) -> InvalidError:
    """The error with what the details of a status say of the field; a proxy may have dropped them."""
    error = InvalidError(said)
    try:
        status = rpc_status.from_call(call)
    except ValueError:
        # Details of another status than the call's.
        return error
    for detail in status.details if status else ():
        request, info = error_details_pb2.BadRequest(), error_details_pb2.ErrorInfo()
        if detail.Unpack(request) and request.field_violations:
            violation = request.field_violations[0]
            error.field, error.limit = violation.field, violation.description or None
        elif detail.Unpack(info):
            error.value = info.metadata.get("value")
    return error
