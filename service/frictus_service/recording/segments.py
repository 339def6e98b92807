"""Which part of a recording is which trial."""

from bisect import bisect_right
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, field

from frictus.keys import FORCE
from frictus.messages import GuidanceState, SceneState
from frictus_service.errors import Exclusion, ExportError
from frictus_service.recording.reader import Item, State
from frictus_service.recording.samples import Samples


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
        Empty: no drive.
    from_s, to_s : float or None
        Part of the recording, in seconds from its first sample.
    """

    participant: str | None = None
    session: int = 1
    speed_mm_s: float | None = None
    force_n: float | None = None
    tones_hz: tuple[float, ...] | None = None
    from_s: float | None = None
    to_s: float | None = None


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
        Played at once, Hz; empty: no drive.
    place : SampleRange
        Where it stands in the recording.
    """

    id: str
    participant: str
    session: int
    order: int
    speed_mm_s: float
    force_n: float
    tones_hz: tuple[float, ...]
    place: SampleRange


@dataclass(frozen=True, slots=True)
class _Stretch:
    """Where a message of samples stands in time."""

    utc_ns: int
    run: int
    first_sample: int
    end_sample: int
    sample_rate_hz: float


@dataclass(slots=True)
class Outline:
    """What a first reading finds: when samples were taken, what was asked, what was played."""

    stretches: list[_Stretch] = field(default_factory=list)
    guidance: list[GuidanceState] = field(default_factory=list)
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
        for item in items:
            if isinstance(item, Samples) and item.stream == FORCE:
                outline.stretches.append(
                    _Stretch(
                        item.utc_ns,
                        item.run,
                        item.first_sample,
                        item.end_sample,
                        item.sample_rate_hz,
                    )
                )
            elif isinstance(item, State) and isinstance(item.message, GuidanceState):
                outline.guidance.append(item.message)
            elif isinstance(item, State) and isinstance(item.message, SceneState):
                outline.scenes.append((item.utc_ns, item.message))
        if not outline.stretches:
            raise ExportError("it holds no samples of force: there is nothing to export")
        outline.stretches.sort(key=lambda stretch: stretch.utc_ns)
        return outline

    @property
    def begin_ns(self) -> int:
        """UTC of the first sample."""
        return self.stretches[0].utc_ns

    @property
    def end_ns(self) -> int:
        """UTC at which the last sample ends."""
        last = self.stretches[-1]
        return last.utc_ns + round(
            1e9 * (last.end_sample - last.first_sample) / last.sample_rate_hz
        )

    def place(self, begin_ns: int, end_ns: int) -> SampleRange:
        """Return where a span of time stands.

        Raises
        ------
        ExportError
            If the rig started anew within it, or it holds no sample.
        """
        first, last = self._at(begin_ns), self._at(end_ns)
        if first[0] != last[0]:
            raise ExportError(
                "the rig started anew within it, and counts samples from 0 again: a trial is "
                "of one run"
            )
        if last[1] <= first[1]:
            raise ExportError("there are no samples in it")
        return SampleRange(
            first[0], first[1], last[1] - first[1], self.stretches[0].sample_rate_hz
        )

    def _at(self, utc_ns: int) -> tuple[int, int]:
        """Return run and device sample at a time within the recording, or nearest to it."""
        place = bisect_right(self.stretches, utc_ns, key=lambda stretch: stretch.utc_ns) - 1
        stretch = self.stretches[max(place, 0)]
        since = round(1e-9 * (utc_ns - stretch.utc_ns) * stretch.sample_rate_hz)
        length = stretch.end_sample - stretch.first_sample
        return stretch.run, stretch.first_sample + min(max(since, 0), length)

    def tones_at(self, utc_ns: int) -> tuple[float, ...] | None:
        """Return the tones of the excitation that was played, None where none was."""
        if not self.scenes:
            return None
        before = [state for at_ns, state in self.scenes if at_ns <= utc_ns]
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
    begin_ns, end_ns = outline.begin_ns, outline.end_ns
    if declared.to_s is not None:
        end_ns = min(end_ns, begin_ns + round(1e9 * declared.to_s))
    if declared.from_s is not None:
        begin_ns += round(1e9 * declared.from_s)
    tones = declared.tones_hz
    if tones is None:
        tones = outline.tones_at((begin_ns + end_ns) // 2)
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
            "nobody was guided in this recording, so that it is one trial; say of it "
            f"{missing} (--tone 0 where nothing was played)"
        )
    place = outline.place(begin_ns, end_ns)
    return TrialSegment("t0000", who, declared.session, 0, speed_mm_s, force_n, tones, place)


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
    for number, (begin, end_ns) in enumerate(_recorded(outline)):
        name, who = f"t{number:04d}", begin.participant
        tones = declared.tones_hz
        if tones is None:
            tones = outline.tones_at((begin.utc_ns + end_ns) // 2)
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
                    outline.place(begin.utc_ns, end_ns),
                )
            )
        except ExportError as error:
            excluded.append(Exclusion(name, "guidance", str(error)))
        orders[who] += 1
    return segments, excluded


def _recorded(outline: Outline) -> list[tuple[GuidanceState, int]]:
    """Return the first message of each recorded phase, and when the phase was over."""
    found: list[tuple[GuidanceState, int]] = []
    last: GuidanceState | None = None
    for state in sorted(outline.guidance, key=lambda state: state.utc_ns):
        same = last is not None and (state.phase, state.trial, state.participant) == (
            last.phase,
            last.trial,
            last.participant,
        )
        if last is not None and last.phase == "record" and not same:
            found[-1] = (found[-1][0], state.utc_ns)
        if state.phase == "record" and not same:
            found.append((state, state.utc_ns))
        last = state
    if last is not None and last.phase == "record":
        found[-1] = (found[-1][0], last.utc_ns)
    return found
