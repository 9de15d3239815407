"""Ways in which recordings arrive broken, done to text and to zip archives by hand. Nothing from skillframe is used.

`TEXT` damages a table's cells (rows of strings, the header first), `BYTES` a whole text file, `META` writes metadata
beside a sound one, `ARRAYS` damages an npz's arrays and `ARCHIVES` the archive itself. Each is one refusal.
"""

import io
import json
import struct
import zipfile

import numpy as np

FORMAT = {"format": "skillframe.demonstration", "version": 1}
WRENCH = ("fx", "fy", "fz", "tx", "ty", "tz")


def cell(row, column, value):
    def damage(rows):
        rows[row][rows[0].index(column)] = value
        return rows

    return damage


def whole(value, *columns):
    def damage(rows):
        for row in rows[1:]:
            for column in columns:
                row[rows[0].index(column)] = value
        return rows

    return damage


def without(*columns):
    def damage(rows):
        keep = [i for i, name in enumerate(rows[0]) if name not in columns]
        return [[row[i] for i in keep] for row in rows]

    return damage


def turned_half(rows):
    """From the middle on, another attitude."""
    q = [rows[0].index(name) for name in ("qx", "qy", "qz", "qw")]
    for row in rows[len(rows) // 2 :]:
        x, y, z, w = (float(row[i]) for i in q)
        for i, v in zip(q, (w, z, -y, -x), strict=True):
            row[i] = repr(v)
    return rows


def w_first(rows):
    i = rows[0].index("qx")
    return [[*row[:i], row[i + 3], *row[i : i + 3], *row[i + 4 :]] for row in rows]


TEXT = {
    "NaN": cell(5, "fy", "NaN"),
    "infinity": cell(5, "px", "-inf"),
    "too large": cell(5, "fz", "1e400"),
    "a word": cell(5, "tz", "n/a"),
    "empty cell": cell(5, "py", ""),
    "hexadecimal": cell(5, "fz", "0x1F"),
    "python's underscore": cell(5, "fz", "1_0"),
    "other digits": cell(5, "fz", "\u0661\u0662"),
    "a date for a time": cell(5, "t", "2026-01-01T00:00:00"),
    "time stands": whole("1.0", "t"),
    "time runs back": lambda rows: cell(9, "t", rows[3][rows[0].index("t")])(rows),
    "no clock": without("t"),
    "no attitude": without("qx", "qy", "qz", "qw"),
    "no wrench": without(*WRENCH),
    "no position": without("px", "py", "pz"),
    "half a force": without("fz"),
    "dead wrench": whole("0.0", *WRENCH),
    "stuck wrench": whole("1.25", *WRENCH),
    "no unit quaternion": cell(7, "qx", "3.0"),
    "zero quaternions": whole("0.0", "qx", "qy", "qz", "qw"),
    "w first": w_first,
    "attitude jumps": turned_half,
    "short row": lambda rows: [*rows[:6], rows[6][:-2], *rows[7:]],
    "long row": lambda rows: [*rows[:6], [*rows[6], "1"], *rows[7:]],
    "cut off": lambda rows: [*rows[:-1], rows[-1][:4]],
    "header only": lambda rows: rows[:1],
    "one row": lambda rows: rows[:2],
    "no header": lambda rows: rows[1:],
    "another header": lambda rows: [[f"column{i}" for i in range(len(rows[0]))], *rows[1:]],
    "capitals": lambda rows: [[name.upper() for name in rows[0]], *rows[1:]],
    "column twice": lambda rows: [[name.replace("fy", "fx") for name in rows[0]], *rows[1:]],
    "header twice": lambda rows: [*rows[:9], rows[0], *rows[9:]],
    "row of units": lambda rows: [rows[0], ["s", *["m"] * (len(rows[0]) - 1)], *rows[1:]],
}
BYTES = {
    "empty": lambda text: b"",
    "blank": lambda text: b" \n\n",
    "utf-16": lambda text: text.encode("utf-16"),
    "utf-16 without a mark": lambda text: text.encode("utf-16-le"),
    "utf-32": lambda text: text.encode("utf-32"),
    "a zero byte": lambda text: text.encode()[:300] + b"\0" + text.encode()[300:],
    "random": lambda text: np.random.default_rng(0).bytes(4000),
    "a web page": lambda text: b"<html><body>404</body></html>\n",
    "a pointer to a large file": lambda text: b"version https://git-lfs.github.com/spec/v1\noid sha256:abc\nsize 1\n",
    "decimal commas between commas": lambda text: text.replace(".", ",").encode(),
    "another separator": lambda text: text.replace(",", "|").encode(),
    "a huge header": lambda text: b"x" * 1_000_000 + b"\n1\n",
    "too many columns": lambda text: b",".join([b"c%d" % i for i in range(9000)]) + b"\n" + b",".join([b"1"] * 9000),
}
META = {
    "frame": 'wrench.frame = "flange"',
    "sign": 'wrench.sign = "robot"',
    "weight": 'wrench.includes_tool_weight = "yes"',
    "no table": 'wrench = "base"',
    "point": 'wrench.point = "nowhere"',
    "half a point": "wrench.point = [0, 0]",
    "mass": "wrench.includes_tool_weight = true\nwrench.tool_mass = -2.0",
    "frames": "frames = [1, 2]",
    "frame of words": '[frames]\nhand = ["a", "b", "c"]',
    "hand": "hand = 5",
    "noise": 'sensor.force_noise = "low"',
    "contact": 'contact = "no"',
    "w first": 'quaternion = "wxyz"',
    "scalar first": '[orientation]\nconvention = "scalar-first"',
    "no value": "= 3",
    "cut off": 'task = "peg',
}


def replaced(**arrays):
    return lambda file: {**file, **arrays}


def meta(**changes):
    return lambda file: {**file, "meta": json.dumps({**FORMAT, **changes})}


def spoiled(name, change):
    def damage(file):
        values = file[name].copy()
        change(values)
        return {**file, name: values}

    return damage


ARRAYS = {
    "no metadata": lambda file: {name: v for name, v in file.items() if name != "meta"},
    "metadata that are a list": replaced(meta="[1]"),
    "metadata cut off": replaced(meta='{"format"'),
    "metadata nested without end": replaced(meta="[" * 50_000),
    "metadata of numbers": replaced(meta=np.arange(3)),
    "another format": meta(format="other"),
    "a newer version": meta(version=2),
    "a version in words": meta(version="1"),
    "frame": meta(wrench={"frame": "world"}),
    "pickled": replaced(fx=np.array([1, None], dtype=object)),
    "pickled metadata": replaced(meta=np.array({"a": 1}, dtype=object)),
    "a column": lambda file: {**file, "fx": file["fx"][:, None]},
    "lengths": lambda file: {**file, "fx": file["fx"][:-3]},
    "complex": lambda file: {**file, "fx": file["fx"] + 1j},
    "text": lambda file: {**file, "fx": file["fx"].astype("U")},
    "dates": lambda file: {**file, "t": (1e9 * file["t"]).astype("datetime64[ns]")},
    "a channel is missing": lambda file: {name: v for name, v in file.items() if name != "tz"},
    "no rows": lambda file: {name: v if name == "meta" else v[:0] for name, v in file.items()},
    "one row": lambda file: {name: v if name == "meta" else v[:1] for name, v in file.items()},
    "NaN": spoiled("fz", lambda v: v.__setitem__(17, np.nan)),
    "time stands": spoiled("t", lambda v: v.__setitem__(slice(None), v[16])),
}


def archive(**members):
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as file:
        for name, content in members.items():
            file.writestr(name, content)
    return buffer.getvalue()


def array_header(shape):
    header = f"{{'descr': '<f8', 'fortran_order': False, 'shape': {shape}, }}".encode().ljust(117) + b"\n"
    return b"\x93NUMPY\x01\x00" + struct.pack("<H", 118) + header


def one_array():
    buffer = io.BytesIO()
    np.save(buffer, np.arange(5.0))
    return buffer.getvalue()


ARCHIVES = {
    "empty": lambda raw: b"",
    "four bytes": lambda raw: raw[:4],
    "half": lambda raw: raw[: len(raw) // 2],
    "the last bytes are missing": lambda raw: raw[:-10],
    "one byte is wrong": lambda raw: (
        raw[: len(raw) // 2] + bytes([raw[len(raw) // 2] ^ 255]) + raw[len(raw) // 2 + 1 :]
    ),
    "text": lambda raw: b"t,px\n1,2\n",
    "random": lambda raw: np.random.default_rng(1).bytes(4000),
    "an array alone": lambda raw: one_array(),
    "an archive of nothing": lambda raw: archive(),
    "an archive of text": lambda raw: archive(readme="hello"),
    "an array of blanks": lambda raw: archive(
        **{"t.npy": b"\x93NUMPY\x01\x00" + struct.pack("<H", 60000) + b" " * 60000}
    ),
    "an array without end": lambda raw: archive(**{"t.npy": array_header((10**14,)) + bytes(80)}),
}
