"""Progress of a recording that takes several attempts."""

from skillframe.cli.record import _onwards


def test_seconds_are_counted_on_from_one_attempt_to_the_next():
    seen = []
    watch = _onwards(lambda now, longest: seen.append((now, longest)))
    for now in (0.0, 6.0, 12.0, 0.0, 6.0, 3.0):
        watch(now, 12.0)
    assert seen == [(0.0, 12.0), (6.0, 12.0), (12.0, 12.0), (12.0, 24.0), (18.0, 24.0), (21.0, 30.0)]
