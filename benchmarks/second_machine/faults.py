"""Faults of a campaign: each changes its equipment, and nothing else. Sizes are in levels.toml."""

from dataclasses import replace

import numpy as np

from . import controller, draws, equations
from .draws import LEVELS
from .logger import Machine

SIZES = LEVELS["faults"]


def top_speed(equipment):
    """Speed of the machine at the largest command. [rad/s]"""
    plus = draws.channel(equipment.parameters, "plus")
    current = equations.steady_current(controller.LARGEST, plus)
    return equations.settled_speed(current, draws.pump(equipment.parameters))


# --- the machine ----------------------------------------------------------------------------------


def with_condition(equipment, **changes):
    """Equipment whose machine differs in all runs, and in new ones."""
    conditions = {
        run: condition._replace(**changes) for run, condition in equipment.conditions.items()
    }
    steady = equipment.steady._replace(**changes)
    return replace(equipment, conditions=conditions, steady=steady)


def scaled(equipment, name, factor):
    """Equipment whose machine has another value of a number."""
    parameters = dict(equipment.parameters)
    parameters[name] *= factor
    return replace(equipment, parameters=parameters)


def spool_friction(equipment):
    """The dither fails: spool and solenoid have their full hysteresis."""
    return with_condition(equipment, hysteresis=SIZES["spool_hysteresis"])


def leakage(equipment):
    """A load that resists motion, and a worn motor."""
    return with_condition(equipment, leakage=SIZES["leakage"] * top_speed(equipment))


def small_leakage(equipment):
    """The same load, and a motor in good order."""
    return with_condition(equipment, leakage=SIZES["leakage_small"] * top_speed(equipment))


def drift(equipment):
    """The speed falls from run to run; on average over the fitted runs it is the machine's."""
    runs = list(equipment.conditions)
    place = np.linspace(0.0, 1.0, len(runs))
    place -= np.mean([at for run, at in zip(runs, place, strict=True)
                      if run not in equipment.held_out])  # fmt: skip
    conditions = {}
    for run, at in zip(runs, place, strict=True):
        condition = equipment.conditions[run]
        speed = condition.speed * (1.0 - SIZES["drift"] * float(at))
        conditions[run] = condition._replace(speed=speed)
    return replace(equipment, conditions=conditions)


def longer_delay(equipment):
    """The card answers later than its data sheet says."""
    return scaled(equipment, "tau", 1.0 + SIZES["late"] / equipment.parameters["tau"])


def low_supply(equipment):
    """The charge pressure is lower than its gauge was read."""
    return scaled(equipment, "Z9", SIZES["supply"])


def weak_dither(equipment):
    """Spool and solenoid have half of the hysteresis without a dither."""
    return with_condition(equipment, hysteresis=SIZES["weak_dither"])


def soft_shaft(equipment):
    """Motor and drum turn against each other."""
    return with_condition(equipment, shaft_frequency=SIZES["soft_shaft"])


def hunting(equipment):
    """The charge pressure oscillates."""
    return with_condition(equipment, hunting=SIZES["hunting"])


def droop(equipment):
    """The charge pressure falls with the flow."""
    return with_condition(equipment, droop=SIZES["droop"])


def of_each_run(equipment, change):
    """Equipment whose machine differs from run to run, by place in the day; new ones are steady."""
    conditions = {
        run: change(place, condition)
        for place, (run, condition) in enumerate(equipment.conditions.items())
    }
    return replace(equipment, conditions=conditions)


def set_anew(equipment):
    """The charge pressure is another one in each run."""
    random = np.random.default_rng([equipment.seed, len(equipment.conditions)])
    levels = SIZES["level"] * random.standard_normal(len(equipment.conditions))
    return of_each_run(
        equipment, lambda place, condition: condition._replace(level=float(levels[place]))
    )


def cold_oil(equipment):
    """The orifices pass less at first; on average over the runs they are the machine's."""
    last = len(equipment.conditions) - 1

    def warmer(place, condition):
        change = SIZES["cold_oil"] * (place / last - 0.5)
        return condition._replace(orifice=condition.orifice * (1.0 + change))

    return of_each_run(equipment, warmer)


def load_in_half(equipment):
    """Every second run is made with a load that resists motion."""
    lost = SIZES["leakage_small"] * top_speed(equipment)
    return of_each_run(
        equipment,
        lambda place, condition: condition._replace(leakage=0.0 if place % 2 else lost),
    )


# --- the instruments ------------------------------------------------------------------------------


def encoder_late(equipment):
    """Counts have the stamps of later samples."""
    return replace(equipment, encoder=replace(equipment.encoder, delay=SIZES["late"]))


def encoder_gain(equipment):
    """More counts a turn than the label says."""
    step = equipment.encoder.step / SIZES["encoder_gain"]
    return replace(equipment, encoder=replace(equipment.encoder, step=step))


def slow_counter(equipment):
    """The counter loses what is beyond a part of the counts a second at the largest command."""
    fastest = SIZES["counter"] * top_speed(equipment) / equipment.encoder.step
    return replace(equipment, encoder=replace(equipment.encoder, fastest=fastest))


def play(equipment):
    """Play between drum and encoder."""
    width = float(np.deg2rad(SIZES["play"]))
    return replace(equipment, encoder=replace(equipment.encoder, play=width))


def ammeter_clipped(equipment):
    """The ammeter's range ends below the largest currents."""
    limit = SIZES[f"ammeter_limit_{equipment.axis}"]
    return replace(equipment, ammeter=replace(equipment.ammeter, limit=limit))


def ammeter_gain(equipment):
    """The ammeter reads too much."""
    gain = SIZES["ammeter_gain"] * equipment.ammeter.gain
    return replace(equipment, ammeter=replace(equipment.ammeter, gain=gain))


def ammeter_slow(equipment):
    """The ammeter has a display's filter."""
    bandwidth = SIZES["ammeter_bandwidth"]
    return replace(equipment, ammeter=replace(equipment.ammeter, bandwidth=bandwidth))


# --- the logs -------------------------------------------------------------------------------------


def command_late(equipment):
    """The command has the stamps of later samples."""
    return replace(equipment, logger=replace(equipment.logger, command_delay=SIZES["late"]))


def coarse_command(equipment):
    """The command is read with few bits."""
    return replace(equipment, logger=replace(equipment.logger, bits=SIZES["command_bits"]))


def other_axis(equipment):
    """One log is of the other axis, with its encoder and this campaign's other instruments."""
    axis = "slew" if equipment.axis == "hoist" else "hoist"
    other = draws.drawn_equipment(axis, equipment.seed, equipment.logger.rate)
    other = replace(
        other, logger=equipment.logger, ammeter=equipment.ammeter, tacho=equipment.tacho
    )
    return replace(equipment, elsewhere={SIZES["other_axis"]: other})


def command_zero(equipment):
    """The command reads a little more than it is."""
    return replace(equipment, logger=replace(equipment.logger, zero=SIZES["command_zero"]))


def command_gain(equipment):
    """The command reads too much."""
    gain = SIZES["command_gain"] * equipment.logger.gain
    return replace(equipment, logger=replace(equipment.logger, gain=gain))


def one_run(equipment, **encoder):
    """Equipment whose encoder differs in one run."""
    other = replace(equipment, encoder=replace(equipment.encoder, **encoder))
    return replace(equipment, elsewhere={SIZES["one_run"]: other})


def one_late(equipment):
    """One run's counts have the stamps of later samples."""
    return one_run(equipment, delay=SIZES["one_run_late"])


def one_gain(equipment):
    """One run's counts are those of a wheel that slips."""
    return one_run(equipment, step=equipment.encoder.step * SIZES["one_run_gain"])


def one_reversed(equipment):
    """One run's counts fall while the machine goes forward."""
    return one_run(equipment, step=-equipment.encoder.step)


def one_dead(equipment):
    """One run has no counts."""
    return one_run(equipment, fastest=0.0)


def runs_missing(equipment):
    """Some tests were never made."""
    words = SIZES[f"missing_{equipment.axis}"]
    return replace(
        equipment,
        conditions={
            run: condition for run, condition in equipment.conditions.items() if words not in run
        },
        held_out=tuple(run for run in equipment.held_out if words not in run),
    )


def nothing(equipment):
    """The sound campaign."""
    return equipment


FAULTS = {
    "none": nothing,
    "run of another axis": other_axis,
    "spool friction": spool_friction,
    "leakage under load, 10 % of the top speed": leakage,
    "leakage under load, 2 % of the top speed": small_leakage,
    "drift of 8 % over the campaign": drift,
    "encoder 20 ms late": encoder_late,
    "ammeter clipped": ammeter_clipped,
    "delay 20 ms longer than stated": longer_delay,
    "runs missing": runs_missing,
    "encoder reads 3 % too much": encoder_gain,
    "ammeter reads 3 % too much": ammeter_gain,
    "command's stamps 20 ms late": command_late,
    "encoder loses counts above 70 % of the top speed": slow_counter,
    "supply pressure 20 % low": low_supply,
    "command read with 8 bits": coarse_command,
    "play of 0.2 degrees before the encoder": play,
    "one run late by 0.2 s": one_late,
    "one run of an encoder that slips by 5 %": one_gain,
    "one run reversed": one_reversed,
    "one run without counts": one_dead,
    "weak dither": weak_dither,
    "shaft of 8 Hz": soft_shaft,
    "charge pressure that hunts by 10 %": hunting,
    "charge pressure that droops by 10 %": droop,
    "charge pressure set anew in each run, 5 %": set_anew,
    "cold oil, orifices 20 % less at first": cold_oil,
    "load in every second run": load_in_half,
    "ammeter of 5 Hz": ammeter_slow,
    "command 50 mV off": command_zero,
    "command reads 2 % too much": command_gain,
}
"""What each does to a drive's equipment."""
OF_AXES = {"ammeter clipped": "ammeter_limit", "runs missing": "missing"}
"""Faults whose size is that of an axis, and its name in levels.toml."""


def applies(fault, axis):
    """Whether a fault has a size on an axis."""
    return fault not in OF_AXES or f"{OF_AXES[fault]}_{axis}" in SIZES


# --- fewer instruments ----------------------------------------------------------------------------


def without_tacho(equipment):
    """Counts and current alone."""
    return replace(equipment, tacho=None)


def without_ammeter(equipment):
    """No current is logged."""
    return replace(equipment, ammeter=None)


def only_counts(equipment):
    """Neither current nor a tacho's speed."""
    return replace(equipment, ammeter=None, tacho=None)


FEWER = {
    "encoder, ammeter and tacho": nothing,
    "encoder and ammeter": without_tacho,
    "encoder and tacho": without_ammeter,
    "encoder": only_counts,
}
"""What a user has, who does not have all of the instruments."""


# --- what no fit can see --------------------------------------------------------------------------


def with_more_counts(numbers):
    """A machine whose drum is faster by the encoder's gain."""
    return {**numbers, "Z10": SIZES["encoder_gain"] * numbers["Z10"]}


def in_other_amperes(numbers):
    """A machine in the amperes of the faulty ammeter."""
    return draws.as_read(numbers, SIZES["ammeter_gain"])


def at_full_supply(numbers):
    """A machine with the stated supply that strokes as the faulty one does.

    All pressures are larger by the ratio r of the supplies, Z1 and Z2/Z1 with them. The root over
    the orifice grows by √r and the pressure's rate should by r, hence Z8 by √r.
    """
    ratio = 1.0 / SIZES["supply"]
    return {
        **numbers,
        "Z1": numbers["Z1"] / ratio,
        "Z8": numbers["Z8"] * ratio**0.5,
        "Z9": numbers["Z9"] * ratio,
        "Z15": numbers["Z15"] * ratio,
    }


EQUAL = {
    encoder_gain: with_more_counts,
    ammeter_gain: in_other_amperes,
    low_supply: at_full_supply,
}
"""Numbers of the sound machine that gives the same signals, from those of the faulty one."""


def unseen(fault, sound):
    """Whether a sound machine with other numbers gives the signals of the faulty equipment.

    A fit takes all numbers of the machine, so that it can get there. The largest RMS differences of
    speed and current over all runs, as shares of the ranges, are within the levels.
    """
    if fault not in EQUAL:
        return False
    faulty = fault(sound)
    equal = EQUAL[fault](faulty.parameters)
    # what the instruments show is that of the equal machine times their gains
    counts = sound.encoder.step / faulty.encoder.step
    amperes = faulty.ammeter.gain / sound.ammeter.gain
    worst = np.zeros(2)
    for run, condition in sound.conditions.items():
        length, wish = controller.maneuver(run.split(",")[0], sound.axis)
        command = controller.held_exactly(wish, length, 100.0)
        shown = Machine(faulty.parameters).march(command, length, condition)
        other = Machine(equal).march(command, length, condition)
        for place, (one, two) in enumerate((
            (counts * shown[:, 5], other[:, 5]),
            (amperes * (shown[:, 1] + shown[:, 2]), other[:, 1] + other[:, 2]),
        )):  # fmt: skip
            share = np.sqrt(np.mean((one - two) ** 2)) / np.ptp(one)
            worst[place] = max(worst[place], share)
    return bool(worst[0] < SIZES["equal"]["speed"] and worst[1] < SIZES["equal"]["current"])
