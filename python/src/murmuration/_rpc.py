"""Calls of a coordinator's services."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from itertools import chain
from typing import TypeVar
from urllib.parse import urlsplit

import grpc
from google.protobuf.message import DecodeError, Message

from ._answers import wrong
from ._errors import AnswerError, InvalidError, MurmurationError, UnavailableError, of_status

Answer = TypeVar("Answer", bound=Message)

_OPTIONS = [
    # A picture may have up to a million bytes for each of its channels.
    ("grpc.max_receive_message_length", 64 * 1024 * 1024),
    # A coordinator that vanished is noticed while a campaign is watched.
    ("grpc.keepalive_time_ms", 20_000),
    ("grpc.keepalive_timeout_ms", 10_000),
    # As Murmuration's programs do.
    ("grpc.enable_http_proxy", 0),
]


class Connection:
    """A connection to one coordinator."""

    def __init__(self, url: str, ca: bytes | None, token: str | None, why: Callable[[], str]) -> None:
        """Connects when the first call is made. `why` says what is known of a coordinator that does not answer."""
        scheme, address = _address(url)
        if scheme == "http":
            self._channel = grpc.insecure_channel(address, options=_OPTIONS)
        else:
            self._channel = grpc.secure_channel(address, grpc.ssl_channel_credentials(ca), options=_OPTIONS)
        self._metadata = (("authorization", f"Bearer {token}"),) if token else ()
        self._why = why
        self._is_closed = False

    def call(self, method: str, request: Message, answer: type[Answer]) -> Answer:
        """Calls a method with one answer. `method` is `SERVICE/METHOD`, without the package."""
        self.check_open()
        ask = self._channel.unary_unary(
            f"/murmuration.v1.{method}",
            request_serializer=type(request).SerializeToString,
            response_deserializer=_reader(answer),
        )
        try:
            return _sound(ask(request, metadata=self._metadata))
        except grpc.RpcError as error:
            raise self.explained(of_status(error)) from None

    def stream(self, method: str, request: Message, answer: type[Answer]) -> Iterator[Answer]:
        """Calls a method whose answer is a stream. The call ends with the iterator."""
        self.check_open()
        ask = self._channel.unary_stream(
            f"/murmuration.v1.{method}",
            request_serializer=type(request).SerializeToString,
            response_deserializer=_reader(answer),
        )
        answers = ask(request, metadata=self._metadata)
        try:
            for read in answers:
                yield _sound(read)
        except grpc.RpcError as error:
            raise self.explained(of_status(error)) from None
        finally:
            answers.cancel()

    def exchange(self, method: str, requests: Iterator[Message], answer: type[Answer]) -> Iterator[Answer]:
        """Calls a method that takes a stream of requests, at least one, and answers with a stream."""
        self.check_open()
        first = next(requests)
        ask = self._channel.stream_stream(
            f"/murmuration.v1.{method}",
            request_serializer=type(first).SerializeToString,
            response_deserializer=_reader(answer),
        )
        answers = ask(chain([first], requests), metadata=self._metadata)
        try:
            for read in answers:
                yield _sound(read)
        except grpc.RpcError as error:
            raise self.explained(of_status(error)) from None
        finally:
            answers.cancel()

    def whole(self, method: str, request: Message, answer: type[Answer]) -> Answer:
        """Calls a method whose answer comes in parts, and joins them."""
        whole = answer()
        for part in self.stream(method, request, answer):
            whole.MergeFrom(part)
        return whole

    def close(self) -> None:
        """Ends the connection."""
        self._is_closed = True
        self._channel.close()

    def check_open(self) -> None:
        """Raises UnavailableError if the connection has ended."""
        if self._is_closed:
            raise UnavailableError("this client is closed")

    def explained(self, error: MurmurationError) -> MurmurationError:
        """An error of a call with what is known of a coordinator that does not answer."""
        if self._is_closed:
            return UnavailableError("this client was closed during the call")
        if isinstance(error, UnavailableError) and (why := self._why()):
            return UnavailableError(f"{error}; {why}")
        return error


def _reader(answer: type[Answer]) -> Callable[[bytes], Answer | AnswerError]:
    """What makes a message of bytes, or an error: gRPC would print one that is raised, and lose its kind."""

    def read(content: bytes) -> Answer | AnswerError:
        try:
            return answer.FromString(content)
        except DecodeError as error:
            return wrong(f"{len(content)} bytes that are no {answer.DESCRIPTOR.name}: {error}")

    return read


def _sound(read: Answer | AnswerError) -> Answer:
    if isinstance(read, AnswerError):
        raise read
    return read


def _address(url: str) -> tuple[str, str]:
    """The scheme of a coordinator's URL, and its host and port."""
    try:
        parts = urlsplit(url)
        is_one = parts.scheme in ("http", "https") and parts.hostname and parts.port
    except (AttributeError, TypeError, ValueError):
        is_one = False
    if not is_one or "@" in parts.netloc or parts.path.strip("/") or parts.query or parts.fragment:
        raise InvalidError(f"url = {url}: must be http://HOST:PORT or https://HOST:PORT, with a port from 1 to 65535")
    return parts.scheme, parts.netloc
