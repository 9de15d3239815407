"""Format and completeness of a mesh file, checked by its own counts before it is read.

Layouts: STL (3D Systems 1989), OBJ (Wavefront), PLY (Turk 1994), OFF (Geomview), GLB (Khronos, glTF 2.0 section 4.4),
STEP (ISO 10303-21).
"""

from __future__ import annotations

import json
import re
import struct
from pathlib import Path
from typing import Any

from skillframe.errors import InputError

_AGAIN = "export or download it again"
_FOREIGN = (
    (b"version https://git-lfs", "is a pointer of Git LFS, not the mesh", "type git lfs pull"),
    (b"<!doctype html", "is a web page, not a mesh", "download the file itself"),
    (b"<html", "is a web page, not a mesh", "download the file itself"),
    (b"<?xml", "is an XML file, not a mesh", "export it as STL"),
    (b"\x89png", "is a picture, not a mesh", "export the part itself"),
    (b"\xff\xd8\xff", "is a picture, not a mesh", "export the part itself"),
    (b"%pdf", "is a PDF document, not a mesh", "export the part itself"),
    (b"pk\x03\x04", "is a zip archive, not a mesh", "unpack it"),
    (b"\x1f\x8b", "is a gzip archive, not a mesh", "unpack it"),
)
_FORMATS = ((b"gltf", ".glb"), (b"ply", ".ply"), (b"off", ".off"), (b"iso-10303-21", ".step"))
_FACE = re.compile(rb"^[ \t]*f[ \t]+([^\r\n#]+)", re.MULTILINE)
_VERTEX = re.compile(rb"^[ \t]*v[ \t]", re.MULTILINE)
_LOOKS = ("KHR_materials", "KHR_texture", "KHR_lights")


def check_contents(raw: bytes, path: Path) -> tuple[str, ...]:
    """Refuse a file that is not of its suffix's format, or is incomplete. Returns sentences on ignored content.

    Raises:
        InputError: it is empty, of another format, truncated, or inconsistent.
    """
    kind = ".step" if path.suffix.lower() == ".stp" else path.suffix.lower()
    if not raw.strip():
        raise InputError(path, "is empty: it holds nothing", _AGAIN)
    if kind == ".stl" and _is_binary_stl(raw):
        return ()
    start = raw[:4096].lstrip().lower()
    for mark, what, fix in _FOREIGN:
        if start.startswith(mark):
            raise InputError(path, what, fix)
    found = next((ending for mark, ending in _FORMATS if start.startswith(mark)), "")
    if not found and (_is_binary_stl(raw) or (start.startswith(b"solid") and b"facet" in start)):
        found = ".stl"
    elif not found and b"\0" not in start and _VERTEX.search(start):
        found = ".obj"
    if found not in ("", kind):
        raise InputError(path, f"is {found.upper()[1:]} by its content", f"rename it to {path.stem}{found}")
    checks = {".stl": _check_stl, ".obj": _check_obj, ".ply": _check_ply, ".off": _check_off, ".step": _check_step}
    if kind in checks:
        checks[kind](raw, path)
    return _check_glb(raw, path) if kind == ".glb" else ()


def no_number(raw: bytes, path: Path) -> str:
    """The first invalid number of a text mesh, in brackets, or ""."""
    begins = {".stl": b"vertex", ".obj": b"v"}.get(path.suffix.lower())
    if begins is None or b"\0" in raw:
        return ""
    for count, line in enumerate(raw.splitlines(), start=1):
        words = line.split()
        for word in words[1:] if words[:1] == [begins] else ():
            try:
                float(word)
            except ValueError:
                return f" (line {count} has {word.decode(errors='replace')[:20]!r} in place of a number)"
    return ""


def _is_binary_stl(raw: bytes) -> bool:
    return len(raw) >= 84 and len(raw) == 84 + 50 * struct.unpack_from("<I", raw, 80)[0]


def _check_stl(raw: bytes, path: Path) -> None:
    if raw[:512].lstrip().lower().startswith(b"solid") and b"\0" not in raw[:512]:
        text = raw.lower()
        begun, ended = (len(re.findall(word, text)) for word in (rb"\bfacet\s+normal\b", rb"\bendfacet\b"))
        if begun != ended or b"endsolid" not in text:
            last = "" if b"endsolid" in text else ", without a last line"
            raise InputError(path, f"is cut off: {begun} facets begin and {ended} end{last}", _AGAIN)
        return
    if len(raw) < 84:
        raise InputError(path, f"is cut off: it has {len(raw)} bytes, and the head of an STL has 84", _AGAIN)
    said, held = struct.unpack_from("<I", raw, 80)[0], (len(raw) - 84) / 50
    what = f"is damaged: it says that it holds {said:,} triangles and has the bytes of {held:,.10g}"
    raise InputError(path, what, _AGAIN)


def _check_obj(raw: bytes, path: Path) -> None:
    count, face = len(_VERTEX.findall(raw)), None
    for face in _FACE.finditer(raw):
        for corner in face[1].split():
            index = corner.split(b"/")[0]
            if not re.fullmatch(rb"[+-]?\d{1,18}", index) or not 1 <= abs(int(index)) <= count:
                line, said = raw.count(b"\n", 0, face.start()) + 1, index.decode(errors="replace")[:20]
                what = f"line {line} has a face of vertex {said}, and there are 1 to {count}"
                raise InputError(path, what, _AGAIN)
    if face is None:
        raise InputError(path, f"holds no triangle: it has {count} vertices and no face", "export it as a mesh")


def _check_ply(raw: bytes, path: Path) -> None:
    head, end, body = raw.partition(b"end_header")
    if not end:
        raise InputError(path, "is cut off: its head has no end_header", _AGAIN)
    words = [line.split() for line in head.decode("latin-1").splitlines()]
    if words[0] != ["ply"]:
        raise InputError(path, "is no PLY: its first line is not ply", _AGAIN)
    form = next((line[1] for line in words if line[:1] == ["format"] and len(line) > 1), "missing")
    if form not in ("ascii", "binary_little_endian", "binary_big_endian"):
        what = f"has the format {form!r}, and PLY has ascii, binary_little_endian and binary_big_endian"
        raise InputError(path, what, _AGAIN)
    said = {line[1]: _whole(line[2], path) for line in words if line[:1] == ["element"] and len(line) == 3}
    if not said.get("face") and not said.get("tristrips"):
        what = f"holds no triangle: it has {said.get('vertex', 0)} vertices and no face"
        raise InputError(path, what, "export it as a mesh, not as a cloud of points")
    # at least a line of text or a byte for each row
    held, of = (len(body.split(b"\n")[1:]), "lines") if form == "ascii" else (len(body), "bytes")
    if held < sum(said.values()):
        parts = " and ".join(f"{count:,} of {name}" for name, count in said.items())
        raise InputError(path, f"is cut off: its head says {parts}, and {held:,} {of} follow", _AGAIN)


def _check_off(raw: bytes, path: Path) -> None:
    lines = [line for line in (row.partition(b"#")[0].strip() for row in raw.splitlines()) if line]
    if b"OFF" not in lines[0].upper():
        raise InputError(path, "is no OFF: its first line is not OFF", _AGAIN)
    rest = lines[0].upper().partition(b"OFF")[2].strip()
    counts = (rest or (lines[1] if len(lines) > 1 else b"")).split()
    if len(counts) < 2:
        raise InputError(path, "is cut off: it has no line of counts", _AGAIN)
    vertices, faces = (_whole(word.decode("latin-1"), path) for word in counts[:2])
    held = len(lines) - (1 if rest else 2)
    if held < vertices + faces:
        what = f"is cut off: it says {vertices:,} vertices and {faces:,} faces, and {held:,} lines follow"
        raise InputError(path, what, _AGAIN)


def _check_step(raw: bytes, path: Path) -> None:
    if not raw[:4096].lstrip().upper().startswith(b"ISO-10303-21"):
        raise InputError(path, "is no STEP: it does not begin with ISO-10303-21", _AGAIN)
    if b"END-ISO-10303-21" not in raw.upper():
        raise InputError(path, "is cut off: it has no END-ISO-10303-21", _AGAIN)
    bare = re.sub(rb"/\*.*?\*/|'[^']*'", b"", raw, flags=re.DOTALL)  # strings are removed
    missing = {*re.findall(rb"#(\d+)", bare)} - {*re.findall(rb"#(\d+)\s*=", bare)}
    if missing:
        named = ", ".join(f"#{number}" for number in sorted(map(int, missing))[:3])
        raise InputError(path, f"is damaged: it goes by {named}, which is not in it", _AGAIN)


def _whole(word: str, path: Path) -> int:
    if not re.fullmatch(r"\d{1,18}", word):
        raise InputError(path, f"has a count of {word[:20]!r}, which is no number of things", _AGAIN)
    return int(word)


def _check_glb(raw: bytes, path: Path) -> tuple[str, ...]:
    if len(raw) < 20 or raw[:4] != b"glTF":
        raise InputError(path, "is no GLB: it does not begin with glTF", _AGAIN)
    said, size = struct.unpack_from("<I", raw, 8)[0], struct.unpack_from("<I", raw, 12)[0]
    if said > len(raw):
        raise InputError(path, f"is cut off: it says {said:,} bytes and has {len(raw):,}", _AGAIN)
    try:
        document = json.loads(raw[20 : 20 + size])
    except (ValueError, RecursionError):
        document = None
    if not isinstance(document, dict):
        raise InputError(path, "is damaged: what it holds is not described in JSON", _AGAIN)
    if not document.get("meshes"):
        raise InputError(path, "holds no mesh", "export the part with its geometry")
    needed = [str(name) for name in _list(document, "extensionsRequired") if not str(name).startswith(_LOOKS)]
    if needed:
        raise InputError(path, f"needs {', '.join(needed)}, which is not read", "export it without compression")
    for buffer in _list(document, "buffers"):
        uri = buffer.get("uri", "data:") if isinstance(buffer, dict) else "data:"
        if not str(uri).startswith("data:"):
            raise InputError(path, f"keeps its points in another file, {str(uri)[:80]!r}", "export it as one file")
    left = [word for word in ("animations", "skins") if document.get(word)]
    return tuple(f"{path.name} has {word}: they are left out, and it stays as it lies at rest" for word in left)


def _list(document: dict[str, Any], key: str) -> list[Any]:
    found = document.get(key)
    return found if isinstance(found, list) else []
