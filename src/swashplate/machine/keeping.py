"""What was made of a model's equations, kept on disk: a warm process reads none of them.

What is kept is plain data: texts, where their numbers go, and object code. It is found by a key
that covers all that it follows from: of a text every equation, constant and type that the model
reaches, declared derivatives among them, and the engine's own source; of object code its text.
"""

from __future__ import annotations

import pickle
from collections.abc import Callable, Iterable
from functools import cache, lru_cache
from hashlib import blake2b
from pathlib import Path
from typing import Any, TypeVar, get_type_hints

from swashplate.__about__ import __version__
from swashplate.machine.cache import generated_folder, mark_used, written
from swashplate.machine.declaration import (
    RULES,
    Replacements,
    closure,
    closure_hash,
    is_function,
)
from swashplate.machine.language import is_named_tuple
from swashplate.machine.model import Model

T = TypeVar("T")

SIZE = 16
"""Bytes of the hash that a file begins with."""


def cached_on_disk(
    name: str, key: tuple[Any, ...], make: Callable[[], T], *, by_engine: bool = True
) -> T:
    """What was made before under this key, or what is made now.

    Parameters
    ----------
    name : str
        How the file's name begins.
    key : tuple
        Of strings, numbers and named tuples of them: all that the result follows from, the engine's
        source apart.
    make : callable
        Makes plain data: it is pickled.
    by_engine : bool
        Whether the result follows from the engine's source as well.

    Returns
    -------
    object
        What `make` returned, in this process or another. A damaged file is made again.
    """
    engine = engine_hash() if by_engine else ""
    digest = blake2b(f"{engine} {key!r}".encode(), digest_size=16).hexdigest()
    folder = generated_folder()
    path = None if folder is None else folder / f"{name}_{digest}.kept"
    content = _read(path)
    if content is not None:
        result: T = content[0]
        return result
    result = make()
    if path is not None:
        payload = pickle.dumps((result,), protocol=pickle.HIGHEST_PROTOCOL)
        written(path, _hash(payload) + payload)
    return result


def _hash(payload: bytes) -> bytes:
    return blake2b(payload, digest_size=SIZE).digest()


def _read(path: Path | None) -> tuple[Any, ...] | None:
    """What a file holds; None if there is none, or it is damaged."""
    if path is None:
        return None
    try:
        framed = path.read_bytes()
        if _hash(framed[SIZE:]) != framed[:SIZE]:
            return None
        mark_used(path)
        content: tuple[Any, ...] = pickle.loads(framed[SIZE:])
    except Exception:  # no file, or whatever unpickling garbage may raise
        return None
    return content


@cache
def engine_hash() -> str:
    """Hash of the source that makes texts of equations."""
    # an installation may have byte code only
    digest = blake2b(__version__.encode(), digest_size=10)
    folder = Path(__file__).parent
    for path in sorted(folder.rglob("*.py")):
        digest.update(path.read_bytes())
    return digest.hexdigest()


# --- keys of models -------------------------------------------------------------------------------


def fingerprint(equations: Iterable[Any]) -> str:
    """Hash of some equations, of all that they reach, and of derivatives that are declared."""
    digest = blake2b(digest_size=16)
    pending, visited = [*equations], set[Any]()
    while pending:
        equation = pending.pop()
        if equation in visited:
            continue
        visited.add(equation)
        digest.update(f"{equation.__name__} {closure_hash(equation)}\0".encode())
        for reached in closure(equation).values():
            rule = RULES.get(reached) if is_function(reached) else None
            if rule is not None:
                pending.append(rule)
    return digest.hexdigest()


@lru_cache(maxsize=256)
def key_of(model: Model) -> str:
    """Hash of all of a model that decides what is generated for it."""
    digest = blake2b(digest_size=16)
    equations: list[Any] = [link.equation for link in model.links.values() if link.equation]
    for part in model.parts:
        kinds = (part.parameters, part.state, part.inputs, part.options, part.given)
        description = (
            part.name,
            (part.place, part.scope, sorted(part.wired.items())),
            [None if kind is None else _shape(kind) for kind in kinds],
            sorted(part.taps.items()),
            sorted(part.defaults.items()),
        )
        digest.update(f"{description!r}\0".encode())
        roles = roles_of(part)
        digest.update(f"{[_hash_of(role) for role in roles]}\0".encode())
        equations += [role for role in roles if role is not None]
        digest.update(f"{_replacement_hashes(part.replacements)!r}\0".encode())
        equations += _new_equations(part.replacements)
    links = [(name, link.sources, _hash_of(link.equation)) for name, link in model.links.items()]
    digest.update(f"{model.name} {links!r} {sorted(model.integrals.items())!r}\0".encode())
    digest.update(f"{_replacement_hashes(model.replacements)!r}\0".encode())
    equations += _new_equations(model.replacements)
    digest.update(fingerprint(equations).encode())
    return digest.hexdigest()


def roles_of(part: Model) -> tuple[Any, ...]:
    """Equations of a part, None for those that it does not have."""
    return part.step, part.sample, part.rest, part.settled, part.limits, part.domain


def _hash_of(equation: Any) -> str:
    """Hash of an equation, empty without one."""
    return "" if equation is None else closure_hash(equation)


def _replacement_hashes(replacements: Replacements) -> list[tuple[str, list[str]]]:
    """Which equations stand for which, in an order that is always the same."""
    return sorted(
        (f"{old.__module__}.{old.__qualname__}", [closure_hash(new) for new in chain])
        for old, chain in replacements.items()
    )


def _new_equations(replacements: Replacements) -> list[Any]:
    """All equations that stand for others."""
    return [new for chain in replacements.values() for new in chain]


def _shape(kind: Any) -> tuple[Any, ...]:
    """What of a class of named tuples decides what is generated."""
    hints = get_type_hints(kind)
    inner = [
        (name, _shape(hints[name]) if is_named_tuple(hints[name]) else str(hints[name]))
        for name in kind._fields
    ]
    return kind.__qualname__, inner, sorted(kind._field_defaults.items())
