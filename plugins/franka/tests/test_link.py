"""The link to a Franka Research 3, with a client library in the place of pylibfranka."""

import enum
import sys
from types import SimpleNamespace

import pytest
from skillframe_franka.link import FrankaLink

Mode = enum.Enum("Mode", ["Idle", "Reflex", "UserStopped"])


@pytest.mark.parametrize(("mode", "fault"), [(Mode.Idle, ""), (Mode.Reflex, "mode Reflex"), (Mode.UserStopped, "mode")])
def test_a_robot_that_is_stopped_before_a_run_is_named_by_the_check(monkeypatch, mode, fault):
    state = SimpleNamespace(robot_mode=mode, time=SimpleNamespace(to_sec=float), q=[0.0], dq=[0.0], O_F_ext_hat_K=[0.0])
    library = SimpleNamespace(
        RobotMode=Mode, RealtimeConfig=SimpleNamespace(kIgnore=0),
        Robot=lambda host, config: SimpleNamespace(read_once=lambda: state),
    )  # fmt: skip
    monkeypatch.setitem(sys.modules, "pylibfranka", library)
    link = FrankaLink("127.0.0.1")
    link.read()
    assert (fault in link.fault) if fault else link.fault == ""
