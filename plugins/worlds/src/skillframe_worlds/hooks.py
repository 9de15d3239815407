"""The plug-in's hooks."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

from skillframe import hookimpl
from skillframe.extend import WorldType
from skillframe.world import Scene
from skillframe_worlds import (
    bayonet,
    corner,
    edge,
    free,
    funnel,
    hose_coupler,
    hump,
    lid,
    pallets,
    peg_in_hole,
    pit,
    socket,
    task_board,
    valley,
)

skillframe_contract = "0.2"


@hookimpl
def skillframe_worlds() -> Iterable[WorldType]:
    """The shipped worlds."""
    worlds: tuple[tuple[str, str, type, Callable[[Any], Scene]], ...] = (
        ("free", "empty space", free.FreeParams, free.build),
        ("valley", "two slopes to slide down", valley.ValleyParams, valley.build),
        ("funnel", "slopes around a point", funnel.FunnelParams, funnel.build),
        ("edge", "a table's edge to lever on", edge.EdgeParams, edge.build),
        ("peg_in_hole", "a filleted peg, a hole with 0.25 mm of play", peg_in_hole.PegParams, peg_in_hole.build),
        ("hose_coupler", "two coupler faces to align", hose_coupler.HoseParams, hose_coupler.build),
        ("socket", "a plug with two pins and a key, and its socket", socket.SocketParams, socket.build),
        ("corner", "a box to set down and push into a corner", corner.CornerParams, corner.build),
        ("hump", "a floor, a ramp to pass and a pocket behind it, in any orientation", hump.HumpParams, hump.build),
        ("pit", "two or three faces that meet, in any orientation", pit.PitParams, pit.build),
        ("lid", "a lid to push shut about its hinge", lid.LidParams, lid.build),
        ("bayonet", "a cap with two pins to push and turn at once", bayonet.BayonetParams, bayonet.build),
        ("task_board", "five places on a board that can be moved: hole, slot, button, groove, corner",
         task_board.BoardParams, task_board.build),
        ("pallets", "a stack of pallets and a stop, for machines", pallets.PalletsParams, pallets.build),
    )  # fmt: skip
    for name, summary, params, build in worlds:
        yield WorldType(name=name, summary=summary, params=params, build=build)
