"""Parts drawn as STEP: their unit, how finely they are cut, and what is said of those that cannot be read."""

from importlib.util import find_spec

import numpy as np
import pytest
from skillframe_parts.load import load
from skillframe_parts.solid import arrays_of, read_part
from skillframe_parts.step import TOLERANCE

from skillframe.cli.main import run
from skillframe.errors import InputError, MissingDependency
from tests.step_files import bush, pin, volume

needs_step = pytest.mark.skipif(find_spec("cascadio") is None, reason="the extra step (cascadio) is not installed")


def written(folder, text, name="plug.step"):
    (folder / name).write_text(text)
    return folder / name


def said(path, units=None):
    with pytest.raises(InputError) as caught:
        read_part(path, units)
    assert "\n" not in str(caught.value)
    return str(caught.value)


def test_without_the_extra_the_line_to_type_is_said(tmp_path, monkeypatch):
    monkeypatch.setattr("skillframe.errors.find_spec", lambda name: None if name == "cascadio" else find_spec(name))
    path = written(tmp_path, pin(5.0, -12.0, 8.0))
    with pytest.raises(
        MissingDependency, match=r"a part drawn as STEP needs cascadio.*pip install 'skillframe\[step\]'"
    ):
        read_part(path, None)


def test_what_is_no_whole_step_file_is_said_without_the_extra(tmp_path):
    text = pin(5.0, -12.0, 8.0)
    assert "cut off: it has no END-ISO-10303-21" in said(written(tmp_path, text[:2000]))
    assert "does not begin with ISO-10303-21" in said(written(tmp_path, "a drawing"))
    assert "says its own unit" in said(written(tmp_path, text, "plug.stp"), "mm")


@needs_step
@pytest.mark.parametrize(("unit", "scale"), [("mm", 1.0), ("m", 1e-3)])
def test_a_pin_has_its_size_whatever_its_unit_and_its_facets_keep_the_tolerance(tmp_path, unit, scale):
    part = read_part(written(tmp_path, pin(5.0 * scale, -12.0 * scale, 8.0 * scale, unit)), None)
    vertices, faces = arrays_of(part.solid)
    assert np.hypot(*vertices[:, :2].T).max() == pytest.approx(5e-3, rel=1e-6)  # single precision in the file
    assert np.ptp(vertices[:, 2]) == pytest.approx(0.02, rel=1e-6) and vertices[:, 2].min() == pytest.approx(
        -0.012, rel=1e-6
    )
    sides = vertices[faces][np.ptp(vertices[faces][:, :, 2], axis=1) > 0.01]
    middles = 0.5 * (sides[:, :, :2] + np.roll(sides[:, :, :2], 1, axis=1))
    sag = 5e-3 - np.hypot(middles[..., 0], middles[..., 1])
    assert 0.1 * TOLERANCE < sag.max() < TOLERANCE
    # n facets of sag s < TOLERANCE: the area is 1 - 4 s / 3 R of the circle's
    assert part.solid.volume() == pytest.approx(volume(5e-3, 0.02), rel=4.0 * TOLERANCE / 3.0 / 5e-3 + 1e-6)
    assert part.notes == ("plug.step was cut into triangles within 5 um of what was drawn",)


@pytest.mark.slow
@needs_step
def test_two_drawings_become_a_world_whose_contact_error_has_the_tolerance(tmp_path, capsys):
    written(tmp_path, pin(5.0, -12.0, 8.0))
    written(tmp_path, bush(9.0, 5.2, 12.0, 5.0), "socket.STP")
    out = tmp_path / "fixture.toml"
    assert (
        run(["worlds", "new", f"{tmp_path}/plug.step", f"{tmp_path}/socket.STP", "--units", "mm", "--out", str(out)])
        == 0
    )
    text = capsys.readouterr().out
    assert "plug.step goes 12 mm deep into socket.STP and comes out along (0, 0, 1)" in text
    assert "note: socket.STP was cut into triangles within 5 um" in text and "units" not in out.read_text()
    found = load(out)
    assert found.fit.clearance == pytest.approx(0.2e-3, abs=2.0 * TOLERANCE)
    assert TOLERANCE <= found.contact_error < TOLERANCE + 4e-6


def test_a_drawing_that_lacks_what_it_goes_by_is_refused(tmp_path):
    """Open CASCADE makes a body of some of these, of other volume and without a word."""
    text = pin(5.0, -12.0, 8.0)
    assert "goes by #7, which is not in it" in said(written(tmp_path, text.replace("#7=", "#7000=")))
    assert "goes by #9, which is not in it" in said(written(tmp_path, text.replace("\n#9=", "\n#9")))


@pytest.mark.slow
@needs_step
def test_a_drawing_that_makes_no_body_is_one_sentence(tmp_path, capfd):
    text = pin(5.0, -12.0, 8.0).replace("'part'", "'part #99999'")
    assert "holds no triangle" in said(written(tmp_path, text.replace("CLOSED_SHELL", "CLOSED_SHLL")))
    assert "open edges" in said(written(tmp_path, text.replace("ADVANCED_FACE", "ADVANCED_FCE", 1)))
    assert "cannot be read as STEP" in said(written(tmp_path, text.replace("ENDSEC;", "", 1)))
    assert capfd.readouterr() == ("", "")


@needs_step
def test_a_drawing_that_takes_too_long_is_stopped_and_said(tmp_path, monkeypatch):
    monkeypatch.setattr("skillframe_parts.step.LONGEST", 1e-3)
    assert "takes longer than 0.001 s" in said(written(tmp_path, pin(5.0, -12.0, 8.0)))
