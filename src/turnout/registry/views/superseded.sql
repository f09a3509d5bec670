-- One row per id that no longer counts: the last word of supersedes about it.
create or replace view superseded as
select
    old_id,
    arg_max(new_id, generation) as new_id,
    arg_max(kind, generation) as kind,
    arg_max(reason, generation) as reason
from supersedes
group by old_id
having arg_max(reason, generation) <> 'reinstated';

-- columns of superseded
-- old_id | varchar | | id that no longer counts
-- new_id | varchar | | what took its place; empty = nothing
-- kind | varchar | | what kind of row
-- reason | varchar | | why
