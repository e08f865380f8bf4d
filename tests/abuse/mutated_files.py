"""Model files gone wrong: the files of all examples, changed at random, and read in processes that may be killed.

A file is known by its number: the number is the seed of all choices, so `python tests/abuse/mutated_files.py 4711` prints
file 4711 and what becomes of it. The long run goes on from where the last one ended.
"""

from __future__ import annotations

import multiprocessing
import os
import random
import re
import sys
import tempfile
import time
import traceback
import warnings
from collections import Counter, defaultdict
from contextlib import suppress
from dataclasses import dataclass, field
from multiprocessing.connection import Connection, wait
from pathlib import Path

from ncgen.errors import LONGEST_LINE, ModelError
from ncgen.exchange.examples import example_names, load
from ncgen.exchange.toml_reader import read_toml
from ncgen.exchange.toml_writer import to_toml
from ncgen.exchange.words import kind_of, signature_of, words

LIMIT = 10.0
"""Seconds for one file."""

MEMORY = 3 * 2**30
"""Bytes of address space of a process that reads files."""

NUMBERS = (
    """0 -0.0 1 -1 2 3 1e308 -1e308 1e-308 5e-324 1.7976931348623157e308 1e999 nan inf -inf 1e16 1e150 1e-150 9223372036854775808
0x10 0b1 1_000 1979-05-27 07:32:00 true false 1e5 0.1 1e-9 1e200""".split()
    + ["7" * 400, "1" * 5000, "0." + "3" * 400]
)

EXPRESSIONS = [
    "pow(9, 999999999)", "9**9**9", "((9**64)**64)**64", "exp(exp(exp(exp(9))))", "(" * 3000 + "1" + ")" * 3000, " + ".join(["t"] * 990),
    "1/0", "1/3", "sqrt(2)", "sqrt(-1)", "log(0)", "0**0", "2*pi", "e", "exp(1)", "t", "x + v", "-t", "--1", "1e400", "9" * 400, "9" * 5000,
    "exp(999999999*log(9))", "__import__('os')", "().__class__", "lambda: 0", "t if t else 1", "'a'*10", "[0]*10", "1j", "...", "a.b.c", "",
    " ", "sin", "sin()", "rate(t)", "rate(1)", "2 kg", "class", "None", "True", "t.x",
    "x" * 5000, "sin(" * 60 + "t" + ")" * 60, "2*(t + 1)",
    "sin(t)**2 + cos(t)**2", "abs(t)", "sign(t)", "atan2(t, 1)", "tan(pi/2)", "0*t", "t/t", "t - t", "0", "1e-320*t", "t**0.5", "t**t", "µ",
]  # fmt: skip

WORDS = [
    "class",
    "for",
    "None",
    "t",
    "pi",
    "e",
    "a²",
    "µ",
    "μ",
    "ground",
    "A B",
    "A.x",
    "",
    ".",
    "a.",
    "1a",
    "é",
    "x" * 600,
    "ﬁ",
    "x",
    "v",
    "name",
]

BITS = [
    "\ufeff",
    "\x00",
    "\u2028",
    "\x7f",
    "\r",
    "\t",
    '"',
    "'",
    '"""',
    "'''",
    "[",
    "]",
    "{",
    "}",
    "=",
    ".",
    ",",
    "#",
    "\\",
    "\\u0000",
    "💥",
    "ß",
    "²",
]


def examples() -> dict[str, str]:
    """{name: model file} of all examples."""
    return {name: to_toml(load(name)) for name in example_names()}


# -- how files are changed ----------------------------------------------------------------------


def mutated(number: int, texts: dict[str, str]) -> bytes:
    """File `number`: an example with one to four changes."""
    chance = random.Random(number)
    text = texts[chance.choice(sorted(texts))]
    for _ in range(chance.choice((1, 1, 1, 1, 1, 2, 3, 4))):
        text = chance.choice(CHANGES)(chance, text)
    data = text.encode("utf-8", "surrogatepass")
    return _bytes(chance, data) if chance.random() < 0.08 else data


def _bytes(chance, data: bytes) -> bytes:
    changed = bytearray(data)
    for _ in range(chance.randint(1, 5)):
        place = chance.randrange(len(changed) + 1)
        action = chance.randrange(4)
        if action == 0:
            changed[place:place] = chance.randbytes(chance.randint(1, 3))
        elif action == 1:
            del changed[place : place + chance.randint(1, 8)]
        elif action == 2 and place < len(changed):
            changed[place] = chance.randrange(256)
        else:
            changed[place:place] = changed[place : place + chance.randint(1, 40)]
    return bytes(changed)


def _lines(chance, text: str) -> str:
    lines = text.split("\n")
    here, there = (chance.randrange(len(lines)) for _ in range(2))
    action = chance.randrange(5)
    if action == 0:
        del lines[here]
    elif action == 1:
        lines.insert(there, lines[here])
    elif action == 2:
        lines[here], lines[there] = lines[there], lines[here]
    elif action == 3:
        lines.insert(there, lines.pop(here))
    else:
        lines = lines[:here]
    return "\n".join(lines)


def _tables(chance, text: str) -> str:
    tables = text.split("\n\n")
    here, there = (chance.randrange(len(tables)) for _ in range(2))
    action = chance.randrange(3)
    if action == 0:
        del tables[here]
    elif action == 1:
        tables.insert(there, tables[here])
    else:
        tables.insert(there, tables.pop(here))
    return "\n\n".join(tables)


def _replaced(chance, text: str, pattern: str, make) -> str:
    found = list(re.finditer(pattern, text))
    if not found:
        return text
    place = chance.choice(found)
    return text[: place.start()] + make(place[0]) + text[place.end() :]


def _tokens(chance, text: str) -> str:
    pattern = r'"[^"\n]*"|[\w.+-]+|[\[\]{}=,]'
    return _replaced(chance, text, pattern, lambda _: chance.choice(re.findall(pattern, text)))


def _numbers(chance, text: str) -> str:
    return _replaced(chance, text, r"-?\b\d+\.?\d*(e-?\d+)?", lambda old: chance.choice([*NUMBERS, f"-{old}".replace("--", ""), old + "0"]))


def _values(chance, text: str) -> str:
    kinds = [
        "[]",
        "{}",
        "true",
        "0",
        '""',
        '"A"',
        "[[]]",
        '["A"]',
        '[["A"]]',
        "[1, 2]",
        "[1, 2, 3]",
        "[1, 2, 3, 4]",
        "{ a = 1 }",
        "1979-05-27",
        "[0, 0, 0]",
    ]
    kinds += ["[" * 3000 + "]" * 3000, "'A'", '"""\n[[point]]\n"""', "[true]", "nan", "[inf, 0]"]
    return _replaced(chance, text, r"(?<== )[^\n]+", lambda _: chance.choice(kinds))


def _keys(chance, text: str) -> str:
    keys = sorted(set(re.findall(r"(?m)^\w+(?= =)", text)))
    odd = [*keys, "nmae", '"name"', "a.b", "point", "options", "self", "owner", "x" * 300, "law", "label", "form", "duraton", "Ä", "''"]
    return _replaced(chance, text, r"(?m)^\w+(?= =)", lambda _: chance.choice(odd))


def _headers(chance, text: str) -> str:
    def header(old: str) -> str:
        word = chance.choice([*words(), "pont", "point.sub", '"point"', "callback", "name", "x" * 300, old.strip("[]")])
        return chance.choice((f"[[{word}]]", f"[{word}]", f"[[{word}]", f"[[ {word} ]] # c"))

    return _replaced(chance, text, r"(?m)^\[.*\]$", header)


def _strings(chance, text: str) -> str:
    return _replaced(chance, text, r'"[^"\n]*"', lambda _: f'"{chance.choice([*EXPRESSIONS, *WORDS])}"')


def _renamed(chance, text: str) -> str:
    """One name replaced wherever it stands."""
    names = re.findall(r'(?m)^name = "([^"\n]+)"', text)
    if not names:
        return text
    return text.replace(f'"{chance.choice(names)}"', f'"{chance.choice([*WORDS, *names])}"')


def _characters(chance, text: str) -> str:
    place = chance.randrange(len(text) + 1)
    return text[:place] + chance.choice(BITS) + text[place:]


def _table(chance, text: str) -> str:
    """One more table, with arguments of about the right kinds, and perhaps a parameter that they may mention."""
    names = defaultdict(list)
    for word, name in re.findall(r'(?m)^\[\[(\w+)\]\]\n(?:\w+ = .*\n)*?name = "([^"\n]+)"', text):
        names[{"attach_point": "point", "attach_vector": "vector"}.get(word, word)].append(name)
    tables = text.split("\n\n")
    if not names["parameter"]:
        tables.insert(1, '[[parameter]]\nname = "par"\ndefault = 0.5')
        names["parameter"].append("par")
    word = chance.choice(words())
    lines = [f"[[{word}]]"]
    for key, parameter in signature_of(word).parameters.items():
        if parameter.default is parameter.empty or chance.random() < 0.3:
            values = [argument(chance, kind_of(parameter), names) for _ in range(2)]
            lines.append(f"{key} = {values[0]}" if parameter.kind is not parameter.VAR_POSITIONAL else f"{key} = [{', '.join(values)}]")
    tables.insert(len(tables) if chance.random() < 0.7 else chance.randrange(1, len(tables) + 1), "\n".join(lines))
    return "\n\n".join(tables)


def argument(chance, kind: str, names: dict[str, list[str]]) -> str:
    def any_of(*kinds: str) -> str:
        return chance.choice([name for kind in kinds for name in names[kind]] or ["A"])

    relative = ("angle", "length", "slide")
    one, other, vector = any_of("point"), any_of("point"), any_of("vector")
    number = chance.choice(["0", "1", "-2.5", "0.5", "1e3", *NUMBERS[:9]])
    value = chance.choice((number, number, f'"{any_of("parameter")}"', f'"2*{any_of("parameter")} + 1"', f'"{chance.choice(EXPRESSIONS)}"'))
    coordinate = chance.choice((f"{one}.x", f"{one}.y", f"{vector}.z", any_of(*relative)))
    moving = chance.choice((f"2*{coordinate}", f"{coordinate}**2 - sin(t)", f"rate({coordinate})", f"{one}.x - {other}.x", *EXPRESSIONS))
    moving = f'"{moving}"' if chance.random() < 0.8 else number
    few = [f'"{one}"', f'"{vector}"', moving, value, '""', "[]", "true"]
    usual = {
        "str": [f'"{chance.choice([*WORDS, "new", "new"])}"'],
        "bool": ["true", "false"],
        "bool | str": ["true", "false", '"z"', '"xz"', '"w"'],
        "Number": [number],
        "Numbers": [f"[0, {number}, 2]", "[0, 1, 0.5, 2]", "[0.0, 0.5, 1.0, 2.5]", "[1, 2]"],
        "Sequence[Numbers]": ["[[0, 0], [1, 0], [0, 1]]", f"[[0, 0, 0], [{number}, 0, 0], [0, 1, {number}]]", "[[0, 0]]"],
        "Value": [value],
        "Values": [f"[{value}, 0, 1]", f"[{value}, 0]", "[0, 0, 1]", f"[{value}, {value}, {value}]", "[1, 0, 0]"],
        "Tensor": [value, "[1, 1, 1]", "[[1, 0, 0], [0, 1, 0], [0, 0, 1]]", f"[[{value}, 0, 0], [0, 1, 0], [0, 0, 1]]", f"[{value}, 1, 1]"],
        "Expression": [moving],
        "Driven": [moving],
        "Moment": [moving, f"[0, {number}, {moving}]"],
        "Expressions": [f"[{number}, {moving}, 0]", f"[{value}, 0, 1]"],
        "Law": ['"2*x - v"', moving, value],
        "Point": [f'"{one}"'],
        "Vector": [f'"{vector}"'],
        "Spatial": [f'"{any_of("point", "vector")}"'],
        **dict.fromkeys(
            (f"Sequence[{x}]" for x in ("Point", "Vector", "Spatial")), [f'["{one}", "{other}"]', f'["{one}"]', f'["{vector}"]']
        ),
        "Relative": [f'"{any_of(*relative)}"'],
        "Direction": [f'"{vector}"', f'"{one} - {other}"', f'"-{vector}"', f'"2*{one} - {other}"', f'"{one} - {other} + 1e300*{vector}"'],
        "Component | Relative": [f'"{coordinate}"'],
        "Row": [f'"{any_of("constrain")}"', '"of another"'],
        "Curve": [f'"{any_of("spline", "table")}"'],
        "Doing": [
            "{ impact = { restitution = 0.5 } }",
            "{ stop = true }",
            f'{{ "rate({coordinate})" = {value} }}',
            f"{{ {one} = {value} }}",
        ],
        "Body": [f'"{any_of("body")}"', f'"{any_of("body")}"', '"ground"'],
        "option": [number, f'"{one}"', '["psi"]', "{ a = 1.0 }", "1e-6", '"dopri5"'],
    }
    return chance.choice(few if chance.random() < 0.05 else usual[kind])


CHANGES = (
    _lines,
    _tables,
    _tokens,
    _numbers,
    _numbers,
    _values,
    _keys,
    _headers,
    _strings,
    _strings,
    _renamed,
    _characters,
    _table,
    _table,
)


# -- what becomes of them -----------------------------------------------------------------------


def outcome(data: bytes, folder: Path) -> str:
    """ "refused" or "accepted" for a file that is dealt with as it should be, otherwise what is wrong."""
    path = folder / "mutated.toml"
    path.write_bytes(data)
    try:
        return _judged(path, data)
    except Exception:
        return traceback.format_exc()


def _judged(path: Path, data: bytes) -> str:
    try:
        model, problems = read_toml(path)
    except ModelError as error:
        return "refused" if _is_line(str(error)) else f"message {str(error)!r}"
    for problem in problems:
        if not (_is_line(problem.of(path)) and 1 <= problem.line <= data.count(b"\n") + 1):
            return f"line {problem.line}: {problem.message!r}"
    if problems:
        return "refused"
    text = to_toml(model)
    path.write_text(text, encoding="utf-8")
    again, problems = read_toml(path)
    if problems:
        return f"written and refused: {problems[0]}"
    return "accepted" if to_toml(again) == text else f"written twice, not the same:\n{text}\n----\n{to_toml(again)}"


def _is_line(text: str) -> bool:
    return 10 < len(text) <= LONGEST_LINE and text.isprintable()


@dataclass
class Tally:
    """How many files had which outcome, and the numbers of those that went wrong, with what is wrong."""

    outcomes: Counter = field(default_factory=Counter)
    wrong: dict[int, str] = field(default_factory=dict)
    slowest: tuple[float, int] = (0.0, 0)

    def add(self, number: int, result: str, seconds: float) -> None:
        self.slowest = max(self.slowest, (seconds, number))
        self.outcomes[result if result in ("refused", "accepted") else "wrong"] += 1
        if result not in ("refused", "accepted"):
            self.wrong[number] = result

    def __str__(self):
        counts = ", ".join(f"{count} {result}" for result, count in sorted(self.outcomes.items()))
        return f"{sum(self.outcomes.values())} mutated files: {counts}; the slowest, file {self.slowest[1]}, took {self.slowest[0]:.1f} s"


def read_all(first: int, count: int, processes: int) -> Tally:
    """Files first … first + count − 1, shared between processes; one that hangs is killed and the next goes on."""
    texts, tally = examples(), Tally()
    context = multiprocessing.get_context("spawn")
    shares = [iter(range(first + k, first + count, processes)) for k in range(processes)]
    workers = [_Worker(context, texts, share) for share in shares]
    while busy := [worker for worker in workers if worker.number is not None]:
        ready = wait([worker.pipe for worker in busy], timeout=1.0)
        for worker in busy:
            if worker.pipe in ready:
                worker.take(tally)
            elif worker.seconds > LIMIT:
                tally.add(worker.number, f"no end after {LIMIT} s", worker.seconds)
                worker.stop()
                worker.start()
    for worker in workers:
        worker.stop()
    return tally


class _Worker:
    """A process that reads one file after the other, as seen from outside."""

    def __init__(self, context, texts, numbers):
        self.context, self.texts, self.numbers = context, texts, numbers
        self.start()

    def start(self) -> None:
        self.pipe, other = self.context.Pipe()
        self.process = self.context.Process(target=_serve, args=(other, self.texts), daemon=True)
        self.process.start()
        other.close()
        self.pipe.recv()  # it has imported what it needs
        self._next()

    def take(self, tally: Tally) -> None:
        try:
            result = self.pipe.recv()
        except EOFError:
            tally.add(self.number, f"the process ended with {self.process.exitcode}", self.seconds)
            self.stop()
            self.start()
            return
        tally.add(self.number, result, self.seconds)
        self._next()

    def stop(self) -> None:
        self.process.kill()
        self.process.join()
        self.pipe.close()

    @property
    def seconds(self) -> float:
        return time.monotonic() - self.began

    def _next(self) -> None:
        self.number, self.began = next(self.numbers, None), time.monotonic()
        if self.number is not None:
            self.pipe.send(self.number)


def _serve(pipe: Connection, texts: dict[str, str]) -> None:
    if sys.platform != "win32":
        import resource

        resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    with tempfile.TemporaryDirectory() as folder:
        for text in texts.values():
            outcome(text.encode(), Path(folder))  # imports and sympy's tables are not the time of the first file
        warnings.simplefilter("error")
        pipe.send("ready")
        with suppress(EOFError, OSError):  # whoever asks has gone
            while True:
                pipe.send(outcome(mutated(pipe.recv(), texts), Path(folder)))


# -- where the long run goes on -----------------------------------------------------------------


def counter() -> Path:
    """The file that remembers how many files have been read."""
    from platformdirs import user_cache_path

    return Path(os.environ.get("NCGEN_ABUSE_COUNTER") or user_cache_path("ncgen") / "mutated-files")


def next_number() -> int:
    try:
        return int(counter().read_text())
    except (OSError, ValueError):
        return 1_000_000


def remember(number: int) -> None:
    counter().parent.mkdir(parents=True, exist_ok=True)
    counter().write_text(f"{number}\n")


if __name__ == "__main__":
    files = examples()
    for argument in sys.argv[1:]:
        sys.stdout.buffer.write(mutated(int(argument), files))
        with tempfile.TemporaryDirectory() as place:
            print("\n----", outcome(mutated(int(argument), files), Path(place)))
