"""Sine and cosine of one angle as instructions: the additions and multiplications of `ncgen_sincos` in ncgen_math.h, so that a module and
compiled C agree to the last bit."""

from __future__ import annotations

from collections.abc import Iterable

from ncgen.emit.wasm.binary import F64, I32, Function, Signature, double, unsigned
from ncgen.emit.wasm.code import CALL, END, F64_CONST, F64_STORE, GET, LESS, OWN, SET, SINCOS

IF, ELSE = b"\x04\x40", b"\x05"
X, SINE, COSINE = range(3)
FAR = 1e6

STEPS = """
k = x * 0.6366197723675814 + 6755399441055744.0 - 6755399441055744.0
head = x - k * 1.5707963267341256
middle = k * 6.077100506303966e-11
rest = head - middle
lost = head - rest - middle - k * 2.0222662487959506e-21
r = rest + lost
tail = rest - r + lost
z = r * r
zz = z * z
half = 0.5 * z
one_less = 1.0 - half
s1 = -2.5050758115840255e-08 + z * 1.589679568451575e-10
s2 = -0.00019841269829807819 + z * 2.7557313691921887e-06 + zz * s1
sine_sum = -0.16666666666666632 + z * 0.008333333333322413 + zz * s2
c1 = 2.0875723273266597e-09 + z * -1.1359647806143871e-11
c2 = 2.4801587289482184e-05 + z * -2.7557314352332913e-07 + zz * c1
cosine_sum = 0.0416666666666666 + z * -0.0013888888888874125 + zz * c2
sine_more = r * z * sine_sum + tail * one_less
s = r + sine_more
c_rest = 1.0 - one_less - half
c_more = zz * cosine_sum - r * tail
c_sum = c_rest + c_more
c = one_less + c_sum
q1 = k * 0.25 - 0.375 + 6755399441055744.0 - 6755399441055744.0
quarter = k - 4.0 * q1
down = quarter * 0.5 - 0.25 + 6755399441055744.0 - 6755399441055744.0
swap = quarter - 2.0 * down
keep = 1.0 - swap
both = down * swap
left = down + swap - 2.0 * both
upright = 1.0 - 2.0 * down
level = 1.0 - 2.0 * left
turned_s = keep * s + swap * c
turned_c = keep * c + swap * s
sine = upright * turned_s
cosine = level * turned_c
"""
"""One assignment a line: sums of products, from left to right."""

SIGNS = {"+": OWN["add"], "-": OWN["sub"]}


def sincos(sine: int, cosine: int) -> Function:
    """f(x, address of the sine, address of the cosine); `sine` and `cosine` are the numbers of the functions for large angles."""
    local = {"x": X}
    code = []
    for line in STEPS.strip().splitlines():
        name, words = line.split(" = ")
        code.append(_sum(words.split(), local))
        local[name] = COSINE + 1 + len(local)  # arguments come first
        code += [SET, unsigned(local[name])]
    near = b"".join(code) + _stored(SINE, GET + unsigned(local["sine"])) + _stored(COSINE, GET + unsigned(local["cosine"]))
    far = b"".join(_stored(place, GET + unsigned(X) + CALL + unsigned(number)) for place, number in ((SINE, sine), (COSINE, cosine)))
    is_near = GET + unsigned(X) + OWN["abs"] + F64_CONST + double(FAR) + LESS
    return Function(SINCOS, Signature((F64, I32, I32), ()), is_near + IF + near + ELSE + far + END, 0, len(local))


def _sum(words: Iterable[str], local: dict[str, int]) -> bytes:
    """A sum of products of names and numbers, in the order of its words."""
    code, sign, product = b"", b"", b""
    for word in [*words, "+"]:
        if word in SIGNS:
            code, sign, product = code + product + sign, SIGNS[word], b""
        elif word != "*":
            factor = GET + unsigned(local[word]) if word in local else F64_CONST + double(float(word))
            product += factor + (OWN["mul"] if product else b"")
    return code


def _stored(place: int, value: bytes) -> bytes:
    return GET + unsigned(place) + value + F64_STORE + unsigned(0)
