"""Records of sections as rows of cells, titles first."""

from __future__ import annotations


def gradient_rows(records: list[dict], digits: int = 2) -> list[tuple[str, ...]]:
    rows: list[tuple[str, ...]] = [("", "ms", "quartiles", "ratio", "error")]
    for r in records:
        low, median, high = (f"{1e3 * r[name]:.{digits}f}" for name in ("low", "seconds", "high"))
        rows.append((r["tool"], median, f"{low}-{high}", f"{r['ratio']:.2f}", "" if r["error"] is None else f"{r['error']:.1e}"))
    return rows


def operation_rows(records: list[dict]) -> list[tuple[str, ...]]:
    """A line a model: its own numbers, then what stands in their place, each with its ratio to these."""
    tools = list(dict.fromkeys(r["tool"] for r in records))
    rows: list[tuple[str, ...]] = [("", tools[0], *(title for tool in tools[1:] for title in (tool, "data", "ratio")))]
    for model in dict.fromkeys(r["model"] for r in records):
        mine = {r["tool"]: r for r in records if r["model"] == model}
        cells = [f"{mine[tools[0]]['operations']:,}"]
        for r in map(mine.get, tools[1:]):
            cells += [f"{r['operations']:,}", str(r["data"] or ""), f"{r['ratio']:.3f}"] if r else [""] * 3
        rows.append((model, *cells))
    return rows


def generation_rows(records: list[dict]) -> list[tuple[str, ...]]:
    """Titles and lines; what takes longest has columns of its own."""
    stages = ("symbolic", "program", "emit", "build")
    moves = any("steps" in r for r in records)
    motion = ("processor", "freedom", "first run", "again", "a step, us", "engine", "by the matrix, us") if moves else ()
    rows: list[tuple[str, ...]] = [("", "in all", *stages, "code, bytes", *motion)]
    for r in records:
        parts = [f"{r['stages'][stage]:.3f}" if stage in r["stages"] else "" for stage in stages]
        if moves:
            taken = (f"{r[name]:.3f}" for name in ("processor", "freedom", "first", "short"))
            motion = (*taken, f"{1e6 * r['steps']:.0f}", r["engine"], f"{1e6 * r['matrix']:.0f}")
        rows.append((r["tool"], f"{r['seconds']:.3f}", *parts, f"{r['code']:,}", *motion))
    return rows
