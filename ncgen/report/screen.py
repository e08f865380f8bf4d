"""What people see in the terminal: a mechanism and a run, each on one screen."""

from __future__ import annotations

import math

from rich.console import Console, Group
from rich.table import Table
from rich.text import Text

from ncgen.errors import counted


def show_inspection(console: Console, facts: dict, seconds: dict[str, float] | None = None, times: dict[str, float] | None = None) -> None:
    """Degrees of freedom, redundant constraints, what was simplified away, and the kernels with their cost."""
    console.print(Text(f"{facts['name']}", style="bold"))
    console.print(
        f"  {counted(facts['coordinates'], 'coordinate')}, {facts['free_coordinates']} free"
        f" · {counted(facts['constraints'], 'constraint')}, rank {facts['rank']} · {counted(facts['dof'], 'degree of freedom')}"
    )
    for entry in facts["redundant"]:
        others = ", ".join(f"{c:+.3g}·constraint {i}" for i, c in zip(entry["implied_by"], entry["coefficients"], strict=True))
        console.print(f"  redundant: constraint {entry['constraint']} ({entry['label']}, {entry['owner']}) = {others}", markup=False)
    if facts["singular"]:
        console.print("  the initial position is singular", style="yellow")
    if facts["initial_angles"]:
        degrees = ", ".join(f"{name} {math.degrees(value):.4f}" for name, value in facts["initial_angles"].items())
        console.print(f"  initial angles (degrees): {degrees}", markup=False)
    if facts["assembled"]:
        moved = ", ".join(f"{each['joint']} by {each['moved']:.6g} {each['unit']}" for each in facts["assembled"])
        console.print(f"  moved to close loops: {moved}", markup=False)
    if facts["measured_constraints"]:
        console.print(
            f"  lengths and angles of {facts['measured_constraints']} constraints are those of the initial position", markup=False
        )
    for words, acts in (("not modelled, and it changes the motion", True), ("without effect on the motion", False)):
        contributions = [f"{each['feature']} ({each['count']})" for each in facts["left_out"] if each["changes_motion"] == acts]
        if contributions:
            console.print(f"  of the file, {words}: {', '.join(contributions)}", markup=False)
    for line in _grouped(facts["simplified"]):
        console.print(f"  simplified away: {line}", markup=False)
    for kind in dict.fromkeys(joint["kind"] for joint in facts["joints"]):
        pairs = ["-".join(joint["bodies"]) or "between coordinates" for joint in facts["joints"] if joint["kind"] == kind]
        console.print(f"  {len(pairs)} {kind}: {', '.join(pairs)}", markup=False)
    if facts["drivers"]:
        console.print(f"  driven: {', '.join(f'{name} = {law}' for name, law in facts['drivers'].items())}", markup=False)
    if facts["tree"]:
        links = ", ".join(f"{link['body']} on {link['parent']} {link['dof']}" for link in facts["tree"])
        console.print(f"  spanning tree (degrees of freedom of its joints): {links}", markup=False)
    if facts.get("motion"):
        console.print(f"  {motion_line(facts['motion'])}", markup=False)
    if facts.get("matrix"):
        console.print(f"  accelerations of a run: {facts['matrix']}", markup=False)
    if facts.get("derivative"):
        console.print(f"  {derivative_line(facts['derivative'])}", markup=False)
    console.print(kernel_table(facts, times))
    if seconds:
        spent = ", ".join(f"{stage} {value:.2f}" for stage, value in seconds.items())
        console.print(f"  seconds of every stage from the model to functions: {spent}", markup=False)


def motion_line(counts: dict) -> str:
    """What a default run takes."""
    end = f"{counts['velocities']} for velocities, {counts['positions']} for positions"
    return f"operations of a default run: {counts['derivative']} a stage; at the end of a step {end}"


def derivative_line(counts: dict) -> str:
    """What the state derivative takes, the cheapest way first."""
    ways = sorted((n, name) for name, n in counts.items() if name not in ("positions", "chosen"))
    counts_of_ways = ", ".join(f"{name} {n}" for n, name in ways)
    return f"operations on independent coordinates: {counts_of_ways}; of the position correction: {counts['positions']}"


def kernel_table(facts: dict, times: dict[str, float] | None) -> Table:
    """One line a kernel: numbers written, operations, elementary functions, and nanoseconds if measured."""
    table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 2))
    for title in ("kernel", "numbers", "operations", "sin, cos …"):
        table.add_column(title, justify="left" if title == "kernel" else "right")
    if times:
        table.add_column(f"ns per call ({facts['backend']})", justify="right")
    for name, record in facts["kernels"].items():
        label = f"{name} (constant)" if record["constant"] else name
        cells = [label, str(record["nonzeros"]), str(record["operations"]), str(record["calls"] or "")]
        table.add_row(*cells, *([f"{times[name]:.0f}"] if times else []))
    return table


def show_run(console: Console, record: dict) -> None:
    """The motion in numbers: end state, energy and constraint error, effort, and the files written."""
    table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 2))
    for title in ("coordinate", "final", "velocity"):
        table.add_column(title, justify="left" if title == "coordinate" else "right")
    for name, value in record["final_position"].items():
        table.add_row(name, f"{value:.12g}", f"{record['final_velocity'][name]:.12g}")
    lines = [
        Text(
            f"{record['duration']:g} s of motion{', ended by its stop' if record['stopped'] else ''}: integrator {record['integrator']}, "
            f"formalism {record['formalism']}, kernels in {record['backend']}, engine {record['engine']}",
            style="bold",
        ),
        table,
        Text(f"  constraint error {record['constraint_violation']:.1e} (relative), energy error {record['energy_drift']:.1e} (relative)"),
        Text(f"  {counted(record['steps'], 'step')}, {counted(record['evaluations'], 'evaluation')}, {_seconds(record)}"),
    ]
    console.print(Group(*lines))
    if record["outputs"]:
        console.print(f"  written to {record['folder']}:", markup=False)
        for path in record["outputs"]:
            console.print(f"    {path}", markup=False)


def _seconds(record: dict) -> str:
    """The time of a run, and that of generating and compiling where it can be seen in two digits."""
    preparation = record["preparation_seconds"]
    before = f", and {preparation:.2f} s before it to generate and compile what it needs" if preparation >= 0.005 else ""
    return f"{record['wall_seconds']:.2f} s{before}"


def _grouped(lines: list[str]) -> list[str]:
    """Lines with the same reason become one: `angle psi1: reason` and `angle psi2: reason`."""
    groups: dict[str, list[str]] = {}
    for line in lines:
        subject, _, reason = line.partition(": ")
        groups.setdefault(reason, []).append(subject)
    return [f"{', '.join(subjects)}: {reason}" if reason else ", ".join(subjects) for reason, subjects in groups.items()]
