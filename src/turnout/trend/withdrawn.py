"""Open alarms that are not raised again when everything is computed anew: closed in sight, never gone silently."""

import logging

import numpy as np
import pandas as pd

from turnout.trend.panel import timestamps

CHART = ["turnout_id", "section_id", "band", "source", "direction"]
# What the tables of the last update say that the next one has to account for.
ACCOUNTED = "select * from alarms where closed_at_utc is null or closed_by = 'recomputed' order by alarm_id"


def with_withdrawn(alarms, before, newest) -> pd.DataFrame:
    """Rows of ``alarms`` and, closed by ``recomputed``, those open ones of ``before`` that have no counterpart there.

    Every alarm is computed anew each night, and a value that was corrected, an event that was entered late or another
    memory of the fleet can take one back. A counterpart is an alarm of the same chart and direction that was open when
    the old one was raised or later; of an old one that was closed like this before, one that was open in its time: what
    is raised after that is another alarm.

    Parameters
    ----------
    alarms : DataFrame
        Rows of the table ``alarms`` as computed now.
    before : DataFrame
        Published rows that are open, or were closed like this before: these stay.
    newest : float
        Newest campaign of the fleet: when they are closed. [d]
    """
    if before.empty:
        return alarms
    times = ["raised_at_utc", "closed_at_utc"]
    now = alarms if len(alarms) else pd.DataFrame(columns=[*CHART, *times])
    both = before.reset_index().merge(now[[*CHART, *times]], on=CHART, suffixes=("", "_now"))
    until, then = pd.to_datetime(both["closed_at_utc_now"]), pd.to_datetime(both["closed_at_utc"])
    again = until.isna() | (until >= both["raised_at_utc"])
    again &= then.isna() | (pd.to_datetime(both["raised_at_utc_now"]) <= then)
    found = both.loc[again.to_numpy(dtype=bool), "index"]
    gone = before[~before.index.isin(found)]
    fresh = gone["closed_at_utc"].isna()
    for row in gone[fresh].itertuples():
        said = "the alarm %s is not raised again by what is known now: closed as recomputed"
        logging.getLogger("turnout.trend").warning(said, row.alarm_id)
    closed = np.fmax(timestamps(np.full(len(gone), newest)), gone["raised_at_utc"].to_numpy("datetime64[us]"))
    gone = gone.assign(
        closed_at_utc=np.where(fresh, closed, gone["closed_at_utc"].to_numpy("datetime64[us]")), closed_by="recomputed"
    )
    return gone.reset_index(drop=True) if alarms.empty else pd.concat([alarms, gone], ignore_index=True)
