"""The farm sends notices to public addresses, and to what its owner names; in no disguise else."""

import pytest

from plateau.service.notices.receivers import ReceiverRefused, Receivers

PUBLIC = ["93.184.215.14", "8.8.8.8", "2606:2800:21f:cb07:6820:80da:af6b:8b2c", "64:ff9b::808:808"]
PRIVATE = [
    *("127.0.0.1", "127.8.8.8", "0.0.0.0", "0.1.2.3", "10.0.0.1", "172.16.0.1", "172.31.255.255"),
    *("192.168.1.1",),
    "169.254.169.254",  # where clouds tell a machine its secrets
    "100.64.0.1",  # carrier-grade NAT
    *("192.0.0.8", "192.88.99.1", "192.0.2.1", "198.18.0.1", "224.0.0.1", "239.255.255.250"),
    *("240.0.0.1", "255.255.255.255", "::", "::1", "fe80::1", "fe80::1%1", "fc00::1"),
    *("fd12:3456:789a::1", "fec0::1", "ff02::1", "ff0e::1", "2001:db8::1", "100::1", "3fff::1"),
    *("5f00::1", "64:ff9b:1::a00:1"),
    "2001::7f00:1",  # Teredo
    *("::ffff:127.0.0.1", "::ffff:10.0.0.1", "::ffff:a9fe:a9fe", "::127.0.0.1"),
    *("64:ff9b::7f00:1", "64:ff9b::a9fe:a9fe", "2002:7f00:1::", "2002:a00:1::1", "fd00:ec2::254"),
]


def bracketed(address: str) -> str:
    return f"[{address}]" if ":" in address else address


def names(*found: str) -> Receivers:
    """Receivers for which every name has these addresses."""
    return Receivers(look_up=lambda *_: list(found))


@pytest.mark.parametrize("address", PRIVATE)
def test_a_private_address_is_refused_as_it_is_written_and_where_a_name_means_it(
    address: str,
) -> None:
    with pytest.raises(ReceiverRefused, match="PLATEAU_WEBHOOK_ALLOW"):
        Receivers().check(f"https://{bracketed(address)}/hook")
    with pytest.raises(ReceiverRefused, match="no public address"):
        names(address).addresses("hook.example", 443, plain=False)
    # And beside a public one
    for found in ((PUBLIC[0], address), (address, PUBLIC[0])):
        with pytest.raises(ReceiverRefused):
            names(*found).addresses("hook.example", 443, plain=False)


@pytest.mark.parametrize("address", PUBLIC)
def test_a_public_address_is_taken(address: str) -> None:
    Receivers().check(f"https://{bracketed(address)}/hook")
    assert names(address).addresses("hook.example", 443, plain=False) == [address]


@pytest.mark.parametrize(
    "host",
    [
        *("127.1", "127.0.1", "2130706433", "017700000001", "0x7f000001", "0x7f.1", "0177.0.0.01"),
        "3232235777",  # 192.168.1.1
        "0xa9fea9fe",  # 169.254.169.254
        *("0", "localhost", "LOCALHOST", "localhost.", "hook.localhost"),
    ],
)
def test_a_disguise_is_refused_at_submission_and_at_the_try(host: str) -> None:
    with pytest.raises(ReceiverRefused):
        Receivers().check(f"https://{host}/hook")
    # The system's own resolver, as the deliverer uses it
    with pytest.raises(ReceiverRefused):
        Receivers().addresses(host, 443, plain=False)


def test_http_is_for_those_that_are_allowed() -> None:
    for url in ("http://studio.example/", "http://8.8.8.8/"):
        with pytest.raises(ReceiverRefused, match="use https"):
            Receivers().check(url)
    with pytest.raises(ReceiverRefused, match="use https"):
        names("8.8.8.8").addresses("studio.example", 80, plain=True)
    lab = Receivers(("10.0.0.0/8", "hooks.lab"), look_up=lambda *_: ["10.1.2.3"])
    lab.check("http://10.1.2.3/")
    lab.check("http://hooks.lab/")
    assert lab.addresses("hooks.lab", 80, plain=True) == ["10.1.2.3"]
    assert lab.addresses("anything.example", 80, plain=True) == ["10.1.2.3"]


@pytest.mark.parametrize(
    ("entry", "allowed", "refused"),
    [
        ("127.0.0.1", "127.0.0.1", "127.0.0.2"),
        ("192.168.0.0/16", "192.168.7.7", "10.0.0.1"),
        ("192.168.7.9/16", "192.168.7.7", "10.0.0.1"),
        ("127.0.0.0/8", "127.1", "0"),
        ("10.0.0.0/8", "[::ffff:10.0.0.1]", "[::ffff:11.0.0.1]"),
        ("::1", "[::1]", "127.0.0.1"),
        ("fd00::/8", "[fd12::1]", "[fe80::1]"),
        ("localhost", "localhost", "127.0.0.1"),
    ],
)
def test_a_network_or_a_name_is_allowed_and_nothing_else(
    entry: str, allowed: str, refused: str
) -> None:
    receivers = Receivers((entry,))
    receivers.check(f"https://{allowed}/")
    receivers.check(f"http://{allowed}:8080/")
    with pytest.raises(ReceiverRefused):
        receivers.check(f"https://{refused}/" if refused != "[::ffff:11.0.0.1]" else "http://11.1/")


def test_a_host_without_an_address() -> None:
    with pytest.raises(ReceiverRefused, match="has no address"):
        Receivers().addresses("no.such.host.invalid", 443, plain=False)
    with pytest.raises(ReceiverRefused, match="has no address"):
        Receivers().addresses("a" * 64 + ".example", 443, plain=False)
    with pytest.raises(ReceiverRefused, match="has no address"):
        names().addresses("empty.example", 443, plain=False)
