"""The DDS network: participants, and what each end reads and writes."""

from __future__ import annotations

import os
from typing import Any

from cyclonedds.core import Qos
from cyclonedds.domain import DomainParticipant
from cyclonedds.internal import InvalidSample
from cyclonedds.pub import DataWriter
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic

from skillframe.errors import InputError

DOMAIN = "ROS_DOMAIN_ID"
"""Environment variable with ROS 2's domain number, 0 if it is not set."""
SETTINGS = "CYCLONEDDS_URI"
"""Environment variable with Cyclone DDS's settings."""
_GIVEN = os.environ.get(SETTINGS, "")
LOOPBACK = """<CycloneDDS><Domain>
<General><Interfaces><NetworkInterface name="lo" multicast="false"/></Interfaces>
<AllowMulticast>false</AllowMulticast></General>
<Discovery><ParticipantIndex>auto</ParticipantIndex><MaxAutoParticipantIndex>20</MaxAutoParticipantIndex>
<Peers><Peer address="127.0.0.1"/></Peers><LeaseDuration>1 s</LeaseDuration></Discovery></Domain></CycloneDDS>"""
REMOTE = """<CycloneDDS><Domain><General><AllowMulticast>spdp</AllowMulticast></General>
<Discovery><ParticipantIndex>auto</ParticipantIndex><MaxAutoParticipantIndex>32</MaxAutoParticipantIndex>
<Peers><Peer address="{host}"/></Peers><LeaseDuration>1 s</LeaseDuration></Discovery></Domain></CycloneDDS>"""


def participant(host: str) -> DomainParticipant:
    """Join the domain that ROS_DOMAIN_ID names.

    At a loopback address nothing leaves this computer, and nothing beyond it is heard. Otherwise the settings of
    CYCLONEDDS_URI hold, or, if there are none, the computer `host` is asked beside those that multicast finds.

    Raises:
        InputError: no such domain, or settings that Cyclone DDS does not take.
    """
    given = os.environ.get(DOMAIN, "0")
    if not given.isdecimal() or int(given) > 232:
        raise InputError(DOMAIN, f"is {given!r}", "set it to ROS 2's domain number, 0 to 232")
    os.environ[SETTINGS] = settings(host)
    try:
        return DomainParticipant(int(given))
    except Exception as error:
        text = f"no DDS participant can be made ({error})"
        raise InputError(f"domain {given}", text, f"check {SETTINGS}, and the number of participants") from None


def settings(host: str) -> str:
    """Cyclone DDS's settings for the robot's address."""
    if host.startswith("127.") or host in ("localhost", "::1"):
        return LOOPBACK
    return _GIVEN or REMOTE.format(host=host)


def reader(at: DomainParticipant, topic: str, kind: Any, quality: Qos) -> DataReader[Any]:
    """A reader of a topic of ROS 2, by its DDS name."""
    return DataReader(at, Topic(at, topic, kind), qos=quality)


def writer(at: DomainParticipant, topic: str, kind: Any, quality: Qos) -> DataWriter[Any]:
    """A writer of a topic of ROS 2, by its DDS name."""
    return DataWriter(at, Topic(at, topic, kind), qos=quality)


def taken(source: DataReader[Any]) -> list[Any]:
    """The messages that came, the newest last, without notices of writers that went."""
    return [each for each in source.take(16) if not isinstance(each, InvalidSample)]
