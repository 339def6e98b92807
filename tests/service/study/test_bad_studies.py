"""One bad trial is named and left out; a bad root is refused; nothing ends in a traceback."""

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

from frictus_service.errors import Exclusion, StudyError, TrialError
from frictus_service.study.importers import open_study, read_all
from frictus_service.study.reader import StudyReader
from frictus_service.study.summary import missing_samples, summarise
from frictus_service.study.trial import Trial

MakeTrial = Callable[..., Trial]
WriteStudy = Callable[..., Path]
Edit = Callable[[h5py.Group], object]
N = 400


def _set(name: str, value: Any) -> Edit:
    return lambda group: group.attrs.__setitem__(name, value)


def _set_latin(name: str) -> Edit:
    """Set text of variable length in Latin-1, as LabVIEW writes it."""
    return lambda group: group.attrs.create(name, b"M\xfcller", dtype=h5py.string_dtype())


def _drop_attribute(name: str) -> Edit:
    return lambda group: group.attrs.__delitem__(name)


def _drop(name: str) -> Edit:
    return lambda group: group.__delitem__(name)


def _put(name: str, values: Any, **attributes: Any) -> Edit:
    """Put other values in the place of a data set."""

    def edit(group: h5py.Group) -> None:
        if name in group:
            del group[name]
        group[name] = values
        group[name].attrs.update(attributes)

    return edit


def _put_group(group: h5py.Group) -> None:
    del group["voltage_v"]
    group.create_group("voltage_v")


def _put_link(group: h5py.Group) -> None:
    del group["voltage_v"]
    group["voltage_v"] = h5py.SoftLink("/nowhere")


def _leave_unwritten(group: h5py.Group) -> None:
    del group["force_n"]
    stored = group.create_dataset("force_n", (N, 3), "f4", chunks=(100, 3))
    stored[:200] = 0.4


COUNTS = np.ones((N, 3), dtype=np.int16)
ATTRIBUTES = (
    "participant",
    "session",
    "order",
    "speed_mm_s",
    "force_n",
    "tone_hz",
    "drive_vpp",
    "sample_rate_hz",
    "started_utc",
)
# Per fault: what is done to the file, the field that is named, what the reason says.
SEEN_AT_ONCE: dict[str, tuple[Edit, str, str]] = {
    **{f"no {name}": (_drop_attribute(name), name, "is missing") for name in ATTRIBUTES},
    "speed in m/s": (_set("speed_mm_s", 0.06), "speed_mm_s", "looks like m/s"),
    "speed of NaN": (_set("speed_mm_s", np.nan), "speed_mm_s", "one finite number"),
    "negative speed": (_set("speed_mm_s", -60.0), "speed_mm_s", "1 to 1000 mm/s"),
    "two speeds": (_set("speed_mm_s", [20.0, 60.0]), "speed_mm_s", "one finite number"),
    "force in mN": (_set("force_n", 400.0), "force_n", "looks like mN"),
    "force as text": (_set("force_n", "0.4"), "force_n", "one finite number"),
    "rate in kHz": (_set("sample_rate_hz", 20.0), "sample_rate_hz", "looks like kHz"),
    "rate of 35.7": (_set("sample_rate_hz", 35.7), "sample_rate_hz", "too slow for the band"),
    "absurd rate": (_set("sample_rate_hz", 1e12), "sample_rate_hz", "absurd"),
    "tone above": (_set("tone_hz", 10_000.0), "tone_hz", "half of the sample rate"),
    "one tone above": (_set("tone_hz", [100.0, 2e4]), "tone_hz", "half of the sample rate"),
    "one tone twice": (_set("tone_hz", [100.0, 250.0, 100.0]), "tone_hz", "more than once"),
    "tone in kHz": (_set("tone_hz", 0.25), "tone_hz", "looks like kHz"),
    "tone of NaN": (_set("tone_hz", [100.0, np.nan]), "tone_hz", "accepted"),
    "0 among tones": (_set("tone_hz", [0.0, 100.0]), "tone_hz", "blank trial"),
    "tone as text": (_set("tone_hz", "250"), "tone_hz", "array of numbers"),
    "drive in mV": (_set("drive_vpp", 150e3), "drive_vpp", "looks like mV"),
    "tone undriven": (_set("drive_vpp", 0.0), "drive_vpp", "trial with tones"),
    "session of 1.5": (_set("session", 1.5), "session", "whole number"),
    "negative order": (_set("order", -1), "order", "whole number"),
    "huge order": (_set("order", 1e300), "order", "whole number"),
    "long pseudonym": (_set("participant", "p" * 300), "participant", "300 letters"),
    "pseudonym for terminals": (_set("participant", "p\x1b[2J"), "participant", "control"),
    "pseudonym backwards": (_set("participant", "p\u202e"), "participant", "formatting"),
    "blank pseudonym": (_set("participant", " "), "participant", "accepted: text"),
    "participant of 3": (_set("participant", 3), "participant", "accepted: text"),
    "not UTF-8 in a heap": (_set_latin("participant"), "participant", "UTF-8"),
    "not UTF-8": (_set("participant", np.bytes_(b"p\xff")), "participant", "UTF-8"),
    "no date": (_set("started_utc", "yesterday"), "started_utc", "ISO 8601"),
    "no forces": (_drop("force_n"), "force_n", "is missing"),
    "no positions": (_drop("position_mm"), "position_mm", "is missing"),
    "no times": (_drop("position_t_s"), "position_t_s", "is missing"),
    "no voltage": (_drop("voltage_v"), "voltage_v", "only a blank trial"),
    "transposed": (_put("force_n", np.zeros((3, N))), "force_n", "transpose"),
    "one axis": (_put("force_n", np.zeros(N)), "force_n", "(n, 3)"),
    "four axes": (_put("accel_m_s2", np.zeros((N, 4))), "accel_m_s2", "(n, 3)"),
    "a scalar": (_put("voltage_v", 3.0), "voltage_v", "(n,)"),
    "a matrix": (_put("voltage_v", np.zeros((2, N))), "voltage_v", "(n,)"),
    "nothing": (_put("voltage_v", h5py.Empty("f8")), "voltage_v", "(n,)"),
    "too short": (_put("voltage_v", np.zeros(N - 1)), "force_n", "voltage_v 399"),
    "one sample": (_put("voltage_v", np.zeros(1)), "voltage_v", "accepted: 2 to"),
    "fewer times": (_put("position_t_s", np.arange(5.0)), "position_t_s", "5 rows"),
    "text": (_put("voltage_v", ["x"] * N), "voltage_v", "no numbers"),
    "complex": (_put("voltage_v", np.zeros(N, complex)), "voltage_v", "no numbers"),
    "a group": (_put_group, "voltage_v", "no data set"),
    "a dangling link": (_put_link, "voltage_v", "a link to elsewhere"),
    "both skins": (_put("skin_velocity_m_s", np.zeros(N)), "skin_velocity_m_s", "one of them"),
}
SEEN_WHEN_READ: dict[str, tuple[Edit, str, str]] = {
    "counts unscaled": (_put("force_n", COUNTS), "force_n", "without the attribute scale"),
    "no offset": (
        _put("force_n", COUNTS, scale=0.1),
        "force_n",
        "the attribute offset",
    ),
    "scale of 0": (_put("force_n", COUNTS, scale=0.0, offset=0.0), "force_n", "scale = (0.0,)"),
    "scale of NaN": (_put("force_n", COUNTS, scale=np.nan, offset=0), "force_n", "finite"),
    "two scales": (_put("force_n", COUNTS, scale=[1, 2], offset=0), "force_n", "per column"),
    "floats scaled": (_put("force_n", COUNTS * 0.1, scale=0.1), "force_n", "on floats"),
    "skew as text": (_put("force_n", COUNTS * 0.1, skew_s="no"), "skew_s", "one finite number"),
    "skew in us": (
        _put("force_n", COUNTS * 0.1, skew_s=25.0),
        "force_n",
        "looks like ms or us",
    ),
    "unwritten": (_leave_unwritten, "force_n", "never written"),
    "other source": (
        _put("voltage_v", np.full(N, 60.0), source="guess"),
        "voltage_v",
        "'command' or 'monitor'",
    ),
}


def _spoilt(path: Path, edit: Edit) -> Path:
    with h5py.File(path, "r+") as file:
        del file["trials/bad"].attrs["sha256"]  # as of a program that writes none
        edit(file["trials/bad"])
    return path


@pytest.mark.parametrize("fault", SEEN_AT_ONCE)
def test_a_trial_that_does_not_fit_is_listed(
    fault: str, make_trial: MakeTrial, write_study: WriteStudy
) -> None:
    edit, field, reason = SEEN_AT_ONCE[fault]
    path = _spoilt(write_study(make_trial("good"), make_trial("bad")), edit)
    with StudyReader(path) as study:
        assert [info.id for info in study.trials] == ["good"]
        assert [(one.trial, one.field) for one in study.excluded] == [("bad", field)]
        assert reason in study.excluded[0].reason
        with pytest.raises(TrialError) as refused:
            study.read("bad")
        assert refused.value.exclusion == study.excluded[0]
        assert str(refused.value).startswith(f"{path}, trial bad, {field}: ")
        assert study.read("good").info.id == "good"


@pytest.mark.parametrize("fault", SEEN_WHEN_READ)
def test_a_trial_whose_storage_says_too_little_is_excluded_when_read(
    fault: str, make_trial: MakeTrial, write_study: WriteStudy
) -> None:
    edit, field, reason = SEEN_WHEN_READ[fault]
    path = _spoilt(write_study(make_trial("good"), make_trial("bad")), edit)
    with StudyReader(path) as study:
        found = {_id_of(one): one for one in read_all(study)}
    assert isinstance(found["good"], Trial)
    bad = found["bad"]
    assert isinstance(bad, Exclusion)
    assert bad.field == field
    assert reason in bad.reason


def _id_of(found: Trial | Exclusion) -> str:
    return found.trial if isinstance(found, Exclusion) else found.info.id


def _scale(name: str, factor: float) -> Callable[[Trial], dict[str, Any]]:
    return lambda trial: {name: factor * getattr(trial, name)}


def _order_times(*rows: int) -> Callable[[Trial], dict[str, Any]]:
    return lambda trial: {"position_t_s": trial.position_t_s[list(rows)]}


def _shift_times(trial: Trial) -> dict[str, Any]:
    return {"position_t_s": 1.7e9 + trial.position_t_s}


def _in_mm_s(trial: Trial) -> dict[str, Any]:
    return {"accel_m_s2": None, "skin_velocity_m_s": np.full(N, -50.0)}


# Per slip: what is done to the measured data, the field that is named, what the reason says.
SLIPS: dict[str, tuple[Callable[[Trial], dict[str, Any]], str, str]] = {
    "force in mN": (_scale("force_n", 1e3), "force_n", "like mN"),
    "voltage in mV": (_scale("voltage_v", 1e3), "voltage_v", "like mV"),
    "volts at the DAC": (_scale("voltage_v", 0.02), "voltage_v", "before the amplifier"),
    "position in m": (_scale("position_mm", 1e-3), "position_mm", "like m,"),
    "position in um": (_scale("position_mm", 1e3), "position_mm", "like um"),
    "times in ms": (_scale("position_t_s", 1e3), "position_t_s", "like ms"),
    "UTC times": (_shift_times, "position_t_s", "first sample"),
    "times that fall": (_order_times(0, 1, 3, 2, 4, 5), "position_t_s", "rise at row 3"),
    "times that rest": (_order_times(0, 1, 1, 3, 4, 5), "position_t_s", "rise at row 2"),
    "a time of NaN": (_scale("position_t_s", np.nan), "position_t_s", "no times"),
    "acceleration in mm/s2": (_scale("accel_m_s2", 1e3), "accel_m_s2", "like mm/s2"),
    "skin velocity in mm/s": (_in_mm_s, "skin_velocity_m_s", "like mm/s"),
    "only NaN": (_scale("force_n", np.nan), "force_n", "but NaN"),
    "no position known": (_scale("position_mm", np.nan), "position_mm", "but NaN"),
    "infinite": (_scale("voltage_v", np.inf), "voltage_v", "infinite"),
    "skew in ms": (lambda trial: {"skin_skew_s": 0.4}, "accel_m_s2", "like ms"),
}


@pytest.mark.parametrize("slip", SLIPS)
def test_a_slip_of_unit_is_named(
    slip: str, make_trial: MakeTrial, write_study: WriteStudy
) -> None:
    change, field, reason = SLIPS[slip]
    good, bad = make_trial("good"), make_trial("bad", n_samples=N)
    bad = replace(bad, info=replace(bad.info, speed_mm_s=1000.0), **change(bad))
    with StudyReader(write_study(good, bad)) as study:
        with pytest.raises(TrialError) as refused:
            study.read("bad")
        assert refused.value.exclusion.field == field
        assert reason in refused.value.exclusion.reason
        assert study.read("good").info.id == "good"


def test_missing_samples_are_counted_and_kept(
    make_trial: MakeTrial, write_study: WriteStudy
) -> None:
    trial = make_trial()
    assert missing_samples(trial) == {}
    trial.force_n[10:20, 0] = np.nan
    trial.force_n[15:30, 2] = np.nan
    assert trial.voltage_v is not None
    trial.voltage_v[5] = np.nan
    trial.position_mm[2] = np.nan
    with StudyReader(write_study(trial)) as study:
        read = study.read("a")
    assert missing_samples(read) == {"voltage_v": 1, "force_n": 20, "position_mm": 1}


def test_unknown_names_are_ignored_and_extras_of_the_root_kept(
    make_trial: MakeTrial, write_study: WriteStudy
) -> None:
    path = write_study(make_trial())
    with h5py.File(path, "r+") as file:
        file["trials/a"].attrs["mood"] = "good"
        file["trials/a"]["temperature"] = np.zeros(3)
        file["trials/a/force_n"].attrs["sensor"] = "left"
        file["notes"] = "free text"
        file.attrs["grid"] = [1.0, 2.0]
        _set_latin("place")(file)
        file.attrs["unit"] = np.bytes_(b"\xb5m")
        file.attrs["lux"] = np.nan
        file.attrs[b"gr\xfc\xdfe"] = 1
    with StudyReader(path) as study:
        assert study.read("a").info.id == "a"
        assert set(study.info.extras) == {"lab", "humidity", "n_people", "grid", "lux"}
        assert study.info.extras["lux"] == "nan"
        json.dumps(summarise(study, 1).fields(), allow_nan=False)
        assert study.info.extras["lab"] == "nord"
        assert json.loads(str(study.info.extras["grid"])) == [1.0, 2.0]


def test_numbers_and_text_as_matlab_writes_them(
    make_trial: MakeTrial, write_study: WriteStudy
) -> None:
    trial = make_trial()
    path = write_study(trial)
    with h5py.File(path, "r+") as file:
        for holder in (file, file["trials/a"]):
            for name, value in list(holder.attrs.items()):
                if isinstance(value, str | bytes):
                    holder.attrs[name] = np.array([value], dtype="S")
                else:
                    holder.attrs[name] = np.atleast_2d(np.asarray(value, dtype=np.float64))
    with StudyReader(path) as study:
        assert study.read("a").info == trial.info


def _mount(lateral: Any) -> Edit:
    return _set("mount", json.dumps({"lateral": lateral}))


BAD_ROOTS: dict[str, tuple[Edit, str]] = {
    "another version": (
        _set("schema", "study/2"),
        r"schema: is 'study/2'; accepted: 'study/1'",
    ),
    "no schema": (_drop_attribute("schema"), "schema: is missing"),
    "no rig": (_drop_attribute("rig"), "rig: is missing"),
    "no carrier": (_drop_attribute("carrier_hz"), "carrier_hz: is missing"),
    "carrier in kHz": (_set("carrier_hz", 7.0), "carrier_hz.*looks like kHz"),
    "peak in kV": (_set("screen_peak_v", 0.075), "screen_peak_v.*looks like kV"),
    "peak of NaN": (_set("screen_peak_v", np.nan), "screen_peak_v.*one finite number"),
    "positions late in ms": (
        _set("positions_late_s", 40.0),
        "positions_late_s.*looks like ms",
    ),
    "no trials": (_drop("trials"), "trials: is missing"),
    "empty": (_put("trials", 3), "trials: is missing"),
    "mount of text": (_set("mount", "stiff"), "mount: is not JSON"),
    "mount of NaN": (_mount({"numerator": [float("nan")], "denominator": [1]}), "numbers"),
    "mount list": (_set("mount", "[1]"), "mount: is not a JSON object"),
    "half a mount": (_mount({"numerator": [1.0]}), "lateral.denominator"),
    "improper": (_mount({"numerator": [1, 0, 1], "denominator": [1, 1]}), "not a proper"),
    "mount of 20,000 poles": (
        _mount({"numerator": [1.0], "denominator": [1.0] * 20_000}),
        "20000 coefficients",
    ),
    "mount beyond numbers": (
        _mount({"numerator": [1e308], "denominator": [1e-308, 1e308, 1e308]}),
        "not stable",
    ),
    "rig that clears terminals": (_set("rig", "r\x1b[2J"), "rig: is.*control"),
    "unstable": (_mount({"numerator": [1], "denominator": [1, -1]}), "not stable"),
    "reversed": (
        _mount({"numerator": [1.2e8], "denominator": [1.2e8, 1300.0, 1.0]}),
        "gain of 1.2e\\+08 at rest",
    ),
}


@pytest.mark.parametrize("fault", BAD_ROOTS)
def test_a_bad_root_is_refused(
    fault: str, make_trial: MakeTrial, write_study: WriteStudy
) -> None:
    edit, reason = BAD_ROOTS[fault]
    path = write_study(make_trial())
    with h5py.File(path, "r+") as file:
        edit(file)
    with pytest.raises(StudyError, match=reason) as refused:
        open_study(path)
    assert str(refused.value).startswith(f"{path}, root, ")
    path.unlink()  # on Windows this fails where the file was left open


@pytest.mark.parametrize("name", ["schema", "carrier_hz"])
def test_a_value_of_a_page_is_not_repeated_whole(name: str, write_study: WriteStudy) -> None:
    path = write_study()
    with h5py.File(path, "r+") as file:
        file.attrs[name] = 30_000 * "x"
    with pytest.raises(StudyError, match=r"'xxx+\.\.\.; accepted") as refused:
        StudyReader(path)
    assert len(str(refused.value)) < 400 + len(str(path))


def test_a_study_without_a_trial_is_refused(write_study: WriteStudy) -> None:
    with pytest.raises(StudyError, match="holds no trial"):
        StudyReader(write_study())


def test_a_study_of_bad_trials_opens_and_says_why(
    make_trial: MakeTrial, write_study: WriteStudy
) -> None:
    path = write_study(make_trial("bad"))
    with h5py.File(path, "r+") as file:
        file["trials"].create_dataset("number", data=3.0)
    with StudyReader(_spoilt(path, _drop("force_n"))) as study:
        assert study.trials == ()
        assert [(one.trial, one.field) for one in study.excluded] == [
            ("bad", "force_n"),
            ("number", "group"),
        ]
        with pytest.raises(StudyError, match="there is no trial 'other'"):
            study.read("other")


def test_a_trial_in_which_nothing_was_seen_is_kept_in_the_file_and_excluded(
    make_trial: MakeTrial, write_study: WriteStudy
) -> None:
    unseen = make_trial("bad", position_mm=np.zeros((0, 2)), position_t_s=np.zeros(0))
    unnamed = make_trial("worse", participant="")
    with StudyReader(write_study(make_trial("good"), unseen, unnamed)) as study:
        assert [info.id for info in study.trials] == ["good"]
        found = {one.trial: (one.field, one.reason) for one in study.excluded}
    assert found["bad"][0] == "position_mm"
    assert "has 0 rows; accepted: 2 to" in found["bad"][1]
    assert found["worse"][0] == "participant"
