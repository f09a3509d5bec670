"""A refused row as a quarantine row: never lost, and never in the way of the others."""

import json
import math

from turnout.registry.columns import names
from turnout.registry.ids import content_id
from turnout.registry.intake import Arrival, Refusal

REMEDY = "This is a fault of the stage that made the row, not of the measurement: report it with this"
_LONGEST = 2000


def quarantine_of(refusal: Refusal, arrival: Arrival) -> dict:
    """Quarantine row that names table, row, column and value, and carries the whole row in ``found``."""
    given = arrival.tables[refusal.table][refusal.row]
    row = given if isinstance(given, dict) else {}
    recordings = [r for r in arrival.tables.get("recordings", ()) if isinstance(r, dict)] or [{}]
    path = row.get("path") or recordings[0].get("path") or arrival.unit
    record = row.get("record")
    number = refusal.number
    whole = json.dumps(given, default=str, sort_keys=True)
    return {
        "turnout_id": arrival.turnout,
        "section_id": _text(row.get("section_id") or recordings[0].get("section_id")),
        "kind": arrival.kind if arrival.kind in ("hammer", "passage") else None,
        "path": str(path),
        "record": record if isinstance(record, int) and record >= 0 else None,
        "recording_id": _text(row.get("recording_id")),
        "stage": "register",
        "reason_code": "internal_error",
        "place": f"{refusal.table}, row {refusal.row + 1}, column {refusal.column}",
        "found": f"{refusal.value}, must be {refusal.asked}; row: {whole}"[:_LONGEST],
        "remedy": REMEDY,
        "measured_value": number if number is not None and math.isfinite(number) else None,
    }


def identified(row: dict, unit: str) -> dict:
    """The quarantine row with its id, which follows from the unit and all that the row says."""
    said = {k: row.get(k) for k in names("quarantine") if k not in ("quarantine_id", "run_id", "result_id")}
    return row | {"quarantine_id": content_id("quarantine", unit, said)}


def _text(value):
    return value if isinstance(value, str) else None
