"""A second machine, written apart from swashplate: truth for benches of identification.

A bench whose truth and model are one simulator finds every interval right. So these are the drive
and its instruments once more, from the equations of Kruse (2001) and nothing of swashplate: no
module here imports it (`tests/test_second_machine.py`).

Where things stand:

- `levels.toml`: the range of everything drawn, the seeds, and what counts as a sound campaign. It
  was committed before the rest and does not change. The sizes of faults came later, before the
  bench that uses them ran.
- `equations`: card, pump, shaft and cylinder in continuous time, and how they are marched.
- `draws`: a machine and its instruments, drawn for an axis and a seed: an `Equipment`.
- `controller`: the maneuvers, and the command as a PLC holds it.
- `instruments`: encoder, tacho, ammeter.
- `logger`: clock, rounding, the CSV files of a campaign and their times.
- `faults`: what changes an equipment, and which faults no fit can see.
- `checks`: the march against SciPy's solvers on five runs.

Differences from the package that are meant: the card's filter is a differential equation, not a
recursion at 512 Hz; the command is held at the controller's instants, which no sample knows; all
switches of the card happen at their instants. Equal to the package by choice are the published form
of the orifice's root and the stop at its pressure, since the published parameters belong to them.
"""
