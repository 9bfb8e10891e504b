"""What a page shows against what was printed."""

import re

NUMBER = re.compile(r"(?<![\w.+−-])[-+−]?\d+(?:,\d{3})*(\.\d+)?(e[-+]?\d+)?(?![\w.]*_)")


def close(shown: re.Match[str], printed: re.Match[str], share: float) -> bool:
    """Whether two numbers agree to a share or to one unit of the last digit that is shown."""
    a, b = (float(each[0].replace(",", "").replace("−", "-")) for each in (shown, printed))
    unit = 10.0 ** (int((shown[2] or "e0")[1:]) - max(len(shown[1] or "") - 1, 0))
    return abs(a - b) <= max(share * abs(a), 1.001 * unit)


def same(shown: str, printed: str, share: float = 0.02) -> bool:
    """Whether a line that is shown is the one that was printed; `` ...`` ends one that goes on."""
    if shown.endswith(" ..."):
        shown = shown.removesuffix(" ...")
        printed = " ".join(printed.split()[: len(shown.split())])
    if NUMBER.sub("0", shown) != NUMBER.sub("0", printed):
        return False
    pairs = zip(NUMBER.finditer(shown), NUMBER.finditer(printed), strict=True)
    return all(close(*pair, share) for pair in pairs)


def lines(text: str) -> list[str]:
    """Its lines that are not empty, spaces and rules shortened."""
    words = (" ".join(re.sub("─+", "─", line).split()) for line in text.splitlines())
    return [line for line in words if line]


def check_shown(shown: str, printed: str, by: str, share: float = 0.02) -> None:
    """Fail unless the lines shown are the lines printed, ``...`` for any that are left out."""
    rest, free = lines(printed), False
    for line in lines(shown):
        if line == "...":
            free = True
            continue
        found = next((k for k, each in enumerate(rest) if same(line, each, share)), None)
        at_once = f"\nprinted {rest[0]}" if rest and not free else ""
        assert found is not None, f"{by}\nshows   {line}{at_once}\n\n{printed}"
        assert free or found == 0, f"{by}\nshows   {line}{at_once}\n\n{printed}"
        rest, free = rest[found + 1 :], False
    assert free or not rest, f"{by}\nprinted more: {rest[0]}"
