"""What of a night cannot be used, though every job came to its end: as far as the registry has it."""

from collections.abc import Collection
from pathlib import Path

import duckdb

from turnout.errors import RegistryError
from turnout.registry.database import open_registry
from turnout.registry.generation import FILE

REJECTED = """
select turnout_id || '/hammer/' || split_part(section_id, '/', -1) || '/' || split_part(campaign_id, '/', -1) as unit
from models_current where status = 'rejected' and unit in (select unnest(?))"""
UNUSED = """
with used as (
    select turnout_id from models_current where status <> 'rejected'
    union all select turnout_id from passages_current where status <> 'rejected'
)
select turnout_id, not exists (select 1 from used u where in_service(u.turnout_id))
from unusable() where used_at_utc is null and turnout_id not in (select turnout_id from used)
group by turnout_id order by turnout_id"""


def rejected(units: Collection[str], registry: Path) -> list[str]:
    """Those of the ``units`` whose hammer test gave no model."""
    return [unit for (unit,) in _asked(registry, REJECTED, [list(units)])] if units else []


def unused_turnouts(registry: Path) -> tuple[list[str], bool]:
    """Turnouts of which files have come and no test and no passage ever counted; and whether that is so of all."""
    rows = _asked(registry, UNUSED, [])
    return [turnout for turnout, _ in rows], any(nothing for _, nothing in rows)


def _asked(registry: Path, sql: str, values: list) -> list[tuple]:
    if not (registry / FILE).exists():
        return []
    try:
        with open_registry(registry) as connection:
            return connection.execute(sql, values).fetchall()
    except (RegistryError, duckdb.Error):  # the line of a night that failed must come all the same
        return []
