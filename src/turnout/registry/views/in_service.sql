-- Whether a turnout has a row in turnouts.tsv: what was measured of one that was taken out is kept, and nobody is sent to
-- it. A registry that knows no turnouts leaves none out.
create or replace macro in_service(id) as (
    id in (select turnout_id from turnouts) or not exists (select 1 from turnouts)
);

-- Whether a section has left the layout of its turnout: its history is kept, too, and nobody is sent to it either.
create or replace macro has_left(id) as (
    coalesce(id in (select section_id from sections where left_layout), false)
);
