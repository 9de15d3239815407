"""HTML and SVG text with safe escaping.

`tag` escapes all attributes and every child that is not `Markup`. Apart from these functions, only literals of this
package may make `Markup`.
"""

from __future__ import annotations

import base64
import html
import json
import math
from collections.abc import Iterable
from typing import Any

VOID = {"br", "hr", "img", "input", "line", "circle", "rect", "path", "polyline", "polygon", "meta"}


class Markup(str):
    """Text that is HTML or SVG."""

    __slots__ = ()


def escape(value: object) -> Markup:
    """Return a value as text for HTML. `Markup` is kept."""
    return value if isinstance(value, Markup) else Markup(html.escape(str(value), quote=True))


def join(parts: Iterable[object], between: str = "") -> Markup:
    """Return concatenated parts, escaped unless `Markup`."""
    return Markup(between.join(escape(part) for part in parts))


def tag(name: str, /, *children: object, **attributes: Any) -> Markup:
    """Return an element. A final underscore is dropped (`class_`), others become hyphens. None and False omit it."""
    text = ""
    for key, value in attributes.items():
        if value is not None and value is not False:
            known = {"viewbox": "viewBox"}.get(key) or key.rstrip("_").replace("_", "-")
            text += f" {known}" if value is True else f' {known}="{html.escape(str(value), quote=True)}"'
    inner = join(children)
    if not inner and name in VOID:
        return Markup(f"<{name}{text}/>")
    return Markup(f"<{name}{text}>{inner}</{name}>")


def json_script(identifier: str, value: object) -> Markup:
    """Return JSON data for a script, with "<" escaped so that no text can close the element."""
    text = json.dumps(value, sort_keys=True, separators=(",", ":"), allow_nan=False).replace("<", "\\u003c")
    return Markup(f'<script type="application/json" id="{html.escape(identifier)}">{text}</script>')


def data_uri(mime: str, content: bytes) -> str:
    """Return bytes as a data URI."""
    return f"data:{mime};base64,{base64.b64encode(content).decode('ascii')}"


def figure(title: str, caption: object, *content: object, class_: str = "") -> Markup:
    """Return a titled picture with its caption below."""
    head = tag("h4", title) if title else ""
    foot = tag("figcaption", caption) if caption else ""
    return tag("figure", head, *content, foot, class_=class_ or None)


def image(title: str, caption: object, svg: str) -> Markup:
    """Return a drawing as an image, which cannot run scripts."""
    source = data_uri("image/svg+xml", svg.encode("utf-8"))
    return figure(title, caption, tag("img", src=source, alt=title, class_="paper"), class_="plot")


def table(head: Iterable[object], rows: Iterable[Iterable[object]], *, class_: str = "", numeric: int = 1) -> Markup:
    """Return a table. Columns from index `numeric` on are numeric."""

    def cells(name: str, row: Iterable[object]) -> Markup:
        return join(tag(name, cell, class_="num" if i >= numeric else None) for i, cell in enumerate(row))

    body = join(tag("tr", cells("td", row)) for row in rows)
    content = tag("table", tag("thead", tag("tr", cells("th", head))), tag("tbody", body), class_=class_ or None)
    return tag("div", content, class_="scroll")


def note(*text: object, role: str | None = None) -> Markup:
    """Return a remark."""
    return tag("p", *text, class_="note", role=role)


def number(value: float, digits: int = 3) -> str:
    """Return a figure with `digits` significant digits, and no exponent between 1e-4 and 1e6."""
    if not math.isfinite(value):
        return "–"
    if value == 0.0:
        return "0"
    size = abs(value)
    if not 1e-4 <= size < 1e6:
        return f"{value:.{digits - 1}e}".replace("-", "−")
    decimals = max(0, digits - 1 - math.floor(math.log10(size)))
    text = f"{value:.{decimals}f}"
    return (text.rstrip("0").rstrip(".") if "." in text else text).replace("-", "−")


def percent(value: float) -> str:
    """Return a percentage, with a decimal below 1 and above 99. 0 % and 100 % are exact."""
    if not math.isfinite(value):
        return "–"
    if value in (0.0, 1.0):
        return f"{value:.0%}".replace("%", " %")
    if 0.01 <= value <= 0.99:
        return f"{math.floor(100.0 * value + 0.5)} %"
    text = f"{100.0 * value:.1f} %"
    return {"0.0 %": "< 0.1 %", "100.0 %": "> 99.9 %"}.get(text, text)
