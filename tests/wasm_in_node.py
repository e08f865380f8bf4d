"""Programs in WebAssembly, run by node: a module that is linked to the runtime, and a script that calls its functions."""

from __future__ import annotations

import json
import subprocess
from collections.abc import Sequence
from pathlib import Path

from ncgen.emit.wasm.linked import linked_module
from ncgen.program.ir.blocks import Program
from ncgen.toolchain.generic_wasm import LINKED, binary

HEAD = """
import { readFileSync } from "node:fs";
const module = new WebAssembly.Module(readFileSync("m.wasm")), [own] = WebAssembly.Module.customSections(module, "ncgen");
const runtime = new WebAssembly.Instance(new WebAssembly.Module(own), { Math }).exports;
runtime._initialize();
const tables = runtime.__heap_base.value, rooms = tables + SIZE, at = (rooms + ROOMS) / 8;
runtime.memory.grow(1 + Math.ceil((SIZE + ROOMS) / 65536));
const w = new WebAssembly.Instance(module, { Math, ncgen: { ...runtime, tables, rooms } }).exports;
const view = new Float64Array(runtime.memory.buffer), found = [];
"""
"""`w` has the functions, `view` all numbers, of which those from `at` on are the caller's; `found` is printed."""


def in_node(programs: Sequence[Program], prefix: str, script: str, folder: Path) -> list:
    """What the script has put into `found`."""
    made = linked_module(programs, prefix, [], [], {"ncgen": binary(LINKED)})
    (folder / "m.wasm").write_bytes(made.binary)
    head = HEAD.replace("SIZE", str(made.size + -made.size % 8)).replace("ROOMS", str(made.rooms))
    (folder / "m.mjs").write_text(f"{head}{script}\nconsole.log(JSON.stringify(found));\n")
    return json.loads(subprocess.run(["node", "m.mjs"], cwd=folder, capture_output=True, text=True, check=True).stdout)
