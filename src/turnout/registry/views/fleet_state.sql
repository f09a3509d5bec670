-- One row per turnout: what is known of it, how old that is, and what waits in quarantine.
-- needs: modes_current, models_current, quarantine_open, trains_current
create or replace view fleet_state as
with measured as (
    select turnout_id, count(distinct section_id) as n_sections_measured, count(distinct campaign_id) as n_campaigns,
        max(measured_at_utc) as last_campaign_utc, count(*) filter (status = 'rejected') as n_models_rejected,
        count(*) filter (status <> 'rejected') as n_models
    from models_current where method = 'joint' group by turnout_id
),
passed as (
    select turnout_id, count(*) as n_passages, max(passed_at_utc) as last_passage_utc
    from trains_current group by turnout_id
),
waiting as (select turnout_id, count(*) as n_quarantine from quarantine_open where not is_remark group by turnout_id),
work as (select turnout_id, max(event_at_utc) as last_event_utc, arg_max(kind, event_at_utc) as last_event
    from events where event_at_utc < published_at() + interval 1 day group by turnout_id)  -- not what is only planned
select
    t.turnout_id, t.name, t.line, t.km, t.layout,
    (select count(*) from sections s where s.turnout_id = t.turnout_id) as n_sections,
    coalesce(n_sections_measured, 0) as n_sections_measured, coalesce(n_campaigns, 0) as n_campaigns,
    coalesce(n_models, 0) as n_models, coalesce(n_models_rejected, 0) as n_models_rejected, last_campaign_utc,
    coalesce(n_passages, 0) as n_passages, last_passage_utc, coalesce(n_quarantine, 0) as n_quarantine,
    last_event, last_event_utc
from turnouts t left join measured using (turnout_id) left join passed using (turnout_id)
    left join waiting using (turnout_id) left join work using (turnout_id);

-- columns of fleet_state
-- turnout_id | varchar | | turnout, as in config/turnouts.tsv
-- name | varchar | | name for display
-- line | varchar | | railway line
-- km | double | km | position along the line
-- layout | varchar | | layout it follows, config/layouts/<layout>.yaml
-- n_sections | bigint | | sections configured
-- n_sections_measured | bigint | | sections with a model, rejected ones included
-- n_campaigns | bigint | | hammer campaigns with a model
-- n_models | bigint | | models that are not rejected
-- n_models_rejected | bigint | | rejected models
-- last_campaign_utc | timestamp | UTC | newest hammer campaign
-- n_passages | bigint | | trains whose passages are used
-- last_passage_utc | timestamp | UTC | newest passage used
-- n_quarantine | bigint | | open quarantine rows
-- last_event | varchar | | newest maintenance event
-- last_event_utc | timestamp | UTC | when that was
