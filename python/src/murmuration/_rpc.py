"""Calls of a coordinator's services."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from itertools import chain
from typing import Any, TypeVar
from urllib.parse import urlsplit

import grpc
from google.protobuf.message import DecodeError, Message

from ._answers import wrong
from ._errors import AnswerError, InvalidError, MurmurationError, UnavailableError, of_status

Answer = TypeVar("Answer", bound=Message)

# Maximum number of bytes of a whole answer, as for the programs: more than all labels of the largest campaign.
_LONGEST_ANSWER = 4 << 30

# Beginnings of gRPC's messages if no server answers, or not in time.
_NOBODY = ("failed to connect to all addresses", "Deadline Exceeded")
_OPTIONS = [
    # A picture may have up to a million bytes for each of its channels.
    ("grpc.max_receive_message_length", 64 * 1024 * 1024),
    # Detects a vanished coordinator while a campaign is watched.
    ("grpc.keepalive_time_ms", 20_000),
    ("grpc.keepalive_timeout_ms", 10_000),
    # Murmuration's programs use no proxy either.
    ("grpc.enable_http_proxy", 0),
]


class Connection:
    """A connection to one coordinator."""

    def __init__(
        self, url: str, ca: bytes | None, token: str | None, why: Callable[[], str], name: str | None = None
    ) -> None:
        """Connects at the first call.

        `why` returns what is known about a coordinator that does not answer. `name` is the name in the coordinator's
        certificate, if it is not the host of the URL.
        """
        scheme, address = _address(url)
        if scheme == "http":
            self._channel = grpc.insecure_channel(address, options=_OPTIONS)
        else:
            options = [*_OPTIONS, ("grpc.ssl_target_name_override", name)] if name else _OPTIONS
            self._channel = grpc.secure_channel(address, grpc.ssl_channel_credentials(ca), options=options)
        self._metadata = (("authorization", f"Bearer {_token(token)}"),) if token else ()
        self._url, self._why = url, why
        self._is_closed = False

    def call(self, method: str, request: Message, answer: type[Answer], seconds: float | None = None) -> Answer:
        """Calls a method with one answer, within `seconds` if they are given. `method` is `SERVICE/METHOD`."""
        self.check_open()
        ask = self._channel.unary_unary(
            f"/murmuration.v1.{method}",
            request_serializer=type(request).SerializeToString,
            response_deserializer=_reader(answer),
        )
        with self._told():
            return _sound(ask(request, metadata=self._metadata, timeout=seconds))

    def stream(self, method: str, request: Message, answer: type[Answer]) -> Iterator[Answer]:
        """Calls a method whose answer is a stream. The call ends with the iterator."""
        self.check_open()
        ask = self._channel.unary_stream(
            f"/murmuration.v1.{method}",
            request_serializer=type(request).SerializeToString,
            response_deserializer=_reader(answer),
        )
        with self._told():
            yield from _each(ask(request, metadata=self._metadata))

    def exchange(self, method: str, requests: Iterator[Message], answer: type[Answer]) -> Iterator[Answer]:
        """Calls a method that takes a stream of requests, at least one, and answers with a stream."""
        self.check_open()
        first = next(requests)
        ask = self._channel.stream_stream(
            f"/murmuration.v1.{method}",
            request_serializer=type(first).SerializeToString,
            response_deserializer=_reader(answer),
        )
        with self._told():
            yield from _each(ask(chain([first], requests), metadata=self._metadata))

    def whole(self, method: str, request: Message, answer: type[Answer]) -> Answer:
        """Calls a method whose answer comes in parts, and joins them."""
        whole, size = answer(), 0
        for part in self.stream(method, request, answer):
            size += part.ByteSize()
            if size > _LONGEST_ANSWER:
                raise AnswerError(f"{method}: the answer is longer than {_LONGEST_ANSWER} bytes")
            whole.MergeFrom(part)
        return whole

    @property
    def is_closed(self) -> bool:
        """Whether the connection was closed."""
        return self._is_closed

    def close(self) -> None:
        """Ends the connection."""
        self._is_closed = True
        self._channel.close()

    def check_open(self) -> None:
        """Raises UnavailableError if the connection has ended."""
        if self._is_closed:
            raise UnavailableError("this client is closed")

    @contextmanager
    def _told(self) -> Iterator[None]:
        """Turns gRPC's errors into errors of this library."""
        try:
            yield
        except grpc.RpcError as error:
            raise self.explained(of_status(error)) from None
        except ValueError as error:
            # gRPC raises a ValueError for a channel that another thread has just closed.
            if isinstance(error, MurmurationError) or not self._is_closed:
                raise
            raise UnavailableError("this client was closed during the call") from None

    def explained(self, error: MurmurationError) -> MurmurationError:
        """A call's error, with the reason why the coordinator does not answer, if known."""
        if self._is_closed:
            return UnavailableError("this client was closed during the call")
        if not isinstance(error, UnavailableError):
            return error
        if why := self._why():
            return UnavailableError(f"{error}; {why}")
        message = str(error)
        if not message.startswith(_NOBODY):
            return error
        reason = message.rpartition(": ")[2]
        check = "check the URL, and that `murmuration serve` runs there"
        return UnavailableError(f"no coordinator answers at {self._url} ({reason}): {check}")


def _reader(answer: type[Answer]) -> Callable[[bytes], Answer | AnswerError]:
    """Returns a parser of messages. The parser returns errors: gRPC would print a raised error and lose its kind."""

    def read(content: bytes) -> Answer | AnswerError:
        try:
            return answer.FromString(content)
        except DecodeError as error:
            return wrong(f"{len(content)} bytes that are no {answer.DESCRIPTOR.name}: {error}")

    return read


def _each(answers: Any) -> Iterator[Any]:  # noqa: ANN401
    """The answers of a call, which ends with the iterator."""
    try:
        for read in answers:
            yield _sound(read)
    finally:
        answers.cancel()


def _sound(read: Answer | AnswerError | None) -> Answer:
    if read is None:
        raise wrong("a call succeeded without an answer")
    if isinstance(read, AnswerError):
        raise read
    return read


def _token(given: object) -> str:
    """Checks a token, without the white space that a file has around it. Messages do not quote it."""
    token = given.strip() if isinstance(given, str) else ""
    if not token.isascii() or not token.isprintable() or not token or " " in token:
        raise InvalidError.of("token", "(not shown)", "a text of visible ASCII characters, such as mur_...")
    return token


def _address(url: str) -> tuple[str, str]:
    """The scheme of a coordinator's URL, and its host and port."""
    try:
        parts = urlsplit(url)
        is_one = parts.scheme in ("http", "https") and parts.hostname and parts.port
    except (AttributeError, TypeError, ValueError):
        is_one = False
    if not is_one or "@" in parts.netloc or parts.path.strip("/") or parts.query or parts.fragment:
        raise InvalidError.of("url", url, "http://HOST:PORT or https://HOST:PORT, with a port from 1 to 65535")
    return parts.scheme, parts.netloc
