"""Payloads that are almost valid: flipped, cut, spliced, with extreme numbers, deep, large.

All draws come from one generator, so that a seed makes the same payloads again; only the time
in them, which a rig compares with its clock, is that of the sending.
"""

import copy
import json
import math
import random
import re
import struct
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final

from tests.campaigns.payloads import Tree, draw_payload

from frictus import block, stream

_MARK: Final = "@number@"
"""Stands in a tree for a text that no JSON writer would write."""

NUMBERS: Final = (
    *("0", "-0", "-0.0", "1", "-1", "0.5", "1e-9", "-1e-9", "0.1", "50", "1000", "10000"),
    *("5e-324", "-5e-324", "2.2250738585072014e-308", "1e-300", "1e-30", "1e30", "1e300"),
    *("1.7976931348623157e308", "-1.7976931348623157e308", "1e400", "-1e400"),
    *("NaN", "Infinity", "-Infinity", "01", "+1", ".5", "0x10", '"1"', "null", "true"),
    *(str(sign * 2**bits + more) for bits in (15, 31, 32, 53, 63, 64) for sign in (-1, 1)
      for more in (-1, 0, 1)),
    *("1" + "0" * 400, "-1" + "0" * 400, "1" + "0" * 5_000, "0." + "3" * 5_000, "1e-5000"),
)  # fmt: skip
"""Extremes of every kind of number, and what is none."""
OTHERS: Final[tuple[Any, ...]] = (
    *(None, True, "", "x", "\x00", "\ud800", "é" * 64, "x" * 65, "x" * 20_000, "../..", "*"),
    *([], {}, [[]], [None] * 100, {"": {}}, {"__class__": 1}, -1, 1e9),
)
"""Values of other types."""
Ways = dict[str, tuple[float, Callable[[], bytes]]]
"""How often each is drawn, and what it makes."""
NUMBER_TEXT: Final = re.compile(rb"(?<=>)-?[0-9]+(\.[0-9]+)?(?=<)")
"""A number between two tags."""
DEPTHS: Final = (10, 127, 200, 1_000, 20_000)


@dataclass(frozen=True, slots=True)
class Mutant:
    """A payload and how it was made."""

    how: str
    payload: bytes


def draw_mutant(
    key: str, client: str, utc_ns: int, most_bytes: int, rng: random.Random
) -> Mutant:
    """Return a payload of a key that is valid or no longer so.

    Parameters
    ----------
    key : str
        One of `payloads.KEYS`.
    client : str
        In whose name.
    utc_ns : int
        Now.
    most_bytes : int
        What the key's reader accepts; sizes around it are drawn too.
    rng : Random
    """
    valid = draw_payload(key, client, utc_ns, rng)
    if isinstance(valid, bytes):
        ways: Ways = {
            "valid": (1.0, lambda: valid),
            "header": (4.0, lambda: _with_header(valid, rng)),
            "samples": (2.0, lambda: _with_samples(valid, rng)),
        }
        plain = valid
    else:
        plain = json.dumps(valid).encode()
        ways = _ways_of_tree(valid, plain, rng)
    ways |= _ways_of_bytes(plain, most_bytes, rng)
    ways["spliced"] = (1.0, lambda: _spliced(plain, key, client, utc_ns, rng))
    return _drawn(ways, rng)


def draw_damaged(valid: Tree, most_bytes: int, rng: random.Random) -> Mutant:
    """Return a JSON document that is valid or no longer so; see `draw_mutant`.

    Parameters
    ----------
    valid : dict
        The document.
    most_bytes : int
        What its reader accepts.
    rng : Random
    """
    plain = json.dumps(valid).encode()
    ways = _ways_of_tree(valid, plain, rng) | _ways_of_bytes(plain, most_bytes, rng)
    ways["repeated"] = (1.0, lambda: _repeated(valid, most_bytes, rng))
    return _drawn(ways, rng)


def draw_damaged_bytes(plain: bytes, most_bytes: int, rng: random.Random) -> Mutant:
    """Return a binary file that is valid or no longer so; see `draw_damaged`.

    Parameters
    ----------
    plain : bytes
        Valid.
    most_bytes : int
        What its reader accepts.
    rng : Random
    """
    ways = _ways_of_bytes(plain, most_bytes, rng)
    ways["valid"] = (1.0, lambda: plain)
    ways["flipped"] = (6.0, ways["flipped"][1])
    ways["repeated"] = (1.0, lambda: _with_slice_repeated(plain, most_bytes, rng))
    return _drawn(ways, rng)


def draw_damaged_text(plain: bytes, most_bytes: int, rng: random.Random) -> Mutant:
    """Return a text, such as XML, that is valid or no longer so; see `draw_damaged`.

    Parameters
    ----------
    plain : bytes
        Valid.
    most_bytes : int
        What its reader accepts.
    rng : Random
    """
    ways = _ways_of_bytes(plain, most_bytes, rng)
    ways["valid"] = (1.0, lambda: plain)
    ways["number"] = (6.0, lambda: _with_number_texts(plain, rng))
    ways["repeated"] = (1.0, lambda: _with_slice_repeated(plain, most_bytes, rng))
    return _drawn(ways, rng)


def _with_number_texts(plain: bytes, rng: random.Random) -> bytes:
    """Replace one or two of the numbers that stand in a text."""
    for place in rng.sample(list(NUMBER_TEXT.finditer(plain)), rng.choice([1, 1, 2])):
        text = _number(float(place[0]), rng).encode()
        plain = plain.replace(place[0], text, 1)
    return plain


def _with_slice_repeated(plain: bytes, most_bytes: int, rng: random.Random) -> bytes:
    begin, end = sorted(rng.sample(range(len(plain)), 2))
    times = rng.choice([2, 10, max(2, (most_bytes - len(plain)) // (end - begin))])
    return plain[:begin] + plain[begin:end] * times + plain[end:]


def _ways_of_tree(valid: Tree, plain: bytes, rng: random.Random) -> Ways:
    return {
        "valid": (1.0, lambda: plain),
        "number": (6.0, lambda: _with_numbers(valid, rng)),
        "value": (3.0, lambda: _with_value(valid, rng)),
        "field": (1.0, lambda: _without_field(valid, rng)),
        "depth": (0.5, lambda: _deep(valid, rng)),
    }


def _ways_of_bytes(plain: bytes, most_bytes: int, rng: random.Random) -> Ways:
    return {
        "flipped": (1.0, lambda: _flipped(plain, rng)),
        "cut": (0.5, lambda: plain[: rng.randrange(len(plain))]),
        "random": (0.5, lambda: rng.randbytes(rng.choice([0, 1, 63, 64, 65, 4_096]))),
        "size": (0.1, lambda: _padded(plain, most_bytes, rng)),
    }


def _drawn(ways: Ways, rng: random.Random) -> Mutant:
    (how,) = rng.choices(list(ways), [weight for weight, _ in ways.values()])
    return Mutant(how, ways[how][1]())


def _places(tree: Any, is_wanted: Callable[[Any], bool]) -> list[tuple[Any, Any]]:
    """Return container and index of every value in a tree that is wanted."""
    pairs = (
        tree.items()
        if isinstance(tree, dict)
        else enumerate(tree)
        if isinstance(tree, list)
        else ()
    )
    found = []
    for index, value in pairs:
        if is_wanted(value):
            found.append((tree, index))
        found += _places(value, is_wanted)
    return found


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _with_numbers(valid: Tree, rng: random.Random) -> bytes:
    """Replace one or two numbers; mostly not the time, which would make it stale."""
    tree = copy.deepcopy(valid)
    places = _places(tree, _is_number)
    if rng.random() < 0.9:
        places = [place for place in places if place[1] not in ("utc_ns", "ttl_ms")] or places
    texts: list[str] = []
    for container, index in rng.sample(places, min(len(places), rng.randint(1, 2))):
        texts.append(_number(container[index], rng))
        container[index] = f"{_MARK}{len(texts) - 1}"
    text = json.dumps(tree)
    for place, number in enumerate(texts):
        text = text.replace(f'"{_MARK}{place}"', number)
    return text.encode()


def _number(former: float, rng: random.Random) -> str:
    """Return an extreme, any magnitude, or one not far from the former."""
    draw = rng.random()
    if draw < 0.3:
        return rng.choice(NUMBERS)
    if draw < 0.6:
        value = rng.choice([-1.0, 1.0, 1.0]) * 10.0 ** rng.uniform(-20.0, 20.0)
        return str(int(value)) if rng.random() < 0.3 else repr(value)
    value = former * 10.0 ** rng.uniform(-3.0, 3.0)
    return str(int(value)) if isinstance(former, int) else repr(value)


def _with_value(valid: Tree, rng: random.Random) -> bytes:
    tree = copy.deepcopy(valid)
    container, index = rng.choice(_places(tree, lambda _value: True))
    container[index] = rng.choice(OTHERS)
    text = json.dumps(tree, ensure_ascii=rng.random() < 0.5)
    return text.encode("utf-8", "surrogatepass")


def _without_field(valid: Tree, rng: random.Random) -> bytes:
    """Leave a field out, or give it another name; twice the same is `spliced`."""
    tree = copy.deepcopy(valid)
    container, index = rng.choice(_places(tree, lambda _value: True))
    value = container.pop(index)
    if isinstance(container, dict) and rng.random() < 0.5:
        container[rng.choice(["", "extra", "x" * 10_000, f"{index} "])] = value
    return json.dumps(tree).encode()


def _deep(valid: Tree, rng: random.Random) -> bytes:
    depth = rng.choice(DEPTHS)
    opening, closing = rng.choice([("[", "]"), ('{"a":', "}"), ("[", "")])
    nested = opening * depth + "1" * (opening != "[") + closing * depth
    if rng.random() < 0.3:
        return nested.encode()
    tree = copy.deepcopy(valid)
    container, index = rng.choice([*_places(tree, lambda _value: True), (tree, "extra")])
    container[index] = _MARK
    return json.dumps(tree).replace(f'"{_MARK}"', nested).encode()


def _repeated(valid: Tree, most_bytes: int, rng: random.Random) -> bytes:
    """Fill the document with copies of what one of its lists holds, as far as is accepted."""
    tree = copy.deepcopy(valid)
    lists = [value for c, i in _places(tree, lambda v: isinstance(v, list)) if (value := c[i])]
    if not lists:
        return json.dumps(tree).encode()
    chosen = rng.choice(lists)
    room = most_bytes - len(json.dumps(tree))
    most = max(room // (len(json.dumps(chosen)) + 2), 1)
    chosen *= min(int(10.0 ** rng.uniform(0.3, 6.0)), most)
    return json.dumps(tree).encode()


def _flipped(plain: bytes, rng: random.Random) -> bytes:
    flipped = bytearray(plain)
    for _ in range(rng.choice([1, 1, 2, 8, 64])):
        flipped[rng.randrange(len(flipped))] ^= 1 << rng.randrange(8)
    return bytes(flipped)


def _spliced(plain: bytes, key: str, client: str, utc_ns: int, rng: random.Random) -> bytes:
    """Return the head of one payload and the tail of another of its key."""
    other = draw_payload(key, client, utc_ns, rng)
    tail = other if isinstance(other, bytes) else json.dumps(other).encode()
    return plain[: rng.randrange(len(plain) + 1)] + tail[rng.randrange(len(tail) + 1) :]


def _padded(plain: bytes, most_bytes: int, rng: random.Random) -> bytes:
    """Return it at, just within or beyond what is accepted, in space or in empty lists."""
    size = rng.choice([most_bytes - 1, most_bytes, most_bytes + 1, most_bytes * 5 // 4])
    if plain[:1] != b"{" or rng.random() < 0.5:
        return plain.ljust(size)
    head = plain[:-1] + b', "extra": [[]'
    return (head + b",[]" * ((size - len(head) - 2) // 3) + b"]}").ljust(size)


def _with_header(valid: bytes, rng: random.Random) -> bytes:
    """Replace one field of a frame's header by an extreme of its type."""
    header = stream.HEADER if valid.startswith(stream.MAGIC) else block.HEADER
    fields = list(header.unpack_from(valid))
    kinds = [letter for letter in header.format if letter not in "<4"]
    place = rng.randrange(1, len(fields))
    if kinds[place] == "d":
        fields[place] = rng.choice(
            [0.0, -0.0, 5e-324, -1.0, 1e-300, 1e300, math.inf, -math.inf, math.nan, 1e3, 10.0]
        )
    else:
        bits = 8 * struct.calcsize(f"<{kinds[place]}") - kinds[place].islower()
        low = -(2**bits) if kinds[place].islower() else 0
        fields[place] = rng.choice(
            [low, 0, 1, 2, 2**bits - 1, 2 ** (bits - 1), rng.getrandbits(bits)]
        )
    return header.pack(*fields) + valid[header.size :]


def _with_samples(valid: bytes, rng: random.Random) -> bytes:
    """Replace some of the samples by extremes of float32."""
    changed = bytearray(valid)
    for _ in range(rng.choice([1, 8, 64])):
        place = 64 + 4 * rng.randrange((len(valid) - 64) // 4)
        value = rng.choice([math.nan, math.inf, -math.inf, 1e-45, -10.0, 10.0, 3.4e38, 10.001])
        changed[place : place + 4] = struct.pack("<f", value)
    return bytes(changed)
