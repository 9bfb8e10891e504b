"""Few places ask which kind of machine, model or fit they have, each for a reason."""

from pathlib import Path

from tools.mirror import faces_of, imports_of, kinds_by_package, modules_of

ROOT = Path(__file__).parents[1]
ASKED = {
    "analysis": (
        1,
        "draws from a fit are those of a drive: identification knows models of its own",
    ),
    "cli": (4, "a file of one's own holds a Machine, a Drive or a Model: the door"),
    "crane": (
        5,
        "an axis takes a Drive, or the name, file or fit of one; a Drive feels a load by its "
        "parameters, a machine of one's own by its input",
    ),
    "drive": (1, "what is equal to a drive is one"),
    "export": (4, "the door, and a drive's value references, which never change"),
    "full_order": (1, "what is equal to such a drive is one"),
    "identification": (47, "a fit is of a drive or of a user-defined model"),
    "machine": (3, "the doors: join takes models or machines, linearize refuses what is none"),
    "report": (2, "a page of a fit is that of a drive or of a user-defined model"),
}
"""By package: how often at most, and why."""


def test_few_places_ask_which_kind_they_have() -> None:
    modules = modules_of(ROOT)
    faces = faces_of(modules)
    imports = {module: list(imports_of(module, modules, faces)) for module in modules}
    calls, _ = kinds_by_package(imports)
    most = {package: count for package, (count, _) in ASKED.items()}
    assert dict(calls) == most, "a question more needs a reason, one less a lower count"
