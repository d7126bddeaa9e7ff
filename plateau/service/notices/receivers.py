"""To which network addresses the farm sends notices: public ones, and those that its owner names.

A submitter chooses the URL, and the farm is inside a private network: without a guard, any
submitter could have it send requests to machines that only the farm can reach. So a host is
resolved here, all its addresses are checked, and the connection goes to a checked address: a later
change of the name has no effect.
"""

import socket
from collections.abc import Callable, Sequence
from ipaddress import IPv4Address, IPv4Network, IPv6Address, IPv6Network, ip_address, ip_network
from typing import Final, TypeAlias
from urllib.parse import urlsplit

Address: TypeAlias = IPv4Address | IPv6Address
Network: TypeAlias = IPv4Network | IPv6Network

#: IPv6 addresses that a gateway turns into the IPv4 address in their last 32 bits (RFC 6052).
_NAT64: Final = IPv6Network("64:ff9b::/96")
#: The deprecated ones that mean the IPv4 address in their last 32 bits (RFC 4291).
_COMPATIBLE: Final = IPv6Network("::/96")

#: Special networks (IANA) that `ipaddress` of some supported Pythons takes for public.
_SPECIAL: Final[tuple[Network, ...]] = tuple(
    map(ip_network, ("192.0.0.0/24", "192.88.99.0/24", "64:ff9b:1::/48", "3fff::/20", "5f00::/16"))
)

_SETTING: Final = "PLATEAU_WEBHOOK_ALLOW"


class ReceiverRefused(Exception):
    """The farm sends no notice to this receiver."""


def look_up(host: str, port: int) -> list[str]:
    """The addresses of a host, by the system's resolver."""
    found = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)
    return list(dict.fromkeys(str(address[0]) for *_, address in found))


class Receivers:
    """The allowed receivers of notices.

    `allow` has networks (``10.0.0.0/8``, ``192.168.1.7``) and host names that are allowed though
    they are not public, by http too. `look_up` resolves host names.
    """

    def __init__(
        self, allow: Sequence[str] = (), look_up: Callable[[str, int], list[str]] = look_up
    ) -> None:
        self._networks: list[Network] = []
        self._names: set[str] = set()
        self._look_up = look_up
        for entry in allow:
            try:
                self._networks.append(ip_network(entry, strict=False))
            except ValueError:
                self._names.add(_name(entry))

    def check(self, url: str) -> None:
        """Check the URL without resolving its host.

        Raises
        ------
        ReceiverRefused
            Its host is an address that is refused, or it is http to a public host.
        """
        parts = urlsplit(url)
        host = parts.hostname or ""
        address = _written(host)
        plain = parts.scheme == "http"
        if address is not None:
            self._check_address(host, address, plain=plain)
        elif not self._knows(host):
            if _name(host) == "localhost" or _name(host).endswith(".localhost"):
                raise _private(host)
            if plain:
                raise _unencrypted(host)

    def addresses(self, host: str, port: int, *, plain: bool) -> list[str]:
        """The checked addresses of the host for a connection, which is `plain` by http.

        Raises
        ------
        ReceiverRefused
            The host has no address, or one that is refused.
        """
        try:
            found = self._look_up(host, port)
        except (OSError, UnicodeError) as error:
            raise ReceiverRefused(f"{host} has no address: {error}") from error
        if not found:
            raise ReceiverRefused(f"{host} has no address")
        if not self._knows(host):
            for text in found:
                self._check_address(host, ip_address(text), plain=plain)
        return found

    def _knows(self, host: str) -> bool:
        return _name(host) in self._names

    def _check_address(self, host: str, address: Address, *, plain: bool) -> None:
        meant = _meant(address)
        if any(meant in network or address in network for network in self._networks):
            return
        if not _is_public(meant):
            raise _private(host)
        if plain:
            raise _unencrypted(host)


def _name(host: str) -> str:
    return host.lower().removesuffix(".")


def _written(host: str) -> Address | None:
    """The address that a host is written as, in any form that a resolver accepts."""
    try:
        return ip_address(host)
    except ValueError:
        pass
    try:  # 127.1, 0x7f.1, 017700000001 and 2130706433 are all this machine
        return IPv4Address(socket.inet_aton(host))
    except (OSError, ValueError):
        return None


def _meant(address: Address) -> Address:
    """The IPv4 address inside an IPv6 one, if it has one; otherwise the address."""
    if isinstance(address, IPv4Address):
        return address
    inside = address.ipv4_mapped or address.sixtofour
    if inside is None and (address in _NAT64 or address in _COMPATIBLE):
        inside = IPv4Address(int(address) & 0xFFFFFFFF)
    return inside or address


def _is_public(address: Address) -> bool:
    """Whether anyone on the internet can send to the address."""
    if isinstance(address, IPv6Address) and address.is_site_local:
        return False
    return address.is_global and not (
        any(address in network for network in _SPECIAL)
        or address.is_multicast
        or address.is_reserved
        or address.is_private
        or address.is_loopback
        or address.is_link_local
        or address.is_unspecified
    )


def _private(host: str) -> ReceiverRefused:
    return ReceiverRefused(
        f"{host} is no public address; a receiver on this machine or in a private network has to "
        f"be named in the farm's {_SETTING}"
    )


def _unencrypted(host: str) -> ReceiverRefused:
    return ReceiverRefused(
        f"messages to {host} would go by plain HTTP, which anyone on the way can read: use https, "
        f"or have it named in the farm's {_SETTING}"
    )
