"""Random damage to files of any kind: to bytes, to words of text, to the values of JSON, and inside zip archives.

Nothing from skillframe is used. `mutated(name, content, rng)` gives other content; the ending of the name says what
besides bytes can be damaged.
"""

import io
import json
import random
import re
import zipfile

NUMBER = re.compile(rb"-?\d+\.?\d*(?:[eE][-+]?\d+)?")
NUMBERS = (
    b"0", b"-1", b"1e300", b"-1e300", b"1e-300", b"1e400", b"nan", b"inf", b"-inf", b"NaN", b"Infinity", b"9" * 41,
    b"9" * 5000, b"18446744073709551616", b"-9223372036854775809", b"2147483648", b"0x10", b"true", b'""', b"[]", b"{}",
    b"null", b"1979-05-27", b"",
)  # fmt: skip
WORDS = (
    b"[" * 3000, b"[" * 200 + b"]" * 200, b'{"a":' * 300, b"\\ud800", b"\xff\xfe", b"\x00", b"\n\n", b"=", b'"', b"'''",
    b"a.b.c.d=1\n", b"\xed\xa0\x80", b"../../x", b"https://example.org/", b"&amp;", b"<!DOCTYPE a>", b"e" * 10_000,
)  # fmt: skip
ODD = (
    None, True, "", "x", "\ud800", "../x", -1, 0, 2.5, 10**41, 10**400, 1e300, -1e300, float("nan"), float("inf"), [],
    {}, [[]], [1, 2], {"a": 1}, [None] * 3, "e" * 10_000,
)  # fmt: skip
TEXT = (".csv", ".txt", ".toml", ".json", ".jsonl", ".urdf", ".xml")
ZIPS = (".npz", ".fmu")


def mutated(name, content, rng):
    """Other content for a file of this name."""
    ways = [bytes_changed]
    if name.endswith(TEXT):
        ways += [words_changed] * 3
    if name.endswith((".json", ".jsonl")):
        ways += [json_changed] * 4
    if name.endswith(ZIPS):
        ways += [zip_changed] * 5
    made = rng.choice(ways)(content, rng)
    return made if rng.random() < 0.8 else bytes_changed(made, rng)


def bytes_changed(content, rng):
    """Flips, a cut, a part twice, a part from elsewhere, a part gone, zeros, random bytes."""
    size = len(content)
    a, b = sorted(rng.randrange(size + 1) for _ in range(2))
    b = min(b, a + rng.choice((1, 4, 40, size)))
    at = rng.randrange(size + 1)
    way = rng.randrange(8)
    if way <= 1 and size:
        made = bytearray(content)
        for _ in range(rng.choice((1, 1, 2, 8, 64))):
            made[rng.randrange(size)] ^= 1 << rng.randrange(8)
        return bytes(made)
    return {
        2: content[:at], 3: content[:b] + content[a:b] + content[b:], 4: content[:at] + content[a:b] + content[at:],
        5: content[:a] + content[b:], 6: content[:a] + bytes(b - a) + content[b:],
    }.get(way, content[:a] + rng.randbytes(min(b - a, 4000)) + content[b:])  # fmt: skip


def words_changed(content, rng):
    """A number for another, a word anywhere, a line gone, twice, or moved."""
    way, lines = rng.randrange(5), content.splitlines(keepends=True)
    places = list(NUMBER.finditer(content))
    if way <= 1 and places:
        for place in sorted(rng.sample(places, min(len(places), rng.choice((1, 1, 3)))), key=lambda m: -m.start()):
            content = content[: place.start()] + rng.choice(NUMBERS) + content[place.end() :]
        return content
    if way == 2 or not lines:
        at = rng.randrange(len(content) + 1)
        return content[:at] + rng.choice(WORDS) + content[at:]
    line = lines.pop(rng.randrange(len(lines)))
    if way == 3:
        lines[rng.randrange(len(lines) + 1) :] = [line, line]
    return b"".join(lines)


def json_changed(content, rng):
    """One value of another kind, a key gone, a key more, a value nested deeply. Of lines, in one of them."""
    lines = content.split(b"\n")
    whole = len(lines) < 2 or rng.random() < 0.1 or not lines[0].rstrip().endswith(b"}")
    i = rng.randrange(len(lines))
    try:
        document = json.loads(content if whole else lines[i])
    except ValueError:
        return words_changed(content, rng)
    document = value_changed(document, rng)
    made = json.dumps(document, default=str).encode()
    if whole:
        return made
    lines[i] = made
    return b"\n".join(lines)


def value_changed(document, rng):
    """One value changed, anywhere: deep ones as likely as shallow ones, because the walk stops with one in four."""
    if not isinstance(document, (dict, list)) or not document or rng.random() < 0.05:
        return nested(document, rng) if rng.random() < 0.1 else rng.choice(ODD)
    keys = list(document) if isinstance(document, dict) else range(len(document))
    key = rng.choice(keys)
    way = rng.random()
    if way < 0.12:
        del document[key]
    elif way < 0.16 and isinstance(document, dict):
        document["surprise"] = rng.choice(ODD)
    elif way < 0.4:
        document[key] = rng.choice(ODD)
    else:
        document[key] = value_changed(document[key], rng)
    return document


def nested(value, rng):
    for _ in range(rng.choice((60, 150, 400))):
        value = [value] if rng.random() < 0.5 else {"a": value}
    return value


def zip_changed(content, rng):
    """A member damaged, gone, renamed, of zeros, or claiming gigabytes, in an archive that is right otherwise."""
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            members = {info.filename: archive.read(info) for info in archive.infolist()}
    except Exception:
        return bytes_changed(content, rng)
    name = rng.choice(sorted(members))
    way = rng.randrange(9)
    if way <= 3:
        members[name] = member_changed(name, members[name], rng)
    elif way == 4:
        del members[name]
    elif way == 5:
        members[rng.choice(("x.npy", "../x", "a" * 300, "\u00e4.npy", "x"))] = members.pop(name)
    elif way == 6:
        members[name] = members[rng.choice(sorted(members))]
    elif way == 7:
        members[name] = npy_header((rng.choice((10**9, 10**14, 0, -1)),)) + bytes(80)
    else:
        members["zeros.npy"] = npy_header((10**6,)) + bytes(8 * 10**6)
    packed = rng.choice((zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED, zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA))
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", packed if rng.random() < 0.3 else zipfile.ZIP_DEFLATED) as archive:
        for member, inside in members.items():
            archive.writestr(member, inside)
    made = bytearray(buffer.getvalue())
    if rng.random() < 0.15:  # sizes, flags and offsets of the directory at the end
        for _ in range(rng.choice((1, 4))):
            made[-rng.randrange(1, min(200, len(made)))] = rng.randrange(256)
    return bytes(made)


def member_changed(name, content, rng):
    """The JSON text of a `meta` array, an XML text, or bytes."""
    if name == "meta.npy" and content.startswith(b"\x93NUMPY"):
        length = int.from_bytes(content[8:10], "little")
        text = content[10 + length :].decode("utf-32-le", "replace")
        try:
            text = json.dumps(value_changed(json.loads(text), rng))
        except ValueError:
            return bytes_changed(content, rng)
        return npy_header((), f"<U{len(text)}") + text.encode("utf-32-le", "surrogatepass")
    return words_changed(content, rng) if name.endswith(TEXT) else bytes_changed(content, rng)


def npy_header(shape, kind="<f8"):
    header = f"{{'descr': '{kind}', 'fortran_order': False, 'shape': {shape}, }}".encode().ljust(117) + b"\n"
    return b"\x93NUMPY\x01\x00" + len(header).to_bytes(2, "little") + header


def numbers_typed(rng):
    """A number as somebody may type it."""
    return random.Random(rng.random()).choice([n.decode() for n in NUMBERS if n])
