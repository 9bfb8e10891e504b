"""Studies of a crane: variants of control and drives in the same seeded seaways.

Differences between variants are within each seaway. Every run begins in the stationary swing
without control of its seaway, has a run-in in which control does what it can, and counts after it.
Of a run only its `RunOutcome` is kept.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from math import hypot, pi, radians, sin, sqrt
from typing import Any, NamedTuple, Unpack

import numpy as np
from numpy.typing import NDArray

from swashplate.crane.axes import RATE, check_names
from swashplate.crane.closed_loop.operator_command import OperatorCommand
from swashplate.crane.closed_loop.result import FARTHEST_SWING, CraneRun
from swashplate.crane.closed_loop.simulating import prepare, simulate
from swashplate.crane.closed_loop.stepper import Actuation, RunOptions
from swashplate.crane.control import Clip, Control, Crew
from swashplate.crane.crane import Crane
from swashplate.crane.kinematics import Vector, boom_at, rotation, tip_of, to_inertial
from swashplate.crane.limits import LIMITED
from swashplate.crane.machines import feels_load, own_drives
from swashplate.crane.rope import GRAVITY
from swashplate.crane.sea.seaway import Seaway, Spectrum
from swashplate.crane.studies.following import follow
from swashplate.crane.studies.run_outcome import STOPPED, RunOutcome, outcome_of
from swashplate.crane.studies.spectral import stationary_start
from swashplate.errors import DomainError, InputError
from swashplate.executors import Executor, Threads
from swashplate.progress import counted
from swashplate.results import Result
from swashplate.tables import listed

Array = NDArray[np.float64]
Controllers = Control | Mapping[str, Control | None]
Drives = Sequence[str] | Mapping[str, str | Crane | Sequence[Crane]]
"""Controllers and drives of a study, by words or names; no controller is None."""

IDEAL, BUILT = "ideal", "identified"
ACTUATED: Mapping[str, Actuation] = {IDEAL: "ideal", BUILT: "inverse", "volts": "volts"}
"""Drives that follow instantaneously; the crane's own after their inverse maps; the same, 10 V for
full speed."""
NO_CONTROL = "no control"
"""The crane as it is built, under the operator's command only."""
CREW = "crew"
"""The same with an operator who damps the swing by hand."""
EVALUATED_TIME, RUN_IN = 600.0, 120.0
"""Time for which a run counts, and that of its run-in: seven decay times of a swing that control
damps by 10 %. [s]"""
CALM = 0.25
"""Height of a sea in which people work with cranes; a crane that cannot, by the model, is damped by
its crew. The lowest class of most scatter diagrams. [m]"""
CREW_NOT_MODELLED = (
    "Not modelled is what a crew does: it damps the swing by moving the boom, which the option "
    "crew adds, and with tag lines, so that a crane without control may work where it is not shown "
    "to."
)
CREW_ASSUMED = "No number of the crew was measured on a crane's operator: all are assumed."
SHORTEST = 60.0
"""Least time for which a run counts. [s]"""
LARGEST_START = 0.5
"""Part of the model's edge that a run begins with at most: nobody begins an operation, or switches
control on, with more."""


class Case(NamedTuple):
    """A crane with its control, as it goes through every seaway."""

    cranes: tuple[Crane, ...]
    """One, or cranes of which each seaway takes the next."""
    options: RunOptions
    command: OperatorCommand

    @property
    def driven(self) -> bool:
        """Whether its drives have limits, as ideal ones have not."""
        return self.options["actuation"] != IDEAL

    @property
    def pose(self) -> dict[str, Any]:
        """Pose at the start: keywords of `Crane.home`."""
        return {name: self._options[name] for name in ("slew_deg", "boom_deg", "rope_m")}

    @property
    def hangs(self) -> dict[str, Any]:
        """Load and suspension, as far as they are given: keywords of `linear_response`."""
        names = ("swing_damping", "load", "suspension")
        return {name: self._options[name] for name in names if name in self._options}

    @property
    def swing_damping(self) -> float:
        """Damping ratio of the load's swing."""
        damping = self.options.get("swing_damping")
        return self.cranes[0].swing_damping if damping is None else damping

    @property
    def _options(self) -> dict[str, Any]:
        return dict(self.options)

    def changed(self, **options: Unpack[RunOptions]) -> Case:
        """The case with other options."""
        return self._replace(options=self.options | options)

    def run(self, number: int, seaway: Seaway, motion: Array | None = None) -> CraneRun:
        """Its run in a seaway by the seaway's number; the ship's motion, if it is known already."""
        crane = self.cranes[number % len(self.cranes)]
        if motion is None:
            motion = seaway.motion(round(self.command.length * RATE) + 1, RATE)
        options = self.options | self._start(seaway)
        return simulate(crane, self.command, sea=motion, **options)

    def swing_at_start(self, seaway: Seaway) -> float:
        """Amplitude of the swing that its run in a seaway begins in. [m]"""
        start = self._start(seaway)
        if not start:
            return 0.0
        omega = sqrt(GRAVITY / self.options["rope_m"])
        return hypot(*start["load_offset"], *(rate / omega for rate in start["load_velocity"]))

    def _start(self, seaway: Seaway) -> RunOptions:
        """The stationary swing without control at time 0, at most a part of the model's edge."""
        if self.swing_damping <= 0.0:
            return {}
        offset, velocity = stationary_start(
            self.cranes[0], seaway, damping=self.swing_damping, **self.pose
        )
        largest = LARGEST_START * self.options["rope_m"] * sin(radians(FARTHEST_SWING))
        offset_x, offset_y = offset
        velocity_x, velocity_y = velocity
        share = min(largest / max(float(np.hypot(offset_x, offset_y)), 1e-9), 1.0)
        return {
            "load_offset": (share * offset_x, share * offset_y),
            "load_velocity": (share * velocity_x, share * velocity_y),
        }

    def sentence(self) -> str:
        """Describe pose, load and control of the crane in a sentence."""
        crane = self.cranes[0]
        pose = self.pose
        control = self.options["control"]
        load = self.hangs.get("load")
        mass = crane.safe_load if load is None else load
        stands = (
            f"boom {pose['boom_deg']:g} deg up and {pose['slew_deg']:g} deg from the bow to "
            f"starboard, rope {pose['rope_m']:g} m, load {mass:g} kg"
        )
        if control is None:
            return f"Without control: {stands}."
        clips = [stage for stage in control.stages if isinstance(stage, Clip)]
        clip = ""
        if clips:
            size = clip_size(clips[0], crane, pose)
            clip = f"; the clip is {size:.2g} m along the boom, sized for the crane's own drives"
        return f"Control by {control.description()}: {stands}{clip}."

    def target(self, seaway: Seaway) -> tuple[float, float] | None:
        """Target of the load, horizontal and inertial [m]; None if the operator moves it."""
        if self.command.samples is not None or self.command.parts:
            return None
        crane = self.cranes[0]
        home = crane.home(**self.pose)
        tip = tip_of(home.slew, boom_at(0.0, crane.geometry, home), crane.geometry)
        attitude = rotation(radians(seaway.list_deg), radians(seaway.trim_deg), 0.0)
        position = to_inertial(attitude, tip, Vector(0.0, 0.0, 0.0))
        return position.x, position.y


@dataclass(frozen=True, eq=False)
class Study(Result):
    """A study as it is asked for: variants of control and drives in seaways."""

    crane: Crane
    cases: Mapping[str, Case]
    """By name: no control, then each controller on each set of drives."""
    seaway: Seaway
    """Sea, heading and ship; its seed is that of each run in turn."""
    seeds: tuple[int, ...]
    length: float
    """Time for which a run counts, after its run-in. [s]"""
    run_in: float
    """[s]"""
    executor: Executor
    progress: Callable[[int, int], None] | None

    @classmethod
    def of(
        cls,
        crane: Crane,
        control: Controllers,
        *,
        seeds: Sequence[int],
        sea: str | Spectrum | Seaway = "ss3",
        drives: Drives = (IDEAL, BUILT),
        crew: Control | None = None,
        command: OperatorCommand | None = None,
        length: float = EVALUATED_TIME,
        run_in: float = RUN_IN,
        executor: Executor | None = None,
        progress: Callable[[int, int], None] | None = None,
        **options: Any,
    ) -> Study:
        """A study; these are the keywords of `assess` and `sweep`.

        Parameters
        ----------
        crane : Crane
            With the drives as identified.
        control : Control or mapping of str to Control or None
            One controller, or several by name.
        seeds : sequence of int
            A seaway for each.
        sea : str, Spectrum or Seaway
            Sea state; a seaway gives heading, ship and spreading as well.
        drives : sequence of str, or mapping of str to str, Crane or sequence of Crane
            ``"ideal"``, which follow instantaneously within their limits of speed;
            ``"identified"``, the crane's own; ``"volts"``, these without their inverse maps. By
            name also other cranes, or several of which each seaway takes the next, see
            `drawn_cranes`.
        crew : Control, optional
            `control.Crew`, which adds the variant ``"crew"``: no control, but an operator who damps
            the swing by hand, on the crane's own drives.
        command : OperatorCommand, optional
            What the operator does; by default nothing, the crane keeps its load in place. Its
            length is then that of each run.
        length : float
            Time for which a run counts; 10 min by default. [s]
        run_in : float
            Time before it. [s]
        executor : Executor, optional
            Of `swashplate.executors`; threads by default. The numbers do not depend on it.
        progress : callable, optional
            Called with seaways done and their number.
        **options
            Where each run begins, what hangs on it: see `RunOptions`, whose control and actuation
            follow from controllers and drives. By default the load hangs abeam on 27 m of rope.
        """
        controllers = control if isinstance(control, Mapping) else {"": control}
        names_or_sets = [drives] if isinstance(drives, str) else drives
        if not isinstance(names_or_sets, Iterable):
            raise InputError(f"drives is {drives!r}, but must be a list of names, or a mapping.")
        if isinstance(names_or_sets, Mapping):
            sets = names_or_sets
        else:
            sets = {name: name for name in names_or_sets}
        if isinstance(seeds, int):
            raise InputError(f"seeds is {seeds}, but must be a sequence, as range({seeds}).")
        if not (controllers and sets and seeds):
            raise InputError(
                "A study needs at least one controller, one set of drives and one seed."
            )
        set_here = ("control", "actuation", "load_offset", "load_velocity")
        run_options = [name for name in RunOptions.__annotations__ if name not in set_here]
        of_study = ("seeds", "sea", "drives", "crew", "command", "length", "run_in")
        keywords = (*of_study, *run_options)
        check_names("A study has no", options, keywords, "it has")
        if not (length >= SHORTEST and run_in >= 0.0):
            raise InputError(
                f"A run is evaluated for {length:g} s after a run-in of {run_in:g} s, but must be "
                f"evaluated for at least {SHORTEST:g} s, eight swings, after a run-in of 0 s or "
                "more."
            )
        if command is None:
            command = OperatorCommand.rest(run_in + length)
        elif command.length < run_in + SHORTEST:
            raise InputError(
                f"The stick is {command.length:g} s long, but a run is evaluated from {run_in:g} s "
                f"on for at least {SHORTEST:g} s: use a longer stick, or a shorter run_in."
            )
        pose: Any = {"slew_deg": 90.0, "boom_deg": 45.0, "rope_m": 27.0, **options}
        none = Case((crane,), pose | {"control": None, "actuation": "inverse"}, command)
        cases = {NO_CONTROL: none}
        if crew is not None:
            cases[CREW] = none.changed(control=crew)
        for controller, stages in controllers.items():
            for name, drives_of_set in sets.items():
                case = _driven(none.changed(control=stages), name, drives_of_set)
                cases[f"{controller}, {name}" if controller else name] = case
        seaway = sea if isinstance(sea, Seaway) else Seaway(sea)
        record = max(seaway.record, command.length)
        return cls(
            crane=crane,
            cases=cases,
            seaway=replace(seaway, record=record),
            seeds=tuple(seeds),
            length=command.length - run_in,
            run_in=run_in,
            executor=executor or Threads(),
            progress=progress,
        )

    @property
    def crewed(self) -> bool:
        """Whether a crew is among the variants."""
        controls = [case.options["control"] for case in self.cases.values()]
        stages = [stage for control in controls if control is not None for stage in control.stages]
        return any(isinstance(stage, Crew) for stage in stages)

    def provenance(self) -> tuple[str, ...]:
        """Sentences on the drives of all its cranes, each once: `Crane.provenance`."""
        cranes = [self.crane, *(crane for case in self.cases.values() for crane in case.cranes)]
        return tuple(dict.fromkeys(sentence for crane in cranes for sentence in crane.provenance()))

    def run(self, name: str, seed: int) -> CraneRun:
        """The whole run of a variant in one seaway; a `DomainError` if it is stopped."""
        check_names("There is no variant", [name], self.cases)
        if seed not in self.seeds:
            raise InputError(
                f"There is no seaway {seed} in this study; its seeds are {self.seeds}."
            )
        return self.cases[name].run(self.seeds.index(seed), replace(self.seaway, seed=seed))

    def outcomes(
        self, cases: Sequence[Case], numbers: Sequence[int] | None = None
    ) -> list[tuple[RunOutcome, ...]]:
        """Outcomes of all cases, a tuple for each seaway, or for some by their numbers.

        An `InputError` or `ParameterError` if a case cannot begin as it is asked to.
        """
        for case in cases:  # refused here, once, and not by a worker
            prepare(case.cranes[0], case.command, case.options)
        seaway_numbers = range(len(self.seeds)) if numbers is None else numbers
        outcomes: list[tuple[RunOutcome, ...]] = [()] * len(seaway_numbers)
        items = [(number, self.seeds[number]) for number in seaway_numbers]
        runs = self.executor.run(_of_seaway, (tuple(cases), self.seaway, self.run_in), items)
        seaways = counted(runs, len(seaway_numbers), "seaways", f"Simulating {self.crane.name}")
        for done, (position, of_seaway) in enumerate(seaways, 1):
            outcomes[position] = of_seaway
            if self.progress is not None and numbers is None:
                self.progress(done, len(seaway_numbers))
        return outcomes


def assumed_sentences(crane: Crane) -> list[str]:
    """List assumptions about a crane and its limits, and whether its drives feel the load."""
    sentences = []
    if crane.assumed:
        sentences.append(f"{crane.assumed} of the crane are assumed.")
    if not any(map(feels_load, own_drives(crane).values())):
        sentences.append("No drive feels the load: they were identified without one.")
    limits = [
        LIMITED[name].label for name, limit in crane.limits.items() if limit.status == "assumed"
    ]
    if limits:
        sentences.append(f"Limits that are assumed: {listed(limits)}.")
    return sentences


def clip_size(clip: Clip, crane: Crane, pose: Mapping[str, Any]) -> float:
    """Largest offset of the tip along the boom that control may add. [m]"""
    if clip.size != "auto":
        return float(clip.size)
    period = 2.0 * pi * sqrt(pose["rope_m"] / GRAVITY)
    reach = follow(crane, [period], seas=(), **pose).amplitude[0, 2]
    return clip.share * float(reach)


def _driven(case: Case, name: str, drives: str | Crane | Sequence[Crane]) -> Case:
    """A case on a set of drives: a name of `ACTUATED`, a crane, or several."""
    if isinstance(drives, str):
        check_names("There are no drives", [drives], ACTUATED)
        return case.changed(actuation=ACTUATED[drives])
    cranes: tuple[Any, ...] = tuple(drives) if isinstance(drives, Sequence) else (drives,)
    if not cranes or not all(isinstance(crane, Crane) for crane in cranes):
        raise InputError(
            f"The drives '{name}' are {drives!r}, but must be a name, a crane or a list of cranes."
        )
    return case._replace(cranes=cranes)


def _of_seaway(
    work: tuple[tuple[Case, ...], Seaway, float], item: tuple[int, int]
) -> tuple[RunOutcome, ...]:
    """Outcomes of all cases in one seaway."""
    cases, unseeded, run_in = work
    number, seed = item
    seaway = replace(unseeded, seed=seed)
    longest = max(case.command.length for case in cases)
    motion = seaway.motion(round(longest * RATE) + 1, RATE)
    outcomes = []
    for case in cases:
        try:
            run = case.run(number, seaway, motion)
        except (DomainError, InputError):  # the travel's limits, or a tip too fast for the rope
            outcomes.append(STOPPED)
        else:
            outcomes.append(outcome_of(run, run_in, case.target(seaway)))
    return tuple(outcomes)
