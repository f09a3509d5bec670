-- One row per thing that was not used: impact, model, passage, fit or recording, with its reason and the number behind it.
-- needs: impacts_current, models_current, passages_current, passage_fits_current, quarantine_open
create or replace view rejected as
with everything as (
    select
        'impact' as what, impact_id as id, turnout_id, section_id, try_cast(right(campaign_id, 10) as timestamp) as at_utc,
        reason as reason_code, measured_value, limit_value, detail
    from impacts_current where status = 'rejected'
    union all
    select 'model', model_id, turnout_id, section_id, measured_at_utc, reason, measured_value, limit_value, detail
    from models_current where status = 'rejected'
    union all
    select 'passage', passage_id, turnout_id, null, passed_at_utc, reason, null, null, detail
    from passages_current where status = 'rejected'
    union all
    select
        'fit', passage_id, turnout_id, section_id, passed_at_utc, status, fit_pct, fit_null_pct, 'sensor ' || channel
    from passage_fits_current where status not in ('accepted', 'peak_only')
    union all
    select
        'recording', quarantine_id, turnout_id, section_id, null, reason_code, measured_value, threshold,
        path || coalesce(', ' || place, '') || ': ' || coalesce(found, '')
    from quarantine_open where not is_remark
)
select
    e.*,
    coalesce(
        r.meaning,
        case e.reason_code  -- states of a fit, which are no reasons of a recording
            when 'null_explains' then 'random models fit as well'
            when 'not_an_impulse' then 'the wheels do not act as impulses'
        end
    ) as reason
from everything e left join reasons r using (reason_code);

-- columns of rejected
-- what | varchar | | impact, model, passage, fit or recording
-- id | varchar | | its id in its table
-- turnout_id | varchar | | turnout
-- section_id | varchar | | section, where it belongs to one
-- at_utc | timestamp | UTC | time of the campaign (impact: its day) or passage; empty for recordings
-- reason_code | varchar | | code of the reason; for a fit its status
-- measured_value | double | | number behind the reason
-- limit_value | double | | limit it was compared with
-- detail | varchar | | all reasons and notes in words
-- reason | varchar | | what the code means
