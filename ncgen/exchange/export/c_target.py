"""A folder of C99 with everything to build, install and embed it, and the same as one header."""

from __future__ import annotations

import re

from ncgen.emit.environment import render
from ncgen.exchange.export.package import Package, renamed

HAS_EVENTS = True


def files(package: Package) -> dict[str, str]:
    """{path in the folder: text}."""
    prefix = package.prefix
    sources = {f"{'include' if name in package.public else 'src'}/{name}": text for name, text in package.c.items()}
    records = package.records | {"compiled": [name for name in sources if name.endswith(".c")], "headers": package.public}

    def filled(template: str) -> str:
        return renamed(render(f"package/c/{template}.jinja", **records), prefix)

    return {
        **{name: filled(name) for name in ("README.md", "CMakeLists.txt", "Makefile")},
        f"{prefix}.pc.in": filled("package.pc.in"),
        f"{prefix}Config.cmake.in": filled("Config.cmake.in"),
        **sources,
        f"include/{prefix}.hpp": filled("motion.hpp"),
        f"single/{prefix}_single.h": single_header(package),
        "examples/main.c": filled("main.c"),
        "examples/realtime.c": filled("realtime.c"),
    }


def single_header(package: Package) -> str:
    """All sources in one file, which one source of the program includes with <PREFIX>_IMPLEMENTATION defined."""
    # The runtime's R and that of generated code are two macros.
    runtime = [name for name in package.c if name.endswith(".c") and name.startswith(f"{package.prefix}_ncgen_")]
    code = package.c | {name: _with_own_names(package.c[name], name.removesuffix(".c")) for name in runtime}
    included: set[str] = set()

    def flat(name: str) -> str:
        """The text of a file with the package's own headers put in where they are first included."""

        def inserted(match: re.Match[str]) -> str:
            header = match[1]
            if header not in code:
                return match[0]
            if header in included:
                return ""
            included.add(header)
            return flat(header)

        return re.sub(r'^#include "([^"]+)"\n', inserted, code[name], flags=re.MULTILINE)

    headers = "".join(flat(name) for name in package.public if name not in included and not included.add(name))
    generated = [name for name in code if name.endswith(".c") and name not in runtime]
    bodies = "\n".join([*map(flat, runtime), *(f"#undef R\n{flat(name)}" for name in generated), "#undef R\n"])
    return render("package/c/single.h.jinja", **package.records, headers=headers, bodies=bodies)


def _with_own_names(text: str, stem: str) -> str:
    """A source in which what only its own file sees begins with that file's name, since in one file all see each other."""
    functions = re.findall(r"^static [\w *]*?\b(\w+)\(", text, flags=re.MULTILINE)
    statements = re.findall(r"^static [^(\n]*?=[^;]*;", text, flags=re.MULTILINE)
    variables = [name for each in statements for name in re.findall(r"(\w+)(?:\[[^\]]*\])* =", each)]
    enums = re.findall(r"^enum \{(.*?)\};", re.sub(r"/\*.*?\*/", "", text, flags=re.DOTALL), flags=re.DOTALL | re.MULTILINE)
    constants = [name for each in enums for name in re.findall(r"(?:^|,)\s*(\w+)", each)]
    types = re.findall(r"^(?:typedef )?struct (\w+) \{", text, flags=re.MULTILINE) + re.findall(r"^\} (\w+);", text, flags=re.MULTILINE)
    names = "|".join(sorted({*functions, *variables, *constants, *types}, key=len, reverse=True))
    return re.sub(rf"(?<![.\w>])({names})\b", rf"{stem}_\1", text) if names else text
