-- One row per section under the hammer, and per turnout under trains ('*'), of which nothing could be used since the last
-- test that gave a model or the last passage that counted, or ever. Of passages it takes ten in a row after a good one:
-- single ones are rejected every day. Source is empty for a turnout none of whose files belongs to any test or passage.
-- needs: models_current, impacts_current, passages_current, quarantine_open, in_service
create or replace macro unusable("asof" := null) as table
with unread as (
    select
        q.turnout_id, q.section_id, q.kind, q.path, q.reason_code,
        q.turnout_id || '/' || split_part(r.label, '/', -1) as campaign_id,
        case q.kind
            when 'hammer' then coalesce(c.started_at_utc, try_cast(split_part(r.label, '/', -1) as timestamp))
            else try_strptime(regexp_extract(r.label, '\d{8}T\d{6}'), '%Y%m%dT%H%M%S')
        end as at_utc
    from quarantine_open q
    join results r using (result_id)  -- a row that is found again keeps the result that brought it first
    left join campaigns c on c.campaign_id = q.turnout_id || '/' || split_part(r.label, '/', -1)
    where q.kind in ('hammer', 'passage') and not q.is_remark
),
tried as not materialized (
    select
        section_id as part, turnout_id, section_id, 'hammer' as source, campaign_id as what, measured_at_utc as at_utc,
        status <> 'rejected' as is_used, reason
    from models_current
    union all
    select turnout_id, turnout_id, '*', 'passage', passage_id, passed_at_utc, status <> 'rejected', reason
    from passages_current
    union all
    select section_id, turnout_id, section_id, 'hammer', campaign_id, at_utc, false, reason_code
    from unread where kind = 'hammer'
    union all
    select turnout_id, turnout_id, '*', 'passage', path, at_utc, false, reason_code
    from unread where kind = 'passage'
),
known as not materialized (
    select * from tried
    where in_service(turnout_id) and not has_left(section_id)
        and coalesce(at_utc <= "asof", "asof" >= newest_measurement(), true)
),
last_used as (
    select part, max(at_utc) filter (is_used) as used_at_utc,
        max_by(what, at_utc) filter (is_used) as used
    from known
    group by part
    having coalesce(max(at_utc) filter (not is_used) > used_at_utc, used_at_utc is null)
),
failed as (
    select
        any_value(turnout_id) as turnout_id, any_value(section_id) as section_id, any_value(source) as source,
        any_value(used_at_utc) as used_at_utc, any_value(used) as used, count(distinct what) as n,
        max(at_utc) as at_utc, coalesce(max_by(what, at_utc), min(what)) as what,
        mode(reason order by reason) as usual_reason, max_by(reason, at_utc) as reason
    from known join last_used using (part)
    where not is_used and coalesce(at_utc > used_at_utc, used_at_utc is null)
    group by part
    having any_value(source) = 'hammer' or any_value(used_at_utc) is null or count(distinct what) >= 10
),
test_impacts as (
    select
        section_id, campaign_id, count(*) as n, count(*) filter (status = 'rejected') as n_rejected,
        mode(reason order by reason) filter (status = 'rejected') as reason
    from impacts_current i semi join failed f on i.section_id = f.section_id and i.campaign_id = f.what
    group by section_id, campaign_id
),
files as (
    select section_id, campaign_id, count(distinct path) as n, mode(reason_code order by reason_code) as reason
    from unread
    where kind = 'hammer'
    group by section_id, campaign_id
)
select
    f.turnout_id, f.section_id, f.source, f.used_at_utc, f.n, f.at_utc,
    case f.source when 'hammer' then 'no hammer test' else 'no passage' end
        || ' could be used ' || coalesce('since ' || case f.source
            when 'hammer' then split_part(f.used, '/', -1) else strftime(f.used_at_utc, '%Y-%m-%d')
        end, 'yet')
        || ' (' || f.n || ' tried); '
        || case
            when f.source = 'passage' then 'most often: ' || f.usual_reason
            else coalesce(split_part(f.what, '/', -1) || ': ', '') || coalesce(
                nullif(concat_ws(', ',
                    b.n_rejected || ' of ' || b.n || ' impacts rejected (' || b.reason || ')',
                    d.n || case when d.n = 1 then ' file' else ' files' end || ' in quarantine (' || d.reason || ')'
                ), ''),
                f.reason)
        end as why
from failed f
left join test_impacts b on b.section_id = f.section_id and b.campaign_id = f.what
left join files d on d.section_id = f.section_id and d.campaign_id = f.what
union all by name
select
    turnout_id, '*' as section_id, count(distinct path) as n,
    'nothing was read: ' || count(distinct path)
        || case when count(distinct path) = 1 then ' entry' else ' entries' end
        || ' in quarantine (' || mode(reason_code order by reason_code) || ')' as why
from quarantine_open
where kind = 'configuration' and reason_code <> 'not_counted' and turnout_id not in (select turnout_id from tried)
    and coalesce("asof" >= newest_measurement(), true)
group by turnout_id;

-- columns of unusable(asof := null)
-- turnout_id | varchar | | turnout
-- section_id | varchar | | section; * = the whole turnout
-- source | varchar | | hammer or passage; empty = no file belongs to either
-- used_at_utc | timestamp | UTC | newest test or passage that was used; empty = none ever
-- n | bigint | | tests or passages since then, or entries in quarantine
-- at_utc | timestamp | UTC | newest of them
-- why | varchar | | in words
