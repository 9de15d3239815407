"""What a hand does to a JSON document: a key lost or added, another type, a sign, a length, a number beyond reason.

Nothing from skillframe is used. Of a list only its first item is edited: the others are like it.
"""

import copy
import random

GONE, MORE = object(), object()
VALUES = (
    GONE, MORE, None, "x", -1.0, 0, 2.5, 1e300, float("nan"), float("inf"), 10**400, True, [], {}, [1, 2],
    [[1, 2], [3]],
)  # fmt: skip


def places(value, path=()):
    """Every key and first item of a document."""
    if path:
        yield path
    inside = value.items() if isinstance(value, dict) else list(enumerate(value))[:1] if isinstance(value, list) else ()
    for key, item in inside:
        yield from places(item, (*path, key))


def edited(document, path, value):
    """A copy with one thing changed, or None where it cannot be."""
    document = copy.deepcopy(document)
    inside = document
    for key in path[:-1]:
        inside = inside[key]
    if value is GONE:
        del inside[path[-1]]
    elif value is not MORE:
        inside[path[-1]] = value
    elif isinstance(inside[path[-1]], dict):
        inside[path[-1]]["surprise"] = 1
    else:
        return None
    return document


def some(document, count, seed):
    """(path, value, document) of a few edits, drawn from all."""
    all_ = [(path, value) for path in places(document) for value in VALUES]
    for path, value in random.Random(seed).sample(all_, min(count, len(all_))):
        changed = edited(document, path, value)
        if changed is not None:
            yield path, value, changed
