"""Units of FMI variables: from "W/m2K" to the exponents of the SI base units."""

from __future__ import annotations

import re

# Exponents (kg, m, s, K, A, mol, cd, rad) of every symbol a unit may be made of; all of them coherent, factor 1.
BASE = ("kg", "m", "s", "K", "A", "mol", "cd", "rad")
_SYMBOLS = {
    "kg": (1,), "m": (0, 1), "s": (0, 0, 1), "K": (0, 0, 0, 1), "rad": (0, 0, 0, 0, 0, 0, 0, 1), "1": (),
    "N": (1, 1, -2), "Pa": (1, -1, -2), "J": (1, 2, -2), "W": (1, 2, -3),
}
_TOKEN = re.compile(r"(kg|rad|Pa|[mskKNJW1])(\d?)")


def base_exponents(unit: str) -> dict[str, int]:
    """Exponents of the base units of `unit`: symbols side by side, powers as digits, at most one "/".

    "W/m2K" is {"kg": 1, "s": -3, "K": -1}.  Raises ValueError for what is not such a unit.
    """
    total = dict.fromkeys(BASE, 0)
    parts = unit.split("/")
    if len(parts) > 2:
        raise ValueError(f"unit {unit!r}: one '/' at most")
    for sign, part in zip((1, -1), parts, strict=False):
        tokens = _TOKEN.findall(part)
        symbols = [symbol for symbol, _ in tokens]
        # A symbol twice in a row is a prefix in disguise: "mm" is not m2.
        if not part or _TOKEN.sub("", part) or len(set(symbols)) < len(symbols) or not _SYMBOLS.keys() >= set(symbols):
            raise ValueError(f"unit {unit!r} is not made of {', '.join(_SYMBOLS)} and powers")
        for symbol, power in tokens:
            for base, exponent in zip(BASE, _SYMBOLS[symbol], strict=False):
                total[base] += sign * exponent * int(power or 1)
    return {base: exponent for base, exponent in total.items() if exponent}
