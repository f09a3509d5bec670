-- Half the 95 % interval of ln f or ln zeta of one campaign of a section with history.
create or replace macro history_half_width(repeatability, between_sd, freedom) as (
    students_t(freedom) * sqrt(repeatability ^ 2 + between_sd ^ 2)
);

-- One row per mode of a hammer test and quantity (frequency, damping): its 95 % interval from the history of its section.
-- The error has two parts: the repeatability of the campaign, and the scatter between the campaigns of the section
-- beyond it (mode_scatter). That scatter is one for all of them, so the interval does not depend on which rival
-- explanations a campaign happened to have. It contains no error that is the same in all campaigns: compare campaigns
-- by it.
-- needs: mode_scatter, students_t
create or replace view mode_intervals as
select
    p.section_id, p.turnout_id, p.band, p.quantity, p.measured_at_utc, exp(p.log_value) as value,
    exp(p.log_value - history_half_width(p.repeatability, between_sd, freedom)) as value_low,
    exp(p.log_value + history_half_width(p.repeatability, between_sd, freedom)) as value_high,
    100 * p.repeatability as repeatability_pct, 100 * between_sd as between_campaigns_pct, n_steps, freedom, p.model_id
from mode_points p join mode_scatter using (section_id, band, quantity)
order by p.section_id, p.band, p.quantity, p.measured_at_utc;

-- columns of mode_intervals
-- section_id | varchar | | section
-- turnout_id | varchar | | turnout
-- band | varchar | | which resonance
-- quantity | varchar | | frequency [Hz] or damping [-]
-- measured_at_utc | timestamp | UTC | time of the campaign
-- value | double | | frequency in Hz, or damping ratio
-- value_low | double | | lower 95 % limit, in the unit of value
-- value_high | double | | upper 95 % limit, in the unit of value
-- repeatability_pct | double | % | standard error from the scatter of the impacts of the campaign
-- between_campaigns_pct | double | % | standard deviation between the campaigns of the section beyond their repeatability
-- n_steps | bigint | | steps from campaign to campaign behind it; at least seven are needed
-- freedom | double | | degrees of freedom of the interval
-- model_id | varchar | | model
