"""The link to a Universal Robot, with a client library in the place of ur_rtde."""

import gc
import sys
from types import SimpleNamespace

import pytest
from skillframe_ur.link import UrLink


@pytest.mark.parametrize("fault", ["", "no state from the robot for 100 ms"])
def test_the_client_library_is_not_destroyed_at_the_end_which_waits_for_a_second_or_to_connect_again(
    monkeypatch, fault
):
    called = []

    class Client:
        def __init__(self, *_):
            pass

        def __getattr__(self, name):
            return lambda *_: called.append(name)

        def __del__(self):
            called.append("destroyed")

    for module, name in (("rtde_control", "RTDEControlInterface"), ("rtde_receive", "RTDEReceiveInterface")):
        monkeypatch.setitem(sys.modules, module, SimpleNamespace(**{name: Client}))
    link = UrLink("127.0.0.1")
    link.fault = fault
    link.close()
    del link
    gc.collect()
    assert called == ([] if fault else ["stopScript", "disconnect", "disconnect"])
