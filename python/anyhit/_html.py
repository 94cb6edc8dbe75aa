"""Objects as tables of HTML, as notebooks show them."""

from __future__ import annotations

from collections.abc import Iterable
from html import escape
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from . import Ray, Traced

# Rays of an array that are shown.
_ROWS = 10


def _table(head: Iterable[str], rows: Iterable[Iterable[Any]], caption: str = "") -> str:
    def row(cells: Iterable[Any], tag: str) -> str:
        return "<tr>" + "".join(f"<{tag}>{escape(_text(cell))}</{tag}>" for cell in cells) + "</tr>"

    body = "".join(row(cells, "td") for cells in rows)
    title = f"<caption>{escape(caption)}</caption>" if caption else ""
    return f"<table>{title}<thead>{row(head, 'th')}</thead><tbody>{body}</tbody></table>"


def _text(cell: Any) -> str:
    if isinstance(cell, float):
        return f"{cell:.6g}"
    if isinstance(cell, (list, tuple)):
        return "(" + ", ".join(map(_text, cell)) + ")"
    return str(cell)


def of_ray(ray: Ray) -> str:
    return _table(["origin", "direction", "t_min", "t_max"], [[ray.origin, ray.direction, ray.t_min, ray.t_max]])


def of_traced(traced: Traced) -> str:
    payload = traced.payload
    names = list(payload.dtype.names or ()) if payload is not None else []
    head = ["ray", "t", "instance", "geometry", "primitive", "position"]
    head += [f"payload.{name}" for name in names] if names else ["payload"] if payload is not None else []
    rows = []
    for at in range(min(len(traced), _ROWS)):
        row: list[Any] = [at, "miss", "", "", "", ""]
        if traced.hit[at]:
            indices = [int(column[at]) for column in (traced.instance, traced.geometry, traced.primitive)]
            row = [at, float(traced.t[at]), *indices, traced.positions[at].tolist()]
        if payload is not None:
            row += [payload[name][at].tolist() for name in names] if names else [payload[at].tolist()]
        rows.append(row)
    more = f", the first {_ROWS}" if len(traced) > _ROWS else ""
    return _table(head, rows, f"{len(traced)} rays, {int(traced.hit.sum())} hits{more}")
