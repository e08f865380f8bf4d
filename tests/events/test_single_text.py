"""What happens at one instant stands once, most of it in C, and so do other rules: no other file has the words of them."""

from __future__ import annotations

import re

import pytest

from ncgen.resources import folder

RULES = {
    "chain of events": (r"most_rounds|max_rounds|while due", "ncgen_chain.c"),
    "zero of a condition": (r"closed_below|gap_tolerance|ncgen_closed\b", "ncgen_chain.c"),
    "bounces that accumulate": (r"\bat_rest\b(?!\()|1 - [^\n]*restitution", "ncgen_chain.c"),
    "laws of impact": (r"restitution[\])]*\s*\*|1 \+ [^\n]*restitution", "ncgen_contact_laws.c ncgen_impulses.c"),
    "laws of several impacts": (r'"ncgen_simultaneous"', "impacts_in_c.py"),
    "least squares of impulses": (r"nnls|lstsq|most_lacking", "ncgen_contact_laws.c"),
    "what its load does not allow": (r"load_tolerance|slack_before|friction_reserve|reserve = ", "ncgen_active.c"),
    "what cannot move": (r"1\.?0?e-0?9\)? \* whole|least_mobility", "ncgen_active.c"),
    "standstill": (r"standstill|velocity_tolerance", "ncgen_active.c"),
    "velocities after a lock closes": (r"locked = r?\(?1|<= \(?locked|allowed \*|velocity_residual", "ncgen_active.c"),
    "determinants of loads": (r"most_parts = 12|most_sliding|\bpositive = (1e|r\()|> determined", "ncgen_sliding.c"),
    "rest in space": (
        r"of_step = r\(0\.1|rounding_share = r\(1\.0e-3|from_rest|speed_factor|longer = r\(|unseen = r\(20",
        "ncgen_sliding.c",
    ),
    "what a contact at rest is compared with": (r"rest = r?\(?1\.?0?e-11", ""),
    "what has become of what was held": (r"ncgen_turns|joints\[\d", "ncgen_active.c ncgen_event_table.h"),
    "how a contact slides": (r"gaps\[k\] not in wanted|slides && |ncgen_slides_on;|ncgen_slides_on :", "ncgen_active.c"),
    "direction that is watched": (r"-slip : direction|-int\(p\[self\.place|slip\] < 0 \?", "ncgen_active.c"),
    "what may be held": (r"\.on\"|\.sticks\"", "holdables.py"),
    "conditions of loads": (r"most \+ side|square \+ \(total", ""),
    "pieces of a curve": (r"knots\[middle\]", "ncgen_math.h"),
    "forces of joints": (r"push \+= [^\n]*->ratios", "ncgen_tree_solve.c"),
    "steps of a fixed length": (r"rtol > 0 \|\|", "ncgen_method.c"),
    "positive definite systems": (r"\[k \* size \+ k\] > 0", "ncgen_positive.h"),
    "contacts that come to rest": (r"missed \* |missed_speed|unseen_sliding\(", "ncgen_sliding.c"),
    "in which direction a contact slides": (r"slides_not|sign\(-force|largest_so_far", "ncgen_active.h ncgen_active.c ncgen_sliding.c"),
    "errors and lengths of explicit steps": (r"0\.9[l)]* \* ncgen_pow|0\.01[l)]* \* (second|d0|size|estimate)", "ncgen_step_rules.h"),
    "sums of stages": (r"(weights?|factors)(\[\w\])? \* (\w+->)?((stage_)?derivatives|terms)\[", "ncgen_stage_sums.h"),
    "contacts in turn": (r"fastest\b", "ncgen_impulses.c"),
}
"""{rule: words that its text has, the file that has it, or two; none where C receives it from the model}"""

COMMENT = re.compile(r'/\*.*?\*/|""".*?"""|#[^\n"]*\n', re.DOTALL)


def texts() -> dict[str, str]:
    """{file: text without comments} of Python for events, and of C."""
    root = folder("runtime").parent
    files = [*(root / "solver" / "events").glob("*.py"), *(root / "mechanism").glob("*.py")]
    files += [path for name in ("src", "include", "lanes") for path in (root / "runtime" / name).glob("*.[ch]")]
    return {path.name: path.read_text(encoding="utf-8") for path in files}


@pytest.mark.parametrize("rule", RULES)
def test_a_rule_of_an_instant_stands_in_one_file(rule):
    words, homes = RULES[rule]
    having = {name for name, text in texts().items() if re.search(words, COMMENT.sub("\n", text).lower())}
    assert having == set(homes.split()), f"{rule} stands in {', '.join(sorted(having))}; call {homes}"
