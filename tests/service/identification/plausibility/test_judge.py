"""Right measurements are left in peace; each slip is named, with the remedy."""

from collections.abc import Callable
from dataclasses import fields, replace

import numpy as np
import pytest
from scipy import signal
from tests.service.identification.plausibility.slips import (
    REFUSED,
    SLIPS,
    WARNINGS,
    Slip,
    is_refused,
    record_of,
    velocity,
)
from tests.service.identification.trials import STUDY, Made, numbered, trial

from frictus_service.errors import ImplausibleStudyError
from frictus_service.identification.observation.response import ResponseRows
from frictus_service.identification.plausibility.checks import CHECKS
from frictus_service.identification.plausibility.finding import (
    leave_out,
    stop_if_implausible,
)
from frictus_service.identification.plausibility.judge import judge_study, judge_trial
from frictus_service.study.trial import Trial

TONES_HZ = (40.0, 110.0, 300.0, 900.0)


@pytest.fixture(scope="module")
def session(module_seed: int) -> list[Trial]:
    """Six trials of one person at two speeds, one without drive."""
    rng = np.random.default_rng(module_seed)
    made = [
        trial(Made(tones, speed, seconds=1.5, noise_n=0.002, noise_m_s2=0.05), rng)
        for speed, tones in (
            (60.0, TONES_HZ[:1]),
            (100.0, TONES_HZ[1:2]),
            (60.0, TONES_HZ[2:3]),
            (100.0, TONES_HZ[3:]),
            (100.0, TONES_HZ),
            (60.0, ()),
        )
    ]
    return [numbered(each, number) for number, each in enumerate(made)]


def without_carrier(trial: Trial) -> Trial:
    """Return a trial whose drive is kept by its rms, as imports keep envelope and fraction."""
    if trial.voltage_v is None:
        return trial
    low = signal.butter(4, 2500.0, fs=trial.info.sample_rate_hz, output="sos")
    power = signal.sosfiltfilt(low, np.square(trial.voltage_v))
    return replace(trial, voltage_v=np.sqrt(np.maximum(power, 0.0)))


def a_short_stroke(trial: Trial) -> Trial:
    """Return half a second of a trial, with the positions of 0.1 s around it."""
    first_s, last_s = 0.4, 0.9
    cut = slice(*(round(at * trial.info.sample_rate_hz) for at in (first_s, last_s)))
    near = np.abs(trial.position_t_s - 0.65) <= 0.35
    assert trial.accel_m_s2 is not None
    return replace(
        trial,
        force_n=trial.force_n[cut],
        accel_m_s2=trial.accel_m_s2[cut],
        voltage_v=None if trial.voltage_v is None else trial.voltage_v[cut],
        position_mm=trial.position_mm[near],
        position_t_s=trial.position_t_s[near] - first_s,
    )


@pytest.mark.parametrize(
    "make",
    [lambda t: t, velocity, without_carrier, a_short_stroke],
    ids=["acceleration", "velocity", "without carrier", "short stroke"],
)
def test_right_measurements(make: Callable[[Trial], Trial], session: list[Trial]) -> None:
    assert judge_study([record_of(make(each), STUDY) for each in session]) == ()


@pytest.mark.parametrize("slip", SLIPS.values(), ids=SLIPS)
def test_what_makes_every_fit_nonsense_stops(slip: Slip, session: list[Trial]) -> None:
    found = judge_study([record_of(slip.make(each), STUDY) for each in session])
    codes = {each.code for each in found}
    assert codes & slip.found_by
    assert found[0].severity == "stop"
    (named,) = [each for each in found if each.code in slip.found_by][:1]
    assert slip.remedy in named.remedy
    assert named.trials == tuple(each.info.id for each in session)
    assert not named.accepted[0] <= named.value <= named.accepted[1]
    assert "\n" not in named.text
    with pytest.raises(ImplausibleStudyError, match="nothing was fitted") as raised:
        stop_if_implausible(found, "a.h5")
    assert slip.remedy in str(raised.value)


@pytest.mark.parametrize("slip", WARNINGS.values(), ids=WARNINGS)
def test_what_leaves_fits_possible_warns(slip: Slip, session: list[Trial]) -> None:
    found = judge_study([record_of(slip.make(each), STUDY) for each in session])
    assert all(each.severity == "warning" for each in found)
    (named,) = [each for each in found if each.code in slip.found_by]
    assert slip.remedy in named.remedy
    stop_if_implausible(found, "a.h5")


@pytest.mark.parametrize("make", REFUSED.values(), ids=REFUSED)
def test_what_the_reader_refuses(make: Callable[[Trial], Trial], session: list[Trial]) -> None:
    assert all(is_refused(make(each), STUDY) for each in session)
    assert not any(is_refused(each, STUDY) for each in session)


def of(person: str, each: Trial) -> Trial:
    return replace(
        each, info=replace(each.info, id=f"{person} {each.info.id}", participant=person)
    )


def test_one_person_of_three_is_left_out(session: list[Trial]) -> None:
    turned = SLIPS["force x turned"].make
    records = [
        record_of(of(person, turned(each) if person == "B" else each), STUDY)
        for person in "ABC"
        for each in session
    ]
    found = judge_study(records)
    assert {each.severity for each in found} == {"warning"}
    assert all(each.sentence.startswith("of B: ") for each in found)
    kept = leave_out([record.observed for record in records], found)
    for each in kept:
        is_turned = each.info.participant == "B"
        assert ("against the motion" in "".join(each.reasons)) is is_turned
        assert each.valid is not bool(each.reasons)
    # Who is in the majority is not known by counting: two of two stop.
    of_two = [record for record in records if record.observed.info.participant in "AB"]
    assert any(each.severity == "stop" for each in judge_study(of_two))


def test_a_turned_trial_of_a_person_is_left_out(session: list[Trial]) -> None:
    """One trial whose force was turned left no friction fit of all the others."""
    turned = SLIPS["force x turned"].make
    records = [
        record_of(turned(each) if n == 1 else each, STUDY) for n, each in enumerate(session)
    ]
    (found,) = judge_study(records)
    assert found.code == "friction_turned"
    assert found.trials == (session[1].info.id,)
    kept = leave_out([record.observed for record in records], [found])
    assert [each.valid for each in kept].count(False) == 1


def test_friction_does_not_need_the_skin(session: list[Trial]) -> None:
    records = [record_of(SLIPS["acceleration in g"].make(each), STUDY) for each in session]
    assert judge_study(records)[0].severity == "stop"
    assert judge_study(records, "mobility")[0].severity == "stop"
    assert {each.severity for each in judge_study(records, "friction")} == {"warning"}
    records = [record_of(SLIPS["force x turned"].make(each), STUDY) for each in session]
    assert judge_study(records, "friction")[0].severity == "stop"


def test_a_low_tone_alone_tells_the_sign(session: list[Trial]) -> None:
    assert judge_trial(session[0], STUDY) == ()
    (found,) = judge_trial(velocity(session[0], -1.0), STUDY)
    assert found.code == "mobility_sign"


def test_a_sensor_s_zero_drops_out_over_both_directions(session: list[Trial]) -> None:
    lifted = [replace(each, force_n=each.force_n - [0.3, 0.0, 0.0]) for each in session]
    assert judge_study([record_of(each, STUDY) for each in lifted]) == ()


def test_a_stroke_in_one_direction_does_not_tell_the_skin_s_motion(
    rng: np.random.Generator,
) -> None:
    short = trial(Made((), 60.0, seconds=0.6, noise_n=0.002, noise_m_s2=0.05), rng)
    assert judge_trial(short, STUDY) == ()


def test_nothing_known_is_nothing_implausible(session: list[Trial]) -> None:
    assert judge_study([]) == ()
    blind = replace(session[0], accel_m_s2=None, position_mm=session[0].position_mm * np.nan)
    assert judge_trial(blind, STUDY) == ()


def test_noise_is_told_by_band(session: list[Trial], rng: np.random.Generator) -> None:
    """A skin's sensor that hears nothing above 200 Hz."""
    low = signal.butter(6, 60.0, fs=20_000.0, output="sos")
    dull = []
    for each in session:
        assert each.accel_m_s2 is not None
        heard = signal.sosfiltfilt(low, each.accel_m_s2, axis=0)
        noisy = heard + 3.0 * rng.standard_normal(heard.shape)
        dull.append(record_of(replace(each, accel_m_s2=noisy), STUDY))
    found = judge_study(dull, "friction")
    assert {"mobility_coherence_200", "mobility_coherence_600"} <= {each.code for each in found}
    assert not any("friction_coherence" in each.code for each in found)
    (named,) = [each for each in found if each.code == "mobility_coherence_200"]
    assert named.sentence.startswith("from 200 to 600 Hz, skin and friction are mostly noise")


@pytest.mark.parametrize(("share", "told"), [(0.05, False), (1.0, True)])
def test_what_is_not_driven_is_no_noise(
    share: float, told: bool, session: list[Trial], rng: np.random.Generator
) -> None:
    """As of a chirp, which is in a band for a part of a stroke; the rest holds noise alone."""
    record = record_of(session[-2], STUDY)
    rows = record.observed.rows
    parts = rng.standard_normal((2, rows.tone_hz.size))
    elsewhere = replace(
        rows,
        message=share * rows.message,
        friction_response=parts[0] + 1j * parts[1],
        friction_variance=np.ones(rows.tone_hz.size),
    )
    mixed = ResponseRows(
        **{
            field.name: np.concatenate(
                [getattr(part, field.name) for part in (rows, elsewhere, elsewhere)]
            )
            for field in fields(ResponseRows)
        }
    )
    found = judge_study([replace(record, observed=replace(record.observed, rows=mixed))])
    assert any("friction_coherence" in each.code for each in found) is told


@pytest.mark.parametrize("code", ["skin_delay", "position_delay", "position_delay_removed"])
def test_a_delay_below_0_is_told_as_early(code: str) -> None:
    (check,) = (each for each in CHECKS if each.code == code)
    assert " 150 " in check.told(-150.0)
    assert "earl" in check.told(-150.0)
    assert "earl" not in check.told(150.0).split(",")[0]
