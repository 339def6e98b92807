"""Which part of a recording is which trial."""

from bisect import bisect_right
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Final

from frictus.keys import FORCE, Topics
from frictus.messages import GuidanceState, SceneState
from frictus_service.errors import Exclusion, ExportError
from frictus_service.recording.reader import Item, State
from frictus_service.recording.samples import Samples

MAX_PART_S: Final = 1e9
_TOLD: Final = (Topics.GUIDANCE.suffix, Topics.SCENE.suffix)


def check_part(from_s: float | None, to_s: float | None) -> None:
    """Refuse a part that begins or ends at no time.

    Raises
    ------
    ExportError
    """
    for at_s in (from_s, to_s):
        if at_s is not None and not 0.0 <= at_s <= MAX_PART_S:  # refuses NaN too
            raise ExportError(f"{at_s} s: a part begins and ends at 0 to {MAX_PART_S:g} s")


@dataclass(frozen=True, slots=True)
class TrialDeclaration:
    """What a person says of a recording that nobody guided; None: take the recording's.

    Attributes
    ----------
    participant : str or None
        Pseudonym.
    session : int
        From 0.
    speed_mm_s, force_n : float or None
        Targets.
    tones_hz : tuple of float or None
        Empty: no drive, unless a texture was played.
    from_s, to_s : float or None
        Part of the recording, in seconds from its first sample.
    texture : bool
        Whether a texture was played, or noise, and no tones.
    """

    participant: str | None = None
    session: int = 1
    speed_mm_s: float | None = None
    force_n: float | None = None
    tones_hz: tuple[float, ...] | None = None
    from_s: float | None = None
    to_s: float | None = None
    texture: bool = False


@dataclass(frozen=True, slots=True)
class SampleRange:
    """Where a trial stands: consecutive samples of one run."""

    run: int
    first_sample: int
    n_samples: int
    sample_rate_hz: float

    @property
    def end_sample(self) -> int:
        """One past the last sample."""
        return self.first_sample + self.n_samples


@dataclass(frozen=True, slots=True)
class TrialSegment:
    """One trial of a recording.

    Attributes
    ----------
    id, participant : str
        Of the trial, and pseudonym.
    session, order : int
        Session, and place in the participant's sequence.
    speed_mm_s, force_n : float
        Targets.
    tones_hz : tuple of float
        Played at once, Hz; empty: no drive, unless a texture was played.
    place : SampleRange
        Where it stands in the recording.
    texture : bool
        Whether one was played.
    """

    id: str
    participant: str
    session: int
    order: int
    speed_mm_s: float
    force_n: float
    tones_hz: tuple[float, ...]
    place: SampleRange
    texture: bool = False


@dataclass(frozen=True, slots=True)
class _Stretch:
    """Where a message of samples stands in time: `at_ns` counts from the first sample."""

    at_ns: int
    utc_ns: int
    run: int
    first_sample: int
    end_sample: int
    sample_rate_hz: float

    @property
    def end_ns(self) -> int:
        """When its last sample ends."""
        return self.at_ns + self._lasting_ns(self.end_sample)

    def after(self, item: Samples) -> int:
        """Return when samples begin that follow these.

        Within a run by their count: somebody may have set the clock of the machine.
        """
        if item.run == self.run:
            return self.at_ns + self._lasting_ns(item.first_sample)
        return max(self.end_ns, self.at_ns + item.utc_ns - self.utc_ns)

    def _lasting_ns(self, until_sample: int) -> int:
        return round(1e9 * (until_sample - self.first_sample) / self.sample_rate_hz)


@dataclass(slots=True)
class Outline:
    """What a first reading finds: when samples were taken, what was asked, what was played.

    Times are in ns from the first sample; a message has that of the samples beside it, and how
    much later it is by the clock.
    """

    stretches: list[_Stretch] = field(default_factory=list)
    guidance: list[tuple[int, GuidanceState]] = field(default_factory=list)
    scenes: list[tuple[int, SceneState]] = field(default_factory=list)

    @classmethod
    def of(cls, items: Iterable[Item]) -> "Outline":
        """Read a recording's items.

        Raises
        ------
        ExportError
            If there are no samples of force.
        """
        outline = cls()
        told: list[tuple[int, State]] = []
        for item in items:
            if isinstance(item, Samples) and item.stream == FORCE:
                outline.stretches.append(
                    _Stretch(
                        outline.stretches[-1].after(item) if outline.stretches else 0,
                        item.utc_ns,
                        item.run,
                        item.first_sample,
                        item.end_sample,
                        item.sample_rate_hz,
                    )
                )
            elif isinstance(item, State) and item.topic in _TOLD:
                told.append((len(outline.stretches), item))
        if not outline.stretches:
            raise ExportError("it holds no samples of force: there is nothing to export")
        for place, state in told:
            at_ns = outline._time_of(state.utc_ns, place)
            if isinstance(state.message, GuidanceState):
                outline.guidance.append((at_ns, state.message))
            elif isinstance(state.message, SceneState):
                outline.scenes.append((at_ns, state.message))
        return outline

    def span(self, from_s: float | None, to_s: float | None) -> tuple[int, int]:
        """Return when a part of the recording begins and ends; None: where it does itself.

        Raises
        ------
        ExportError
            As `check_part`.
        """
        check_part(from_s, to_s)
        end_ns = self.stretches[-1].end_ns
        return (
            0 if from_s is None else round(1e9 * from_s),
            end_ns if to_s is None else min(end_ns, round(1e9 * to_s)),
        )

    def place(self, begin_ns: int, end_ns: int) -> SampleRange:
        """Return where a span of time stands.

        Raises
        ------
        ExportError
            If the rig started anew within it, or it holds no sample.
        """
        (first, begin), (last, end) = self._at(begin_ns), self._at(end_ns)
        if first.run != last.run:
            raise ExportError(
                "the rig started anew within it, and counts samples from 0 again: a trial is "
                "of one run"
            )
        if end <= begin:
            raise ExportError("there are no samples in it")
        return SampleRange(first.run, begin, end - begin, first.sample_rate_hz)

    def _time_of(self, utc_ns: int, place: int) -> int:
        """Return the time of a message that stands before the samples of a place."""
        beside = self.stretches[max(place - 1, 0) : place + 1]
        # Between the two somebody may have set the clock.
        nearest = min(beside, key=lambda stretch: abs(utc_ns - stretch.utc_ns))
        return nearest.at_ns + utc_ns - nearest.utc_ns

    def _at(self, at_ns: int) -> tuple[_Stretch, int]:
        """Return the samples around a time, or nearest to it, and which of them it is."""
        place = bisect_right(self.stretches, at_ns, key=lambda stretch: stretch.at_ns) - 1
        stretch = self.stretches[max(place, 0)]
        since = round(1e-9 * (at_ns - stretch.at_ns) * stretch.sample_rate_hz)
        length = stretch.end_sample - stretch.first_sample
        return stretch, stretch.first_sample + min(max(since, 0), length)

    def tones_at(self, at_ns: int) -> tuple[float, ...] | None:
        """Return the tones of the excitation that was played, None where none was."""
        if not self.scenes:
            return None
        before = [state for since_ns, state in self.scenes if since_ns <= at_ns]
        scene = before[-1] if before else self.scenes[0][1]
        if scene.excitation is None:
            return None
        return tuple(tone.hz for tone in scene.excitation.tones)


def declared_segment(
    outline: Outline, declared: TrialDeclaration, participant: str | None
) -> TrialSegment:
    """Return the one trial that a person says a recording is.

    Parameters
    ----------
    outline : Outline
        Runs, guidance and streams of a recording.
    declared : TrialDeclaration
        What a person says of it.
    participant : str or None
        As the recording itself names.

    Raises
    ------
    ExportError
        If something is not said, or the part is not within one run of the rig.
    """
    begin_ns, end_ns = outline.span(declared.from_s, declared.to_s)
    tones = declared.tones_hz
    if tones is None:
        tones = () if declared.texture else outline.tones_at((begin_ns + end_ns) // 2)
    who = declared.participant or participant
    speed_mm_s, force_n = declared.speed_mm_s, declared.force_n
    if who is None or speed_mm_s is None or force_n is None or tones is None:
        wanted = zip(
            ("--participant", "--speed", "--force", "--tone"),
            (who, speed_mm_s, force_n, tones),
            strict=True,
        )
        missing = ", ".join(name for name, value in wanted if value is None)
        raise ExportError(
            "nobody was guided in this recording, so that it is one trial: give "
            f"`frictus export` {missing} (--tone 0 where nothing was played, --texture where a "
            "texture was)"
        )
    place = outline.place(begin_ns, end_ns)
    return TrialSegment(
        "t0000",
        who,
        declared.session,
        0,
        speed_mm_s,
        force_n,
        tones,
        place,
        declared.texture and not tones,
    )


def guided_segments(
    outline: Outline, declared: TrialDeclaration
) -> tuple[list[TrialSegment], list[Exclusion]]:
    """Return the trials in which a participant was guided, and those that cannot be used.

    Parameters
    ----------
    outline : Outline
        Runs, guidance and streams of a recording.
    declared : TrialDeclaration
        Its session and tones count; the rest is what the guidance says.
    """
    segments: list[TrialSegment] = []
    excluded: list[Exclusion] = []
    orders: Counter[str] = Counter()
    for number, (begin_ns, begin, end_ns) in enumerate(_recorded(outline)):
        name, who = f"t{number:04d}", begin.participant
        tones = declared.tones_hz
        if tones is None:
            tones = outline.tones_at((begin_ns + end_ns) // 2)
        try:
            if tones is None:
                raise ExportError("no excitation was played: give its tones with --tone")
            segments.append(
                TrialSegment(
                    name,
                    who,
                    declared.session,
                    orders[who],
                    begin.target_speed_mm_s,
                    begin.target_force_n,
                    tones,
                    outline.place(begin_ns, end_ns),
                )
            )
        except ExportError as error:
            excluded.append(Exclusion(name, "guidance", str(error)))
        orders[who] += 1
    return segments, excluded


def _recorded(outline: Outline) -> list[tuple[int, GuidanceState, int]]:
    """Return begin and first message of each recorded phase, and when the phase was over."""
    found: list[tuple[int, GuidanceState, int]] = []
    last: GuidanceState | None = None
    for at_ns, state in sorted(outline.guidance, key=lambda told: told[0]):
        same = last is not None and (state.phase, state.trial, state.participant) == (
            last.phase,
            last.trial,
            last.participant,
        )
        if last is not None and last.phase == "record":
            found[-1] = (*found[-1][:2], at_ns)
        if state.phase == "record" and not same:
            found.append((at_ns, state, at_ns))
        last = state
    return found
