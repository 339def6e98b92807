"""What is known of a trial beside its data, as one row of a table."""

from typing import Any

from frictus_service.study.trial import Trial


def row_of(trial: Trial) -> dict[str, Any]:
    """Return names and plain values.

    As in the study file, but the targets are `target_speed_mm_s` and `target_force_n`, apart
    from the force that was measured, and the tones a list, empty where there was no drive.
    """
    info = trial.info
    return {
        "id": info.id,
        "participant": info.participant,
        "session": info.session,
        "order": info.order,
        "target_speed_mm_s": info.speed_mm_s,
        "target_force_n": info.force_n,
        "tone_hz": list(info.tones_hz),
        "drive_vpp": info.drive_vpp,
        "sample_rate_hz": info.sample_rate_hz,
        "started_utc": info.started_utc,
        "voltage_source": trial.voltage_source,
        "force_skew_s": trial.force_skew_s,
        "skin_skew_s": trial.skin_skew_s,
        "sha256": trial.sha256,
    }
