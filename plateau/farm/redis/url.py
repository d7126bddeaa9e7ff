"""``PLATEAU_REDIS_URL``: the address of a Redis, and the credentials for it.

::

    redis://USER:PASSWORD@HOST:6379/0
    rediss://USER:PASSWORD@HOST:6379/0                    with TLS
    redis+sentinel://USER:PASSWORD@HOST1,HOST2:26379/NAME/0
    rediss+sentinel://…                                   with TLS, to the sentinels too
    unix:///run/redis/redis.sock

Parameters (``?ssl_ca_certs=…&ssl_certfile=…``) are those of redis-py, and for sentinels also
``sentinel_username`` and ``sentinel_password``.

A URL may hold a password, so errors repeat no part of it except names of files.
"""

import re
from dataclasses import dataclass, replace
from ipaddress import IPv6Address, ip_address
from pathlib import Path
from typing import Any, Final
from urllib.parse import parse_qsl, quote, unquote, urlencode

_SCHEMES: Final = ("redis", "rediss", "redis+sentinel", "rediss+sentinel", "unix")
_SENTINEL_PORT: Final = 26379
_HIGHEST_PORT: Final = 65535
_FORM: Final = "redis+sentinel://host1:26379,host2:26379/mymaster/0"
_HIDDEN: Final = "***"

#: A URL's parts, by RFC 3986. Python's `urlsplit` takes a list of sentinels for one host, and only
#: some versions accept an IPv6 address in it.
_URL: Final = re.compile(
    r"(?P<scheme>[^:/?#]+)://(?P<netloc>[^/?#]*)(?P<path>[^?#]*)(?:\?(?P<query>[^#]*))?"
)
_ADDRESS: Final = re.compile(
    r"(?:\[(?P<ipv6>[^][]+)\]|(?P<name>[^][:]+))(?::(?P<port>[0-9]{1,5}))?"
)


class BadRedisUrl(ValueError):
    """This is no URL of a Redis; the message says why, and shows no password."""


@dataclass(frozen=True)
class Sentinels:
    """The servers that know the present master of a name."""

    addresses: tuple[tuple[str, int], ...]  #: host and port of each
    service: str  #: the master's name
    options: dict[str, Any]  #: redis-py's, for connections to the Redis
    own_options: dict[str, Any]  #: and to the sentinels


@dataclass(frozen=True)
class _Parts:
    scheme: str
    netloc: str  #: user, password, hosts and ports
    path: str
    query: str

    @property
    def url(self) -> str:
        return f"{self.scheme}://{self.netloc}{self.path}{'?' if self.query else ''}{self.query}"


def check(url: str) -> None:
    """Return if the URL can mean a Redis, or raise `BadRedisUrl`."""
    if sentinels_of(url) is None:
        _options(url)


def sentinels_of(url: str) -> Sentinels | None:
    """The URL's sentinels, or None where it names a Redis itself; `BadRedisUrl` for neither."""
    parts = _parts(url)
    if not parts.scheme.endswith("+sentinel"):
        return None
    user_info, at, hosts = parts.netloc.rpartition("@")
    service, _, database = parts.path.strip("/").partition("/")
    if not re.fullmatch(r"[\w.-]+", service) or not re.fullmatch(r"\d*", database):
        raise BadRedisUrl(f"must name the master, and may name a database: {_FORM}")
    plain = replace(parts, scheme="redis", netloc=f"{user_info}{at}localhost", path=f"/{database}")
    options = _options(plain.url)
    del options["host"]
    if parts.scheme == "rediss+sentinel":
        options["ssl"] = True
    own = {name: options.pop(f"sentinel_{name}", None) for name in ("username", "password")}
    tls = {name: value for name, value in options.items() if name.startswith("ssl")}
    return Sentinels(
        tuple(_address(one) for one in hosts.split(",")),
        service,
        options,
        {**tls, **{name: value for name, value in own.items() if value}},
    )


def uses_tls(url: str) -> bool:
    """Whether connections to this Redis are encrypted."""
    return url.startswith("rediss")


def without_password(url: str) -> str:
    """The URL with its passwords hidden, even if it is malformed."""
    shown = re.sub(r"(?<=://)([^:@/]*):.*@", rf"\1:{_HIDDEN}@", url, flags=re.DOTALL)
    return re.sub(r"(?i)(\w*password=)[^&#]*", rf"\1{_HIDDEN}", shown)


def with_user(url: str, user: str) -> str:
    """The URL with this user; raises `BadRedisUrl` where it has another one."""
    parts = _parts(url)
    user_info, _, hosts = parts.netloc.rpartition("@")
    given, colon, password = user_info.partition(":")
    if given and unquote(given) != user:
        raise BadRedisUrl("names another user than PLATEAU_REDIS_USER: leave one of the two out")
    return replace(parts, netloc=f"{quote(user, safe='')}{colon}{password}@{hosts}").url


def with_password(url: str, password: str) -> str:
    """The URL with this password; raises `BadRedisUrl` where it has another one."""
    parts = _parts(url)
    user_info, _, hosts = parts.netloc.rpartition("@")
    user, has_password, given = user_info.partition(":")
    if has_password and unquote(given) != password:
        raise BadRedisUrl(
            "has another password than PLATEAU_REDIS_PASSWORD_FILE: leave one of the two out"
        )
    return replace(parts, netloc=f"{user}:{quote(password, safe='')}@{hosts}").url


def with_parameters(url: str, parameters: dict[str, str]) -> str:
    """The URL with these parameters; its own overrule them."""
    parts = _parts(url)
    both = {**parameters, **dict(parse_qsl(parts.query))}
    return replace(parts, query=urlencode(both, safe="/")).url


def _parts(url: str) -> _Parts:
    """The URL's parts; `BadRedisUrl` where an unescaped password may have split them wrongly."""
    scheme = url.partition("://")[0]
    if scheme not in _SCHEMES or "://" not in url:
        raise BadRedisUrl(f"must begin with one of {', '.join(f'{one}://' for one in _SCHEMES)}")
    found = _URL.fullmatch(url)  # a URL with a fragment does not match
    if found is None or not url.isprintable():
        raise _unreadable()
    parts = _Parts(**found.groupdict(default=""))
    if "@" in parts.path or parts.netloc.count("@") > 1:
        raise _unreadable()
    if scheme != "unix" and not parts.netloc.rpartition("@")[2]:
        raise BadRedisUrl("names no host")
    return parts


def _options(url: str) -> dict[str, Any]:
    """redis-py's options for connections, of a URL without sentinels."""
    from redis.connection import parse_url  # takes 0.1 s, and not every command needs it

    _parts(url)
    try:
        options: dict[str, Any] = parse_url(url)
    except ValueError:
        raise _unreadable() from None
    for name in ("ssl_ca_certs", "ssl_certfile", "ssl_keyfile"):
        if name in options and not Path(options[name]).is_file():
            raise BadRedisUrl(f"there is no file {options[name]}, its {name}")
    return options


def _address(text: str) -> tuple[str, int]:
    if not text:
        raise BadRedisUrl(f"names no sentinels: {_FORM}")
    found = _ADDRESS.fullmatch(text)
    if found is None or int(found["port"] or 0) > _HIGHEST_PORT:
        raise _unreadable()
    if found["ipv6"]:
        try:
            IPv6Address(found["ipv6"])
        except ValueError:
            raise _unreadable() from None
    return found["ipv6"] or found["name"], int(found["port"] or _SENTINEL_PORT)


def _unreadable() -> BadRedisUrl:
    return BadRedisUrl(
        "cannot be read; in a password, all but letters, digits and -._~ is written as % and two "
        "hexadecimal digits"
    )


def is_loopback(host: str) -> bool:
    """Whether this name or address, without a port, can only mean this machine."""
    if host.lower() == "localhost":
        return True
    try:
        if host.startswith("[") and host.endswith("]"):
            return IPv6Address(host[1:-1]).is_loopback
        return ip_address(host).is_loopback
    except ValueError:
        return False
