-- One row per thing to do: every campaign that must be confirmed now, every open alarm, the largest change first (the
-- end of its interval nearer to zero, in multiples of the target of its chart), and what else there is up to `trend.worklist_rows` rows in all, or `most`; n_in_all counts what there would be without an end.
-- asof at or after the newest measurement uses everything; an earlier one uses only what was measured by then
-- (change and date then come from the sums alone, and a slow drift is not among the plans).
-- An alarm that follows from the other resonance of a section refers to its row, if that one is listed.
-- needs: chart_states, campaign_name, cannot_see, chart_status_at, acknowledgement_counts, in_service, is_below_target, stiffness_words, findings_current
create or replace macro worklist("asof", most := null) as table
with then_status as (select * from chart_status_at("asof")),
recent as (
    select
        a.alarm_id, a.turnout_id, a.section_id, a.band, a.source, a.direction, a.raised_at_utc, a.began_at_utc,
        a.threshold, c.residual_pct, c.measured_at_utc,
        case a.direction when 'down' then c.cusum_down else c.cusum_up end as statistic,
        b.sd_pct * sqrt((1 + b.phi) / (1 - b.phi)) as sd_pct,
        row_number() over (partition by a.alarm_id order by c.measured_at_utc desc) as place
    from alarms a
    join charts c using (turnout_id, section_id, band, source)
    join baselines b using (turnout_id, section_id, band, source, epoch)
    join then_status n on n.turnout_id = a.turnout_id and n.section_id = a.section_id and n.band = a.band
        and n.source = a.source and n.state = 'alarm'
    where a.raised_at_utc <= "asof" and coalesce(a.closed_at_utc > "asof", true) and c.measured_at_utc <= "asof"
        and c.residual_pct is not null and c.measured_at_utc > coalesce(a.began_at_utc, a.raised_at_utc - interval 1 day)
    -- a sum sinks slowly: of a loss after a gain both alarms are open, and the later one is the news
    qualify a.raised_at_utc = max(a.raised_at_utc) over (partition by a.turnout_id, a.section_id, a.band, a.source)
),
raised as (
    select
        turnout_id, section_id, band, source, any_value(direction) as direction,
        any_value(raised_at_utc) as raised_at_utc, any_value(began_at_utc) as began_at_utc,
        max(statistic / threshold) filter (where place = 1) as ratio,
        avg(residual_pct) filter (where place <= 8) as change_pct,
        1.96 * max(sd_pct) / sqrt(count(*) filter (where place <= 8)) as half
    from recent
    group by turnout_id, section_id, band, source
),
acknowledged_alarms as (
    select
        r.*,
        (
            select max_by(k.by_whom || ': ' || k.reason, k.at_utc) from acknowledgements k
            where k.turnout_id = r.turnout_id and coalesce(k.section_id, r.section_id) = r.section_id
                and coalesce(k.band, r.band) = r.band and k.action = 'acknowledge'
                and k.at_utc >= r.raised_at_utc and acknowledgement_counts(k.at_utc, "asof")
        ) as acknowledged
    from raised r
),
alarmed as (
    select
        r.turnout_id, r.section_id, r.band, r.source,
        r.direction, r.raised_at_utc, r.ratio, r.acknowledged,
        case
            when "asof" - s.last_measured_at_utc
                > to_microseconds((86400e6 * c.stale_after_days)::bigint)
            then s.last_measured_at_utc
        end as not_since_utc,
        s.change_pct is not null and "asof" >= s.last_measured_at_utc as told,
        case when told then s.change_pct else r.change_pct end as change_pct,
        case when told then s.change_low_pct else r.change_pct - r.half end as low_pct,
        case when told then s.change_high_pct else r.change_pct + r.half end as high_pct,
        case when told then s.since_at_utc else r.began_at_utc end as since_at_utc,
        case when told then s.since_earliest_utc end as since_earliest_utc,
        case when told then s.since_latest_utc end as since_latest_utc,
        is_below_target(low_pct, high_pct, c.target_pct) as is_small,
        case when told then s.changed_component end as changed_component,
        s.ballast_stiffness_pct, s.ballast_stiffness_low_pct, s.ballast_stiffness_high_pct,
        s.pad_stiffness_pct, s.pad_stiffness_low_pct, s.pad_stiffness_high_pct,
        coalesce(told and d.is_coupled, false) as follows_other,
        case when r.acknowledged is null and not is_small and not follows_other then 'inspect this week' else 'plan' end as state,
        null::varchar as why
    from acknowledged_alarms r
    left join chart_states_on("asof") s using (turnout_id, section_id, band, source)
    left join chart_status_on("asof") d using (turnout_id, section_id, band, source)
    left join chart_status c using (turnout_id, section_id, band, source)
),
drifting as (
    select
        turnout_id, section_id, band, source, 'plan' as state, direction, null::timestamp as raised_at_utc,
        statistic_ratio as ratio, null::varchar as acknowledged, change_pct, change_low_pct as low_pct,
        change_high_pct as high_pct, since_at_utc, since_earliest_utc, since_latest_utc, null::varchar as why,
        changed_component, ballast_stiffness_pct, ballast_stiffness_low_pct, ballast_stiffness_high_pct,
        pad_stiffness_pct, pad_stiffness_low_pct, pad_stiffness_high_pct
    from chart_states_on("asof") s
    where state = 'plan' and "asof" >= newest_charted()
        and not exists (
            select 1 from alarmed a
            where a.turnout_id = s.turnout_id and a.section_id = s.section_id and a.band = s.band
                and a.source = s.source
        )
),
confirming as (
    select
        n.turnout_id, n.section_id, n.band, n.source, 'confirm now' as state,
        case when c.deviation_pct < 0 then 'down' else 'up' end as direction, c.deviation_pct as change_pct,
        c.deviation_pct - coalesce(100 * (c.expected_high_hz / c.expected_hz - 1), 0) as low_pct,
        c.deviation_pct + coalesce(100 * (c.expected_high_hz / c.expected_hz - 1), 0) as high_pct,
        printf('the campaign of %s lies %.1f %%', campaign_name(c.turnout_id, c.measured_at_utc), abs(c.deviation_pct))
            || coalesce(printf(' (± %.1f, 95 %%)', 100 * (c.expected_high_hz / c.expected_hz - 1)), '')
            || case when c.deviation_pct < 0 then ' below' else ' above' end || ' its expected value; not yet confirmed'
            as why,
        c.measured_at_utc - interval 1 day as visit_from_utc  -- a visit lasts a day at most
    from then_status n
    join charts c
        on c.turnout_id = n.turnout_id and c.section_id = n.section_id and c.band = n.band and c.source = n.source
            and c.measured_at_utc = n.last_measured_at_utc and c.deviation_pct is not null
    where n.state = 'confirm_now'
),
silent as (
    select
        turnout_id, section_id, band, source, state, null::varchar as direction, null::timestamp as raised_at_utc,
        null::double as ratio, null::varchar as acknowledged, null::double as change_pct, null::double as low_pct,
        null::double as high_pct, null::timestamp as since_at_utc, null::timestamp as since_earliest_utc,
        null::timestamp as since_latest_utc, why, up_to_a_tenth(detectable_pct) as detectable_pct
    from cannot_see("asof") c
    where (section_id <> '*' or band = 'all') and state in ('learning', 'cannot tell')
        -- nobody measures better for the damping alone; its resonance has a row of its own
        and not ends_with(band, '_damping')
        and not exists (
            select 1 from alarmed a
            where a.turnout_id = c.turnout_id and a.section_id = c.section_id and a.band = c.band
                and a.source = c.source
        )
        and not exists (
            select 1 from drifting d
            where d.turnout_id = c.turnout_id and d.section_id = c.section_id and d.band = c.band
                and d.source = c.source
        )
),
everything as (
    select * from alarmed union all by name select * from drifting union all by name select * from silent
    union all by name select * from confirming
),
not_silenced as (
    select e.*, s.target_pct
    from everything e
    left join chart_status s using (turnout_id, section_id, band, source)
    where in_service(e.turnout_id) and not has_left(e.section_id) and not exists (
        select 1 from acknowledgements k
        where k.turnout_id = e.turnout_id and coalesce(k.section_id, e.section_id) = e.section_id
            and coalesce(k.band, e.band) = e.band and k.action = 'suppress'
            and acknowledgement_counts(k.at_utc, "asof")
            and coalesce(k.until_utc, timestamp '9999-01-01') > "asof"
    )
),
rows_to_list as (
    select * exclude (has_other) replace (
        follows_other and has_other as follows_other,
        case when follows_other and not has_other and acknowledged is null and not is_small
            then 'inspect this week' else state end as state
    )
    from (
        select *, count(*) filter (band in ('ballast', 'railpad') and (raised_at_utc is not null or state = 'confirm now'))
            over (partition by turnout_id, section_id, source) > 1 as has_other
        from not_silenced
    )
),
grouped as (
    -- sections whose rows say the same but for their numbers. The whole turnout speaks for them, else of campaigns to
    -- confirm the farthest, of others the first
    select
        *, row_number() over (
            partition by turnout_id, band, source, state, reason
            order by section_id <> '*', abs(change_pct) desc nulls last, section_id
        ) = 1 as speaks
    from (
        select
            *, split_part(section_id, '/', -1) as label, coalesce(abs(change_pct), detectable_pct) as size_pct,
            case when state = 'confirm now' then direction when band = 'all' then why
                else regexp_replace(why, '[0-9]+', '', 'g') end as reason
        from rows_to_list
        where why is not null
    )
),
listed as (
    select
        *, split_part(section_id, '/', -1) as named, case when section_id = '*' then 'whole turnout' else named end as sections
    from rows_to_list
    where why is null
    union all by name
    select
        turnout_id, case when count(*) = 1 then min(section_id) end as section_id,
        case min(section_id)
            when '*' then 'whole turnout' else string_agg(label, ', ' order by section_id)
        end as sections, max(label) filter (speaks) as named, band, source, state, max(direction) as direction,
        case when count(distinct why) = 1 then min(why)
            else replace(named, '*', 'whole turnout') || ': ' || max(why) filter (speaks)
                || '; likewise ' || string_agg(label, ', ' order by section_id) filter (not speaks)
                || coalesce(' (' || one_or_range(min(size_pct) filter (not speaks), max(size_pct) filter (not speaks)) || ')', '')
        end as why,
        max(change_pct) filter (speaks) as change_pct, max(low_pct) filter (speaks) as low_pct,
        max(high_pct) filter (speaks) as high_pct, max(target_pct) as target_pct, max(visit_from_utc) as visit_from_utc
    from grouped
    group by turnout_id, band, source, state, reason
),
fleet as (
    select
        count(*) as n_charts, sum(s.campaigns_per_year * (1 / s.run_length_down + 1 / s.run_length_up)) as alarms_per_year
    from chart_status s
    join then_status n using (turnout_id, section_id, band, source)
    where n.complete and in_service(s.turnout_id) and not has_left(s.section_id)
),
maintenance as (
    select
        h.turnout_id, h.sections, h.band, h.source, h.state,
        max_by(replace(e.kind, '_', ' ') || ' ' || strftime(e.event_at_utc, '%Y-%m-%d'), e.event_at_utc) as last_work
    from listed h
    join events e
        on e.turnout_id = h.turnout_id and e.event_at_utc <= "asof"
            and (h.section_id = '*' or e.section_id is null
                or list_contains(string_split(h.sections, ', '), split_part(e.section_id, '/', -1)))
    group by all
),
changed as (
    select *
    from (
        select
            *, unnest(string_split(sections, ', ')) as label,
            change * case when grows then epoch(found_at_utc - onset_by_utc) else 1 end < 0 as is_softer
        from change_findings
        where found_at_utc < "asof" + interval 1 day
    )
    qualify row_number() over (partition by turnout_id, label order by found_at_utc desc, sections) = 1
),
diagnosed_sleepers as (
    -- where the newest diagnosis of a section names a change of ballast or pads, at most 3 m from it
    select
        c.turnout_id, c.label, c.found_at_utc, c.component, c.is_softer,
        coalesce(c.verdict = 'named' and c.term = 'hanging_sleeper', false) as hangs,
        case when c.last_m - c.first_m < 0.05 then printf('the sleeper at %.1f m', c.first_m)
            else printf('the sleepers from %.1f to %.1f m', c.first_m, c.last_m) end as sleepers
    from changed c
    left join sections p on p.section_id = c.turnout_id || '/' || c.label
    where c.verdict in ('named', 'a_or_b') and c.component is not null and c.first_m is not null
        and coalesce(greatest(c.first_m - p.position_m, p.position_m - c.last_m) <= 3, true)
),
diagnosed as (
    select *
    from (
        select turnout_id, unnest(string_split(coalesce(sections, ''), ', ')) as label, finding_id, found_at_utc, visit, verdict, term, sentence
        from findings_current
        where found_at_utc <= "asof"
    )
    qualify row_number() over (partition by turnout_id, label order by found_at_utc desc, finding_id) = 1
)
select
    row_number() over importance as rank,
    h.turnout_id, h.section_id, h.sections, h.band, h.source, h.state, h.direction, h.raised_at_utc, h.since_at_utc,
    h.since_earliest_utc, h.since_latest_utc, h.change_pct, h.low_pct as change_low_pct,
    h.high_pct as change_high_pct, h.ratio as statistic_ratio, h.component, h.changed_component,
    h.ballast_stiffness_pct, h.ballast_stiffness_low_pct, h.ballast_stiffness_high_pct,
    h.pad_stiffness_pct, h.pad_stiffness_low_pct, h.pad_stiffness_high_pct,
    case
        when h.why is not null then h.why
        else (case
                when h.band = 'amplitude' then 'acceleration under trains, '
                when ends_with(h.band, '_damping') then 'damping of the ' || replace(h.band, '_damping', '') || ' resonance of '
                else h.band || ' resonance of ' end)
            || (case when h.section_id = '*' then 'the whole turnout' else split_part(h.section_id, '/', -1) end)
            || (case when not coalesce(h.told, true) then ', mean of its last campaigns since the sum began to grow,' else '' end)
            || (case when h.change_pct < 0 then ' fell by ' else ' rose by ' end)
            || printf('%.1f %% (%.1f to %.1f, 95 %%)', abs(h.change_pct),
                to_a_tenth(case when h.change_pct < 0 then -h.high_pct else h.low_pct end),
                to_a_tenth(case when h.change_pct < 0 then -h.low_pct else h.high_pct end))
            || coalesce(', since ' || strftime(h.since_at_utc, '%Y-%m-%d')
                || coalesce(' (' || strftime(h.since_earliest_utc, '%Y-%m-%d') || ' to '
                    || strftime(h.since_latest_utc, '%Y-%m-%d') || ')', ''), '')
            || (case when h.source = 'passage' then '; from passages' else '; from hammer tests' end)
            || stiffness_words(h.band, h.changed_component, h.change_pct,
                h.ballast_stiffness_pct, h.ballast_stiffness_low_pct, h.ballast_stiffness_high_pct,
                h.pad_stiffness_pct, h.pad_stiffness_low_pct, h.pad_stiffness_high_pct)
            || (case when h.follows_other then '; it follows from the ' ||
                (case h.changed_component when 'pad' then 'railpads' else 'ballast' end)
                || ', whose own row says what to do' else '' end)
            || coalesce('; not measured since ' || campaign_name(h.turnout_id, h.not_since_utc), '')
            || (case when h.is_small then printf('; below the target of %.1f %%: nobody needs to go there', h.target_pct)
                else '' end)
            || coalesce('; acknowledged by ' || h.acknowledged, '')
    end as sentence,
    case
        when h.raised_at_utc is not null then
            'one false alarm expected in '
            || printf('%,d campaigns', round(case when h.direction = 'up' then s.run_length_up else s.run_length_down end)::bigint)
            || coalesce(printf(' (%,d years)', round(
                case when h.direction = 'up' then s.run_length_up else s.run_length_down end
                / nullif(s.campaigns_per_year, 0))::bigint), '')
            || ' of this chart; of all ' || f.n_charts || ' charts '
            || case
                when f.alarms_per_year >= 1.5 then printf('%.0f a year', f.alarms_per_year)
                when f.alarms_per_year > 2 / 3 then 'one a year'
                when f.alarms_per_year >= 0.01 then printf('one in %.0f years', 1 / f.alarms_per_year)
                else 'less than one in 100 years'
            end
        when h.state = 'confirm now' then
            'one campaign alone is no alarm: only a second one shows whether the track has changed or the measurement was wrong'
        when h.state = 'plan' then
            printf('one in ten of the drifts reported is expected to be false; this one: adjusted p = %.2g', s.drift_q)
        when h.state = 'learning' then 'not an alarm: the chart raises alarms once it has learned what is normal'
        else 'not an alarm: the data do not show whether the track has changed'
    end as false_alarm_words,
    m.last_work as last_maintenance,
    case
        when h.state = 'confirm now' then
            'repeat the hammer test today, at the marked position and with the same hammer, tip and sensor: at least ten '
            || 'impacts with rail temperature; if the value stays: '
            || case
                when h.section_id = '*' then 'what all sections share'
                when h.band = 'ballast' and h.direction = 'down' then 'voids, wet or fouled ballast'
                when h.band = 'railpad' and h.direction = 'down' then 'broken or displaced pads, loose fastenings'
                else 'frost, or work that is not in the events'
            end
        when h.follows_other then 'nothing for this resonance: see the other one of this section'
        when h.is_small then 'nothing on site: the next campaigns, and the other resonance of this section'
        when h.state = 'learning' then 'nothing; measure again as planned'
        when h.why like 'the alarm of %' then 'what was corrected or entered since, and the chart of this section'
        when h.band = 'all' then 'what was rejected: turnout query "from rejected where turnout_id = ''' || h.turnout_id || '''"'
        when h.state = 'cannot tell' and h.source = 'passage' then
            'the measurement: more trains of one type a week, rail temperature in their files, sensor'
        when h.state = 'cannot tell' then 'the measurement: more impacts per campaign, rail temperature, sensor'
        when h.section_id = '*' then 'what all sections share: thermometer, hammer and method first, then drainage'
        when h.changed_component = 'both' then
            ballast_advice(h.ballast_stiffness_pct, case w.component when 'ballast' then w.sleepers end) || '; '
            || pad_advice(h.pad_stiffness_pct, case w.component when 'railpad' then w.sleepers end)
        when w.component = 'ballast' and w.hangs and w.is_softer and coalesce(h.changed_component, 'either') <> 'pad' then
            void_advice(w.sleepers)
        when w.component = 'ballast' and coalesce(h.changed_component, 'either') <> 'pad' then
            ballast_advice(case when w.is_softer then -1 else 1 end, w.sleepers)
        when w.component = 'railpad' and coalesce(h.changed_component, 'either') <> 'ballast' then
            pad_advice(case when w.is_softer then -1 else 1 end, w.sleepers)
        when h.changed_component = 'either' and h.component = 'ballast' then
            ballast_advice(case h.direction when 'down' then -1 else 1 end, null) || '; '
            || pad_advice(case h.direction when 'down' then -1 else 1 end, null)
        when h.changed_component = 'either' and h.component = 'railpad' then
            pad_advice(case h.direction when 'down' then -1 else 1 end, null) || '; '
            || ballast_advice(case h.direction when 'down' then -1 else 1 end, null)
        when h.component = 'ballast' then
            ballast_advice(coalesce(h.ballast_stiffness_pct, case h.direction when 'down' then -1 else 1 end), null)
        when h.component = 'railpad' then
            pad_advice(coalesce(h.pad_stiffness_pct, case h.direction when 'down' then -1 else 1 end), null)
        when h.band = 'ballast_damping' then 'wet, fouled or loose ballast; frost; the position of hammer and sensor'
        when h.band = 'railpad_damping' then 'aged or hardened pads, loose fastenings; the position of hammer and sensor'
        when h.band = 'amplitude' then
            peak_advice(h.direction,
                c.verdict = 'none' and c.found_at_utc >= coalesce(h.since_at_utc, h.raised_at_utc),
                p.panel, p.position_m)
        else 'the section'
    end as look_at,
    case
        when h.raised_at_utc is null and h.state <> 'confirm now' then null
        when h.section_id = '*' then 'no decision: a diagnosis is of sections, and this is the median of all'
        when c.found_at_utc >= coalesce(h.since_at_utc, h.raised_at_utc, c.found_at_utc) and c.verdict in ('named', 'a_or_b', 'unknown') then
            case
                when c.component is not null and h.changed_component in ('ballast', 'pad')
                        and h.changed_component <> replace(c.component, 'railpad', 'pad') then
                    'no decision: the resonances point to the ' || replace(h.changed_component, 'pad', 'railpads')
                    || ', the diagnosis to the ' || replace(c.component, 'railpad', 'railpads') || ': '
                when c.component is not null and h.band in ('ballast', 'railpad') and h.changed_component in ('ballast', 'pad')
                        and c.is_softer <> (h.direction = 'down') then
                    'no decision: the resonance ' || case h.direction when 'down' then 'fell' else 'rose' end
                    || ', and the diagnosis finds ' || case when c.is_softer then 'less' else 'more' end || ' stiffness: '
                when greatest(c.first_m - p.position_m, p.position_m - c.last_m) > 3 then
                    'no decision: the section of the alarm lies at ' || printf('%.1f m', p.position_m)
                    || ', and what has changed is more than 3 m from there: '
                else ''
            end
            || c.sentence
            || case
                when c.onset_after_utc > h.since_latest_utc or c.onset_by_utc < h.since_earliest_utc then
                    '; the alarm dates the change differently, from ' || strftime(h.since_earliest_utc, '%Y-%m-%d')
                    || ' to ' || strftime(h.since_latest_utc, '%Y-%m-%d')
                else ''
            end
            || case
                when g.found_at_utc < coalesce(h.since_at_utc, h.raised_at_utc, h.visit_from_utc) or g.verdict is distinct from 'named'
                    or g.term = c.term or c.verdict = 'unknown' then ''
                else '; against the track file the recordings of ' || coalesce(g.visit, strftime(g.found_at_utc, '%Y-%m-%d'))
                    || ' name another effect, ' || replace(g.term, '_', ' ')
            end
        when g.finding_id is not null and g.found_at_utc >= coalesce(h.since_at_utc, h.raised_at_utc, h.visit_from_utc) and g.verdict <> 'none' then
            g.sentence
        when c.verdict = 'no_decision' then c.sentence
        when c.sentence is not null and c.found_at_utc < coalesce(h.since_at_utc, h.raised_at_utc) then
            'no decision: the diagnosis of ' || coalesce(c.visit, strftime(c.found_at_utc, '%Y-%m-%d'))
            || ' is older than the change'
        when h.band = 'amplitude' and c.verdict = 'none' then
            'only trains show it, so the running surface or the sensor is the likely cause, not ballast or railpads: '
            || c.sentence
        when c.sentence is not null then 'no decision: ' || c.sentence
        when g.finding_id is null then 'no decision: no diagnosis of this section yet (turnout diagnose)'
        when g.found_at_utc < coalesce(h.since_at_utc, h.raised_at_utc, h.visit_from_utc) then
            'no decision: the diagnosis of ' || coalesce(g.visit, strftime(g.found_at_utc, '%Y-%m-%d'))
            || ' is older than the change (turnout diagnose)'
        else
            'no decision: within the tolerances of the track file the recordings of '
            || coalesce(g.visit, strftime(g.found_at_utc, '%Y-%m-%d'))
            || ' need no effect (turnout twin compares them with earlier visits)'
    end as diagnosis,
    t.name, t.line, t.km, count(*) over () as n_in_all
from (
    select
        *, case changed_component
            when 'ballast' then 'ballast' when 'pad' then 'railpad' when 'both' then 'ballast and railpad' else band
        end as component
    from listed
) h
left join chart_status s
    on s.turnout_id = h.turnout_id and s.section_id = h.section_id and s.band = h.band and s.source = h.source
left join maintenance m
    on m.turnout_id = h.turnout_id and m.sections = h.sections and m.band = h.band and m.source = h.source
        and m.state = h.state
left join diagnosed g on g.turnout_id = h.turnout_id and g.label = h.named
left join changed c on c.turnout_id = h.turnout_id and c.label = h.named
left join diagnosed_sleepers w
    on w.turnout_id = h.turnout_id and w.label = h.named
        and w.found_at_utc >= coalesce(h.since_at_utc, h.raised_at_utc)
        and (h.band not in ('ballast', 'railpad') or w.is_softer = (h.direction = 'down'))
left join sections p on p.section_id = h.turnout_id || '/' || h.named
left join turnouts t on t.turnout_id = h.turnout_id
cross join fleet f
window importance as (
    order by
        case h.state
            when 'confirm now' then 0 when 'inspect this week' then 1 when 'plan' then 2 when 'cannot tell' then 3 else 4
        end,
        h.band = 'all' desc,
        -- a percentage of frequency, of damping and of acceleration are not alike, multiples of their targets are
        case when h.low_pct * h.high_pct < 0 then 0 else least(abs(h.low_pct), abs(h.high_pct)) / h.target_pct end
            desc nulls last,
        h.ratio desc nulls last, h.turnout_id, h.sections, h.band, h.source
)
qualify rank <= coalesce(most, (select max(worklist_rows) from chart_status), 20) or h.state in ('confirm now', 'inspect this week')
order by rank;

create or replace view worklist as select * from worklist(newest_measurement());

-- columns of worklist
-- rank | bigint | | 1 = first
-- turnout_id | varchar | | turnout
-- section_id | varchar | | section; * = median of the turnout's sections; empty = several, see sections
-- sections | varchar | | labels of the sections meant, or 'whole turnout' (its median)
-- band | varchar | | which resonance; all = no newer recording could be used
-- source | varchar | | hammer or passage: never mixed in one chart; empty = no file belongs to either
-- state | varchar | | confirm now, inspect this week, plan, learning or cannot tell
-- direction | varchar | | loss of stiffness (down) or gain (up)
-- raised_at_utc | timestamp | UTC | campaign that raised the alarm
-- since_at_utc | timestamp | UTC | estimated time of the change
-- since_earliest_utc | timestamp | UTC | 95 % interval, earliest
-- since_latest_utc | timestamp | UTC | 95 % interval, latest
-- change_pct | double | % | change of frequency at the newest campaign since the onset
-- change_low_pct | double | % | 95 % interval, lower end
-- change_high_pct | double | % | upper end
-- statistic_ratio | double | | CUSUM over its limit
-- component | varchar | | what to look at: ballast, railpad, or ballast and railpad; else the resonance as in band
-- changed_component | varchar | | stiffness that changed: ballast, pad, both, or either (both resonances together do not decide)
-- ballast_stiffness_pct | double | % | change of the ballast's stiffness since the onset
-- ballast_stiffness_low_pct | double | % | 95 % interval, lower end
-- ballast_stiffness_high_pct | double | % | upper end
-- pad_stiffness_pct | double | % | change of the railpads' stiffness since the onset
-- pad_stiffness_low_pct | double | % | 95 % interval, lower end
-- pad_stiffness_high_pct | double | % | upper end
-- sentence | varchar | | what happened, with its interval, in words
-- false_alarm_words | varchar | | how often charts without a change raise such an alarm; for a row that is no alarm, that it is none and why
-- last_maintenance | varchar | | newest work on the section
-- look_at | varchar | | what to look at
-- diagnosis | varchar | | of an alarm or a campaign to confirm: what has changed by the diagnosis, or why there is no decision; where alarm and diagnosis differ, in what; empty = no alarm
-- name | varchar | | name for display
-- line | varchar | | railway line
-- km | double | km | position along the line
-- n_in_all | bigint | | rows that the list would have without an end

-- columns of worklist(asof, most := null)
-- rank | bigint | | 1 = first
-- turnout_id | varchar | | turnout
-- section_id | varchar | | section; * = median of the turnout's sections; empty = several, see sections
-- sections | varchar | | labels of the sections meant, or 'whole turnout' (its median)
-- band | varchar | | which resonance; all = no newer recording could be used
-- source | varchar | | hammer or passage: never mixed in one chart; empty = no file belongs to either
-- state | varchar | | confirm now, inspect this week, plan, learning or cannot tell
-- direction | varchar | | loss of stiffness (down) or gain (up)
-- raised_at_utc | timestamp | UTC | campaign that raised the alarm
-- since_at_utc | timestamp | UTC | estimated time of the change
-- since_earliest_utc | timestamp | UTC | 95 % interval, earliest
-- since_latest_utc | timestamp | UTC | 95 % interval, latest
-- change_pct | double | % | change of frequency at the newest campaign since the onset
-- change_low_pct | double | % | 95 % interval, lower end
-- change_high_pct | double | % | upper end
-- statistic_ratio | double | | CUSUM over its limit
-- component | varchar | | what to look at: ballast, railpad, or ballast and railpad; else the resonance as in band
-- changed_component | varchar | | stiffness that changed: ballast, pad, both, or either (both resonances together do not decide)
-- ballast_stiffness_pct | double | % | change of the ballast's stiffness since the onset
-- ballast_stiffness_low_pct | double | % | 95 % interval, lower end
-- ballast_stiffness_high_pct | double | % | upper end
-- pad_stiffness_pct | double | % | change of the railpads' stiffness since the onset
-- pad_stiffness_low_pct | double | % | 95 % interval, lower end
-- pad_stiffness_high_pct | double | % | upper end
-- sentence | varchar | | what happened, with its interval, in words
-- false_alarm_words | varchar | | how often charts without a change raise such an alarm; for a row that is no alarm, that it is none and why
-- last_maintenance | varchar | | newest work on the section
-- look_at | varchar | | what to look at
-- diagnosis | varchar | | of an alarm or a campaign to confirm: what has changed by the diagnosis, or why there is no decision; where alarm and diagnosis differ, in what; empty = no alarm
-- name | varchar | | name for display
-- line | varchar | | railway line
-- km | double | km | position along the line
-- n_in_all | bigint | | rows that the list would have without an end
