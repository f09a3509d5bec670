"""Mark rows as superseded: they stay, and a row of ``supersedes`` names their successor and the reason.

Each file of the large tables knows the number of its superseded rows, because looking up 29 million ids takes longer
than most queries. Compaction separates valid and superseded rows; a file without valid rows is not read.
"""

from collections.abc import Collection
from dataclasses import replace
from pathlib import Path

import duckdb

from turnout.registry.generation import DataFile
from turnout.registry.schema import CHILDREN, WHOLE_TABLES, file_literal, key, names, tables

# type of row: its table, its id, and the SQL of the text that is equal in its counterpart of the new result
KINDS = {
    "model": ("models", "model_id", "t.section_id || ' ' || t.method"),
    "passage": ("passages", "passage_id", "t.passed_at_utc::varchar"),
    "quarantine": ("quarantine", "quarantine_id", "t.path || coalesce(t.record, -1) || t.stage || t.reason_code"),
    "finding": ("mismatch_findings", "finding_id", "coalesce(t.sections, t.section_id, '')"),
    "result": ("results", "result_id", "t.kind"),
}


def note_superseded(con: duckdb.DuckDBPyConnection) -> None:
    """Create table ``dead``: ids of the registry that are superseded.

    Parameters
    ----------
    con : DuckDB connection
        Connection with the view ``old_supersedes``.
    """
    con.execute(f"create temp table dead as {latest_supersession('old_supersedes')}")


def latest_supersession(*relations: str) -> str:
    """SELECT of the superseded ids, by the last statement about each in the ``relations``.

    Parameters
    ----------
    *relations : str
        Tables or views with the columns of ``supersedes``.

    Returns
    -------
    str
        A SELECT statement.
    """
    statements = " union all ".join(f"select old_id, generation, reason from {r}" for r in relations)
    return f"select old_id from ({statements}) group by old_id having arg_max(reason, generation) <> 'reinstated'"


def supersede(
    con: duckdb.DuckDBPyConnection, generation: int, run_id: str, filled: Collection[str], stored: Collection[str]
) -> int:
    """Fill ``new_supersedes`` by comparing new and earlier results of the same units.

    Parameters
    ----------
    con : DuckDB connection
        Connection with the staging tables.
    generation : int
        Number of the new generation.
    run_id : str
        Id of the run.
    filled, stored : collection of str
        Tables that may have new rows, and those that have earlier ones: others are not asked.

    Returns
    -------
    int
        Number of rows of ``supersedes``.
    """
    _note_new_ids(con, filled)
    _note_prior(con, stored)
    _note_causes(con)
    con.execute(
        """insert into new_supersedes by name
        with gone as (select p.* from prior p anti join new_ids n on p.kind = n.kind and p.id = n.id
            where not p.is_dead),
        heirs as (select kind, unit_id, place, min(id) as id from new_ids group by all)
        select g.id as old_id, $generation as generation, h.id as new_id, g.kind,
            case when g.kind = 'quarantine' and h.id is null then 'repaired'
                else coalesce(c.reason, 'new_data') end as reason,
            $run as run_id, 0 as _unit, 0 as _row, 0 as _year
        from gone g left join heirs h on g.kind = h.kind and g.unit_id = h.unit_id and g.place = h.place
            left join causes c on c.unit_id = g.unit_id
        union all
        select distinct id, $generation, null, kind, 'reinstated', $run, 0, 0, 0
        from new_ids semi join dead on id = old_id""",
        {"generation": generation, "run": run_id},
    )
    return con.execute("select count(*) from new_supersedes").fetchall()[0][0]


def supersede_unlisted_results(con: duckdb.DuckDBPyConnection, generation: int, run_id: str) -> int:
    """Supersede rows whose result is in no file any more: damage took the result away, and no work batch holds it.

    Parameters
    ----------
    con : DuckDB connection
        Connection with the staging tables, after ``supersede``.
    generation : int
        Number of the new generation.
    run_id : str
        Id of the run.

    Returns
    -------
    int
        Number of rows added to ``supersedes``.
    """
    with_result = [t for t in tables() if t != "results" and t not in WHOLE_TABLES and "result_id" in names(t)]
    held = " union ".join(f"select result_id from old_{table}" for table in with_result)
    con.execute(
        f"""create temp table unlisted_results as select result_id from ({held}) where result_id is not null
        and result_id not in (select result_id from old_results union all select result_id from new_results)"""
    )
    selects = [
        f"select distinct {id_column} as id, '{row_type}' as kind from old_{table} "
        "semi join unlisted_results using (result_id)"
        for row_type, (table, id_column, _) in KINDS.items()
        if table != "results"
    ]
    ids = " union all ".join(["select result_id as id, 'result' as kind from unlisted_results", *selects])
    added = con.execute(
        f"""insert into new_supersedes by name
        select id as old_id, $generation as generation, null as new_id, kind, 'new_data' as reason, $run as run_id,
            0 as _unit, 0 as _row, 0 as _year
        from ({ids}) where id not in (select old_id from dead union all select old_id from new_supersedes)
            and id not in (select id from new_ids)""",
        {"generation": generation, "run": run_id},
    ).fetchall()
    return added[0][0]


def remove_known_rows(con: duckdb.DuckDBPyConnection, filled: Collection[str]) -> None:
    """Delete from the staging tables the rows that the registry already has: same id, same content.

    Parameters
    ----------
    con : DuckDB connection
        Connection with the staging tables.
    filled : collection of str
        Tables that may have new rows.
    """
    con.execute(
        "create or replace temp table known_results as "
        "select result_id from new_results semi join old_results using (result_id)"
    )
    for table in {"recordings", "impacts"} & set(filled):
        con.execute(f"delete from new_{table} where result_id in (from known_results)")
    for table, id_column in (("results", "result_id"), ("models", "model_id"), ("passages", "passage_id"),
                             ("quarantine", "quarantine_id"), ("mismatch_findings", "finding_id")):  # fmt: skip
        if table not in filled:
            continue
        con.execute(
            f"create or replace temp table known as select {id_column} from new_{table} "
            f"semi join old_{table} using ({id_column})"
        )
        for child in set(CHILDREN.get(table, ("", ()))[1]) & set(filled):
            con.execute(f"delete from new_{child} where {_known_child_condition(child, id_column)}")
        con.execute(f"delete from new_{table} where {id_column} in (from known)")


def remove_present_rows(con: duckdb.DuckDBPyConnection) -> None:
    """Delete from the staging tables the rows that the registry has, row by row: children may have lost their parent.

    Parameters
    ----------
    con : DuckDB connection
        Connection with the staging tables.
    """
    for table in tables():
        if table not in WHOLE_TABLES:
            keys = ", ".join(f'"{k}"' for k in key(table))
            con.execute(f"delete from new_{table} where ({keys}) in (select ({keys}) from old_{table})")


def _known_child_condition(child: str, id_column: str) -> str:
    """SQL condition: the child row is known, with its parent; a fit only if it has the same model, too."""
    if child != "passage_fits":
        return f"{id_column} in (from known)"
    keys = "passage_id, section_id, channel, model_id"
    return f"({keys}) in (select ({keys}) from old_passage_fits where passage_id in (from known))"


def _note_new_ids(con: duckdb.DuckDBPyConnection, filled: Collection[str]) -> None:
    """Create table ``new_ids``: ids of all incoming rows, before known rows are deleted."""
    selects = [
        f"select '{row_type}' as kind, t.{id_column} as id, c.unit_id, {counterpart} as place "
        f"from new_{table} t join (select _unit, unit_id from came) c using (_unit)"
        for row_type, (table, id_column, counterpart) in KINDS.items()
        if table in filled or table == "results"
    ]
    con.execute(f"create temp table new_ids as {' union all '.join(selects)}")


def _note_prior(con: duckdb.DuckDBPyConnection, stored: Collection[str]) -> None:
    """Create table ``prior``: ids of earlier results of the same units, and whether they are superseded."""
    con.execute(
        "create temp table prior_results as select result_id, unit_id, code_version from old_results "
        "semi join came using (unit_id)"
    )
    selects = [
        f"select '{row_type}' as kind, t.{id_column} as id, p.unit_id, {counterpart} as place, "
        f"t.{id_column} in (select old_id from dead) as is_dead "
        f"from old_{table} t join (select result_id, unit_id from prior_results) p using (result_id)"
        for row_type, (table, id_column, counterpart) in KINDS.items()
        if table in stored or table == "results"
    ]
    con.execute(f"create temp table prior as {' union all '.join(selects)}")


def _note_causes(con: duckdb.DuckDBPyConnection) -> None:
    """Create table ``causes``: why each unit was computed again: new data, new code or new configuration."""
    con.execute(
        """create temp table causes as
        with live as (select p.* from prior_results p where p.result_id not in (select old_id from dead)),
        before as (select l.unit_id, any_value(l.code_version) as algo,
                list_sort(list(distinct r.recording_id)) as files
            from live l left join old_recordings r using (result_id) group by l.unit_id),
        after as (select c.unit_id, any_value(c.algo) as algo, list_sort(list(distinct r.recording_id)) as files
            from came c left join new_recordings r using (_unit) group by c.unit_id)
        select unit_id, case when before.files is distinct from after.files then 'new_data'
            when before.algo is distinct from after.algo then 'new_code' else 'new_configuration' end as reason
        from before join after using (unit_id)"""
    )


# The large tables, and the ids by which their rows are superseded.
LARGE_TABLES = {"modes": ("model_id",), "impact_modes": ("model_id",), "passage_fits": ("passage_id", "model_id")}


def superseded_condition(table: str, alias: str = "t") -> str:
    """SQL condition: the row is superseded, by the ids in the table or view ``superseded``.

    Parameters
    ----------
    table : str
        One of ``LARGE_TABLES``.
    alias : str
        Name of the table in the query.

    Returns
    -------
    str
        SQL expression.
    """
    return " or ".join(f"{alias}.{i} in (select old_id from superseded)" for i in LARGE_TABLES[table])


def count_superseded(con: duckdb.DuckDBPyConnection, root: Path, files: list[DataFile]) -> list[DataFile]:
    """The files with their number of superseded rows, from the table ``superseded`` of ``con``.

    Parameters
    ----------
    con : DuckDB connection
        Connection with the table ``superseded``.
    root : Path
        Folder of the registry.
    files : list of DataFile
        Live files.

    Returns
    -------
    list of DataFile
        Copies with ``dead``; files of small tables are unchanged.
    """
    counted: dict[str, int] = {}
    for table in LARGE_TABLES:
        paths = {str(root / f.path): f.path for f in files if f.table == table}
        if paths:
            listed = ", ".join(map(file_literal, paths))
            ids = ", ".join(LARGE_TABLES[table])
            sql = f"select {ids}, filename from read_parquet([{listed}], filename = true, union_by_name = true)"
            rows = con.execute(
                f"select filename, count(*) from ({sql}) t where {superseded_condition(table)} group by 1"
            ).fetchall()
            counted |= {paths[name]: count for name, count in rows}
    return [replace(f, dead=counted.get(f.path, 0)) if f.table in LARGE_TABLES else f for f in files]


def split_files(files: list[DataFile]) -> tuple[list[DataFile], list[DataFile]]:
    """Files of a large table without superseded rows, and those with some; one without valid rows is in neither.

    Parameters
    ----------
    files : list of DataFile
        Live files of one of ``LARGE_TABLES``.

    Returns
    -------
    (list of DataFile, list of DataFile)
        Settled and touched files.
    """
    return [f for f in files if f.dead == 0], [f for f in files if 0 < f.dead < f.rows]


def split_superseded(table: str, select: str) -> tuple[str, str]:
    """SELECTs of the valid and of the superseded rows.

    Parameters
    ----------
    table : str
        One of ``LARGE_TABLES``.
    select : str
        SQL of the rows.

    Returns
    -------
    (str, str)
        SELECT of the valid and of the superseded rows.
    """
    columns = ", ".join(f't."{n}"' for n in names(table))
    return tuple(
        f"select {columns} from ({select}) t where {sign} ({superseded_condition(table)})" for sign in ("not", "")
    )  # type: ignore[return-value]
