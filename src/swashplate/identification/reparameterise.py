"""A set-up that the runs can determine: what to hold, and which forces to ask for instead."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from textwrap import wrap
from typing import TYPE_CHECKING, Any

import numpy as np

from swashplate.errors import InputError
from swashplate.identification.excitation import Outlook
from swashplate.identification.forces import Forces
from swashplate.identification.identifiability import NAMED
from swashplate.identification.setup import Free, GivenForces, Setup, Stage
from swashplate.parameters.definitions import CATALOGUE

if TYPE_CHECKING:
    from tomlkit.items import InlineTable

ROOM = 0.98
"""Part of the largest tested current at which the outermost force is asked for."""
IDLE = "no run exercises it"
COMMENT = 96
"""Letters in a line of a comment."""


@dataclass(frozen=True)
class Proposal:
    """What to change in one stage so that the runs determine all that is free."""

    stage: Stage
    """As it was."""
    proposed: Stage | None
    """As it could be; None if nothing of it can be determined."""
    held: Mapping[str, str]
    """Unknowns to hold, each with the reason."""
    notes: tuple[str, ...] = ()
    """What else is changed, or cannot be."""

    @property
    def changes(self) -> bool:
        """Whether anything is to be changed."""
        return self.proposed != self.stage

    def sentences(self) -> tuple[str, ...]:
        """The offer in words."""
        said = [f"Hold {', '.join(names)}: {reason}." for names, reason in self._by_reason()]
        if self.proposed is None:
            said.append(f"Nothing is then left of the stage '{self.stage.name}'.")
        return (*said, *self.notes)

    def comments(self) -> tuple[str, ...]:
        """What is held, as lines for the file."""
        lines = []
        for names, reason in self._by_reason():
            are = "is" if len(names) == 1 else "are"
            lines += wrap(f"{', '.join(names)} {are} held: {reason}", COMMENT)
        return tuple(lines)

    def _by_reason(self) -> list[tuple[list[str], str]]:
        reasons: dict[str, list[str]] = {}
        for name, reason in self.held.items():
            reasons.setdefault(reason, []).append(name)
        return [
            (names, "no run exercises them" if reason == IDLE and len(names) > 1 else reason)
            for reason, names in reasons.items()
        ]


def propose(outlook: Outlook, *, faint: bool = False) -> Proposal:
    """What to hold, or to ask for instead, from what the runs cannot tell.

    Parameters
    ----------
    outlook : Outlook
        Of one stage.
    faint : bool
        Hold as well what the runs hardly tell: for values that are known, as they are then taken
        for exact.
    """
    verdict = outlook.identifiability
    reasons = dict.fromkeys(verdict.unexcited, IDLE)
    for direction in (*verdict.null, *(verdict.faint if faint else ())):
        others = [name for name in direction.changes if name != direction.hold]
        if direction.gauge is not None:
            reason = direction.gauge.determined
        elif direction.sharpness > 0.0:
            more = len(others) - NAMED
            told = f"{', '.join(others[:NAMED])}{f' and {more} others' if more > 0 else ''}"
            reason = f"the runs hardly tell it from {told}, but a wrong value shows in them"
        else:
            reason = f"the runs cannot tell it from {', '.join(others)}"
        reasons[direction.hold] = reason
    own = [each for each in reasons if "(" in each]
    notes = [f"{name} belongs to one run and stays free." for name in own]
    reasons = {name: why for name, why in reasons.items() if name not in own}
    stage = outlook.stage
    forces, of_forces, said = _forces(outlook, reasons)
    for name in of_forces:
        del reasons[name]
    notes += said
    free = _without(stage.free, tuple(reasons))
    proposed = None
    if free:
        proposed = stage.model_copy(update={"free": free, "forces": forces})
    return Proposal(stage, proposed, reasons, tuple(notes))


def _without(free: Mapping[str, Free], held: Sequence[str]) -> dict[str, Free]:
    """Entries of a stage without some unknowns; a direction alone where the other one is held."""
    kept: dict[str, Free] = {}
    for name, entry in free.items():
        if name in held:
            continue
        columns = CATALOGUE[name].columns if name in CATALOGUE else (name,)
        left = [column for column in columns if column not in held]
        if entry.tied or len(left) == len(columns):
            kept[name] = entry
        else:
            kept |= dict.fromkeys(left, entry)
    return kept


def _forces(
    outlook: Outlook, reasons: Mapping[str, str]
) -> tuple[GivenForces | None, list[str], list[str]]:
    """Forces within the tested currents; names of forces among the reasons, and what to say."""
    given = outlook.stage.forces
    if given is None:
        return None, [], []
    known = Forces(given.plus, given.minus).names
    concerned = [name for name in reasons if name in known]
    changes: dict[str, tuple[float, ...]] = {}
    notes = []
    for side, sign in (("plus", 1.0), ("minus", -1.0)):
        names = [name for name in concerned if f"_{side}_" in name]
        currents = getattr(given, side)
        largest = _largest_current(outlook, sign)
        outermost = outlook.activation[f"force_{side}_{len(currents)}"]
        if largest <= 0.0 and names:
            notes.append(
                f"{', '.join(names)} cannot be left out of [stages.forces]: without a current "
                f"beyond Z17 ({side}) they stay at their nominal values, and do no harm."
            )
        elif largest > 0.0 and not outermost.any():
            factor = ROOM * largest / currents[-1]
            changes[side] = tuple(float(f"{factor * current:.3g}") for current in currents)
            asked = ", ".join(f"{current:g}" for current in changes[side])
            notes.append(
                f"Ask for the {side} forces at {asked} A: no run goes further than {largest:.3g} A "
                "beyond Z17."
            )
        elif names:
            notes.append(
                f"{', '.join(names)} cannot be held alone in [stages.forces]: add a run that "
                f"dwells at more levels between {currents[0]:g} and {currents[-1]:g} A ({side})."
            )
    return given.model_copy(update=changes), concerned, notes


def _largest_current(outlook: Outlook, sign: float) -> float:
    """Largest current beyond the solenoids' dead zone in any run, one way. [A]"""
    return max(
        float(np.max(sign * each.current, initial=0.0)) - each.pump.Z17
        for each in outlook.simulations.values()
    )


def proposed_setup(setup: Setup, proposals: Sequence[Proposal]) -> Setup:
    """A set-up with all proposals taken; stages of which nothing is left are left out.

    Raises
    ------
    InputError
        If nothing is left at all.
    """
    stages = tuple(each.proposed for each in proposals if each.proposed is not None)
    if not stages:
        raise InputError(
            "The runs determine none of the unknowns, so that there is no set-up to propose: test "
            "what exercises them first."
        )
    return setup.model_copy(update={"stages": stages})


def setup_text(setup: Setup, proposals: Sequence[Proposal] = ()) -> str:
    """A set-up as TOML, with a comment for each unknown that is held.

    Parameters
    ----------
    setup : Setup
        What to write; `setup.load_setup` reads an equal one.
    proposals : sequence of Proposal
        Where it comes from.
    """
    from tomlkit import aot, comment, document, inline_table, table

    def inline(content: Mapping[str, Any]) -> InlineTable:
        made = inline_table()
        made.update(content)
        return made

    why = {each.stage.name: each for each in proposals}
    text, stages = document(), aot()
    if setup.title:
        text.add("title", setup.title)
    for stage in setup.stages:
        content = stage.model_dump(mode="json", by_alias=True, exclude_defaults=True)
        made = table()
        for key in ("name", "part", "current", "channels"):
            if key in content:
                made.add(key, content[key])
        free = table()
        for name, entry in content["free"].items():
            free.add(name, inline(entry))
        proposal = why.get(stage.name)
        if proposal is not None:
            for line in proposal.comments():
                free.add(comment(line))
        made.add("free", free)
        for key in ("forces", "weights"):
            if key in content:
                part = table()
                for name, value in content[key].items():
                    part.add(name, value)
                made.add(key, part)
        stages.append(made)
    text.add("stages", stages)
    return text.as_string()
