"""Tones in residuals as they are told: each once, channel by channel."""

from __future__ import annotations

from collections.abc import Sequence

from swashplate.identification.tones import Tone


def distinct(tones: Sequence[Tone]) -> tuple[Tone, ...]:
    """Tones by channel and frequency, those whose bands overlap as one.

    A line that was taken out in several rounds is one tone: the strongest, with the shares of all.
    """
    made: list[Tone] = []
    end = 0.0
    channels = list(dict.fromkeys(tone.channel for tone in tones))
    for tone in sorted(tones, key=lambda each: (channels.index(each.channel), each.low)):
        if made and made[-1].channel == tone.channel and tone.low <= end:
            strongest = max(made[-1], tone, key=lambda each: each.share)
            made[-1] = strongest._replace(share=made[-1].share + tone.share)
            end = max(end, tone.high)
        else:
            made.append(tone)
            end = tone.high
    return tuple(made)


def tone_sentences(tones: Sequence[Tone]) -> tuple[str, ...]:
    """What tones there are, one sentence a channel."""
    channels: dict[str, list[Tone]] = {}
    for tone in distinct(tones):
        channels.setdefault(tone.channel, []).append(tone)
    said = []
    for channel, alike in channels.items():
        most = max(alike, key=lambda each: each.share)
        what, them = f"A tone at {most.frequency:.3g} Hz makes", "it"
        largest = ""
        if len(alike) > 1:
            what, them = (
                (
                    f"{len(alike)} tones between {alike[0].frequency:.3g} and "
                    f"{alike[-1].frequency:.3g} Hz make"
                ),
                "them",
            )
            largest = f", the largest {100.0 * most.share:.2g} % at {most.frequency:.3g} Hz"
        share = sum(each.share for each in alike)
        said.append(
            f"{what} {100.0 * share:.2g} % of the residuals' variance of {channel}{largest}; "
            f"no unknown depends on {them}, and the noise is judged without {them}."
        )
    return tuple(said)
