"""The block diagrams of chapters 4 and 7: what is connected with what, drawn anew."""

from __future__ import annotations

from reproduction.content import Arrow, Diagram, Figure, Node

_AMMETER = Diagram(
    (
        Node("command", 0.0, 0.5, "command\n±10 V", plain=True),
        Node("card", 1.15, 0.5, "control card"),
        Node("ammeter", 2.65, 0.5, "one ammeter\naround both leads"),
        Node("plus", 3.9, 0.0, "solenoid A"),
        Node("minus", 3.9, 1.0, "solenoid B"),
        Node("log", 2.65, 1.5, "log, 512 Hz\n|I₊| + |I₋|", plain=True),
    ),
    (
        Arrow("command", "card"),
        Arrow("card", "ammeter", "I₊, I₋"),
        Arrow("ammeter", "plus"),
        Arrow("ammeter", "minus"),
        Arrow("ammeter", "log"),
    ),
)


def _optimisation(machine: str, model: str, signal: str, unknowns: str) -> Diagram:
    return Diagram(
        (
            Node("command", 0.0, 0.5, "command", plain=True),
            Node("machine", 1.1, 0.0, machine),
            Node("model", 1.1, 1.0, model),
            Node("cost", 2.75, 0.5, "squared error,\nsum over tests"),
            Node("search", 2.75, 1.7, f"optimiser:\nnext {unknowns}"),
            Node("found", 4.0, 0.5, f"{unknowns}*\nof least cost", plain=True),
        ),
        (
            Arrow("command", "machine"),
            Arrow("command", "model"),
            Arrow("machine", "cost", f"measured\n{signal}"),
            Arrow("model", "cost", f"simulated\n{signal}"),
            Arrow("cost", "search"),
            Arrow("search", "model"),
            Arrow("cost", "found"),
        ),
    )


_MEASURED_SPEED = Diagram(
    (
        # apart so that all arrows are of one length
        Node("counts", 0.0, 0.0, "encoder\ncounts", plain=True),
        Node("filled", 1.35, 0.0, "straight lines\nin between"),
        Node("low pass", 3.04, 0.0, "a / (s + a)\na = 2π·10 rad/s"),
        Node("derivative", 4.76, 0.0, "b s / (s + b)\nb = 2π·30 rad/s"),
        Node("speed", 6.2, 0.0, "measured\nspeed", plain=True),
    ),
    (
        Arrow("counts", "filled"),
        Arrow("filled", "low pass"),
        Arrow("low pass", "derivative"),
        Arrow("derivative", "speed"),
    ),
)
_SIMULATED_SPEED = Diagram(
    (
        Node("speed", 0.0, 0.0, "simulated\nspeed", plain=True),
        Node("low pass", 1.0, 0.0, "a / (s + a)\na = 2π·10 rad/s"),
        Node("second", 2.0, 0.0, "b / (s + b)\nb = 2π·30 rad/s"),
        Node("filtered", 3.0, 0.0, "speed to be\ncompared", plain=True),
    ),
    (Arrow("speed", "low pass"), Arrow("low pass", "second"), Arrow("second", "filtered")),
)

DIAGRAMS = {
    "4.1": Figure(
        "4.1",
        "Where the ammeter sits",
        "One ammeter around the leads of both solenoids: the log holds the sum of the magnitudes, "
        "which is what the simulated currents are added up to in figures 4.3 to 4.16.",
        _AMMETER,
    ),
    "4.2": Figure(
        "4.2",
        "How the card was identified",
        "The card's parameters X are those whose simulated current differs least from the "
        "measured one, over all tests at once.",
        _optimisation("card", "card model", "|I₊| + |I₋|", "X"),
    ),
    "7.1": Figure(
        "7.1",
        "How pump and motor were identified",
        "The same for the parameters Z of pump and motor, by the shaft's speed; the model is "
        "driven by the simulated current.",
        _optimisation("drive", "card, pump and\nmotor model", "speed", "Z"),
    ),
    "7.3": Figure(
        "7.3",
        "From counts to a speed",
        "A low pass of 10 Hz and a differentiator that is band-limited at 30 Hz follow the "
        "smoothing of figure 7.2.",
        _MEASURED_SPEED,
        errata=(33,),
    ),
    "7.4": Figure(
        "7.4",
        "The same phase for the simulated speed",
        "A simulated speed goes through the same two low passes, the second without the "
        "differentiator's zero. All speeds below but those of figures 7.14 and 7.20 are drawn so.",
        _SIMULATED_SPEED,
        errata=(33,),
    ),
}
"""By number."""
