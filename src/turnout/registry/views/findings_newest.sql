-- One row per finding that is still valid: for at least one of its sections its visit is the newest diagnosis. A finding
-- ends when each of its sections was diagnosed again, in any group, because the sections differ from visit to visit.
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

-- columns of findings_newest
-- finding_id | varchar | | content id of the finding
-- turnout_id | varchar | | turnout
-- section_id | varchar | | section, where the finding belongs to one
-- found_at_utc | timestamp | UTC | time of the newest recording used
-- verdict | varchar | | the one answer
-- grade | varchar | | A: residual back at control level; B: structure left
-- term | varchar | | physics left out
-- rival_term | varchar | | the other name of an 'a or b'
-- locked_to | varchar | | place, wheel, train, sensor, wavelength, frequency, clock, condition, numerics
-- position_m | double | m | position along the turnout
-- position_se_m | double | m | its standard error
-- channel | varchar | | sensor it is locked to
-- band_low_hz | double | Hz | lower edge of the band
-- band_high_hz | double | Hz | upper edge
-- probability | double | | stated probability of the verdict
-- p_value | double | | corrected p value of the position
-- fit_before_pct | double | % | fit on held-out recordings, without the term
-- fit_after_pct | double | % | fit on held-out recordings, with the term
-- fit_rival_pct | double | % | the same with the best rival
-- fit_decoy_pct | double | % | the same with a decoy of as many parameters
-- fit_gain_se_pct | double | % | standard error of the fit with the term less that without it
-- n_held_out | integer | | held-out recordings
-- parameters_json | varchar | | name, value, standard error and unit of each parameter, JSON
-- sentence | varchar | | what was left out, in words
-- next_measurement | varchar | | measurement that would tell more
-- visit | varchar | | what was diagnosed together: day of the campaign, or month
-- sections | varchar | | sections diagnosed together, with commas between them
-- route | varchar | | track that they belong to
-- place_low_m | double | m | first sensor or impact
-- place_high_m | double | m | last sensor or impact
-- train | varchar | | train, and axle, that it is locked to
-- axle | integer | | axle of that train, from 1; empty = the whole train, or none
-- wheel_within_m | double | m | four fifths of it happen while a wheel is this near to the sensor
-- n_hammer_tests | integer | | hammer tests used
-- n_passages | integer | | passages used
-- n_sensors | integer | | installed sensors used
-- level_before | double | | weighted mean square of the residual without the term, 1: noise and tolerance
-- level_after | double | | the same with it
-- term_json | varchar | | the terms as they go into a track file, JSON
-- evidence_json | varchar | | frames, probabilities and nats by condition, JSON
-- notes | varchar | | what was not used, and why, one line each
-- result_id | varchar | | result (unit and key) that it came with
-- run_id | varchar | | content id of the batch
