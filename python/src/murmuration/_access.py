"""The access file of a coordinator, and links that log a browser in."""

from __future__ import annotations

import base64
import hashlib
import hmac
import json
import os
import secrets
import ssl
import time
from dataclasses import dataclass, field
from pathlib import Path
from urllib.parse import urlencode, urlsplit

from ._errors import InvalidError, UnavailableError

_PURPOSE = b"murmuration one-time code"
_SECONDS_TO_SHAKE_HANDS = 30


@dataclass(frozen=True)
class Access:
    """Where a coordinator is, and what its clients need.

    Attributes:
        coordinator: The URL for programs.
        pages: The URL of the pages.
        fingerprint: `sha256:` and the digest of the certificate at `coordinator`; None without encryption.
        name: The name in a certificate that the coordinator made for itself; None for a certificate of an authority.
        token: A token that lets its bearer do everything; None if the coordinator requires none.
    """

    coordinator: str
    pages: str
    fingerprint: str | None = None
    name: str | None = None
    token: str | None = field(default=None, repr=False)

    def link(self, page: str) -> str:
        """An address for a browser. If the coordinator requires tokens, the address works once, for 15 minutes."""
        if self.token is None:
            return self.pages + page
        signed = secrets.token_bytes(16) + (time.time_ns() // 1_000_000).to_bytes(8, "big")
        key = hmac.digest(self.token.encode(), _PURPOSE, "sha256")
        code = base64.urlsafe_b64encode(signed + hmac.digest(key, signed, "sha256"))
        query = urlencode({"code": code.decode().rstrip("="), "to": page})
        return f"{self.pages}/open?{query}"

    def certificate(self) -> bytes | None:
        """The certificate (PEM) of the coordinator, which has the fingerprint; None without encryption."""
        if self.fingerprint is None:
            return None
        if self.name is None:
            raise InvalidError.of("ca", None, "the file of the authority that signed the coordinator's certificate")
        url = urlsplit(self.coordinator)
        address = (str(url.hostname), url.port or 443)
        try:
            pem = ssl.get_server_certificate(address, timeout=_SECONDS_TO_SHAKE_HANDS)
        except OSError as error:
            raise UnavailableError(
                f"no coordinator answers at {self.coordinator} ({error}): check that `murmuration serve` runs there"
            ) from None
        found = hashlib.sha256(ssl.PEM_cert_to_DER_cert(pem)).hexdigest()
        if f"sha256:{found}" != self.fingerprint.lower():
            raise UnavailableError(f"the certificate at {self.coordinator} is not the one that the access file names")
        return pem.encode()


def default_file() -> Path:
    """The access file that the environment names, or else the data directory's."""
    if named := os.environ.get("MURMURATION_ACCESS"):
        return Path(named)
    return Path(os.environ.get("MURMURATION_DATA") or "murmuration-data", "access.json")


def read(file: Path) -> Access:
    """Reads an access file.

    Raises:
        OSError: If the file cannot be read.
        InvalidError: If the file is no access file.
    """
    wrong = InvalidError.of("access", os.fspath(file), "the access file that `murmuration serve` wrote")
    try:
        fields = json.loads(file.read_text(encoding="utf-8"))
    except ValueError:
        raise wrong from None
    if not isinstance(fields, dict):
        raise wrong
    coordinator, pages = fields.get("coordinator"), fields.get("pages")
    fingerprint, name, token = fields.get("fingerprint"), fields.get("name"), fields.get("token")
    if not (isinstance(coordinator, str) and isinstance(pages, str)):
        raise wrong
    if not all(isinstance(value, str | None) for value in (fingerprint, name, token)):
        raise wrong
    return Access(coordinator, pages, fingerprint, name, token)
