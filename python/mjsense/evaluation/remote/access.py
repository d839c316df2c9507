# SPDX-License-Identifier: Apache-2.0
"""Who may use a policy server: its key, and the certificates of ``wss://``."""

from __future__ import annotations

import hmac
import re
import ssl
from collections.abc import Mapping
from typing import Any

HEADER = "Authorization"
_KEY = re.compile(r"[\x21-\x7e]{16,512}")
_FILE_BYTES = 4096


def key_of(file: str) -> str:
    """The key that a file contains; empty without a file."""
    if not file:
        return ""
    with open(file, "rb") as opened:
        text = opened.read(_FILE_BYTES + 1).decode(errors="replace").strip()
    if not _KEY.fullmatch(text):
        raise ValueError(f"key_file '{file}': it must contain one key: 16 to 512 visible ASCII characters without a space")
    return text


def headers_of(key: str) -> dict[str, str]:
    """What a client sends, as openpi's does."""
    return {HEADER: f"Api-Key {key}"} if key else {}


def is_allowed(headers: Mapping[str, str], key: str) -> bool:
    """Whether a client has the key. Without a key, all clients are allowed. The time does not depend on where it differs."""
    given = headers.get(HEADER, "").encode(errors="replace")
    return not key or hmac.compare_digest(given, headers_of(key)[HEADER].encode())


def server_context(certificate: str, private_key: str) -> Any:
    """The encryption of a server; None without files."""
    if not certificate and not private_key:
        return None
    if not certificate or not private_key:
        raise ValueError(
            f"wss:// needs both certificate and private_key; {'private_key' if certificate else 'certificate'} is missing"
        )
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    try:
        context.load_cert_chain(certificate, private_key, password=_no_password)
    except (OSError, ValueError) as error:  # SSLError is an OSError
        raise ValueError(f"certificate '{certificate}', private_key '{private_key}': {error}; expected PEM files") from None
    return context


def client_context(url: str, certificate: str) -> Any:
    """The encryption of a client; None for ``ws://``.

    Args:
        certificate: File with the certificate of the server or of who signed it; empty: those that the system trusts.
    """
    if not url.startswith("wss:"):
        if certificate:
            raise ValueError(f"policy '{url}': a certificate belongs to wss://HOST:PORT")
        return None
    try:
        return ssl.create_default_context(cafile=certificate or None)
    except OSError as error:
        raise ValueError(f"certificate '{certificate}': {error}; expected a PEM file") from None


def _no_password() -> str:
    """OpenSSL would ask for one at the terminal."""
    raise ValueError("the private key has a password; remove it with openssl pkey")
