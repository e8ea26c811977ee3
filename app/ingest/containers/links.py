"""Link layers: where in a captured frame the IP packet begins.

Numbers are those of the list "Link-Layer Header Types" of tcpdump.org.
"""

from __future__ import annotations

IPV4, IPV6 = 0x0800, 0x86DD
"""EtherTypes of what is looked for."""

_TAGS = (0x8100, 0x88A8, 0x9100, 0x9200)
"""EtherTypes of VLAN tags: 2 octets, then the EtherType of what is inside."""

_LONGEST = 1500
"""An EtherType up to this is the length of an IEEE 802.3 frame."""

_SNAP = bytes.fromhex("aaaa03000000")
"""Header of an IEEE 802.2 frame that has an EtherType all the same, right behind."""

_ETHERTYPE_AT = {1: (12, 14), 113: (14, 16), 276: (0, 20)}
"""Link type -> where the EtherType is, octets before what it tells of."""

_BARE = {0: 4, 12: 0, 14: 0, 101: 0, 108: 4, 228: 0, 229: 0}
"""Link type without an EtherType -> octets before the IP packet, which tells its version itself."""

_NAMES = {
    0: "BSD loopback", 1: "Ethernet", 6: "token ring", 9: "PPP", 12: "raw IP", 14: "raw IP", 50: "PPP over HDLC",
    51: "PPPoE", 101: "raw IP", 104: "Cisco HDLC", 105: "IEEE 802.11", 108: "OpenBSD loopback",
    113: "Linux cooked", 127: "IEEE 802.11 with radiotap", 147: "user 0", 187: "Bluetooth", 189: "Linux USB",
    192: "PPI", 195: "IEEE 802.15.4", 197: "ERF", 220: "Linux USB", 227: "CAN", 228: "IPv4", 229: "IPv6",
    239: "NFLOG", 249: "USBPcap", 253: "netlink", 258: "Apple PKTAP", 276: "Linux cooked 2",
}  # fmt: skip


def is_read(link: int) -> bool:
    """Packets of this link type are looked into."""
    return link in _ETHERTYPE_AT or link in _BARE


def name_of(link: int) -> str:
    """The link type for people: its number, what it is, and whether it is read."""
    known = _NAMES.get(link, "")
    return f"{link}{f' ({known})' if known else ''}{'' if is_read(link) else ' not read'}"


def network(link: int, frame: bytes) -> tuple[int, bytes] | None:
    """(IPV4 or IPV6, the packet) in a frame of a link type that is read; None when it holds neither."""
    if link in _BARE:
        at = _BARE[link]
        kind = {4: IPV4, 6: IPV6}.get(frame[at] >> 4, 0) if len(frame) > at else 0
    else:
        where, at = _ETHERTYPE_AT[link]
        kind = int.from_bytes(frame[where : where + 2], "big")
        while kind in _TAGS and len(frame) >= at + 4:
            kind = int.from_bytes(frame[at + 2 : at + 4], "big")
            at += 4
        if kind <= _LONGEST and frame[at : at + 6] == _SNAP:
            kind = int.from_bytes(frame[at + 6 : at + 8], "big")
            at += 8
    return (kind, frame[at:]) if kind in (IPV4, IPV6) and len(frame) > at else None
