-- One row per turnout and group of sections: what the diagnosis of its newest visit says.
-- needs: findings_current
create or replace view findings_newest as
select * from findings_current
qualify row_number() over (partition by turnout_id, sections order by found_at_utc desc, finding_id) = 1;
