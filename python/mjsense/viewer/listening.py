# SPDX-License-Identifier: Apache-2.0
"""Where a page's server listens: a socket that is bound at once or is an error at once, and the names by which browsers may call
it."""

from __future__ import annotations

import errno
import ipaddress
import re
import socket
from typing import Any

from mjsense.core.representations import plain

_TRIED = 1000  # ports after the wanted one
_HOST = re.compile(r"(\[[0-9a-f:.]+\]|[a-z0-9._-]+)(:[0-9]{1,5})?", re.ASCII | re.IGNORECASE)  # name and port of the header Host


class Listening:
    """A socket that listens at an address of this computer.

    Args:
        host: Address or name.
        port: The next free one is used if it is taken; 0: any free port.

    Raises:
        ValueError: This computer cannot listen there.
    """

    def __init__(self, host: str, port: int) -> None:
        if not 0 <= port <= 65535:
            raise ValueError(f"port is {port}: must be in [0, 65535]; 0 takes any free port")
        host = host.strip().removeprefix("[").removesuffix("]")
        if not host:
            raise ValueError(
                "host is empty: must be an address of this computer, such as 127.0.0.1, or 0.0.0.0 for all its networks"
            )
        try:
            found = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE)
        except (OSError, UnicodeError) as error:
            raise ValueError(
                f"host is '{plain(host, 60)}', which is not a known name or address ({error}): must be an address "
                "of this computer, such as "
                "127.0.0.1, or 0.0.0.0 for all its networks"
            ) from None
        family, _, _, _, address = min(found, key=lambda one: one[0] != socket.AF_INET)
        self._host = host
        self.socket: socket.socket = _bound(family, address, host, port)
        self.address: str = str(self.socket.getsockname()[0])
        self.port: int = self.socket.getsockname()[1]
        self.local: bool = ipaddress.ip_address(self.address.partition("%")[0]).is_loopback
        """Whether only programs of this computer reach the socket."""

    @property
    def origin(self) -> str:
        """``http://127.0.0.1:8080``."""
        address = ipaddress.ip_address(self.address.partition("%")[0])
        name = self.address if not address.is_unspecified else "127.0.0.1" if address.version == 4 else "::1"
        return f"http://[{name}]:{self.port}" if ":" in name else f"http://{name}:{self.port}"

    def answers_to(self, host: str) -> bool:
        """Whether this value of the header Host may name this server. A page whose name an attacker has pointed to this computer
        sends its own name. The port may be another one, of a tunnel."""
        match = _HOST.fullmatch(host)
        if match is None:
            return False
        name = match[1].lower()
        try:
            address = ipaddress.ip_address(name.strip("[]"))
        except ValueError:
            own = socket.gethostname().lower()
            return name in ("localhost", self._host.lower()) or (not self.local and name in (own, f"{own}.local"))
        return address.is_loopback or not self.local  # an address cannot be pointed elsewhere


def _bound(family: int, address: tuple[Any, ...], host: str, port: int) -> socket.socket:
    """A socket that listens at this port or one of the next ones."""
    last = min(port + _TRIED, 65535) if port else 0
    for candidate in range(port, last + 1):
        try:
            return _listening(family, (address[0], candidate, *address[2:]))
        except OSError as error:
            if error.errno == errno.EADDRINUSE:
                continue
            if error.errno == errno.EACCES:
                raise ValueError(
                    f"port is {candidate}: this user may not listen there ({error.strerror}); choose one from 1024 to 65535"
                ) from None
            raise ValueError(
                f"host is '{plain(host, 60)}': this computer cannot listen there ({error.strerror}); must be one of "
                "its own addresses, such as "
                "127.0.0.1, or 0.0.0.0 for all its networks"
            ) from None
    raise ValueError(f"port is {port}: it and all ports up to {last} are taken")


def _listening(family: int, address: tuple[Any, ...]) -> socket.socket:
    made = socket.socket(family, socket.SOCK_STREAM)
    try:
        made.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        if family == socket.AF_INET6:
            made.setsockopt(socket.IPPROTO_IPV6, socket.IPV6_V6ONLY, 1)
        made.bind(address)
        made.listen(100)
    except OSError:
        made.close()
        raise
    return made
