"""Messages over a socket: what is none, comes out of turn, is too long or too slow is refused."""

import socket
import threading
import time

import pytest

from skillframe.fmu.child import HEAD, Channel, Garbled

TOKEN = 2**63 + 5


@pytest.fixture
def ends():
    """A bare socket that anyone may write to, and a channel at its other end."""
    bare, end = socket.socketpair()
    yield bare, Channel(end, TOKEN)
    bare.close()
    end.close()


def message(number, body, token=TOKEN):
    return HEAD.pack(token, number, len(body)) + body


def test_messages_come_as_they_were_sent_however_they_are_cut(ends):
    bare, channel = ends
    sent = [b"", b"one", bytes(200_000)]
    data = b"".join(message(k + 1, body) for k, body in enumerate(sent))
    sender = threading.Thread(target=lambda: [bare.sendall(data[k : k + 7000]) for k in range(0, len(data), 7000)])
    sender.start()
    assert [channel.receive(10**6) for _ in sent] == sent
    sender.join()


@pytest.mark.parametrize(
    "then", [message(1, b"again"), message(3, b"ahead"), message(2, b"of another", TOKEN + 1), b"stray bytes, many"]
)
def test_what_is_not_the_next_message_is_stray(ends, then):
    """The number tells an answer that was forged: the true one behind it comes out of turn."""
    bare, channel = ends
    bare.sendall(message(1, b"first") + then)
    assert channel.receive(100) == b"first"
    with pytest.raises(Garbled, match="stray bytes"):
        channel.receive(100)


def test_a_message_longer_than_expected_is_refused_before_it_comes(ends):
    bare, channel = ends
    bare.sendall(HEAD.pack(TOKEN, 1, 101))
    with pytest.raises(Garbled, match="a message of 101 bytes, where 100 are the most"):
        channel.receive(100, time.monotonic() + 10.0)


def test_one_deadline_holds_for_a_message_that_drips(ends):
    bare, channel = ends
    stop = threading.Event()

    def drip():
        for byte in message(1, bytes(1000)):
            if stop.wait(0.02):
                return
            bare.sendall(bytes([byte]))

    dripping = threading.Thread(target=drip)
    dripping.start()
    begun = time.monotonic()
    with pytest.raises(TimeoutError):
        channel.receive(10_000, begun + 0.3)
    assert time.monotonic() - begun < 5.0  # 20 s in all
    stop.set()
    dripping.join()
