"""Calls of a coordinator's services."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from itertools import chain
from typing import TypeVar

import grpc
from google.protobuf.message import Message

from ._errors import InvalidError, UnavailableError, of_status

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
        scheme, _, rest = url.partition("://")
        address = rest.rstrip("/")
        if scheme not in ("http", "https") or not address or "/" in address:
            raise InvalidError(f"url = {url}: must be http://HOST:PORT or https://HOST:PORT")
        if scheme == "http":
            self._channel = grpc.insecure_channel(address, options=_OPTIONS)
        else:
            self._channel = grpc.secure_channel(address, grpc.ssl_channel_credentials(ca), options=_OPTIONS)
        self._metadata = (("authorization", f"Bearer {token}"),) if token else ()
        self._why = why

    def call(self, method: str, request: Message, answer: type[Answer]) -> Answer:
        """Calls a method with one answer. `method` is `SERVICE/METHOD`, without the package."""
        ask = self._channel.unary_unary(
            f"/murmuration.v1.{method}",
            request_serializer=type(request).SerializeToString,
            response_deserializer=answer.FromString,
        )
        try:
            return ask(request, metadata=self._metadata)
        except grpc.RpcError as error:
            raise self._explained(error) from None

    def stream(self, method: str, request: Message, answer: type[Answer]) -> Iterator[Answer]:
        """Calls a method whose answer is a stream. The call ends with the iterator."""
        ask = self._channel.unary_stream(
            f"/murmuration.v1.{method}",
            request_serializer=type(request).SerializeToString,
            response_deserializer=answer.FromString,
        )
        answers = ask(request, metadata=self._metadata)
        try:
            yield from answers
        except grpc.RpcError as error:
            raise self._explained(error) from None
        finally:
            answers.cancel()

    def exchange(self, method: str, requests: Iterator[Message], answer: type[Answer]) -> Iterator[Answer]:
        """Calls a method that takes a stream of requests, at least one, and answers with a stream."""
        first = next(requests)
        ask = self._channel.stream_stream(
            f"/murmuration.v1.{method}",
            request_serializer=type(first).SerializeToString,
            response_deserializer=answer.FromString,
        )
        answers = ask(chain([first], requests), metadata=self._metadata)
        try:
            yield from answers
        except grpc.RpcError as error:
            raise self._explained(error) from None
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
        self._channel.close()

    def _explained(self, error: grpc.RpcError) -> Exception:
        said = of_status(error)
        if isinstance(said, UnavailableError) and (why := self._why()):
            return UnavailableError(f"{said}; {why}")
        return said
