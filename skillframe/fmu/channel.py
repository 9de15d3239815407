"""Messages between this process and one that runs foreign code, over a socket.

A message is a head (a token of the channel, the message's number, its length) and its bytes. What stray or forged bytes
do to it is found out: another token, a number out of turn, or a length above what the receiver takes. One deadline
holds for a whole message, however slowly it comes.
"""

from __future__ import annotations

import socket
import struct
from time import monotonic

HEAD = struct.Struct("<QII")
CHUNK = 1 << 16


class Garbled(Exception):
    """Bytes came that are not a message of this channel. The text says what they are."""


class Channel:
    """One end.

    Args:
        end: a connected stream socket, taken over.
        token: number that both ends know, below 2**64.
    """

    def __init__(self, end: socket.socket, token: int) -> None:
        self.end, self._token = end, token
        self._sent = self._taken = 0
        self._rest = b""

    def send(self, message: bytes, limit_s: float | None = None) -> None:
        """Send a message, within a time. Raises OSError if the other end has gone or does not read."""
        self.end.settimeout(limit_s)
        self._sent = (self._sent + 1) & 0xFFFFFFFF
        self.end.sendall(HEAD.pack(self._token, self._sent, len(message)) + message)

    def receive(self, most: int, until: float | None = None) -> bytes:
        """The next message of `most` bytes at most, by a time of the monotonic clock.

        Raises:
            TimeoutError, EOFError, OSError: too late, or the other end has closed.
            Garbled: what came is no message, or a longer one.
        """
        data = self._filled(self._rest, HEAD.size, until)
        token, number, length = HEAD.unpack_from(data)
        self._taken = (self._taken + 1) & 0xFFFFFFFF
        if token != self._token or number != self._taken:
            raise Garbled("stray bytes")
        if length > most:
            raise Garbled(f"a message of {length} bytes, where {most} are the most")
        end = HEAD.size + length
        data = self._filled(data, end, until)
        self._rest = data[end:]
        return data[HEAD.size : end]

    def _filled(self, data: bytes, size: int, until: float | None) -> bytes:
        """At least `size` bytes, those that are there first."""
        if len(data) >= size:
            return data
        parts, have = [data], len(data)
        while have < size:
            if until is not None:
                self.end.settimeout(max(1e-6, until - monotonic()))
            part = self.end.recv(CHUNK)
            if not part:
                raise EOFError
            parts.append(part)
            have += len(part)
        return b"".join(parts)

    def close(self) -> None:
        """Close this end."""
        self.end.close()
