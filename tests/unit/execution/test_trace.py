import numpy as np
import pytest

from skillframe.errors import InputError
from skillframe.execution.trace import FORMAT, VERSION, Trace
from tests.laws.pushing import Push, impedance
from tests.laws.runs import run, setup


@pytest.fixture
def trace():
    skill = Push((0.0, 0.0, -1.0), impedance(free_axes="x"), stall=False)
    return run(skill, setup(), duration_s=0.05, trace_hz=100).traces[0]


def test_a_trace_survives_its_file_to_the_last_bit(trace, tmp_path):
    trace.save(tmp_path / "deep" / "a.npz")
    again = Trace.load(tmp_path / "deep" / "a.npz")
    for name in Trace.__slots__:
        if name == "meta":
            assert {k: v for k, v in again.meta.items() if k not in ("format", "version")} == trace.meta
        elif name == "machine":
            assert again.machine == {}
        else:
            np.testing.assert_array_equal(getattr(again, name), getattr(trace, name))
            assert getattr(again, name).dtype == getattr(trace, name).dtype
    assert (again.meta["format"], again.meta["version"]) == (FORMAT, VERSION)


def test_nothing_but_the_whole_file_is_left_behind(trace, tmp_path):
    trace.save(tmp_path / "a.npz")
    assert [path.name for path in tmp_path.iterdir()] == ["a.npz"]


def rewrite(path, **changes):
    with np.load(path) as file:
        arrays = {name: file[name] for name in file.files}
    arrays["meta"] = np.array(str(arrays["meta"]).replace(*changes["meta"]))
    np.savez(path, **arrays)


def test_a_newer_version_is_refused(trace, tmp_path):
    trace.save(tmp_path / "a.npz")
    rewrite(tmp_path / "a.npz", meta=(f'"version": {VERSION}', f'"version": {VERSION + 1}'))
    with pytest.raises(InputError, match="newer"):
        Trace.load(tmp_path / "a.npz")


def test_another_kind_of_file_is_refused(trace, tmp_path):
    trace.save(tmp_path / "a.npz")
    rewrite(tmp_path / "a.npz", meta=(FORMAT, "something.else"))
    with pytest.raises(InputError, match=r"something\.else"):
        Trace.load(tmp_path / "a.npz")


@pytest.mark.parametrize("content", [b"", b"not an archive", None])
def test_a_missing_or_broken_file_is_refused_by_name(tmp_path, content):
    path = tmp_path / "broken.npz"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(InputError, match=r"broken\.npz"):
        Trace.load(path)


def test_an_archive_that_lacks_an_array_is_refused_by_name(trace, tmp_path):
    trace.save(tmp_path / "a.npz")
    with np.load(tmp_path / "a.npz") as file:
        arrays = {name: file[name] for name in file.files if name != "wrench"}
    np.savez(tmp_path / "a.npz", **arrays)
    with pytest.raises(InputError, match="wrench"):
        Trace.load(tmp_path / "a.npz")


def test_an_archive_whose_arrays_differ_in_length_is_refused(trace, tmp_path):
    trace.save(tmp_path / "a.npz")
    with np.load(tmp_path / "a.npz") as file:
        arrays = {name: file[name] for name in file.files}
    arrays["wrench"] = arrays["wrench"][:-1]
    np.savez(tmp_path / "a.npz", **arrays)
    with pytest.raises(InputError, match="wrench"):
        Trace.load(tmp_path / "a.npz")
