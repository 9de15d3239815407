"""RTDE packets against the maker's layout, byte by byte."""

import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st
from skillframe_ur import rtde


def test_a_state_is_laid_out_as_the_guide_says():
    names = ["timestamp", "actual_q", "safety_status_bits", "joint_mode", "no_such_thing", "output_int_register_0"]
    assert [rtde.kind(name) for name in names] == [
        "DOUBLE", "VECTOR6D", "UINT32", "VECTOR6INT32", "NOT_FOUND", "INT32",
    ]  # fmt: skip
    joints = [0.1, 0.2, 0.3, 0.4, 0.5, 0.6]
    found = rtde.packed(names, rtde.layout(names), {"timestamp": 1.5, "actual_q": joints, "safety_status_bits": 1})
    assert found == struct.pack(">d6dI6ii", 1.5, *joints, 1, *[0] * 6, 0)


@given(st.lists(st.tuples(st.sampled_from("VOISPU"), st.binary(max_size=40)), max_size=5), st.integers(1, 9))
def test_packets_are_whole_however_the_stream_is_cut(sent, step):
    stream = b"".join(rtde.packet(what, body) for what, body in sent)
    received, found = bytearray(), []
    for i in range(0, len(stream), step):
        received += stream[i : i + step]
        found += rtde.packets(received)
    assert found == sent and not received


@pytest.mark.parametrize("name", ["actual_TCP_force", "input_double_register_17", "speed_slider_mask"])
def test_every_variable_that_the_client_names_has_a_type(name):
    assert rtde.kind(name) != rtde.UNKNOWN
