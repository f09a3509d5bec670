-- One row per turnout, kind and reason: how much is in quarantine now.
-- needs: quarantine_open
create or replace view quarantine_by_reason as
select turnout_id, kind, reason_code, reason, count(*) as n, min(path) as first_path
from quarantine_open
group by turnout_id, kind, reason_code, reason;

-- columns of quarantine_by_reason
-- turnout_id | varchar | | turnout
-- kind | varchar | | kind of recording
-- reason_code | varchar | | code, see docs/reasons.md
-- reason | varchar | | what the code means
-- n | bigint | | rows in quarantine now
-- first_path | varchar | | one of the files
