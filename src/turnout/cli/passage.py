"""Analyse one passage file: axles, speed, type of the train, and what the model of each section predicts.

Nothing is written without --figure, the name of a page. For each sensor the page shows the passage as measured and as
predicted, whole and for two wheelsets, and its spectrogram with the axles. The models are those that the last run
identified (--work). Without them, or with --no-fit, only the train is described.

Exit code 1 if no train is found, 2 if the command line or an input is wrong.
"""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from turnout.cli.options import (
    add_configuration,
    add_figure,
    add_former,
    add_raw,
    add_result,
    add_turnout,
    add_work,
    check_output_files,
)
from turnout.constants import KMH, Z95

if TYPE_CHECKING:
    from collections.abc import Mapping
    from typing import Any

    from turnout.config import TurnoutConfig
    from turnout.config.settings.passage import PassageSettings
    from turnout.passage.channel_fit import ChannelFit
    from turnout.passage.result import Passage
    from turnout.records import LongRecording, Recording
    from turnout.stages.passage import PassageContext

GROUP = "Look at recordings"
HELP = "analyse one passage file, without storing results"
SPEED_SOURCES = {
    "sensors": "the delays between sensors",
    "axle spacing": "the axle spacing",
    "both": "sensors and axle spacing",
    "bogie": "the axle spacing of a usual bogie",
}
FIT_HEAD = "  sensor      fit / null   forecast / null  left out / null   along b  peak m/s²  status"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The recording, its turnout, and the folder of its models.

    Parameters
    ----------
    parser : argparse.ArgumentParser
        Parser of the command.
    """
    parser.add_argument("file", help="passage recording, in any format that is read")
    add_turnout(parser, "id of the turnout, for its sensors and models")
    add_configuration(parser)
    add_raw(parser)
    add_work(parser, "folder of the last run (%(default)s)")
    parser.add_argument("--no-fit", action="store_true", help="only find the train, fit no model")
    add_figure(parser, "draw panels of the first train into this HTML file")
    add_former(parser, "--out", "--figure")


def run(args: argparse.Namespace) -> int:
    """Print the train of each record and, unless --no-fit, the fit at each sensor; exit code 1 without a train.

    Parameters
    ----------
    args : argparse.Namespace
        Options of the command.

    Returns
    -------
    int
        Exit code.
    """
    from pathlib import Path

    from turnout.config import load_configuration
    from turnout.errors import REMARK_REASONS, ReadError
    from turnout.readers import read
    from turnout.stages.layout_reading import grouped_errors
    from turnout.stages.passage import trains_in
    from turnout.stages.passage_context import passage_context
    from turnout.stages.requested_units import passage_file

    check_output_files(args, "--figure")
    configuration = load_configuration(args.configuration)
    turnout = configuration.turnout(args.turnout)
    description = turnout.require_passages().description
    folders = {name: row.raw for name, row in configuration.rows.items()}
    path = passage_file(args.file, turnout, Path(args.raw), folders).resolve()  # a link may lead anywhere
    settings = turnout.settings["passage"]
    result = read(path.name, path.parent, description, settings.longest)
    remarks = [e for e in result.errors if isinstance(e, ReadError) and e.reason in REMARK_REASONS]
    for problem in grouped_errors([error for error in result.errors if error not in remarks]):
        print(f"Not used: {problem}")
    for problem in grouped_errors(remarks):
        print(f"Note: {problem}")
    _, context = passage_context(turnout.id, turnout.settings, args.work)
    has_train = False
    rows: list[dict[str, Any]] = []
    records: list[Recording | LongRecording] = [*result.recordings, *result.long_recordings]
    for record in records:
        for recording, offset, name in trains_in(record, settings):
            out = None if has_train else args.figure
            row = _show(recording, offset if name else None, turnout, context, settings, args.no_fit, out)
            has_train |= row["n_axles"] > 0
            rows.append(row)
    add_result(args, rows)
    return 0 if has_train else 1


def _show(
    recording: Recording,
    offset: float | None,
    turnout: TurnoutConfig,
    context: PassageContext,
    settings: PassageSettings,
    no_fit: bool,
    out: str | None,
) -> dict[str, Any]:
    """Print one train and its fits, write its page; returns the train as numbers."""
    from turnout.passage.analysis import analyse
    from turnout.stages.passage import sensors_of

    if offset is not None:
        print(f"{offset:.1f} s after the start of the record:")
    passage = analyse(recording, sensors_of(turnout), context.patterns, settings)
    print("\n".join(_train_lines(recording, passage)))
    fits = {} if no_fit or not passage.n_axle else _fits(recording, passage, turnout, context, settings)
    if fits:
        print("\n".join(_fit_lines(fits, settings)))
    if out and passage.n_axle:
        _write_page(out, turnout.id, recording, passage, fits, _train_lines(recording, passage))
    return _train_row(recording, offset, passage, fits)


def _train_row(
    recording: Recording, offset: float | None, passage: Passage, fits: Mapping[str, ChannelFit | str]
) -> dict[str, Any]:
    """A train and the fit at each sensor as numbers."""
    row: dict[str, Any] = {
        "file": recording.source, "record": recording.record + 1, "offset_s": offset or 0.0, "status": passage.status,
        "reasons": [f.reason for f in passage.findings], "n_axles": passage.n_axle, "direction": passage.direction,
        "track": passage.track, "axles_m": [float(x) for x in passage.offsets],
    }  # fmt: skip
    if passage.speed is not None and passage.type is not None:
        row |= {
            "speed_kmh": KMH * passage.speed.speed, "speed_se_kmh": KMH * passage.speed.se,
            "acceleration_ms2": passage.speed.acceleration, "acceleration_se_ms2": passage.speed.acceleration_se,
            "train_type": passage.type.type, "train_type_probability": float(passage.type.probability),
        }  # fmt: skip
    return row | {"sensors": [_sensor_row(name, fit) for name, fit in fits.items()]}


def _sensor_row(name: str, fit: ChannelFit | str) -> dict[str, Any]:
    """The fit at one sensor as numbers, or why there is none."""
    if isinstance(fit, str):
        return {"sensor": name, "status": None, "detail": fit}
    row: dict[str, Any] = {"sensor": name, "status": fit.status, "detail": fit.detail or None}
    if fit.scores is None or fit.null is None or fit.test is None:
        return row
    return row | {
        "fit_pct": fit.scores.fit, "fit_null_pct": fit.null.fit,
        "forecast_pct": fit.scores.forecast, "forecast_null_pct": fit.null.forecast,
        "leave_one_out_pct": fit.scores.leave_one_out, "leave_one_out_null_pct": fit.null.leave_one_out,
        "along_b_share": fit.test.along_share, "peak_ms2": fit.peak,
    }  # fmt: skip


def _train_lines(recording: Recording, passage: Passage) -> list[str]:
    """The train in words."""
    lines = [f"{recording.source}, record {recording.record + 1}: {recording.duration:.1f} s, {passage.status}"]
    lines += [f"  {f.reason}: {f.detail}" for f in passage.findings]
    if passage.speed is None or passage.type is None:
        return lines
    speed, type_ = passage.speed, passage.type
    lines.append(f"  axles      {passage.n_axle}; the weakest peak is {passage.contrast:.1f} times the next one")
    speed_text = f"{KMH * speed.speed:.1f} ± {KMH * Z95 * speed.se:.1f} km/h (95 %) in the middle"
    lines.append(f"  speed      {speed_text}, from {SPEED_SOURCES[speed.source]}")
    lines.append(f"  change     {speed.acceleration:+z.2f} ± {Z95 * speed.acceleration_se:.2f} m/s² (95 %)")
    if speed.disagreement is not None and abs(speed.disagreement) > 3:
        lines.append(f"  sensors and axle spacing differ by {abs(speed.disagreement):.1f} standard errors")
    lines.append(f"  direction  {passage.direction}, track {passage.track}")
    probability = "above 0.999" if type_.probability > 0.9995 else f"{type_.probability:.3f}"  # no certainty
    lines.append(f"  type       {type_.type}, probability {probability}")
    if type_.residual is not None:
        row = " ".join(v.name for v in type_.vehicles)
        lines.append(f"             axle spacings differ by {100 * type_.residual:.1f} cm rms from {row}")
    spacing = ", ".join(f"{d:.2f}" for d in passage.offsets[:12])
    lines.append(f"  axles at   {spacing}{' ...' if passage.n_axle > 12 else ''} m behind the first")
    return lines


def _fits(
    recording: Recording, passage: Passage, turnout: TurnoutConfig, context: PassageContext, settings: PassageSettings
) -> dict[str, ChannelFit | str]:
    """The fit of each sensor's model, or why there is none."""
    from datetime import datetime

    from turnout.passage.channel_fit import fit_channel
    from turnout.stages.passage import model_at, sensors_of

    fits: dict[str, ChannelFit | str] = {}
    for sensor in sensors_of(turnout):
        models = context.models.get(sensor.section, ())
        model = model_at(models, recording.started_at or datetime.max)
        if sensor.name not in passage.at_sensor or model is None:
            fits[sensor.name] = "does not record the train" if models else "no model of its section"
            continue
        samples, times = recording.signal(sensor.name), passage.at_sensor[sensor.name]
        fits[sensor.name] = fit_channel(
            samples, recording.rate, times, passage.train_motion.speed, model.model, settings
        )
    return fits


def _fit_lines(fits: Mapping[str, ChannelFit | str], settings: PassageSettings) -> list[str]:
    """A line per sensor: each score with that of its null models."""
    lines = [FIT_HEAD]
    for name, fit in fits.items():
        if isinstance(fit, str) or fit.scores is None or fit.null is None or fit.test is None:
            lines.append(f"  {name:<10}{fit if isinstance(fit, str) else fit.detail}")
            continue
        s, null = fit.scores, fit.null
        lines.append(
            f"  {name:<10}{s.fit:6.1f} /{null.fit:5.1f} {s.forecast:9.1f} /{null.forecast:6.1f} "
            f"{s.leave_one_out:9.1f} /{null.leave_one_out:6.1f} {fit.test.along_share:10.0%} {fit.peak:10.1f}"
            f"  {fit.status}"
        )
    lines.append(f"  {score_basis(settings)}")
    return lines


def _write_page(
    path: str,
    turnout_id: str,
    recording: Recording,
    passage: Passage,
    fits: Mapping[str, ChannelFit | str],
    lines: list[str],
) -> None:
    """The page of a passage, with panels of every sensor that recorded the train."""
    import numpy as np

    from turnout.files import write_text
    from turnout.report.passage_page import SensorPassage, passage_page

    sensors = []
    for name, times in passage.at_sensor.items():
        fit = fits.get(name)
        samples = recording.signal(name)
        prediction = None if fit is None or isinstance(fit, str) else fit
        sensors.append(SensorPassage(name, samples - np.median(samples), recording.rate, np.sort(times), prediction))
    write_text(path, passage_page(f"{turnout_id}, {recording.source}", lines, sensors))


def score_basis(settings: PassageSettings) -> str:
    """The settings behind the scores, in words.

    Parameters
    ----------
    settings : PassageSettings
        Section ``passage`` of the configuration.

    Returns
    -------
    str
        Band, number of values per wheel and null models.
    """
    return (
        f"band {settings.band_low:g}-{settings.band_high:g} Hz, two numbers per wheel, "
        f"null: {settings.null_models} random models, 95 % quantile"
    )
