"""ncgen next to other people's simulators and generators, and measurements of ncgen itself.

    python tests/benchmarks/bench.py robot                     what `ncgen bench` prints, next to sympy, CasADi and Octave; generation
    python tests/benchmarks/bench.py robot --instructions      instructions of a call, counted by valgrind
    python tests/benchmarks/bench.py robot --derivatives       what `ncgen compare` prints, next to CasADi, JAX, SymForce; ∂ẏ/∂y
    python tests/benchmarks/bench.py robot --tables            the same, and the paper's Tables 9 and 10
    python tests/benchmarks/bench.py robot --gradients         derivatives of a motion by all its data, next to differences and CasADi
    python tests/benchmarks/bench.py robot --libraries         many motions and gradients inside JAX and PyTorch
    python tests/benchmarks/bench.py all --data                operations with data as parameters, next to numbers; or one MODEL
    python tests/benchmarks/bench.py arm --arms --seed 2       the example and a random arm next to CasADi, Pinocchio and MuJoCo
    python tests/benchmarks/bench.py nfourbar --peers          N four-bars next to Pinocchio, MuJoCo and Exudyn
    python tests/benchmarks/bench.py chain --growth            generation and steps of longer and longer chains; or arm
    python tests/benchmarks/bench.py all --defaults            the default call next to the best method; or one hard case
    python tests/benchmarks/bench.py all --calls               what a call costs beside its run in C; or one MODEL
    python tests/benchmarks/bench.py fourbar --other-calls     what calls besides simulate cost

MODEL is an example's name or a path to a model's file. What is not installed is left out; requirements.txt names it all.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
from collections.abc import Iterable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # as the command line has it
if __name__ == "__main__":
    sys.path[0] = str(Path(__file__).resolve().parents[1])  # rivals/jax.py and its like are no libraries

from benchmarks import tables  # noqa: E402
from ncgen.cli.measuring import check_reports, show_comparison, show_sections  # noqa: E402
from ncgen.cli.terminal import err, print_records, progress, show  # noqa: E402
from ncgen.errors import ModelError, NcgenError  # noqa: E402
from ncgen.exchange.examples import example_names, load  # noqa: E402
from ncgen.report.document import aligned  # noqa: E402

ALL = "all"


def in_sections(sections: Iterable[tuple[str, list[dict]]], options: argparse.Namespace) -> None:
    """One table after the other, as they come; or all records."""
    from benchmarks import arms

    rows: dict[str, Any] = {"generation": tables.generation_rows, "operations": tables.operation_rows, "arm": arms.rows}
    rows |= {"gradients": tables.gradient_rows, "libraries": partial(tables.gradient_rows, digits=4)}
    show_sections(options.model, sections, options.json, rows)


def everything(options: argparse.Namespace) -> None:
    from benchmarks.sections import everything

    in_sections(everything(load(options.model)), options)


def gradients(options: argparse.Namespace) -> None:
    from benchmarks.sections import of_gradients

    in_sections(of_gradients(load(options.model)), options)


def libraries(options: argparse.Namespace) -> None:
    from benchmarks.sections import of_libraries

    in_sections(of_libraries(load(options.model)), options)


def data(options: argparse.Namespace) -> None:
    from benchmarks.sections import of_data

    in_sections(of_data(map(load, example_names() if options.model == ALL else [options.model])), options)


def arms(options: argparse.Namespace) -> None:
    from benchmarks.sections import of_arms

    _only(options, "arm")
    in_sections(of_arms(options.seed), options)


def peers(options: argparse.Namespace) -> None:
    from benchmarks.peers import COUNTS, LIMIT, lines, peer_records

    _only(options, "nfourbar")
    records = []
    for count in COUNTS:
        with progress(f"measuring {count} four-bars", None):
            found = list(peer_records([count], limit=options.limit or LIMIT))
        records += found
        show(() if options.json else lines(found))
    if options.json:
        print(json.dumps(records, indent=1))


def growth(options: argparse.Namespace) -> None:
    from benchmarks.generation import LENGTHS, growth_records

    _only(options, *LENGTHS)
    records = []
    with progress(f"generating {options.model}s", len(LENGTHS[options.model])) as advance:
        for done, record in enumerate(growth_records(options.model), 1):
            records.append(record)
            advance(done)
    print_records(records, lambda found: aligned(tables.generation_rows(found)), options.json)


def instructions(options: argparse.Namespace) -> None:
    from benchmarks.instructions import instruction_records, table

    with progress(f"counting instructions of {options.model}", None):
        records = list(instruction_records(load(options.model)))
    print_records(records, lambda found: aligned(table(found)), options.json)


def derivatives(options: argparse.Namespace, with_tables: bool = False) -> None:
    from benchmarks.derivatives import WiderComparison

    reports = options.html, options.plot, options.csv
    check_reports(*reports)
    show_comparison(WiderComparison(load(options.model), [], with_tables), *reports, options.json)


def paper_tables(options: argparse.Namespace) -> None:
    derivatives(options, with_tables=True)


def defaults(options: argparse.Namespace) -> None:
    from benchmarks.defaults import NAMES, default_lines, default_records
    from ncgen.comparisons.hard_cases import CASES

    names, records = NAMES if options.model == ALL else (options.model,), []
    if options.model != ALL:
        _only(options, *CASES)
    with progress("default calls", len(names)) as advance:
        for record in default_records(names, options.limit or 20.0):
            records.append(record)
            advance(len(records))
    print_records(records, default_lines, options.json)


def calls(options: argparse.Namespace) -> None:
    from benchmarks.calls import call_lines, call_records

    names, records = example_names() if options.model == ALL else [options.model], []
    with progress("calls", len(names)) as advance:
        for record in call_records(names):
            records.append(record)
            advance(len(records))
    print_records(records, call_lines, options.json)


def other_calls(options: argparse.Namespace) -> None:
    from benchmarks.calls import other_lines, other_records

    print_records([*other_records(options.model)], partial(other_lines, options.model), options.json)


def _only(options: argparse.Namespace, *names: str) -> None:
    if options.model not in names:
        raise ModelError(f"{options.model}: this is not measured of it; choose {', '.join(names)}")


WHAT = {
    "--instructions": instructions, "--derivatives": derivatives, "--tables": paper_tables, "--gradients": gradients,
    "--libraries": libraries, "--data": data, "--arms": arms, "--peers": peers, "--growth": growth, "--defaults": defaults,
    "--calls": calls,
    "--other-calls": other_calls,
}  # fmt: skip


def main(arguments: Sequence[str] | None = None) -> int:
    """What the arguments ask for; a refusal is one line on standard error."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("model", metavar="MODEL")
    what = parser.add_mutually_exclusive_group()
    for flag, measure in WHAT.items():
        what.add_argument(flag, dest="measure", action="store_const", const=measure, default=everything)
    parser.add_argument("--seed", type=int, default=1, help="of the random arms")
    parser.add_argument("--limit", type=float, help="with --peers and --defaults: seconds after which a run is stopped [20]")
    for flag, kind in (("--html", "a report"), ("--plot", "the plots, as .svg or .png,"), ("--csv", "the records")):
        parser.add_argument(flag, type=Path, metavar="FILE", help=f"with --derivatives and --tables: write {kind} into this file")
    parser.add_argument("--json", action="store_true", help="print the records instead of tables")
    options = parser.parse_args(arguments)
    try:
        options.measure(options)
    except NcgenError as error:
        err.print(f"bench.py: {error}", markup=False)
        return error.exit_code
    return 0


if __name__ == "__main__":
    sys.exit(main())
