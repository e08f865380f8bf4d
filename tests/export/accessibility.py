"""Where axe-core is, and how it looks at a page: by NCGEN_AXE=FILE, or after `npm install --no-save axe-core` in the repository."""

from __future__ import annotations

import os
from pathlib import Path

AXE = Path(os.environ.get("NCGEN_AXE") or Path(__file__).parents[2] / "node_modules" / "axe-core" / "axe.min.js")

VIOLATIONS = """axe.run({ iframes: false }).then((found) => JSON.stringify([found.passes.length,
  found.violations.map(({ id, nodes }) => [id, ...nodes.map(({ html, any }) => `${html.slice(0, 120)} ${any[0]?.message ?? ""}`)])]))"""
