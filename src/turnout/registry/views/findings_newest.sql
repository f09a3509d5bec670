-- One row per finding that still stands: of one of its sections at least, its visit's is the newest diagnosis. A finding
-- ends when each of its sections was looked at again, in whatever groups: what is measured differs from visit to visit.
-- needs: findings_current
create or replace view findings_newest as
select * from findings_current
where finding_id in (
    select finding_id
    from (
        select finding_id, turnout_id, found_at_utc, unnest(string_split(coalesce(sections, ''), ', ')) as section
        from findings_current
    )
    qualify row_number() over (partition by turnout_id, section order by found_at_utc desc, finding_id) = 1
);
