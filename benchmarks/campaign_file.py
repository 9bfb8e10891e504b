"""Campaign files of virtual tests."""

from collections.abc import Mapping


def campaign_text(
    title: str,
    *,
    axis: str,
    drive: str,
    command: str,
    interpolation: str,
    channels: Mapping[str, str],
    runs: Mapping[str, str],
) -> str:
    """A campaign of one axis under a voltage.

    Parameters
    ----------
    command : str
        Column of the voltage.
    channels : mapping of str to str
        Entries of what is measured, by its name.
    runs : mapping of str to str
        Roles by log.
    """
    voltage = f'kind = "voltage", column = "{command}", unit = "V"'
    lines = [
        f'title = "{title}"',
        "virtual = true",
        "",
        f"[axes.{axis}]",
        f'drive = "{drive}"',
        'start = "rest"',
        'time = { column = "time", unit = "s" }',
        f'input = {{ {voltage}, interpolation = "{interpolation}" }}',
    ]
    lines += [f"channels.{name} = {entry}" for name, entry in channels.items()]
    for file, role in runs.items():
        lines += ["", "[[runs]]", f'file = "{file}"', f'role = "{role}"']
    return "\n".join(lines) + "\n"
