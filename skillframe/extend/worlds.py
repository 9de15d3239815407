"""The list of worlds that ship with the core."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from skillframe.config import build
from skillframe.extend.records import WorldType
from skillframe.world.scene import Scene
from skillframe.world.worlds import (
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


def world_types() -> Iterable[WorldType]:
    """Records of the core's worlds."""
    yield WorldType(name="free", summary="empty space", params=free.FreeParams, build=free.build)
    yield WorldType(name="valley", summary="two slopes to slide down", params=valley.ValleyParams, build=valley.build)
    yield WorldType(name="funnel", summary="slopes around a point", params=funnel.FunnelParams, build=funnel.build)
    yield WorldType(name="edge", summary="a table's edge to lever on", params=edge.EdgeParams, build=edge.build)
    yield WorldType(
        name="peg_in_hole", summary="a filleted peg, a hole with 0.25 mm of play", params=peg_in_hole.PegParams,
        build=peg_in_hole.build,
    )  # fmt: skip
    yield WorldType(
        name="hose_coupler", summary="two coupler faces to align", params=hose_coupler.HoseParams,
        build=hose_coupler.build,
    )  # fmt: skip
    yield WorldType(
        name="socket", summary="a plug with two pins and a key, and its socket", params=socket.SocketParams,
        build=socket.build,
    )  # fmt: skip
    yield WorldType(
        name="corner", summary="a box to set down and push into a corner", params=corner.CornerParams,
        build=corner.build,
    )  # fmt: skip
    yield WorldType(
        name="hump", summary="a floor, a ramp to pass and a pocket behind it, in any attitude", params=hump.HumpParams,
        build=hump.build,
    )  # fmt: skip
    yield WorldType(
        name="pit", summary="two or three faces that meet, in any attitude", params=pit.PitParams, build=pit.build,
    )  # fmt: skip
    yield WorldType(
        name="lid", summary="a lid to push shut about its hinge", params=lid.LidParams, build=lid.build,
    )  # fmt: skip
    yield WorldType(
        name="bayonet", summary="a cap with two pins to push and turn at once", params=bayonet.BayonetParams,
        build=bayonet.build,
    )  # fmt: skip
    yield WorldType(
        name="task_board", summary="five places on a board that can be moved: hole, slot, button, groove, corner",
        params=task_board.BoardParams, build=task_board.build,
    )  # fmt: skip
    yield WorldType(
        name="pallets", summary="a stack of pallets and a stop, for machines", params=pallets.PalletsParams,
        build=pallets.build,
    )  # fmt: skip


def make_scene(record: WorldType, params: Mapping[str, Any]) -> Scene:
    """The scene of a world with some parameters set, checked by name and type.

    Raises:
        InputError: an unknown parameter (with a suggestion) or one out of range.
    """
    import dataclasses

    values: Any = build(record.params, params, f"world.{record.name}")
    scene = record.build(values)
    return dataclasses.replace(scene, params={**scene.params, **dataclasses.asdict(values)})
